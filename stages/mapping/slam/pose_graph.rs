//! A graph of poses with relative measurements between them, and its most likely poses.

use crate::shared::geometry::relative_pose::{self, rotation_of_pose};
use crate::shared::geometry::{Point2, Pose2};
use crate::shared::sparse::{Columns, SimilarSystems, factor, minimum_degree};
use nalgebra::{Matrix2, Matrix3, UnitComplex, Vector3};

/// Largest number of Gauss-Newton steps.
const MAX_STEPS: usize = 60;
/// Factor by which the weights narrow from step to step.
const NARROWING: f64 = 2.0;
/// Steps shorter than this end the iteration, metres and radians; and those where measurements are made anew after it.
const LEAST_STEP: f64 = 1e-4;
const LEAST_SETTLING_STEP: f64 = 1e-3;
/// Information on where each pose was before a step, which fixes what nothing else fixes. So little that thousands of poses do
/// not together hold a drive of a kilometre by its lever: they would be taken for more certain than their measurements make
/// them, and loops would not close.
const DAMPING: f64 = 1e-9;
/// Information on the pose that fixes the frame.
const FIXED: f64 = 1e12;
/// Squared residual at which the influence of a loop closure falls, in variances: the 0.99 quantile of three
/// dimensions.
const ROBUST: f64 = 11.3;

/// A measurement of the pose of node `to` in node `from`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Constraint {
    /// First node.
    pub from: usize,
    /// Second node.
    pub to: usize,
    /// `T_from_to`.
    pub transform: Pose2,
    /// Inverse of its covariance (x, y, yaw), in the frame of `from`.
    pub information: Matrix3<f64>,
    /// Whether it is a loop closure, which may be wrong.
    pub is_loop: bool,
}

/// A measurement of the position of a landmark in the frame of a node. It may be wrong, as a loop closure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LandmarkSighting {
    /// The node.
    pub from: usize,
    /// Number of the landmark.
    pub landmark: usize,
    /// Its position in the frame of the node, metres.
    pub place: Point2,
    /// Standard deviation of the position in each direction, metres.
    pub deviation: f64,
}

/// Poses and the measurements between them. The first pose is fixed.
#[derive(Clone, Debug, Default)]
pub struct PoseGraph {
    /// The poses.
    pub poses: Vec<Pose2>,
    /// The measurements.
    pub constraints: Vec<Constraint>,
    /// The measurements of landmarks, in the order of time.
    pub sightings: Vec<LandmarkSighting>,
}

/// Turns the inverse of a covariance (x, y, yaw) into a frame in which its own is turned by `rotation`.
pub(super) fn turned_information(information: &Matrix3<f64>, rotation: &UnitComplex<f64>) -> Matrix3<f64> {
    let by = rotation_of_pose(rotation);
    by * information * by.transpose()
}

/// Inverse of the variance of the yaw where the inverse of a covariance (x, y, yaw) is given. Where nothing shows the position,
/// it has a standard deviation of a metre.
pub(super) fn yaw_information(information: &Matrix3<f64>) -> f64 {
    let position = information.fixed_view::<2, 2>(0, 0) + Matrix2::identity();
    let with_yaw = information.fixed_view::<2, 1>(0, 2);
    position.try_inverse().map_or(0.0, |covariance| information.m33 - with_yaw.dot(&(covariance * with_yaw))).max(0.0)
}

impl Constraint {
    /// Squared residual at two poses, in variances.
    pub fn squared_residual(&self, poses: &[Pose2]) -> f64 {
        let residual = relative_pose::residual(&poses[self.from], &poses[self.to], &self.transform);
        residual.dot(&(self.information * residual))
    }

    /// Whether it measures the yaw, and no position.
    pub fn is_of_yaw_alone(&self) -> bool {
        self.information.m11 == 0.0 && self.information.m22 == 0.0 && self.information.m33 > 0.0
    }

    /// Weight of a measurement with this squared residual: 1 for odometry, and less for loop closures that contradict
    /// the rest. It is that of Geman and McClure with a scale that is `width` times as wide.
    fn weight(&self, squared: f64, width: f64) -> f64 {
        if self.is_loop { (width * ROBUST / (width * ROBUST + squared)).powi(2) } else { 1.0 }
    }
}

impl LandmarkSighting {
    /// The same, with the landmark as a node whose yaw nothing shows.
    fn constraint(&self, nodes: usize) -> Constraint {
        let by_axis = self.deviation.powi(-2);
        Constraint {
            from: self.from,
            to: nodes + self.landmark,
            transform: Pose2::from_parts(self.place.into(), UnitComplex::identity()),
            information: Matrix3::from_diagonal(&Vector3::new(by_axis, by_axis, 0.0)),
            is_loop: true,
        }
    }
}

impl PoseGraph {
    /// Moves the poses to the minimum of the squared residuals, by Gauss-Newton on SE(2). The weights of loop closures
    /// are wide at first, so that those of a long drive are not taken for wrong ones, and narrow with the steps
    /// (graduated non-convexity, Yang et al. 2020).
    pub fn optimize(&mut self) {
        self.optimize_with(&mut Solver::default());
    }

    /// The same with a solver that is used again where the measurements are nearly the same.
    pub fn optimize_with(&mut self, solver: &mut Solver) {
        self.iterate(true, solver);
    }

    /// The same for poses that are near the minimum, to a millimetre: the weights are narrow from the first step on.
    pub fn settle(&mut self, solver: &mut Solver) {
        self.iterate(false, solver);
    }

    /// The poses and after them the landmarks as nodes, each of these where it was seen first; and all measurements.
    fn nodes(&self) -> (Vec<Pose2>, Vec<Constraint>) {
        let count = self.poses.len();
        let mut nodes = self.poses.clone();
        let landmarks = self.sightings.iter().map(|sighting| sighting.landmark + 1).max().unwrap_or(0);
        nodes.resize(count + landmarks, Pose2::identity());
        for LandmarkSighting { from, landmark, place, .. } in self.sightings.iter().rev() {
            nodes[count + landmark] = Pose2::from_parts((nodes[*from] * place).into(), UnitComplex::identity());
        }
        let sightings = self.sightings.iter().map(|sighting| sighting.constraint(count));
        (nodes, self.constraints.iter().copied().chain(sightings).collect())
    }

    fn iterate(&mut self, is_graduated: bool, solver: &mut Solver) {
        let (mut nodes, constraints) = self.nodes();
        let loops = constraints.iter().filter(|constraint| constraint.is_loop);
        let largest = loops.map(|constraint| constraint.squared_residual(&nodes)).fold(0.0, f64::max);
        let (mut width, least_step) = match is_graduated {
            true => ((2.0 * largest / ROBUST).max(1.0), LEAST_STEP),
            false => (1.0, LEAST_SETTLING_STEP),
        };
        for _ in 0..MAX_STEPS {
            let Some(moves) = solver.step(&nodes, &constraints, width) else { break };
            let mut longest = 0.0f64;
            for (pose, step) in nodes.iter_mut().zip(&moves).skip(1) {
                pose.translation.vector += step.xy();
                pose.rotation *= UnitComplex::new(step.z);
                longest = longest.max(step.amax());
            }
            if width == 1.0 && longest < least_step {
                break;
            }
            width = (width / NARROWING).max(1.0);
        }
        nodes.truncate(self.poses.len());
        self.poses = nodes;
    }

    /// Covariances of all poses relative to one of them, in its frame, by all measurements with the weights that they have
    /// at these poses. `None` if the equations have no solution.
    pub fn covariances_from(&self, start: usize) -> Option<Vec<Matrix3<f64>>> {
        let (nodes, constraints) = self.nodes();
        let order = elimination_order(&nodes, &constraints);
        let (columns, _) = equations(&nodes, &constraints, &order, start, 1.0);
        let factor = factor(&columns)?;
        let inverse = factor.selected_inverse();
        let into = rotation_of_pose(&nodes[start].rotation.inverse());
        let covariance = |&place: &usize| into * inverse.at(place, place) * into.transpose();
        Some(order[..self.poses.len()].iter().map(covariance).collect())
    }
}

/// Solves the equations of one step after the other.
#[derive(Debug, Default)]
pub struct Solver {
    /// Places of the nodes in the order of elimination.
    order: Vec<usize>,
    systems: SimilarSystems,
}

impl Solver {
    /// A step of all nodes by their measurements. `None` if the equations have no solution.
    fn step(&mut self, nodes: &[Pose2], constraints: &[Constraint], width: f64) -> Option<Vec<Vector3<f64>>> {
        if self.order.len() != nodes.len() {
            self.order = elimination_order(nodes, constraints);
        }
        let (columns, vector) = equations(nodes, constraints, &self.order, 0, width);
        let solved = self.systems.solve(&columns, &vector)?;
        let moves: Vec<Vector3<f64>> = self.order.iter().map(|&place| solved[place]).collect();
        moves.iter().all(|step| step.iter().all(|value| value.is_finite())).then_some(moves)
    }
}

/// The normal equations of a step of all nodes, in the order of elimination; one of them stays where it is.
fn equations(
    nodes: &[Pose2],
    constraints: &[Constraint],
    order: &[usize],
    held: usize,
    width: f64,
) -> (Columns, Vec<Vector3<f64>>) {
    let mut columns: Columns = vec![Vec::new(); nodes.len()];
    let mut vector = vec![Vector3::zeros(); nodes.len()];
    let mut add = |row: usize, column: usize, block: Matrix3<f64>| {
        let (row, column) = (order[row], order[column]);
        if row >= column {
            columns[column].push((row, block));
        }
    };
    for node in 0..nodes.len() {
        let fixed = if node == held { FIXED } else { DAMPING };
        add(node, node, Matrix3::identity() * fixed);
    }
    for constraint in constraints {
        let (from, to) = (&nodes[constraint.from], &nodes[constraint.to]);
        let residual = relative_pose::residual(from, to, &constraint.transform);
        let squared = residual.dot(&(constraint.information * residual));
        let information = constraint.information * constraint.weight(squared, width);
        let [by_from, by_to] = relative_pose::derivatives(from, to);
        let sides = [(constraint.from, by_from), (constraint.to, by_to)];
        for (row, by_row) in &sides {
            let weighted = by_row.transpose() * information;
            vector[order[*row]] -= weighted * residual;
            for (column, by_column) in &sides {
                add(*row, *column, weighted * by_column);
            }
        }
    }
    (columns, vector)
}

/// Places of the nodes in an order of elimination that leaves the factor sparse.
fn elimination_order(nodes: &[Pose2], constraints: &[Constraint]) -> Vec<usize> {
    let mut neighbours = vec![Vec::new(); nodes.len()];
    for Constraint { from, to, .. } in constraints {
        neighbours[*from].push(*to);
        neighbours[*to].push(*from);
    }
    for of_node in &mut neighbours {
        of_node.sort_unstable();
        of_node.dedup();
    }
    minimum_degree(neighbours)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::pose;

    /// A drive around a square whose steps are each turned too far, and the true poses.
    fn square() -> (PoseGraph, Vec<Pose2>) {
        let mut truth = vec![Pose2::identity()];
        let mut graph = PoseGraph { poses: vec![Pose2::identity()], ..Default::default() };
        for step in 1..40 {
            let turn = if step % 10 == 0 { std::f64::consts::FRAC_PI_2 } else { 0.0 };
            let moved = pose(0.5, 0.0, turn);
            truth.push(truth[step - 1] * moved);
            let transform = moved * pose(0.0, 0.0, 0.01);
            graph.poses.push(graph.poses[step - 1] * transform);
            let information = Matrix3::from_diagonal(&Vector3::new(400.0, 400.0, 5000.0));
            graph.constraints.push(Constraint { from: step - 1, to: step, transform, information, is_loop: false });
        }
        (graph, truth)
    }

    fn closure(truth: &[Pose2], from: usize, to: usize) -> Constraint {
        let transform = truth[from].inv_mul(&truth[to]);
        Constraint { from, to, transform, information: Matrix3::identity() * 1e4, is_loop: true }
    }

    fn worst(graph: &PoseGraph, truth: &[Pose2]) -> f64 {
        let off = |(a, b): (&Pose2, &Pose2)| (a.translation.vector - b.translation.vector).norm();
        graph.poses.iter().zip(truth).map(off).fold(0.0, f64::max)
    }

    #[test]
    fn loop_closures_straighten_a_drive_and_a_wrong_one_does_not_bend_it() {
        let (mut graph, truth) = square();
        let before = worst(&graph, &truth);
        for (from, to) in [(0, 39), (0, 38), (1, 39)] {
            graph.constraints.push(closure(&truth, from, to));
        }
        let mut misled = graph.clone();
        graph.optimize();
        let after = worst(&graph, &truth);
        assert!(before > 1.0 && after < 0.3 * before, "{before} {after}");
        assert_eq!(graph.poses[0], Pose2::identity());

        misled.constraints.push(Constraint { transform: pose(3.0, -2.0, 1.0), ..closure(&truth, 5, 25) });
        misled.optimize();
        assert!(worst(&misled, &truth) < after + 0.2, "{}", worst(&misled, &truth));
        assert!(misled.constraints.last().unwrap().squared_residual(&misled.poses) > 100.0 * ROBUST);
    }

    #[test]
    fn landmarks_that_are_seen_again_straighten_a_drive_and_one_that_was_mistaken_does_not_bend_it() {
        let (mut graph, truth) = square();
        let sighting = |from: usize, landmark: usize, at: Point2| LandmarkSighting {
            from,
            landmark,
            place: truth[from].inverse() * at,
            deviation: 0.05,
        };
        let [near, far] = [Point2::new(1.0, 1.0), Point2::new(-2.0, 0.5)];
        graph.sightings = vec![sighting(0, 0, near), sighting(2, 1, far), sighting(38, 0, near), sighting(39, 1, far)];
        let before = worst(&graph, &truth);
        let mut misled = graph.clone();
        graph.optimize();
        let after = worst(&graph, &truth);
        assert!(after < 0.3 * before && graph.poses.len() == truth.len(), "{before} {after}");
        misled.sightings.push(LandmarkSighting { place: Point2::new(9.0, 4.0), ..sighting(20, 0, near) });
        misled.optimize();
        assert!(worst(&misled, &truth) < after + 0.2, "{}", worst(&misled, &truth));
    }

    #[test]
    fn walls_on_one_side_show_the_yaw_as_far_as_they_show_it_wherever_the_robot_is() {
        // A wall along x, seen from 3 m: the yaw moves what is far along it.
        let corridor = Matrix3::new(0.0, 0.0, 0.0, 0.0, 900.0, 0.0, 0.0, 0.0, 2500.0);
        assert!((yaw_information(&corridor) - 2500.0).abs() < 1e-9);
        // What is on one side only shows a yaw that a move of the robot explains as well.
        let one_side = Matrix3::new(0.0, 0.0, 0.0, 0.0, 900.0, 1500.0, 0.0, 1500.0, 2500.0);
        assert!(yaw_information(&one_side) < 3.0);
        assert_eq!(yaw_information(&Matrix3::zeros()), 0.0);
    }

    #[test]
    fn the_uncertainty_grows_along_the_drive_and_shrinks_by_a_loop_closure() {
        let (mut graph, truth) = square();
        let at = |graph: &PoseGraph, node: usize| graph.covariances_from(0).unwrap()[node].trace();
        assert!(at(&graph, 39) > 2.0 * at(&graph, 10));
        let open = at(&graph, 39);
        graph.constraints.push(closure(&truth, 0, 39));
        assert!(at(&graph, 39) > 0.5 * open, "it contradicts the rest so far");
        graph.optimize();
        assert!(at(&graph, 39) < 0.1 * open);
    }

    #[test]
    fn a_drive_of_half_a_kilometre_is_as_uncertain_as_its_steps() {
        let (steps, length, deviation) = (1500, 0.35, 0.004);
        let moved = pose(length, 0.0, 0.0);
        let information = Matrix3::from_diagonal(&Vector3::new(1e4, 1e4, f64::powi(deviation, -2)));
        let poses = (0..=steps).map(|step| pose(length * step as f64, 0.0, 0.0)).collect();
        let step = |to: usize| Constraint { from: to - 1, to, transform: moved, information, is_loop: false };
        let mut graph = PoseGraph { poses, constraints: (1..=steps).map(step).collect(), ..Default::default() };
        let yaw = graph.covariances_from(0).unwrap()[steps].m33.sqrt();
        let by_steps = deviation * (steps as f64).sqrt();
        assert!((0.95..1.0 + 1e-9).contains(&(yaw / by_steps)), "{yaw} {by_steps}");

        // A place known again at its end turns it as a whole, whatever the way before it.
        let turned = pose(0.0, 0.0, 0.5 * by_steps) * graph.poses[steps];
        graph.constraints.push(Constraint { to: steps, transform: turned, ..closure(&graph.poses, 0, steps) });
        graph.optimize();
        let off = (graph.poses[steps].translation.vector - turned.translation.vector).norm();
        assert!(off < 0.1, "{off}");
    }
}
