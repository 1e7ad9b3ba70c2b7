//! Simulated worlds with two robots, each from a seed.

use super::kinds::Kind;
use super::truth::{Closeness, NEAR, NEAR_DEGREES};
use crate::trial::World;
use anyhow::Result;
use gridweave::evaluate::{Evaluation, RobotResult, evaluate_summary};
use gridweave_logs::summary::{Frame, Summary};
use gridweave_runtime::stage::Registry;
use gridweave_stages::shared::geometry::Pose2;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;

/// Which seeds worlds are made from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Seeds {
    /// Those on which parameters and weights were chosen.
    Tuning,
    /// Those that nothing was chosen on.
    HeldOut,
}

impl Seeds {
    /// The seed of a world.
    pub(super) fn seed(self, number: u64) -> u64 {
        let first = match self {
            Self::Tuning => 150_000,
            Self::HeldOut => 700_050_000,
        };
        first + number
    }
}

/// The two robots of simulated worlds.
pub(crate) const ROBOTS: [&str; 2] = ["robot1", "robot2"];

/// A log of two robots, and the building that it was simulated in.
pub(crate) struct PairWorld {
    pub(crate) name: String,
    pub(crate) world: World,
    /// The name of the kind of building.
    pub(crate) kind: &'static str,
}

/// Two robots in a building of any kind. `None` if the robots find no way or see nothing there.
pub(crate) fn varied(seeds: Seeds, number: u64, registry: &Registry) -> Option<PairWorld> {
    let seed = seeds.seed(number);
    let kind = Kind::of(number);
    PairWorld::simulate(kind.name(), &kind.settings(&mut ChaCha8Rng::seed_from_u64(seed)), seed, registry)
}

impl PairWorld {
    /// Two robots in a building of a kind. `None` if the robots find no way or see nothing there.
    pub(super) fn simulate(kind: &'static str, settings: &[String], seed: u64, registry: &Registry) -> Option<Self> {
        let world = World::simulate(settings, seed, registry).ok()?;
        Some(Self { name: format!("seed {seed}, {kind}"), world, kind })
    }

    /// Whether `T_a_b` is right by the world's truth.
    pub(crate) fn is_right(&self, robots: [&str; 2], transform_a_b: &Pose2) -> Result<bool> {
        Ok(is_place_right(&self.evaluation(robots, transform_a_b)?))
    }

    /// Error of `T_a_b` by the world's truth.
    pub(crate) fn closeness(&self, robots: [&str; 2], transform_a_b: &Pose2) -> Result<Closeness> {
        let evaluation = self.evaluation(robots, transform_a_b)?;
        let is_near = match &evaluation.common {
            Some(common) => common.rigid.median_m < NEAR,
            None => evaluation.robots.first().is_some_and(|robot| {
                robot.error_m.is_some_and(|metres| metres < NEAR)
                    && robot.error_deg.is_some_and(|degrees| degrees < NEAR_DEGREES)
            }),
        };
        Ok(match is_place_right(&evaluation) {
            true => Closeness::Right,
            false if evaluation.related && is_near => Closeness::Near,
            false => Closeness::Wrong,
        })
    }

    fn evaluation(&self, [a, b]: [&str; 2], transform_a_b: &Pose2) -> Result<Evaluation> {
        let (x, y, yaw) = (transform_a_b.translation.x, transform_a_b.translation.y, transform_a_b.rotation.angle());
        let placed = Frame { x, y, yaw, ..Default::default() };
        let frames = BTreeMap::from([(a.to_owned(), Frame::default()), (b.to_owned(), placed)]);
        let placed = Summary { reference: Some(a.to_owned()), frames, ..Default::default() };
        evaluate_summary(&placed, &self.world.truth)
    }
}

/// Whether the relative pose of two robots is right: places that both have seen are within 0.5 m of each other in the
/// median, and nine of ten within 1 m. Where the truth lists none, the second robot is within 0.5 m and 3 degrees of
/// its true pose, as drift turns maps by that.
fn is_place_right(evaluation: &Evaluation) -> bool {
    let is_near =
        |robot: &RobotResult| robot.error_m.is_some_and(|m| m < 0.5) && robot.error_deg.is_some_and(|deg| deg < 3.0);
    let is_right = match &evaluation.common {
        Some(common) => common.rigid.median_m < 0.5 && common.rigid.p90_m < 1.0,
        None => evaluation.robots.first().is_some_and(is_near),
    };
    evaluation.related && is_right
}
