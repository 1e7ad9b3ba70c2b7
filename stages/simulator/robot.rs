//! One robot of a simulation: its drive, its estimates and its log.

use super::drift::{PoseDrift, estimate_poses};
use super::drive::{DriveLimits, drive};
use super::lidar::Beam;
use super::mapper::Mapper;
use super::parameters::SimulatorParameters;
use super::route::plan_route;
use super::shape::{Rectangle, between};
use super::tags::SimulatedReading;
use super::wheel_odometry::wheel_odometry;
use super::world::{SimulationError, Stream, World};
use crate::shared::geometry::{Point2, Pose2, is_free, pose};
use crate::shared::scan_grid::SnapshotMap;
use rand::{Rng, RngExt};
use std::ops::Range;

/// Metres a second squared.
const ACCELERATION: f64 = 0.6;
/// Radians a second.
const TURN_RATE: f64 = 1.2;

/// The value of a cell that is drawn occupied by chance, per cent.
const SPECK: i8 = 100;

/// Log of one robot, by ticks of [`TICK_SECONDS`](super::TICK_SECONDS) from the start.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotLog {
    /// Its name: `robot1`, `robot2`, ...
    pub name: String,
    /// Pose of its map frame in the building, `T_building_map`.
    pub transform_building_map: Pose2,
    /// True poses in the building, one per tick.
    pub true_poses: Vec<Pose2>,
    /// Estimated poses in its map frame, one per tick.
    pub poses: Vec<Pose2>,
    /// Poses by the odometry of its wheels, in a frame that is its map frame at the start, one per tick; none if
    /// odometry is not logged.
    pub odometry: Vec<Pose2>,
    /// The tags that it has read, with their ticks.
    pub readings: Vec<(usize, SimulatedReading)>,
    /// Scans of its lidar, one per tick; none if scans are not logged.
    pub(super) scans: Vec<Vec<Beam>>,
    /// The maps it has sent, with the ticks of their last scans.
    pub maps: Vec<(usize, SnapshotMap)>,
}

impl RobotLog {
    /// The hits of the scan at a tick, in the frame of the robot and the order of the beams; none if scans are not logged.
    pub fn hits(&self, tick: usize) -> Vec<Point2> {
        let hit = |beam: &Beam| Point2::new(beam.range * beam.angle.cos(), beam.range * beam.angle.sin());
        self.scans.get(tick).map_or_else(Vec::new, |beams| beams.iter().map(hit).collect())
    }
}

/// Simulates the drive of one robot through its rooms, its map and its tag readings.
pub(super) fn simulate_robot(
    world: &World,
    robot: usize,
    rooms: Range<usize>,
    parameters: &SimulatorParameters,
) -> Result<RobotLog, SimulationError> {
    let name = format!("robot{}", robot + 1);
    let own_world = (parameters.moved > 0.0).then(|| world.rearranged(robot, parameters));
    let world = own_world.as_ref().unwrap_or(world);
    let route = plan_route(&world.plan, &world.space, rooms, &mut world.random(Stream::Route(robot)));
    let limits = DriveLimits {
        speed: parameters.speed,
        acceleration: ACCELERATION,
        turn_rate: TURN_RATE,
        duration: parameters.duration,
    };
    let true_poses = drive(&route, &limits);
    let Some(start) = true_poses.first() else { return Err(SimulationError::NoWay { robot: name }) };

    let transform_building_map = map_frame(start, world, robot, parameters);
    let transform_map_building = transform_building_map.inverse();
    let exact: Vec<Pose2> = true_poses.iter().map(|pose| transform_map_building * pose).collect();
    let drift = PoseDrift { deviation: parameters.drift, correction_length: parameters.correction_length };
    let poses = estimate_poses(&exact, &drift, &mut world.random(Stream::Drift(robot)));

    let odometry = match parameters.odometry {
        true => wheel_odometry(&exact, &parameters.odometry_errors(), &mut world.random(Stream::Odometry(robot))),
        false => Vec::new(),
    };

    let mut scans = Vec::new();
    let maps = map_building(world, robot, &true_poses, &poses, parameters, &mut scans);
    if maps.len() != parameters.snapshots as usize {
        return Err(SimulationError::SeenNothing { robot: name });
    }
    let readings = read_tags(world, robot, &true_poses, parameters);
    Ok(RobotLog { name, transform_building_map, true_poses, poses, odometry, readings, scans, maps })
}

/// A map frame near the start of the drive, with a random rotation: `T_building_map`.
fn map_frame(start: &Pose2, world: &World, robot: usize, parameters: &SimulatorParameters) -> Pose2 {
    let mut random = world.random(Stream::MapFrame(robot));
    let mut offset = || between(&mut random, -parameters.map_offset, parameters.map_offset);
    let (x, y) = (start.translation.x + offset(), start.translation.y + offset());
    pose(x, y, between(&mut random, -parameters.map_yaw, parameters.map_yaw))
}

fn map_building(
    world: &World,
    robot: usize,
    true_poses: &[Pose2],
    poses: &[Pose2],
    parameters: &SimulatorParameters,
    scans: &mut Vec<Vec<Beam>>,
) -> Vec<(usize, SnapshotMap)> {
    let lidar = parameters.lidar();
    let (mut random, mut specks) = (world.random(Stream::Lidar(robot)), world.random(Stream::Specks(robot)));
    let places: Vec<Point2> = poses.iter().map(|pose| Point2::from(pose.translation.vector)).collect();
    let Some(driven) = Rectangle::bounding(&places) else { return Vec::new() };
    let in_sight = lidar.reach.min(world.plan.bounds.width().hypot(world.plan.bounds.height())) + 0.5;
    let mut mapper = Mapper::new(&driven.expanded(in_sight), parameters.resolution_of(robot));
    let snapshots = parameters.snapshots as usize;
    let mut maps = Vec::with_capacity(snapshots);
    let mut beams = Vec::with_capacity(lidar.beams);
    for (tick, (true_pose, pose)) in true_poses.iter().zip(poses).enumerate() {
        lidar.scan(&world.caster, true_pose, &mut random, &mut beams);
        mapper.add_scan(pose, &beams);
        if parameters.scans {
            scans.push(beams.clone());
        }
        // The last scan of each of the equal parts of the drive; a very short drive sends some maps twice.
        while maps.len() < snapshots && (tick + 1) * snapshots >= true_poses.len() * (maps.len() + 1) {
            let Some(mut map) = mapper.snapshot() else { return maps };
            add_specks(&mut map, parameters.specks, &mut specks);
            maps.push((tick, map));
        }
    }
    maps
}

/// Sets a share of the free cells to occupied.
fn add_specks(map: &mut SnapshotMap, share: f64, random: &mut impl Rng) {
    if share > 0.0 {
        for cell in map.cells.iter_mut().filter(|cell| is_free(**cell)) {
            if random.random_bool(share) {
                *cell = SPECK;
            }
        }
    }
}

fn read_tags(
    world: &World,
    robot: usize,
    true_poses: &[Pose2],
    parameters: &SimulatorParameters,
) -> Vec<(usize, SimulatedReading)> {
    let reader = parameters.tag_reader();
    let mut random = world.random(Stream::Tags(robot));
    let mut readings = Vec::new();
    for (tick, pose) in true_poses.iter().enumerate() {
        reader.read(&world.tags, &world.caster, pose, &mut random, |reading| readings.push((tick, reading)));
    }
    readings
}
