//! Simulated pose graphs with known poses and known outliers, for tests and benches.

use crate::merge::frame_solver::UncertainPose;
use crate::merge::frame_solver::graph::Edge;
use crate::shared::geometry::{Pose2, pose};
use gridweave_runtime::ros::Alignment;
use nalgebra::{Matrix3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::collections::BTreeSet;
use std::f64::consts::{FRAC_PI_2, PI};

/// Standard deviation of the position of every alignment, at the origin of the moved map, metres.
const POSITION_DEVIATION: f64 = 0.06;
/// Standard deviation of the rotation of every alignment, radians.
const YAW_DEVIATION: f64 = 0.006;

/// Robots and the alignments between them.
pub(crate) struct SimulatedGraph {
    /// Pose of each robot's map in the world.
    pub(crate) poses: Vec<Pose2>,
    /// The alignments.
    pub(crate) edges: Vec<Edge>,
    /// Indices of those that are wrong.
    pub(crate) wrong: BTreeSet<usize>,
    random: ChaCha8Rng,
}

impl SimulatedGraph {
    /// Robots spread over a building, each aligned with the `nearest` others, and with those that it is among the
    /// nearest of. The errors of alignments follow their covariances.
    pub(crate) fn new(robots: usize, nearest: usize, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let size = 10.0 * (robots as f64).sqrt();
        let mut random_pose = || {
            pose(
                size * random.random::<f64>(),
                size * random.random::<f64>(),
                PI * (2.0 * random.random::<f64>() - 1.0),
            )
        };
        let poses: Vec<Pose2> = (0..robots).map(|_| random_pose()).collect();
        let mut pairs = BTreeSet::new();
        for robot in 0..robots {
            let distance = |other: usize| (poses[robot].translation.vector - poses[other].translation.vector).norm();
            let mut others: Vec<usize> = (0..robots).filter(|other| *other != robot).collect();
            others.sort_by(|&one, &other| distance(one).total_cmp(&distance(other)));
            pairs.extend(others.iter().take(nearest).map(|&other| (robot.min(other), robot.max(other))));
        }
        let mut simulated = Self { poses, edges: Vec::new(), wrong: BTreeSet::new(), random };
        for (a, b) in pairs {
            let error = simulated.error();
            let covariance = deviations().component_mul(&deviations());
            let transform_a_b = UncertainPose {
                pose: error_added(&(simulated.poses[a].inverse() * simulated.poses[b]), &error),
                covariance: Matrix3::from_diagonal(&covariance),
            };
            simulated.edges.push(Edge { a, b, transform_a_b });
        }
        simulated
    }

    /// Makes this share of the alignments wrong, independently: by metres, and many by quarter turns.
    #[must_use]
    pub(crate) fn with_outliers(mut self, share: f64) -> Self {
        while (self.wrong.len() as f64) < share * self.edges.len() as f64 {
            let index = self.random.random_range(0..self.edges.len());
            let outlier = self.outlier();
            if self.wrong.insert(index) {
                let pose = &mut self.edges[index].transform_a_b.pose;
                *pose *= outlier;
            }
        }
        self
    }

    /// Makes this share of the alignments wrong in pairs: both place the same robot at the same wrong pose.
    #[must_use]
    pub(crate) fn with_agreeing_outliers(mut self, share: f64) -> Self {
        for _ in 0..100 * self.edges.len() {
            if self.wrong.len() as f64 + 1.0 >= share * self.edges.len() as f64 {
                break;
            }
            let robot = self.random.random_range(0..self.poses.len());
            let touches = |edge: &Edge| edge.a == robot || edge.b == robot;
            let own: Vec<usize> = (0..self.edges.len()).filter(|&index| touches(&self.edges[index])).collect();
            let two = [0; 2].map(|_| own[self.random.random_range(0..own.len())]);
            let outlier = self.outlier();
            if two[0] == two[1] || two.iter().any(|index| self.wrong.contains(index)) {
                continue;
            }
            for index in two {
                self.wrong.insert(index);
                let edge = &mut self.edges[index];
                let pose = &mut edge.transform_a_b.pose;
                *pose = if edge.b == robot { *pose * outlier } else { outlier.inverse() * *pose };
            }
        }
        self
    }

    /// Name of a robot.
    pub(crate) fn name(robot: usize) -> String {
        format!("robot{robot:02}")
    }

    /// An alignment as a message.
    pub(crate) fn alignment(&self, index: usize) -> Alignment {
        let edge = &self.edges[index];
        let mut alignment = Alignment {
            a: Self::name(edge.a),
            b: Self::name(edge.b),
            covariance: crate::shared::geometry::row_by_row(&edge.transform_a_b.covariance),
            score: 0.9,
            accepted: true,
            ..Default::default()
        };
        alignment.set_transform_a_b(&edge.transform_a_b.pose);
        alignment
    }

    /// Whether a pose in the frame of the first robot is so far from the true one that a wrong alignment must be the
    /// cause.
    pub(crate) fn is_wrong(&self, robot: usize, transform_first_robot: &Pose2) -> bool {
        let off = (self.poses[0].inverse() * self.poses[robot]).inverse() * transform_first_robot;
        off.translation.vector.norm() > 2.0 || off.rotation.angle().abs() > 0.15
    }

    fn error(&mut self) -> Vector3<f64> {
        deviations().map(|deviation| deviation * self.random.sample::<f64, _>(StandardNormal))
    }

    fn outlier(&mut self) -> Pose2 {
        let far = 4.0 + 16.0 * self.random.random::<f64>();
        let direction = PI * (2.0 * self.random.random::<f64>() - 1.0);
        let quarters = f64::from(self.random.random_range(0..4u8));
        pose(far * direction.cos(), far * direction.sin(), quarters * FRAC_PI_2)
    }
}

fn deviations() -> Vector3<f64> {
    Vector3::new(POSITION_DEVIATION, POSITION_DEVIATION, YAW_DEVIATION)
}

fn error_added(transform: &Pose2, error: &Vector3<f64>) -> Pose2 {
    pose(transform.translation.x + error.x, transform.translation.y + error.y, transform.rotation.angle() + error.z)
}
