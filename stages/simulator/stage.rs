//! The source `simulator`: a simulation as the messages of a log.

use super::drive::TICK_SECONDS;
use super::parameters::SimulatorParameters;
use super::robot::RobotLog;
use super::simulation::{Simulation, simulate};
use crate::shared::geometry::Pose2;
use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::{
    GridPrefix, Header, LaserScan, MapMetaData, OccupancyGrid, Odometry, PoseStamped, PoseWithCovariance,
    SimulationTruth, TFMessage, TagRange, TransformStamped,
};
use gridweave_runtime::stage::{Context, Out, Output, OutputPorts, Outputs, Source, StageError, StageKind};

/// When simulated logs begin: 14 November 2023, 22:13:20 UTC.
const START: LogTime = LogTime(1_700_000_000_000_000_000);
/// Delay of a map after its last scan, seconds.
const MAP_DELAY: f64 = TICK_SECONDS / 2.0;

/// The stage kind `simulator`.
pub fn kind() -> StageKind {
    StageKind::source(
        "simulator",
        "Makes a test world: a building, robots that map it and read radio tags, and the truth.",
        |parameters, context: &Context| Ok(Simulator { parameters, seed: context.seed, playback: None }),
    )
}

/// What a log of the robots holds, and the truth.
struct SimulatedLog {
    map: Out<OccupancyGrid<'static>>,
    pose: Out<PoseStamped>,
    tags: Out<TagRange>,
    tf: Out<TFMessage>,
    scan: Out<LaserScan>,
    odometry: Out<Odometry>,
    truth: Out<SimulationTruth>,
}

impl Outputs for SimulatedLog {
    fn declare(ports: &mut OutputPorts) -> Self {
        Self {
            map: ports.output_on("/{robot}/map", "map", "Each robot's map, growing."),
            pose: ports.output_on("/{robot}/pose", "pose", "Each robot's pose in its map, at 10 Hz."),
            tags: ports.output_on("/{robot}/tag_ranges", "tags", "Ranges of radio tags in reach, at 10 Hz."),
            tf: ports.output_on("/tf", "tf", "The same poses: robotN/map to robotN/base_link."),
            scan: ports.output_on("/{robot}/scan", "scan", "Each robot's scans, at 10 Hz, if `scans` says so."),
            odometry: ports.output_on(
                "/{robot}/odom",
                "odometry",
                "Each robot's odometry in robotN/odom, at 10 Hz, if `odometry` says so.",
            ),
            truth: ports.output_on(
                "/truth",
                "truth",
                "The poses of the maps and the positions of the tags in the first robot's map frame. Sent once, before everything else.",
            ),
        }
    }
}

/// The world is made when the first message is asked for.
struct Simulator {
    parameters: SimulatorParameters,
    seed: u64,
    playback: Option<Playback>,
}

/// A simulation, and the position in its messages.
struct Playback {
    simulation: Simulation,
    events: Vec<Event>,
    sent: usize,
}

/// Something that a robot logs. The fields are in the order of the log.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Event {
    time: LogTime,
    robot: usize,
    what: What,
}

/// A logged item, by its index in the robot's list.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum What {
    Pose(usize),
    Odometry(usize),
    Reading(usize),
    Scan(usize),
    Map(usize),
}

impl Source for Simulator {
    type Outputs = SimulatedLog;

    fn next(&mut self, output: &Output<SimulatedLog>) -> Result<bool, StageError> {
        let playback = match &mut self.playback {
            Some(playback) => playback,
            none => {
                let playback = none.insert(Playback::new(&self.parameters, self.seed)?);
                output.set_log_time(START);
                let truth = &mut playback.simulation.truth;
                truth.header.stamp = START.into();
                output.truth.send("", truth)?;
                playback
            }
        };
        let Some(&Event { time, robot, what }) = playback.events.get(playback.sent) else { return Ok(false) };
        output.set_log_time(time);
        if let Some(log) = playback.simulation.robots.get(robot) {
            match what {
                What::Pose(index) => send_pose(output, log, index)?,
                What::Odometry(index) => send_odometry(output, log, index)?,
                What::Reading(index) => send_reading(output, &playback.simulation, log, index, &self.parameters)?,
                What::Scan(index) => send_scan(output, log, index, &self.parameters)?,
                What::Map(index) => send_map(output, log, index)?,
            }
        }
        playback.sent += 1;
        Ok(playback.sent < playback.events.len())
    }

    fn progress(&self) -> Option<f64> {
        let playback = self.playback.as_ref()?;
        Some(playback.sent as f64 / playback.events.len().max(1) as f64)
    }
}

impl Playback {
    fn new(parameters: &SimulatorParameters, seed: u64) -> Result<Self, StageError> {
        let simulation = simulate(parameters, seed).map_err(|error| StageError::new("simulate a world", error))?;
        let mut events = Vec::new();
        for (robot, log) in simulation.robots.iter().enumerate() {
            let mut add = |tick, what| events.push(Event { time: time_of(tick, what), robot, what });
            (0..log.poses.len()).for_each(|tick| add(tick, What::Pose(tick)));
            (0..log.odometry.len()).for_each(|tick| add(tick, What::Odometry(tick)));
            (0..log.scans.len()).for_each(|tick| add(tick, What::Scan(tick)));
            log.readings.iter().enumerate().for_each(|(index, (tick, _))| add(*tick, What::Reading(index)));
            log.maps.iter().enumerate().for_each(|(index, (tick, _))| add(*tick, What::Map(index)));
        }
        events.sort_unstable();
        Ok(Self { simulation, events, sent: 0 })
    }
}

fn time_of(tick: usize, what: What) -> LogTime {
    let delay = if matches!(what, What::Map(_)) { MAP_DELAY } else { 0.0 };
    // Nanoseconds are whole here, so that times are the decimals that are meant.
    LogTime(START.0 + tick as u64 * (TICK_SECONDS * 1e9) as u64 + (delay * 1e9) as u64)
}

fn map_frame(log: &RobotLog) -> String {
    format!("{}/map", log.name)
}

fn base_frame(log: &RobotLog) -> String {
    format!("{}/base_link", log.name)
}

fn send_pose(output: &Output<SimulatedLog>, log: &RobotLog, index: usize) -> Result<(), StageError> {
    let Some(pose) = log.poses.get(index) else { return Ok(()) };
    let header = Header::new(output.log_time(), map_frame(log));
    output.pose.send(&log.name, &PoseStamped { header: header.clone(), pose: (*pose).into() })?;
    let transform: Pose2 = *pose;
    let transform = TransformStamped { header, child_frame_id: base_frame(log), transform: transform.into() };
    output.tf.send("", &TFMessage { transforms: vec![transform] })
}

fn send_odometry(output: &Output<SimulatedLog>, log: &RobotLog, index: usize) -> Result<(), StageError> {
    let Some(pose) = log.odometry.get(index) else { return Ok(()) };
    let message = Odometry {
        header: Header::new(output.log_time(), format!("{}/odom", log.name)),
        child_frame_id: base_frame(log),
        pose: PoseWithCovariance { pose: (*pose).into(), ..Default::default() },
        ..Default::default()
    };
    output.odometry.send(&log.name, &message)
}

fn send_reading(
    output: &Output<SimulatedLog>,
    simulation: &Simulation,
    log: &RobotLog,
    index: usize,
    parameters: &SimulatorParameters,
) -> Result<(), StageError> {
    let Some((_, reading)) = log.readings.get(index) else { return Ok(()) };
    let Some(tag) = simulation.tags.get(reading.tag) else { return Ok(()) };
    let message = TagRange {
        header: Header::new(output.log_time(), base_frame(log)),
        tag_id: tag.id.clone(),
        range: reading.range,
        range_stddev: parameters.tag_noise,
        rssi: reading.rssi,
    };
    output.tags.send(&log.name, &message)
}

/// Sends a scan with all directions; beams without an echo have no range.
fn send_scan(
    output: &Output<SimulatedLog>,
    log: &RobotLog,
    index: usize,
    parameters: &SimulatorParameters,
) -> Result<(), StageError> {
    let Some(beams) = log.scans.get(index) else { return Ok(()) };
    let lidar = parameters.lidar();
    let (first, apart) = (lidar.first_angle(), lidar.field_of_view / lidar.beams as f64);
    let mut ranges = vec![f32::INFINITY; lidar.beams];
    for beam in beams {
        if let Some(range) = ranges.get_mut(((beam.angle - first) / apart).round() as usize) {
            *range = beam.range as f32;
        }
    }
    let scan = LaserScan {
        header: Header::new(output.log_time(), base_frame(log)),
        angle_min: first as f32,
        angle_max: (first + apart * (lidar.beams as f64 - 1.0)) as f32,
        angle_increment: apart as f32,
        // The robot does not move during a scan.
        time_increment: 0.0,
        scan_time: TICK_SECONDS as f32,
        range_min: 0.0,
        range_max: (lidar.reach + 5.0 * lidar.noise) as f32,
        ranges,
        intensities: Vec::new(),
    };
    output.scan.send(&log.name, &scan)
}

fn send_map(output: &Output<SimulatedLog>, log: &RobotLog, index: usize) -> Result<(), StageError> {
    let Some((_, map)) = log.maps.get(index) else { return Ok(()) };
    let size = |cells: usize| {
        u32::try_from(cells).map_err(|error| StageError::new(format!("send the map of {}", log.name), error))
    };
    let info = MapMetaData {
        resolution: map.geometry.resolution as f32,
        width: size(map.geometry.width)?,
        height: size(map.geometry.height)?,
        origin: map.geometry.origin.into(),
        ..Default::default()
    };
    let prefix = GridPrefix { header: Header::new(output.log_time(), map_frame(log)), info };
    output.map.send_grid(&log.name, &prefix, |blank| blank.copy_cells(&map.cells))
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_runtime::message::Message;
    use gridweave_runtime::stage::StageHarness;

    const WORLD: &str = "robots = 2\nwidth = 10\nheight = 9\nbeams = 60\ntags = 8\nduration = 20";

    #[test]
    fn odometry_begins_at_the_first_pose_and_drifts_off() {
        let context = Context { stage: "world".into(), seed: 1, ..Default::default() };
        let parameters = format!("{WORLD}\nodometry = true\ndrift = 0.0");
        let mut stage = StageHarness::with_context(&kind(), &parameters, &context).unwrap();
        while stage.node().advance().unwrap() {}
        let of_robot = |message: &&Message| message.robot() == "robot1";
        let [poses, odometry] = ["pose", "odometry"].map(|port| stage.take_messages(port));
        let poses: Vec<PoseStamped> = poses.iter().filter(of_robot).map(|pose| pose.decode().unwrap()).collect();
        let odometry: Vec<Odometry> = odometry.iter().filter(of_robot).map(|pose| pose.decode().unwrap()).collect();
        assert_eq!(odometry.len(), poses.len());
        assert_eq!(odometry[0].header.frame_id, "robot1/odom");
        let off = |index: usize| {
            let (pose, by_odometry) = (&poses[index].pose.position, &odometry[index].pose.pose.position);
            (pose.x - by_odometry.x).hypot(pose.y - by_odometry.y)
        };
        assert!(off(0) < 1e-9 && off(poses.len() - 1) > 0.02, "{}", off(poses.len() - 1));
    }
}
