//! A whole simulation: a building, its tags, the robots in it, and the truth.

use super::floor_plan::FloorPlan;
use super::free_space::FreeSpace;
use super::parameters::Parameters;
use super::ray_caster::RayCaster;
use super::robot::{RobotLog, simulate_robot};
use super::route::share_rooms;
use super::tags::{Tag, place_tags};
use super::truth::Truth;
use crate::geometry::Point2;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// Why there is no simulation.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SimulationError {
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

/// A simulation.
#[derive(Clone, Debug, PartialEq)]
pub struct Simulation {
    /// The building.
    pub plan: FloorPlan,
    /// Its tags.
    pub tags: Vec<Tag>,
    /// What each robot has logged.
    pub robots: Vec<RobotLog>,
    /// What a merge is measured against.
    pub truth: Truth,
}

/// What the robots share.
pub(super) struct World {
    pub(super) plan: FloorPlan,
    pub(super) space: FreeSpace,
    pub(super) caster: RayCaster,
    pub(super) tags: Vec<Tag>,
    seed: u64,
}

/// What random numbers are for. Every purpose has a stream of its own, so that to change one thing changes no other.
#[derive(Clone, Copy, Debug)]
pub(super) enum Stream {
    Building,
    TagPlaces,
    MapFrame(usize),
    Route(usize),
    Drift(usize),
    Lidar(usize),
    Tags(usize),
}

impl World {
    fn new(parameters: &Parameters, seed: u64) -> Self {
        let plan = FloorPlan::random(&parameters.building(), &mut random(seed, Stream::Building));
        let entrance = plan.corridors.first().map_or(plan.bounds.centre(), |corridor| corridor.centre());
        let space = FreeSpace::new(&plan.bounds, &plan.solids, &entrance);
        let caster = RayCaster::new(&plan.solids);
        let count = parameters.tags as usize;
        let tags = place_tags(&plan, &space, &caster, count, &mut random(seed, Stream::TagPlaces));
        Self { plan, space, caster, tags, seed }
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
    };
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(robot as u64 * 8 + purpose);
    random
}

/// Makes a building, lets the robots drive through it, and says what is true. The same parameters and seed give the
/// same simulation on any number of threads.
///
/// `parameters` are those that [`check`](gridweave_runtime::stage::Parameters::check) has nothing against.
pub fn simulate(parameters: &Parameters, seed: u64) -> Result<Simulation, SimulationError> {
    let world = World::new(parameters, seed);
    let rooms = share_rooms(world.plan.rooms.len(), parameters.robots as usize, parameters.overlap);
    let robots = rooms
        .into_par_iter()
        .enumerate()
        .map(|(robot, rooms)| simulate_robot(&world, robot, rooms, parameters))
        .collect::<Vec<_>>();
    // The first error by robot, whichever thread was first.
    let robots = robots.into_iter().collect::<Result<Vec<_>, _>>()?;
    let truth = truth_of(&world.tags, &robots);
    Ok(Simulation { plan: world.plan, tags: world.tags, robots, truth })
}

fn truth_of(tags: &[Tag], robots: &[RobotLog]) -> Truth {
    let transform_building_first = robots.first().map(|robot| robot.transform_building_map).unwrap_or_default();
    let frame = |robot: &RobotLog| transform_building_first.inv_mul(&robot.transform_building_map);
    let last_map = |robot: &RobotLog| Some((robot.name.clone(), robot.maps.last()?.1.geometry));
    let centres = robots.iter().filter_map(last_map).map(|(name, geometry)| {
        let size = Point2::new(geometry.width as f64, geometry.height as f64);
        (name, geometry.origin * (size * geometry.resolution / 2.0))
    });
    Truth {
        resolution: robots.first().and_then(last_map).map_or(0.0, |(_, geometry)| geometry.resolution),
        frames: robots.iter().map(|robot| (robot.name.clone(), frame(robot))).collect(),
        tags: tags
            .iter()
            .map(|tag| (tag.id.clone(), transform_building_first.inverse_transform_point(&tag.place)))
            .collect(),
        centres: centres.collect(),
    }
}
