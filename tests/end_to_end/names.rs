//! Topics and frames as robots log them, without the robots' names: what a merge writes is one tree of frames all the
//! same.

use crate::support::{Ended, gridweave, simulate};
use gridweave_logs::dynamic::Schema;
use gridweave_logs::reader::{LogFile, LogReader};
use gridweave_logs::schemas::full_type_name;
use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::{
    Header, OccupancyGrid, PoseStamped, PoseWithCovarianceStamped, RosMessage, TFMessage, TagRange, TransformStamped,
    decode,
};
use gridweave_tests::LogBuilder;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Two simulated robots, whose messages can be written as robots log them.
struct World {
    folder: TempDir,
    log: PathBuf,
    truth: PathBuf,
    /// Whether the logs have the poses of the robots' maps.
    is_placed: bool,
}

/// The topics of one robot, and what it calls its frames.
struct NamingStyle<'a> {
    map: &'a str,
    pose: &'a str,
    tf: &'a str,
    /// What stands before the frames in transforms, and before those in all other messages.
    frames: [&'a str; 2],
    others: &'a str,
}

/// One robot that knows of no other.
const ALONE: NamingStyle<'_> = NamingStyle { map: "/map", pose: "/amcl_pose", tf: "", frames: ["", ""], others: "" };

impl World {
    fn new() -> Self {
        let folder = TempDir::new().unwrap();
        let (log, truth) = simulate(folder.path(), "simulated.mcap", &["--robots", "2", "--seed", "2"]);
        Self { folder, log, truth, is_placed: false }
    }

    /// Writes a log of the robots, each by its convention.
    fn write(&self, name: &str, robots: &[(&str, &NamingStyle<'_>)]) {
        let mut out = LogBuilder::new(&self.folder.path().join(name));
        let mut reader = LogReader::new(vec![LogFile::open(&self.log).unwrap()]);
        let files = reader.files().clone();
        let (mut started, mut has_started) = (BTreeSet::new(), BTreeSet::new());
        while let Some(message) = reader.next_message() {
            let channel = files[0].channel(message.channel).unwrap();
            let Some((robot, names)) =
                robots.iter().find(|(robot, _)| channel.topic.starts_with(&format!("/{robot}/")))
            else {
                continue;
            };
            let time = message.log_time;
            let seconds = time.seconds_since(LogTime(1_700_000_000_000_000_000));
            let header = |frame: &str| Header::new(time, format!("{}{frame}", names.frames[1]));
            if started.insert(*robot) && self.is_placed {
                // The poses of the maps were recorded, as static transforms and as periodic ones.
                for (topic, parent) in [("/tf_static", "world"), ("/tf", "earth")] {
                    let placed = NamingStyle { frames: ["", ""], ..**names };
                    out.message(
                        seconds,
                        topic,
                        &placed.transform(time, parent, &format!("{robot}/map"), Default::default()),
                    );
                }
            }
            if has_started.insert(*robot) {
                let tf = names.transform(time, "base_link", "laser", Default::default());
                out.message(seconds, &format!("{}/tf_static", names.tf), &tf);
            }
            match &*full_type_name(&channel.schema_name) {
                OccupancyGrid::NAME => {
                    let map: OccupancyGrid<'_> = decode(message.data).unwrap();
                    out.message(seconds, names.map, &OccupancyGrid { header: header("map"), ..map });
                }
                PoseStamped::NAME => {
                    let pose: PoseStamped = decode(message.data).unwrap();
                    let to_odom = names.transform(time, "map", "odom", Default::default());
                    out.message(seconds, &format!("{}/tf", names.tf), &to_odom);
                    let to_base = names.transform(time, "odom", "base_link", pose.pose.planar().into());
                    out.message(seconds, &format!("{}/tf", names.tf), &to_base);
                    let pose = PoseStamped { header: header("map"), ..pose };
                    if !names.pose.is_empty() {
                        out.message(seconds, names.pose, &PoseWithCovarianceStamped::from(pose));
                    }
                }
                TagRange::NAME => {
                    let reading: TagRange = decode(message.data).unwrap();
                    let topic = format!("{}/tag_ranges", names.others);
                    out.message(seconds, &topic, &TagRange { header: header("base_link"), ..reading });
                }
                _ => {}
            }
        }
        out.finish();
    }

    fn run(&self, args: &[&str]) -> Ended {
        gridweave(self.folder.path(), args)
    }

    /// Merges, and holds that the merge is right and its output one tree.
    #[track_caller]
    fn merge(&self, inputs: &[&str], robots: [&str; 2]) -> Ended {
        let args = [&["merge"], inputs, &["-o", "out.mcap", "--summary", "summary.json"]].concat();
        let ended = self.run(&args);
        ended.assert(0, &["merged 2 of 2 robots"]);
        assert_is_one_tree(&self.folder.path().join("out.mcap"), robots);
        if robots == ["robot1", "robot2"] {
            let truth = ["evaluate", "summary.json", "--truth", self.truth.to_str().unwrap()];
            self.run(&truth).assert(0, &["right 1, wrong 0, refused 0"]);
        }
        ended
    }
}

impl NamingStyle<'_> {
    fn transform(
        &self,
        time: LogTime,
        parent: &str,
        child: &str,
        transform: gridweave_runtime::ros::Transform,
    ) -> TFMessage {
        let name = |frame: &str| format!("{}{frame}", self.frames[0]);
        let header = Header::new(time, name(parent));
        TFMessage { transforms: vec![TransformStamped { header, child_frame_id: name(child), transform }] }
    }
}

/// Every frame has one parent over the whole log, on the topics where programs look for transforms; and what every
/// message names hangs under `world`.
#[track_caller]
fn assert_is_one_tree(log: &Path, robots: [&str; 2]) {
    let mut reader = LogReader::new(vec![LogFile::open(log).unwrap()]);
    let files = reader.files().clone();
    let mut parents: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    let mut named: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    let mut schemas = BTreeMap::new();
    while let Some(message) = reader.next_message() {
        let channel = files[0].channel(message.channel).unwrap();
        if channel.schema_name == TFMessage::NAME {
            assert!(["/tf", "/tf_static"].contains(&channel.topic.as_str()), "{}", channel.topic);
            for edge in decode::<TFMessage>(message.data).unwrap().transforms {
                parents.entry(edge.child_frame_id).or_default().insert(edge.header.frame_id);
            }
            continue;
        }
        let schema = schemas.entry(message.channel).or_insert_with(|| Schema::of_channel(&channel).unwrap());
        let value = schema.decode(message.data).unwrap();
        if let Ok(frame) = value.find(&"header.frame_id".parse().unwrap()) {
            named.entry(channel.topic).or_default().insert(frame.to_string().trim_matches('"').to_owned());
        }
    }
    for (child, parents) in &parents {
        assert_eq!(parents.len(), 1, "{child}: {parents:?}");
    }
    let chain = |frame: &str| {
        let parent = |frame: &String| parents.get(frame)?.first().cloned();
        std::iter::successors(Some(frame.to_owned()), parent).collect::<Vec<_>>()
    };
    for robot in robots {
        let expected = ["laser", "base_link", "odom", "map"].map(|frame| format!("{robot}/{frame}"));
        let expected: Vec<String> = expected.into_iter().chain(["world".to_owned()]).collect();
        assert_eq!(chain(&format!("{robot}/laser")), expected);
        assert_eq!(named[&format!("/{robot}/map")], BTreeSet::from([format!("{robot}/map")]));
    }
    for (topic, frame) in named.iter().flat_map(|(topic, frames)| frames.iter().map(move |frame| (topic, frame))) {
        assert_eq!(chain(frame).last().map(String::as_str), Some("world"), "{topic} names {frame}");
    }
}

#[test]
fn a_log_for_each_robot_without_names_is_put_under_those_that_are_given() {
    let world = World::new();
    world.write("a.mcap", &[("robot1", &ALONE)]);
    world.write("b.mcap", &[("robot2", &ALONE)]);
    let ended = world.merge(&["robot1=a.mcap", "robot2=b.mcap"], ["robot1", "robot2"]);
    assert!(!ended.text().contains("equal topics"), "{ended:#?}");
    // By poses of `/amcl_pose`, tags are located.
    let summary = std::fs::read_to_string(world.folder.path().join("summary.json")).unwrap();
    assert!(summary.contains("tags"), "{summary}");

    let args = ["run", "auto_merge", "--input", "robot1=a.mcap", "--input", "robot2=b.mcap", "--output", "run.mcap"];
    world.run(&args).assert(0, &["merged 2 of 2"]);
    let [merged, run] = ["out.mcap", "run.mcap"].map(|name| std::fs::read(world.folder.path().join(name)).unwrap());
    assert!(merged == run);
    world.run(&["info", "robot1=a.mcap", "robot2=b.mcap"]).assert(0, &["/robot1/map (logged as /map)", "of robot2"]);
    let args = ["merge", "robot1=a.mcap", "robot2=b.mcap", "-o", "a.mcap"];
    world.run(&args).assert(2, &["a.mcap is an input"]);
}

#[test]
fn a_map_with_a_recorded_pose_is_placed_only_by_the_merge() {
    let world = World { is_placed: true, ..World::new() };
    let [first, second] = ["robot1", "robot2"]
        .map(|robot| [format!("/{robot}/map"), format!("/{robot}/pose"), format!("{robot}/"), format!("/{robot}")]);
    fn named([map, pose, frames, others]: &[String; 4]) -> NamingStyle<'_> {
        NamingStyle { map, pose, tf: "", frames: [frames, frames], others }
    }
    world.write("all.mcap", &[("robot1", &named(&first)), ("robot2", &named(&second))]);
    let ended = world.merge(&["all.mcap"], ["robot1", "robot2"]);
    let warning = "input transforms that place a robot's map frame were dropped";
    assert_eq!(ended.text().matches(warning).count(), 1, "{ended:#?}");
    // What a merge has written can be merged again.
    world.run(&["merge", "out.mcap", "-o", "again.mcap"]).assert(0, &["merged 2 of 2", warning]);
    assert_is_one_tree(&world.folder.path().join("again.mcap"), ["robot1", "robot2"]);
}

#[test]
fn poses_that_are_in_tf_alone_are_found_there() {
    let world = World::new();
    let only_tf = NamingStyle { pose: "", ..ALONE };
    world.write("a.mcap", &[("robot1", &only_tf)]);
    world.write("b.mcap", &[("robot2", &only_tf)]);
    world.merge(&["robot1=a.mcap", "robot2=b.mcap"], ["robot1", "robot2"]);
    let summary = std::fs::read_to_string(world.folder.path().join("summary.json")).unwrap();
    assert!(summary.contains("tags"), "tags are located by poses of tf: {summary}");
    let from = "tf (robot1/map to robot1/base_link)";
    world.run(&["info", "robot1=a.mcap", "robot2=b.mcap"]).assert(0, &[from]);
}

#[test]
fn logs_that_look_alike_are_called_as_their_files_and_one_line_says_so() {
    let world = World::new();
    world.write("red.mcap", &[("robot1", &ALONE)]);
    world.write("blue.mcap", &[("robot2", &ALONE)]);
    let ended = world.merge(&["red.mcap", "blue.mcap"], ["red", "blue"]);
    assert_eq!(ended.text().matches("equal topics").count(), 1, "{ended:#?}");
    ended.assert(0, &["red.mcap to red and blue.mcap to blue", "ROBOT=LOG"]);
    world.run(&["info", "red.mcap", "blue.mcap"]).assert(0, &["equal topics", "of blue", "/red/amcl_pose"]);
}

#[test]
fn transforms_in_a_robots_namespace_join_the_tree() {
    let world = World::new();
    let bare = |robot: &'static str| {
        let [map, pose, namespace] = match robot {
            "robot1" => ["/robot1/map", "/robot1/amcl_pose", "/robot1"],
            _ => ["/robot2/map", "/robot2/pose", "/robot2"],
        };
        NamingStyle { map, pose, tf: namespace, frames: ["", ""], others: namespace }
    };
    world.write("all.mcap", &[("robot1", &bare("robot1")), ("robot2", &bare("robot2"))]);
    world.merge(&["all.mcap"], ["robot1", "robot2"]);
    // Full names in `/tf`, and none in maps and poses.
    let mixed = |robot| NamingStyle {
        tf: "",
        frames: [if robot == "robot1" { "robot1/" } else { "robot2/" }, ""],
        ..bare(robot)
    };
    let mixed = [mixed("robot1"), mixed("robot2")].map(|names| NamingStyle { frames: [names.frames[0]; 2], ..names });
    world.write("all.mcap", &[("robot1", &mixed[0]), ("robot2", &mixed[1])]);
    world.merge(&["all.mcap"], ["robot1", "robot2"]);
}

#[test]
fn topics_are_renamed_and_robots_and_times_chosen_on_the_command_line() {
    let world = World::new();
    let odd = NamingStyle { map: "/slam/grid", ..ALONE };
    world.write("a.mcap", &[("robot1", &odd)]);
    world.write("b.mcap", &[("robot2", &odd)]);
    let inputs = ["robot1=a.mcap", "robot2=b.mcap", "--rename", "/slam/grid=/map"];
    world.merge(&inputs, ["robot1", "robot2"]);
    let wrong = ["merge", "a.mcap", "-o", "x.mcap", "--rename", "/slam/grid"];
    world.run(&wrong).assert(2, &["is not a topic rename", "/slam/map=/map"]);
    let one = [&["merge"], &inputs[..], &["-o", "one.mcap", "--robots", "robot1"]].concat();
    world.run(&one).assert(0, &[]);
    let one = LogFile::open(world.folder.path().join("one.mcap")).unwrap();
    assert!(one.channels().all(|(_, channel)| !channel.topic.starts_with("/robot2/")));
    let unknown = [&["merge"], &inputs[..], &["-o", "one.mcap", "--robots", "robot3"]].concat();
    world.run(&unknown).assert(1, &["`robot3`", "robot1 and robot2"]);
    let part = [&["merge"], &inputs[..], &["-o", "part.mcap", "--start", "5", "--topics", "/{robot}/map"]].concat();
    world.run(&part);
    let part = LogFile::open(world.folder.path().join("part.mcap")).unwrap();
    let topics: BTreeSet<String> = part.channels().map(|(_, channel)| channel.topic).collect();
    assert!(topics.contains("/robot1/map") && !topics.contains("/tf") && !topics.contains("/robot1/amcl_pose"));
}
