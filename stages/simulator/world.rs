//! Common parts of the robots of a simulation: the building, its tags, and random numbers.

use super::clearances::Clearances;
use super::floor_plan::FloorPlan;
use super::parameters::SimulatorParameters;
use super::ray_caster::RayCaster;
use super::tags::{Tag, place_tags};
use gridweave_runtime::stage::ParameterError;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Why there is no simulation.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SimulationError {
    /// A parameter is out of its range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// None of a robot's rooms can be reached.
    #[error("{robot} finds no way through the building: make it larger, or lower `clutter`")]
    NoWay {
        /// Which robot.
        robot: String,
    },
    /// No beam of a robot's lidar has returned.
    #[error("the lidar of {robot} has met nothing: raise `lidar_range`, or lower `dropped_beams`")]
    SeenNothing {
        /// Which robot.
        robot: String,
    },
}

/// Common parts of the robots.
pub(super) struct World {
    pub(super) plan: FloorPlan,
    pub(super) space: Clearances,
    pub(super) caster: RayCaster,
    pub(super) tags: Vec<Tag>,
    seed: u64,
}

/// Purposes of random numbers. Every purpose has its own stream, so that to change one thing changes no other.
#[derive(Clone, Copy, Debug)]
pub(super) enum Stream {
    Building,
    TagPlaces,
    MapFrame(usize),
    Route(usize),
    Drift(usize),
    Lidar(usize),
    Tags(usize),
    Specks(usize),
    Furniture(usize),
    Odometry(usize),
}

impl World {
    pub(super) fn new(parameters: &SimulatorParameters, seed: u64) -> Self {
        let plan = FloorPlan::random(&parameters.building(), &mut random(seed, Stream::Building));
        let space = Clearances::of(&plan);
        let caster = RayCaster::new(&plan.solids);
        let count = parameters.tags as usize;
        let tags = place_tags(&plan, &space, &caster, count, &mut random(seed, Stream::TagPlaces));
        Self { plan, space, caster, tags, seed }
    }

    /// The world of one robot, with the furniture of some rooms rearranged; tags are on the walls.
    pub(super) fn rearranged(&self, robot: usize, parameters: &SimulatorParameters) -> Self {
        let mut random = self.random(Stream::Furniture(robot));
        let plan = self.plan.rearranged(parameters.moved, &parameters.building(), &mut random);
        Self {
            space: Clearances::of(&plan),
            caster: RayCaster::new(&plan.solids),
            plan,
            tags: self.tags.clone(),
            ..*self
        }
    }

    pub(super) fn random(&self, stream: Stream) -> ChaCha8Rng {
        random(self.seed, stream)
    }
}

fn random(seed: u64, stream: Stream) -> ChaCha8Rng {
    let (purpose, robot) = match stream {
        Stream::Building => (0, 0),
        Stream::TagPlaces => (1, 0),
        Stream::MapFrame(robot) => (2, robot),
        Stream::Route(robot) => (3, robot),
        Stream::Drift(robot) => (4, robot),
        Stream::Lidar(robot) => (5, robot),
        Stream::Tags(robot) => (6, robot),
        Stream::Specks(robot) => (7, robot),
        // After the streams of the largest number of robots.
        Stream::Furniture(robot) => (0, 64 + robot),
        Stream::Odometry(robot) => (1, 64 + robot),
    };
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(robot as u64 * 8 + purpose);
    random
}
