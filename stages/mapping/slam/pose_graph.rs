//! A graph of poses with relative measurements between them, and its most likely poses.

use crate::shared::geometry::relative_pose::{self, rotation_of_pose};
use crate::shared::geometry::{Point2, Pose2, quarter_turn};
use crate::shared::sparse::{Columns, SimilarSystems, nested_dissection};
use nalgebra::{Matrix3, UnitComplex, Vector3};
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Largest number of Gauss-Newton steps.
const MAX_STEPS: usize = 60;
/// Factor by which the weights narrow from step to step.
const NARROWING: f64 = 2.0;
/// Steps shorter than this end the iteration, metres and radians; and those where measurements are made anew after it.
const LEAST_STEP: f64 = 1e-4;
const LEAST_SETTLING_STEP: f64 = 1e-3;
/// Prior of each pose about where it was before a step, in standard deviations of a hundred metres or radians: the
/// first pose is fixed by it alone where nothing else fixes it.
const DAMPING: f64 = 1e-4;
/// Information on the first pose, which fixes the frame.
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

impl Constraint {
    /// Squared residual at two poses, in variances.
    pub fn squared_residual(&self, poses: &[Pose2]) -> f64 {
        let residual = relative_pose::residual(&poses[self.from], &poses[self.to], &self.transform);
        residual.dot(&(self.information * residual))
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

    fn iterate(&mut self, is_graduated: bool, solver: &mut Solver) {
        let count = self.poses.len();
        let mut nodes = self.poses.clone();
        let landmarks = self.sightings.iter().map(|sighting| sighting.landmark + 1).max().unwrap_or(0);
        nodes.resize(count + landmarks, Pose2::identity());
        // A landmark is where it was seen first.
        for LandmarkSighting { from, landmark, place, .. } in self.sightings.iter().rev() {
            nodes[count + landmark] = Pose2::from_parts((nodes[*from] * place).into(), UnitComplex::identity());
        }
        let sightings = self.sightings.iter().map(|sighting| sighting.constraint(count));
        let constraints: Vec<Constraint> = self.constraints.iter().copied().chain(sightings).collect();
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
        nodes.truncate(count);
        self.poses = nodes;
    }

    /// Covariances of all poses relative to one of them, in its frame, along the most certain path of measurements:
    /// an upper bound of what all of them together leave (Dijkstra projection, Olson 2008, "Robust and efficient
    /// robotic mapping", section 3.5). `None` for what is not connected.
    pub fn covariances_from(&self, start: usize) -> Vec<Option<Matrix3<f64>>> {
        let mut beside: Vec<Vec<usize>> = vec![Vec::new(); self.poses.len()];
        for (number, constraint) in self.constraints.iter().enumerate() {
            beside[constraint.from].push(number);
            beside[constraint.to].push(number);
        }
        let mut found: Vec<Option<Matrix3<f64>>> = vec![None; self.poses.len()];
        let mut open = BinaryHeap::from([Reached { cost: 0.0, node: start, covariance: Matrix3::zeros() }]);
        while let Some(Reached { node, covariance, .. }) = open.pop() {
            if found[node].is_some() {
                continue;
            }
            found[node] = Some(covariance);
            let here = self.poses[start].inv_mul(&self.poses[node]);
            for &number in &beside[node] {
                let constraint = &self.constraints[number];
                let other = if constraint.from == node { constraint.to } else { constraint.from };
                if found[other].is_some() {
                    continue;
                }
                let Some(own) = constraint.information.try_inverse() else { continue };
                // The measurement's own error, turned into the frame of the start.
                let turned = self.poses[start].rotation.inverse() * self.poses[constraint.from].rotation;
                let turned = rotation_of_pose(&turned);
                // The error of the yaw so far moves what lies ahead.
                let there = self.poses[start].inv_mul(&self.poses[other]);
                let lever = quarter_turn(&(there.translation.vector - here.translation.vector));
                let moved = Matrix3::new(1.0, 0.0, lever.x, 0.0, 1.0, lever.y, 0.0, 0.0, 1.0);
                let covariance = moved * covariance * moved.transpose() + turned * own * turned.transpose();
                open.push(Reached { cost: covariance.trace(), node: other, covariance });
            }
        }
        found
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
        let count = nodes.len();
        if self.order.len() != count {
            self.order = elimination_order(nodes, constraints);
        }
        let order = &self.order;
        let mut columns: Columns = vec![Vec::new(); count];
        let mut vector = vec![Vector3::zeros(); count];
        let mut add = |row: usize, column: usize, block: Matrix3<f64>| {
            let (row, column) = (order[row], order[column]);
            if row >= column {
                columns[column].push((row, block));
            }
        };
        for node in 0..count {
            let fixed = if node == 0 { FIXED } else { DAMPING };
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
        let solved = self.systems.solve(&columns, &vector)?;
        let moves: Vec<Vector3<f64>> = order.iter().map(|&place| solved[place]).collect();
        moves.iter().all(|step| step.iter().all(|value| value.is_finite())).then_some(moves)
    }
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
    let places: Vec<Point2> = nodes.iter().map(|pose| pose.translation.vector.into()).collect();
    nested_dissection(&places, &neighbours)
}

/// A node that the search of the most certain paths has reached.
struct Reached {
    cost: f64,
    node: usize,
    covariance: Matrix3<f64>,
}

impl Ord for Reached {
    /// The least cost is the greatest, and of equal ones the first node.
    fn cmp(&self, other: &Self) -> Ordering {
        other.cost.total_cmp(&self.cost).then(other.node.cmp(&self.node))
    }
}

impl PartialOrd for Reached {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Reached {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Reached {}

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
    fn the_uncertainty_grows_along_the_drive_and_shrinks_by_a_loop_closure() {
        let (mut graph, truth) = square();
        let at = |graph: &PoseGraph, node: usize| graph.covariances_from(0)[node].unwrap().trace();
        assert!(at(&graph, 39) > 2.0 * at(&graph, 10));
        let open = at(&graph, 39);
        graph.constraints.push(closure(&truth, 0, 39));
        assert!(at(&graph, 39) < 0.1 * open);
        graph.poses.push(Pose2::identity());
        assert!(graph.covariances_from(0)[40].is_none(), "nothing connects it");
    }
}
