//! The source `simulator`: a simulation as the messages of a log.

use super::drive::TICK_SECONDS;
use super::parameters::SimulatorParameters;
use super::robot::RobotLog;
use super::world::{Simulation, simulate};
use crate::geometry::Pose2;
use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::{
    GridPrefix, Header, MapMetaData, OccupancyGrid, PoseStamped, TFMessage, TagRange, TransformStamped,
};
use gridweave_runtime::stage::{Context, Output, OutputPort, PortType, Source, StageError, StageKind};
use serde_json::Value;

/// When simulated logs begin: 14 November 2023, 22:13:20 UTC.
const START: LogTime = LogTime(1_700_000_000_000_000_000);
/// A map is sent so long after its last scan, seconds.
const MAP_DELAY: f64 = TICK_SECONDS / 2.0;

const MAP: usize = 0;
const POSE: usize = 1;
const TAGS: usize = 2;
const TF: usize = 3;

/// The stage kind `simulator`.
pub fn kind() -> StageKind {
    StageKind::source(
        "simulator",
        "Makes a test world: a building, robots that map it and read radio tags, and the truth, which is its report.",
        vec![
            OutputPort::new("map", PortType::of::<OccupancyGrid<'_>>(), "Each robot's map, growing.")
                .on_topic("/{robot}/map"),
            OutputPort::new("pose", PortType::of::<PoseStamped>(), "Each robot's pose in its map, at 10 Hz.")
                .on_topic("/{robot}/pose"),
            OutputPort::new("tags", PortType::of::<TagRange>(), "Ranges of radio tags in reach, at 10 Hz.")
                .on_topic("/{robot}/tag_ranges"),
            OutputPort::new("tf", PortType::of::<TFMessage>(), "The same poses: robotN/map to robotN/base_link.")
                .on_topic("/tf"),
        ],
        |parameters, context: &Context| Ok(Simulator { parameters, seed: context.seed, playback: None }),
    )
}

/// The world is made when the first message is asked for.
struct Simulator {
    parameters: SimulatorParameters,
    seed: u64,
    playback: Option<Playback>,
}

/// A simulation, and how much of it has been sent.
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

/// What is logged: its place in the robot's list.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum What {
    Pose(usize),
    Reading(usize),
    Map(usize),
}

impl Source for Simulator {
    fn next(&mut self, output: &mut Output<'_>) -> Result<bool, StageError> {
        let playback = match &mut self.playback {
            Some(playback) => playback,
            none => none.insert(Playback::new(&self.parameters, self.seed)?),
        };
        let Some(&Event { time, robot, what }) = playback.events.get(playback.sent) else { return Ok(false) };
        output.set_log_time(time);
        if let Some(log) = playback.simulation.robots.get(robot) {
            match what {
                What::Pose(index) => send_pose(output, log, index)?,
                What::Reading(index) => send_reading(output, &playback.simulation, log, index, &self.parameters)?,
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

    fn report(&self) -> Option<Value> {
        self.playback.as_ref().map(|playback| playback.simulation.truth.to_json())
    }
}

impl Playback {
    fn new(parameters: &SimulatorParameters, seed: u64) -> Result<Self, StageError> {
        let simulation = simulate(parameters, seed).map_err(|error| StageError::new("simulate a world", error))?;
        let mut events = Vec::new();
        for (robot, log) in simulation.robots.iter().enumerate() {
            let mut add = |tick, what| events.push(Event { time: time_of(tick, what), robot, what });
            (0..log.poses.len()).for_each(|tick| add(tick, What::Pose(tick)));
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

fn send_pose(output: &mut Output<'_>, log: &RobotLog, index: usize) -> Result<(), StageError> {
    let Some(pose) = log.poses.get(index) else { return Ok(()) };
    let header = Header::new(output.log_time(), map_frame(log));
    output.send(POSE, &log.name, &PoseStamped { header: header.clone(), pose: (*pose).into() })?;
    let transform: Pose2 = *pose;
    let transform = TransformStamped { header, child_frame_id: base_frame(log), transform: transform.into() };
    output.send(TF, "", &TFMessage { transforms: vec![transform] })
}

fn send_reading(
    output: &mut Output<'_>,
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
    output.send(TAGS, &log.name, &message)
}

fn send_map(output: &mut Output<'_>, log: &RobotLog, index: usize) -> Result<(), StageError> {
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
    output.send_grid(MAP, &log.name, &prefix, |blank| blank.copy_cells(&map.cells))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Grid;
    use gridweave_runtime::message::Message;
    use gridweave_runtime::stage::{CollectedOutputs, Node};

    const WORLD: &str = "robots = 2\nwidth = 10\nheight = 9\nbeams = 60\ntags = 8\nduration = 20";

    fn run(parameters: &str, seed: u64) -> Result<(Vec<Vec<Message>>, Option<Value>), StageError> {
        let kind = kind();
        let context = Context { stage: "world".into(), seed, ..Default::default() };
        let Node::Source(mut source) = kind.make(parameters.parse().unwrap(), &context)? else { panic!("a source") };
        let mut outputs = CollectedOutputs::new(&kind);
        while source.next(&mut outputs.output(LogTime::MIN))? {
            assert!((0.0..1.0).contains(&source.progress().unwrap()));
        }
        assert_eq!(source.progress(), Some(1.0));
        assert!(!source.next(&mut outputs.output(LogTime::MIN))?, "it stays at its end");
        Ok(((0..4).map(|port| outputs.take(port)).collect(), source.report()))
    }

    #[test]
    fn the_messages_are_those_of_a_log() {
        let (ports, report) = run(WORLD, 1).unwrap();
        assert_eq!(ports[MAP].len(), 6);
        assert_eq!(ports[POSE].len(), 400);
        assert_eq!(ports[TF].len(), 400);
        let topics = [MAP, POSE, TAGS, TF].map(|port| ports[port][0].header().topic);
        assert_eq!(topics[MAP].as_str(), "/robot1/map");
        assert_eq!(topics[POSE].as_str(), "/robot1/pose");
        assert!(topics[TAGS].as_str().ends_with("/tag_ranges"));
        assert_eq!(topics[TF].as_str(), "/tf");

        let pose: PoseStamped = ports[POSE][0].decode().unwrap();
        assert_eq!((pose.header.frame_id.as_str(), ports[POSE][0].header().log_time), ("robot1/map", START));
        let tf: TFMessage = ports[TF][0].decode().unwrap();
        assert_eq!(tf.transforms[0].child_frame_id, "robot1/base_link");
        assert!((tf.transforms[0].transform.translation.x - pose.pose.position.x).abs() < 1e-12);
        let range: TagRange = ports[TAGS][0].decode().unwrap();
        assert!(range.header.frame_id.ends_with("/base_link") && range.range_stddev == 0.05);
        for message in &ports[MAP] {
            let map: OccupancyGrid<'_> = message.decode().unwrap();
            assert!(Grid::from_message(&map).unwrap().occupied().count() > 50);
            assert_eq!(map.header.frame_id, format!("{}/map", message.robot()));
        }
        let report = report.unwrap();
        assert_eq!(report["frames"].as_object().unwrap().len(), 2);
    }

    #[test]
    fn a_seed_gives_the_same_bytes() {
        let bytes = |seed| {
            let (ports, report) = run(WORLD, seed).unwrap();
            let bytes: Vec<Vec<u8>> = ports.iter().flatten().map(|message| message.bytes().to_vec()).collect();
            (bytes, report)
        };
        assert!(bytes(7) == bytes(7));
        assert!(bytes(7) != bytes(8));
    }

    #[test]
    fn every_port_is_in_the_order_of_time() {
        let (ports, _) = run(WORLD, 3).unwrap();
        for port in ports {
            assert!(port.is_sorted_by_key(|message| message.header().log_time));
        }
    }

    #[test]
    fn parameters_out_of_range_and_unknown_ones_are_refused() {
        for wrong in ["robots = 0", "overlap = 1.5", "resolution = []", "robot = 3", "speed = \"fast\""] {
            assert!(run(wrong, 1).is_err(), "{wrong}");
        }
    }
}
