//! Search of the pose of a scan within a window, by its correlation with a likelihood field.

use super::likelihood_field::{CELL, LikelihoodField};
use crate::shared::geometry::{Point2, Pose2, pose, wrap_angle};
use nalgebra::{Matrix3, Vector2, Vector3};

/// Margin of the likelihood field around the points, metres: the reach of a wall in it.
pub(super) const MARGIN: f64 = 0.3;

/// What is known of a pose before the search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PosePrior {
    /// Mean.
    pub(super) mean: Pose2,
    /// Inverse of the covariance of (x, y, yaw) in the frame in which the mean is given; metres and radians.
    pub(super) information: Matrix3<f64>,
    /// Half the window along x, y and yaw, metres and radians.
    pub(super) window: [f64; 3],
}

/// A pose that the search has found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FoundPose {
    /// The pose.
    pub(super) pose: Pose2,
    /// Mean value of the likelihood field at the points, 0 to 1.
    pub(super) response: f64,
    /// Logarithm of the posterior probability, but for a constant.
    pub(super) score: f64,
}

/// A pose around which nothing is searched: the second best is not the best's neighbour.
#[derive(Clone, Copy, Debug)]
pub(super) struct Excluded {
    /// The pose.
    pub(super) pose: Pose2,
    /// Distance, metres.
    pub(super) distance: f64,
    /// Turn, radians.
    pub(super) turn: f64,
}

/// The poses that are searched: translations by cells of the field, and rotations, each relative to the mean.
struct Window {
    mean: Pose2,
    /// Half of it along x and y, cells.
    half: [i32; 2],
    rotations: Vec<Rotation>,
}

/// The scan in one rotation.
struct Rotation {
    /// Turn from the mean, radians.
    turn: f64,
    /// Cells of the points, without translation from the mean.
    cells: Vec<[i32; 2]>,
}

/// Scores the nodes of the search tree.
struct Scorer<'a> {
    field: &'a LikelihoodField,
    window: &'a Window,
    prior: &'a PosePrior,
    /// Information of the prior on the yaw, whatever the translation is.
    information_of_turn: f64,
    /// Score of each unit of the field.
    scale: f64,
    /// Least sum of the field that counts.
    least: u32,
}

/// A node of the search tree: one rotation, and a square of translations.
#[derive(Clone, Copy)]
struct Node {
    /// Index of the rotation.
    rotation: usize,
    /// The square has a side of two to this power, cells.
    level: usize,
    /// Least translation, cells.
    offset: [i32; 2],
    /// The score of its poses is no higher; at level 0 it is this.
    bound: f64,
}

/// Finds the pose with the highest posterior: `gain` times the sum of the likelihood field at the points, less half
/// the squared deviation from the prior. It is exact on a grid of cells of the field and of rotations by which the
/// farthest points move by a cell (Olson 2009, "Real-time correlative scan matching"; branch and bound as in Hess et
/// al. 2016). Poses with a response below `least` are left out. `None` if there are no others, or no points.
pub(super) fn search(
    field: &LikelihoodField,
    points: &[Point2],
    prior: &PosePrior,
    gain: f64,
    least: f64,
    excluded: Option<&Excluded>,
) -> Option<FoundPose> {
    if points.is_empty() {
        return None;
    }
    let window = Window::new(field, points, prior);
    let scorer = Scorer {
        field,
        window: &window,
        prior,
        information_of_turn: prior.information_of_turn(),
        scale: gain / 255.0,
        least: (least * 255.0 * points.len() as f64).ceil() as u32,
    };
    let best = branch_and_bound(&window, &scorer, excluded)?;
    let Rotation { turn, cells } = &window.rotations[best.rotation];
    let [x, y] = best.offset.map(|cells| f64::from(cells) * CELL);
    let sum = f64::from(field.sum(0, cells, best.offset));
    let mean = window.mean;
    Some(FoundPose {
        pose: pose(mean.translation.x + x, mean.translation.y + y, mean.rotation.angle() + turn),
        response: sum / (255.0 * points.len() as f64),
        score: best.bound,
    })
}

/// The node of one pose with the highest score. Squares are searched depth first, the best first; those that cannot
/// exceed the best pose so far are left out.
fn branch_and_bound(window: &Window, scorer: &Scorer<'_>, excluded: Option<&Excluded>) -> Option<Node> {
    let mut open = scorer.roots();
    let mut best: Option<Node> = None;
    while let Some(node) = open.pop() {
        if best.is_some_and(|best| best.bound >= node.bound) {
            continue;
        }
        if node.level > 0 {
            let possible = |part: &Node| window.contains(part.offset) && part.bound > f64::NEG_INFINITY;
            open.extend(scorer.parts(&node).into_iter().filter(possible));
        } else if !excluded.is_some_and(|excluded| window.is_excluded(&node, excluded)) {
            best = Some(node);
        }
    }
    best
}

impl Window {
    fn new(field: &LikelihoodField, points: &[Point2], prior: &PosePrior) -> Self {
        let farthest = points.iter().map(|point| point.coords.norm()).fold(CELL, f64::max);
        let step = (CELL / farthest).max(0.004);
        let turns = (prior.window[2] / step).ceil() as i32;
        let mean = prior.mean;
        let yaw = mean.rotation.angle();
        let rotation = |turn: i32| {
            let turn = f64::from(turn) * step;
            let at = pose(mean.translation.x, mean.translation.y, yaw + turn);
            Rotation { turn, cells: points.iter().map(|point| field.cell(&(at * point))).collect() }
        };
        let half = [0, 1].map(|axis| (prior.window[axis] / CELL).ceil() as i32);
        Self { mean, half, rotations: (-turns..=turns).map(rotation).collect() }
    }

    /// Whether a square with this least translation reaches into the window.
    fn contains(&self, offset: [i32; 2]) -> bool {
        offset[0] <= self.half[0] && offset[1] <= self.half[1]
    }

    /// Whether a node of one pose is near an excluded pose.
    fn is_excluded(&self, node: &Node, excluded: &Excluded) -> bool {
        let place = self.mean.translation.vector + Vector2::from(node.offset.map(f64::from)) * CELL;
        let yaw = self.mean.rotation.angle() + self.rotations[node.rotation].turn;
        let turn = wrap_angle(yaw - excluded.pose.rotation.angle());
        (place - excluded.pose.translation.vector).norm() < excluded.distance && turn.abs() < excluded.turn
    }
}

impl Scorer<'_> {
    fn node(&self, rotation: usize, level: usize, offset: [i32; 2]) -> Node {
        let Rotation { turn, cells } = &self.window.rotations[rotation];
        let squared_deviation = match level {
            0 => self.squared_deviation(*turn, offset),
            // The square has a translation that fits the turn best, at most.
            _ => self.information_of_turn * turn * turn,
        };
        let sum = self.field.sum(level, cells, offset);
        let bound = match sum < self.least {
            true => f64::NEG_INFINITY,
            false => self.scale * f64::from(sum) - 0.5 * squared_deviation,
        };
        Node { rotation, level, offset, bound }
    }

    /// Squared deviation of a pose from the prior, in variances.
    fn squared_deviation(&self, turn: f64, offset: [i32; 2]) -> f64 {
        let by = Vector3::new(f64::from(offset[0]) * CELL, f64::from(offset[1]) * CELL, turn);
        by.dot(&(self.prior.information * by))
    }

    /// The nodes that cover the window, the best last; equals in the order of the window.
    fn roots(&self) -> Vec<Node> {
        let (level, [half_x, half_y]) = (self.field.top_level(), self.window.half);
        let mut roots = Vec::new();
        for rotation in 0..self.window.rotations.len() {
            for x in (-half_x..=half_x).step_by(1 << level) {
                for y in (-half_y..=half_y).step_by(1 << level) {
                    let node = self.node(rotation, level, [x, y]);
                    if node.bound > f64::NEG_INFINITY {
                        roots.push(node);
                    }
                }
            }
        }
        roots.sort_by(|a, b| a.bound.total_cmp(&b.bound));
        roots
    }

    /// The four quarters of a node, the best last.
    fn parts(&self, node: &Node) -> [Node; 4] {
        let level = node.level - 1;
        let side = 1 << level;
        let [x, y] = node.offset;
        let mut parts = [[x, y], [x + side, y], [x, y + side], [x + side, y + side]]
            .map(|offset| self.node(node.rotation, level, offset));
        parts.sort_by(|a, b| a.bound.total_cmp(&b.bound));
        parts
    }
}

impl PosePrior {
    /// Lower and upper corner of a rectangle that holds the points at all poses of the window.
    pub(super) fn reach(&self, points: &[Point2]) -> [Point2; 2] {
        let Self { mean, window, .. } = self;
        let mut corners = [mean.translation.vector; 2];
        for point in points {
            let place = (mean * point).coords;
            let sweep = Vector2::repeat(point.coords.norm() * window[2].min(2.0));
            corners = [corners[0].inf(&(place - sweep)), corners[1].sup(&(place + sweep))];
        }
        let margin = Vector2::new(window[0], window[1]) + Vector2::repeat(MARGIN);
        [(corners[0] - margin).into(), (corners[1] + margin).into()]
    }

    /// Information on the yaw alone, whatever the position is: the inverse of its variance.
    fn information_of_turn(&self) -> f64 {
        let of_position = self.information.fixed_view::<2, 2>(0, 0).into_owned();
        let mixed = self.information.fixed_view::<2, 1>(0, 2).into_owned();
        let by_position = of_position.try_inverse().map(|inverse| (mixed.transpose() * inverse * mixed).x);
        by_position.map_or(0.0, |explained| (self.information.m33 - explained).max(0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The corner of a room, with a niche.
    fn room() -> Vec<Point2> {
        let along = |from: [f64; 2], to: [f64; 2]| {
            let (from, to) = (Vector2::from(from), Vector2::from(to));
            let steps = ((to - from).norm() / 0.05) as i32;
            (0..steps).map(move |step| Point2::from(from + (to - from) * (f64::from(step) / f64::from(steps))))
        };
        along([-3.0, -2.0], [4.0, -2.0])
            .chain(along([4.0, -2.0], [4.0, 3.0]))
            .chain(along([-3.0, -2.0], [-3.0, 0.5]))
            .chain(along([1.0, 2.0], [2.5, 2.0]))
            .collect()
    }

    fn field() -> LikelihoodField {
        LikelihoodField::new(room().into_iter(), &[Point2::new(-6.0, -6.0), Point2::new(7.0, 7.0)], 1.0)
    }

    #[test]
    fn a_scan_is_found_where_it_was_made() {
        let truth = pose(0.42, -0.3, 0.21);
        let points: Vec<Point2> = room().iter().map(|point| truth.inverse() * point).collect();
        let prior = PosePrior {
            mean: pose(0.0, 0.0, 0.0),
            information: Matrix3::from_diagonal(&Vector3::new(4.0, 4.0, 10.0)),
            window: [1.0, 1.0, 0.5],
        };
        let found = search(&field(), &points, &prior, 0.3, 0.0, None).unwrap();
        let off = truth.inverse() * found.pose;
        assert!(off.translation.vector.norm() < 0.06 && off.rotation.angle().abs() < 0.02, "{found:?}");
        assert!(found.response > 0.8, "{found:?}");
        let excluded = Excluded { pose: found.pose, distance: 0.5, turn: 0.2 };
        let second = search(&field(), &points, &prior, 0.3, 0.0, Some(&excluded)).unwrap();
        assert!(second.response < 0.7 * found.response, "{second:?}");
        assert!(search(&field(), &[], &prior, 0.3, 0.0, None).is_none());
    }

    #[test]
    fn branch_and_bound_finds_what_an_exhaustive_search_does() {
        let points: Vec<Point2> = room().iter().map(|point| pose(0.1, 0.2, 0.05).inverse() * point).collect();
        let information = Matrix3::new(9.0, 2.0, 1.0, 2.0, 5.0, -1.0, 1.0, -1.0, 20.0);
        let prior = PosePrior { mean: pose(0.3, 0.0, 0.0), information, window: [0.4, 0.4, 0.1] };
        let field = field();
        let found = search(&field, &points, &prior, 0.1, 0.0, None).unwrap();
        let farthest = points.iter().map(|point| point.coords.norm()).fold(CELL, f64::max);
        let mut most = f64::NEG_INFINITY;
        let turns = (0.1 * farthest / CELL).ceil() as i32;
        for turn in -turns..=turns {
            let turn = f64::from(turn) * CELL / farthest;
            let at = pose(0.3, 0.0, turn);
            let cells: Vec<[i32; 2]> = points.iter().map(|point| field.cell(&(at * point))).collect();
            for (x, y) in (-8..=8).flat_map(|x| (-8..=8).map(move |y| (x, y))) {
                let by = Vector3::new(f64::from(x) * CELL, f64::from(y) * CELL, turn);
                let score = 0.1 / 255.0 * f64::from(field.sum(0, &cells, [x, y])) - 0.5 * by.dot(&(information * by));
                most = most.max(score);
            }
        }
        assert!((found.score - most).abs() < 1e-9, "{} {most}", found.score);
    }
}
