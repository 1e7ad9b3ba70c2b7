//! Noise of the odometry of a robot, estimated from the scans that were registered.

use crate::shared::geometry::{Pose2, wrap_angle};
use nalgebra::{Matrix3, Vector2, Vector3};

/// Least standard deviation of odometry, even for a robot that stands still, metres and radians.
const LEAST_DEVIATION: [f64; 2] = [0.02, 0.01];
/// Steps that the assumption before the first step counts as.
const PRIOR_STEPS: f64 = 10.0;
/// Steps after which what was seen counts half as much: the ground and the load change.
const HALF_LIFE: f64 = 50.0;
/// Factor by which the deviation is assumed larger than the parameter, before the first step.
const PRIOR_FACTOR: f64 = 1.5;

/// Standard deviation of the scale of odometry before the first step: the radius of wheels is known to some percent.
const SCALE_DEVIATION: f64 = 0.03;
/// Standard deviation of the way between two scans as their walls show it, metres.
const WAY_DEVIATION: f64 = 0.02;
/// Largest difference of the scale of one step from the estimate, as a share: more is a slip, or a wrong registration.
pub const MOST_SCALE_ERROR: f64 = 0.3;

/// Least root of the summed squares of the turns, radians, from which they show which way the scans turn, and the
/// correlation of both turns below which they turn against odometry.
const LEAST_TURNS: f64 = 1.0;
const OPPOSITE: f64 = -0.5;

/// Information of the walls on the place of a step in each direction, as a multiple of that of odometry, from which the step as
/// registered is theirs.
const SHOWN_BY_WALLS: f64 = 4.0;
/// Least way, metres, of such steps, and least correlation of both ways, by which they show how odometry lies to the scans.
const LEAST_WAY: f64 = 5.0;
const STEADY: f64 = 0.9;

/// What turns the ways of a robot by odometry into those by its scans.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OdometryCorrection {
    /// Length of the ways by scans as a share of that by odometry.
    pub scale: f64,
    /// Rotation of the ways, radians to the left, as where the lidar is mounted with another yaw than given.
    pub turn: f64,
}

/// Ways between scans by odometry and by the walls, where these show them well.
#[derive(Clone, Debug, Default, PartialEq)]
struct ComparedWays {
    /// Sum of the ways by odometry, metres.
    way: f64,
    /// Sums of the squared ways by odometry and by the walls.
    squares: [f64; 2],
    /// Sum of the products of both, as vectors: along the way by odometry, and to its left.
    products: Vector2<f64>,
}

impl ComparedWays {
    fn add(&mut self, by_odometry: &Vector2<f64>, by_walls: &Vector2<f64>) {
        self.way += by_odometry.norm();
        self.squares[0] += by_odometry.norm_squared();
        self.squares[1] += by_walls.norm_squared();
        self.products += Vector2::new(by_odometry.dot(by_walls), by_odometry.perp(by_walls));
    }

    /// What turns the ways by odometry into those by the walls; `None` if it is not steady.
    fn correction(&self) -> Option<OdometryCorrection> {
        let product = self.products.norm();
        let is_steady = self.way >= LEAST_WAY && product >= STEADY * (self.squares[0] * self.squares[1]).sqrt();
        is_steady.then(|| OdometryCorrection {
            scale: product / self.squares[0],
            turn: self.products.y.atan2(self.products.x),
        })
    }
}

/// How uncertain the steps of odometry are: standard deviations in proportion to the way and the turn, with factors
/// that are estimated from the steps so far; and by which factor its ways are too long or too short.
#[derive(Clone, Debug, PartialEq)]
pub struct OdometryNoise {
    share: f64,
    steps: f64,
    /// Sums of squared deviations of the position and of the yaw, in the variances that were assumed.
    squares: [f64; 2],
    /// Sums of the squared turns by odometry, of those as registered, and of their products.
    turns: [f64; 3],
    /// Sums of the products of the ways by odometry and by walls, and of the squared ways by odometry, in variances.
    ways: [f64; 2],
    compared: ComparedWays,
}

impl OdometryNoise {
    /// Noise of which nothing has been seen: `share` is the standard deviation as a share of the way and the turn.
    pub fn new(share: f64) -> Self {
        let squares = [PRIOR_STEPS * PRIOR_FACTOR * PRIOR_FACTOR; 2];
        Self {
            share,
            steps: PRIOR_STEPS,
            squares,
            turns: [0.0; 3],
            ways: [SCALE_DEVIATION.powi(-2); 2],
            compared: ComparedWays::default(),
        }
    }

    /// Length of a way by the walls as a share of that by odometry.
    pub fn scale(&self) -> f64 {
        self.ways[0] / self.ways[1]
    }

    /// What turns the ways by odometry into those by the walls, where these show them well; no step is left out. `None` if
    /// it is not steady.
    pub fn correction(&self) -> Option<OdometryCorrection> {
        self.compared.correction()
    }

    /// A step of odometry with its way in the scale of the walls.
    pub fn corrected(&self, moved: &Pose2) -> Pose2 {
        Pose2::from_parts((self.scale() * moved.translation.vector).into(), moved.rotation)
    }

    /// Standard deviations of a step, before any factor: of the position, metres, and of the yaw, radians.
    fn assumed(&self, moved: &Pose2) -> [f64; 2] {
        let (way, turn) = (moved.translation.vector.norm(), moved.rotation.angle().abs());
        // Wheels that slip turn the robot along its path, too, and where it turns, its centre is not quite known.
        [self.share * (way + 0.5 * turn) + LEAST_DEVIATION[0], self.share * (turn + way) + LEAST_DEVIATION[1]]
    }

    /// Standard deviations of a step: of the position, metres, and of the yaw, radians.
    pub fn deviations(&self, moved: &Pose2) -> [f64; 2] {
        let [position, yaw] = self.assumed(moved);
        let factor = self.squares.map(|squares| (squares / self.steps).sqrt());
        [position * factor[0], yaw * factor[1]]
    }

    /// Inverse covariance (x, y, yaw) of a step.
    pub fn information(&self, moved: &Pose2) -> Matrix3<f64> {
        let [position, yaw] = self.deviations(moved).map(|deviation| deviation.powi(-2));
        Matrix3::from_diagonal(&Vector3::new(position, position, yaw))
    }

    /// Whether the robot turns one way by odometry and the other way by its scans.
    pub fn turns_against_scans(&self) -> bool {
        let [by_odometry, registered, both] = self.turns;
        by_odometry.sqrt() >= LEAST_TURNS && both < OPPOSITE * (by_odometry * registered).sqrt()
    }

    /// Learns from a [corrected](Self::corrected) step and the same step as registered, with its covariance and what the
    /// walls alone say about it, as an inverse covariance. A step that no wall constrains is as odometry has it, but its
    /// covariance is that of odometry, so that it changes nothing (expectation maximisation).
    pub fn learn(&mut self, moved: &Pose2, registered: &Pose2, covariance: &Matrix3<f64>, by_walls: &Matrix3<f64>) {
        let least = by_walls.fixed_view::<2, 2>(0, 0).into_owned().symmetric_eigenvalues().min();
        if least >= SHOWN_BY_WALLS * self.deviations(moved)[0].powi(-2) {
            self.compared.add(&(moved.translation.vector / self.scale()), &registered.translation.vector);
        }
        self.learn_scale(moved, registered, by_walls);
        let [position, yaw] = self.assumed(moved);
        let off = registered.translation.vector - moved.translation.vector;
        let turned = wrap_angle(registered.rotation.angle() - moved.rotation.angle());
        let turns = [moved.rotation.angle(), registered.rotation.angle()];
        let products = [turns[0] * turns[0], turns[1] * turns[1], turns[0] * turns[1]];
        self.turns.iter_mut().zip(products).for_each(|(sum, product)| *sum += product);
        let keep = 0.5f64.powf(1.0 / HALF_LIFE);
        self.steps = keep * self.steps + 1.0;
        // Two directions of the position are one step.
        self.squares[0] = keep * self.squares[0]
            + 0.5 * (off.norm_squared() + covariance.m11 + covariance.m22) / (position * position);
        self.squares[1] = keep * self.squares[1] + (turned * turned + covariance.m33) / (yaw * yaw);
    }

    /// Learns the scale by weighted least squares. The registered way is the mean of that by odometry and that by the
    /// walls, weighted by their information: the part of the walls is taken out of it.
    fn learn_scale(&mut self, moved: &Pose2, registered: &Pose2, by_walls: &Matrix3<f64>) {
        let scale = self.scale();
        let way = moved.translation.vector.norm();
        if way == 0.0 {
            return;
        }
        let along = moved.translation.vector / way;
        let information = along.dot(&(by_walls.fixed_view::<2, 2>(0, 0) * along));
        let share = information / (information + self.deviations(moved)[0].powi(-2));
        let by_walls = along.dot(&registered.translation.vector) - (1.0 - share) * way;
        // Written so that a value that is not a number fails it.
        if (by_walls - share * way).abs() < MOST_SCALE_ERROR * share * way {
            let by_odometry = way / scale;
            let weight = by_odometry / WAY_DEVIATION.powi(2);
            self.ways[0] += weight * by_walls;
            self.ways[1] += weight * share * by_odometry;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::pose;

    #[test]
    fn scans_that_turn_the_other_way_are_noticed() {
        let mut right = OdometryNoise::new(0.1);
        let mut mirrored = right.clone();
        for step in 0..40 {
            let turn = if step % 3 == 0 { -0.2 } else { 0.3 };
            right.learn(&pose(0.1, 0.0, turn), &pose(0.1, 0.0, turn + 0.1), &Matrix3::zeros(), &Matrix3::zeros());
            mirrored.learn(&pose(0.1, 0.0, turn), &pose(0.1, 0.0, 0.02 - turn), &Matrix3::zeros(), &Matrix3::zeros());
            assert!(step > 10 || !mirrored.turns_against_scans(), "a few turns tell nothing");
        }
        assert!(mirrored.turns_against_scans() && !right.turns_against_scans());
    }

    #[test]
    fn the_scale_becomes_that_of_the_walls_where_these_show_it() {
        let mut noise = OdometryNoise::new(0.1);
        let mut blind = noise.clone();
        for step in 0..200 {
            let moved = pose(0.2, 0.0, 0.0);
            // The walls and odometry are as sure, and the registered way lies between both.
            let corrected = noise.corrected(&moved);
            let equal = Matrix3::identity() * noise.deviations(&corrected)[0].powi(-2);
            let between = 0.5 * (corrected.translation.x + 0.2 * 0.9);
            noise.learn(&corrected, &pose(between, 0.0, 0.0), &Matrix3::zeros(), &equal);
            let across = Matrix3::from_diagonal(&Vector3::new(0.0, 1e4, 1e4));
            let corrected = blind.corrected(&moved);
            blind.learn(&corrected, &corrected, &Matrix3::zeros(), &across);
            // A slip says nothing.
            noise.learn(&noise.corrected(&moved), &Pose2::identity(), &Matrix3::zeros(), &(1e6 * equal));
            assert!(step > 0 || noise.scale() > 0.98, "one step says little");
        }
        // What was assumed before the first step still counts a tenth.
        assert!((noise.scale() - 0.91).abs() < 0.002, "{}", noise.scale());
        assert_eq!(blind.scale(), 1.0);
    }

    #[test]
    fn a_lidar_that_is_turned_and_odometry_twice_as_long_are_noticed() {
        let well = Matrix3::identity() * 1e8;
        let correction = |turn: f64, scale: f64, slips: usize| {
            let mut noise = OdometryNoise::new(0.1);
            for step in 0..60 {
                let moved = pose(0.3, 0.02, if step % 2 == 0 { 0.3 } else { -0.3 });
                let registered = nalgebra::UnitComplex::new(turn) * moved.translation.vector * scale;
                let registered = if step < slips { Vector2::zeros() } else { registered };
                let registered = Pose2::from_parts(registered.into(), moved.rotation);
                noise.learn(&noise.corrected(&moved), &registered, &Matrix3::zeros(), &well);
                assert!(step > 10 || noise.correction().is_none(), "a few steps tell nothing");
            }
            noise.correction().unwrap()
        };
        for (turn, scale) in [(0.0, 1.0), (-1.5, 1.0), (3.0, 1.0), (0.2, 0.5)] {
            let found = correction(turn, scale, 0);
            assert!((found.scale - scale).abs() < 1e-6 && (found.turn - turn).abs() < 1e-6, "{found:?}");
        }
        let found = correction(0.0, 1.0, 6);
        assert!(found.scale > 0.85 && found.turn == 0.0, "{found:?}");
        // Along a corridor the walls do not show the way.
        let mut blind = OdometryNoise::new(0.1);
        let across = Matrix3::from_diagonal(&Vector3::new(0.0, 1e8, 1e8));
        (0..60).for_each(|_| blind.learn(&pose(0.3, 0.0, 0.0), &pose(0.1, 0.2, 0.0), &Matrix3::zeros(), &across));
        assert_eq!(blind.correction(), None);
    }

    #[test]
    fn the_deviation_becomes_that_of_the_steps() {
        let mut noise = OdometryNoise::new(0.1);
        let moved = pose(1.0, 0.0, 0.0);
        let before = noise.deviations(&moved);
        for step in 0..400 {
            let off = if step % 2 == 0 { 0.03 } else { -0.03 };
            noise.learn(&moved, &pose(1.0 + off, off, off), &Matrix3::zeros(), &Matrix3::zeros());
        }
        let after = noise.deviations(&moved);
        assert!(before[0] > 0.15 && before[1] > 0.15, "{before:?}");
        assert!((after[0] - 0.03).abs() < 0.005 && (after[1] - 0.03).abs() < 0.005, "{after:?}");
        assert!(noise.deviations(&pose(2.0, 0.0, 0.0))[0] > 1.5 * after[0], "a longer way is less certain");
        assert!(noise.deviations(&Pose2::identity())[0] > 0.0);
    }
}
