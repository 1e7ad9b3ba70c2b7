//! Links of a run on another machine, tapped at the base.

use crate::bridge::{Wire, free_endpoint, source};
use crate::bridge_verb::{BASE, ROBOT, Robot, log_base};
use crate::command::{GRIDWEAVE, Running, run, wait_until};
use crate::wire::WATCHDOG;
use gridweave_runtime::message::{FixedText, LogTime, Message, MessageFlags, MessageHeader};
use gridweave_runtime::ros::{PoseStamped, RosMessage};
use gridweave_runtime::stage::{Context, InputWire, LinkView, RunLink, RunLinks, StageError, StageHarness, StageKind};
use std::io::Read;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Sends the readings of tags to a base, and neither maps nor poses.
const SINK: &str = r#"
[stages.base]
kind = "bridge_sink"
inputs = ["robots.tags"]
sender = "robot-1"
connect = ["ENDPOINT"]
"#;
/// So many messages are missed by each observer of a link of a [`robot`].
const MISSED: u64 = 3;
/// So many programs may observe a link.
const MOST: usize = 4;

/// Begins to tap a link that is not sent, and reads the first lines: the last poses of two robots.
#[track_caller]
fn tap(robot: &Robot, base: &str, link: &str, more: &[&str], log: &str) -> (Running, Vec<String>) {
    let args = ["tap", link, "--json", "--run", base, "--wait", "60"];
    let mut tap = Running::start(GRIDWEAVE, &[&args, more].concat(), robot.path(), log);
    // Of what is read ahead nothing is lost: one byte at a time.
    let mut lines = vec![String::new()];
    while lines.len() < 3 {
        let mut byte = [0];
        let count = tap.stdout().read(&mut byte).unwrap();
        assert_eq!(count, 1, "{lines:?} {}", tap.errors());
        match byte[0] {
            b'\n' => lines.push(String::new()),
            byte => lines.last_mut().unwrap().push(byte as char),
        }
    }
    lines.pop();
    (tap, lines)
}

/// How many poses a log holds that are sent.
fn poses(robot: &Robot, log: &str) -> usize {
    let bytes = std::fs::read(robot.path().join(log)).unwrap();
    let topics = mcap::MessageStream::new(&bytes).unwrap().map(|message| message.unwrap().channel.topic.clone());
    topics.filter(|topic| topic.ends_with("/pose")).count() - 1
}

#[test]
fn a_link_that_is_not_sent_is_shown_at_the_base_as_on_its_machine() {
    let (endpoint, _) = free_endpoint();
    let mut robot = Robot::start_with(&format!("{ROBOT}{}", SINK.replace("ENDPOINT", &endpoint)));
    let (base_name, base) = log_base(&robot, BASE, &endpoint, "base.mcap");
    robot.play(0);
    // Who comes late gets the last of each topic, and then what follows.
    let count = (2 + poses(&robot, "part1.mcap")).to_string();
    let name = robot.name.clone();
    let (mut here, mut here_lines) = tap(&robot, &name, "robots.pose", &["--count", &count], "here.log");
    let (mut there, mut there_lines) =
        tap(&robot, &base_name, "robot-1:robots.pose", &["--count", &count], "there.log");
    robot.play(1);
    for (tap, lines) in [(&mut here, &mut here_lines), (&mut there, &mut there_lines)] {
        lines.extend(tap.end_with(0).lines().map(str::to_owned));
    }
    assert_eq!(there_lines.len().to_string(), count);
    assert_eq!(there_lines, here_lines);
    let decoded = ["\"type\":\"geometry_msgs/msg/PoseWithCovarianceStamped\"", "\"position\":{"];
    assert!(decoded.iter().all(|words| there_lines[5].contains(words)), "{}", there_lines[5]);
    // Names that are none.
    for (link, expected) in [
        ("robot-7:robots.pose", "has no machine `robot-7`; did you mean `robot-1`?"),
        ("other:robots.pose", "has no machine `other`; there are: `robot-1`"),
        ("robot-1:robots.poses", "the run on `robot-1` has no link `robots.poses`; did you mean `robots.pose`?"),
        ("robot-1:x", "has no link `x`; there are: `robots.map`, `robots.pose`, `robots.tags`"),
        ("robot-1:robots", "`robots` has several outputs: choose one of robots.map, robots.pose, robots.tags"),
    ] {
        let args = ["tap", link, "--run", &base_name, "--wait", "1"];
        let mut wrong = Running::start(GRIDWEAVE, &args, robot.path(), "wrong.log");
        wrong.end_with(2);
        assert!(wrong.errors().contains(expected), "{link}: {}", wrong.errors());
    }
    // From elsewhere, where no run is known.
    run(GRIDWEAVE, &["tap", "robot-1:robots.pose", "--at", &endpoint, "--count", "1"], robot.path());
    // The maximum number of observers. A killed one makes room for another.
    let mut taps: Vec<Running> = (0..MOST)
        .map(|number| tap(&robot, &base_name, "robot-1:robots.pose", &[], &format!("{number}.log")).0)
        .collect();
    let one_more = || {
        let args = ["tap", "robot-1:robots.pose", "--run", &base_name, "--wait", "60", "--count", "1"];
        let mut tap = Running::start(GRIDWEAVE, &args, robot.path(), "more.log");
        (tap.end().0, tap.errors())
    };
    let (status, errors) = one_more();
    assert!(status == 1 && errors.contains("observe"), "{status} {errors}");
    taps[0].signal("KILL");
    wait_until("room", || one_more().0 == 0, || base.errors());
    // An interrupt ends a tap, and the end of the run all others. Nothing keeps the run from it.
    taps[1].signal("INT");
    taps[1].end_with(0);
    robot.end();
    for tap in &mut taps[2..] {
        tap.end_with(0);
    }
    let mut base = base;
    base.end_with(0);
}

/// The kind of this name.
fn kind(name: &str) -> StageKind {
    gridweave_ros::kinds().into_iter().find(|kind| kind.name == name).unwrap()
}

/// What has passed on a link: log times. And the observers.
pub(crate) type Link = Arc<Mutex<(Vec<u64>, usize)>>;

struct Viewer(Link);

impl LinkView for Viewer {
    fn take(&mut self, take: &mut dyn FnMut(Message)) -> Result<(), StageError> {
        for time in self.0.lock().unwrap().0.drain(..) {
            let topic = FixedText::new("/robot1/slam_pose").unwrap();
            let (log_time, flags) = (LogTime(time), MessageFlags::DATA);
            let header = MessageHeader { sequence: time, log_time, flags, topic, ..Default::default() };
            take(Message::from_vec(header, vec![0; 12]));
        }
        Ok(())
    }

    fn missed(&self) -> u64 {
        MISSED
    }
}

impl Drop for Viewer {
    fn drop(&mut self) {
        self.0.lock().unwrap().1 -= 1;
    }
}

/// The end of a bridge on a robot, whose run has one link.
pub(crate) fn robot(endpoint: &str, more: &str, link: Option<&Link>) -> StageHarness {
    let links = link.map(|link| {
        let (stage, output, ros_type) = ("slam".to_owned(), "pose".to_owned(), PoseStamped::NAME.to_owned());
        let of_open = Arc::clone(link);
        RunLinks::new([RunLink { stage, output, ros_type, ..Default::default() }], move |_| {
            of_open.lock().unwrap().1 += 1;
            Ok(Some(Box::new(Viewer(Arc::clone(&of_open)))))
        })
    });
    let inputs = vec![InputWire { port: "in", output: "map", ..Default::default() }];
    let context = Context { inputs, links, ..Default::default() };
    let parameters = format!("connect = [\"{endpoint}\"]\nsender = \"robot-1\"\n{more}");
    StageHarness::with_context(&kind("bridge_sink"), &parameters, &context).unwrap()
}

pub(crate) fn tap_stage(endpoint: &str, more: &str) -> StageHarness {
    let parameters = format!("connect = [\"{endpoint}\"]\nsender = \"robot-1\"\nlink = \"slam\"\n{more}");
    StageHarness::new(&kind("bridge_tap"), &parameters).unwrap()
}

/// Lets a tap go on until this is so. Gives what was the error, if there was one.
#[track_caller]
pub(crate) fn go_on(
    tap: &mut StageHarness,
    what: &str,
    mut is_so: impl FnMut(&mut StageHarness) -> bool,
) -> Option<String> {
    let until = Instant::now() + WATCHDOG;
    while !is_so(tap) {
        assert!(Instant::now() < until, "{what}: {:?} {:?}", tap.warnings(), tap.counts());
        tap.node().wait(Duration::from_millis(20));
        if let Err(error) = tap.node().advance() {
            return Some(error.to_string());
        }
    }
    None
}

pub(crate) fn times(tap: &mut StageHarness) -> Vec<u64> {
    let is_data = |message: &Message| message.header().flags.contains(MessageFlags::DATA);
    tap.take_messages("messages")
        .iter()
        .filter(|message| is_data(message))
        .map(|message| message.header().log_time.0)
        .collect()
}

#[test]
fn a_tap_whose_wire_is_cut_is_closed_at_the_robot_and_goes_on_when_it_is_restored() {
    let (endpoint, port) = free_endpoint();
    let _base = source(&endpoint, "");
    let link = Link::default();
    let _robot = robot(&endpoint, "", Some(&link));
    let (wire, by_wire) = Wire::new(port);
    let mut tap = tap_stage(&by_wire, "");
    let viewers = || link.lock().unwrap().1;
    let pass = |time: u64| link.lock().unwrap().0.push(time);
    let mut came = Vec::new();
    for round in 1..4 {
        pass(round);
        assert_eq!(
            go_on(&mut tap, "message", |tap| {
                came.extend(times(tap));
                came.len() as u64 == round
            }),
            None
        );
        assert_eq!(viewers(), 1);
        wire.cut();
        // On a wire that is restored before, Zenoh connects again by itself.
        let is_noticed = |tap: &mut StageHarness| {
            viewers() == 0 && tap.warnings().keys().any(|text| text.contains("is lost: it is retried"))
        };
        assert_eq!(go_on(&mut tap, "close", is_noticed), None);
        wire.restore();
    }
    assert_eq!(came, [1, 2, 3]);
    let warnings = tap.warnings();
    assert_eq!(warnings["`slam.pose` was reopened: messages may have been missed"], 2, "{warnings:?}");
    let has_missed = |tap: &mut StageHarness| tap.counts().get("messages missed") == Some(&(3 * MISSED));
    assert_eq!(go_on(&mut tap, "missed", has_missed), None);
    // The end of the tap.
    assert_eq!(go_on(&mut tap, "open", |_| viewers() == 1), None);
    drop(tap);
    wait_until("close", || viewers() == 0, String::new);
}

#[test]
fn a_machine_that_is_not_there_is_waited_for_and_the_end_of_its_run_is_that_of_the_tap() {
    let (endpoint, port) = free_endpoint();
    let has_warned =
        |words: &'static str| move |tap: &mut StageHarness| tap.warnings().keys().any(|text| text.contains(words));
    // Nobody is there yet.
    let mut tap = tap_stage(&endpoint, "");
    assert_eq!(go_on(&mut tap, "base", has_warned("cannot connect to any machine")), None);
    let _base = source(&endpoint, "");
    let (wire, by_wire) = Wire::new(port);
    let link = Link::default();
    let pass = |time: u64| link.lock().unwrap().0.push(time);
    let mut came = Vec::new();
    let mut all_came = |tap: &mut StageHarness, count: usize| {
        came.extend(times(tap));
        came.len() == count
    };
    let robot = robot(&by_wire, "", Some(&link));
    pass(1);
    assert_eq!(go_on(&mut tap, "first", |tap| all_came(tap, 1)), None);
    // The robot drives out of reach, and comes back.
    wire.cut();
    assert_eq!(go_on(&mut tap, "gone", has_warned("the machine `robot-1` is gone: it is waited for")), None);
    wire.restore();
    pass(2);
    assert_eq!(go_on(&mut tap, "second", |tap| all_came(tap, 2)), None);
    pass(3);
    // Its run ends.
    drop(robot);
    let until = Instant::now() + WATCHDOG;
    while tap.node().advance().unwrap() {
        assert!(Instant::now() < until, "{:?}", tap.warnings());
        tap.node().wait(Duration::from_millis(20));
    }
    assert!(all_came(&mut tap, 3));
    assert_eq!((came, link.lock().unwrap().1), (vec![1, 2, 3], 0));
}

#[test]
fn a_robot_that_does_not_show_its_links_says_why() {
    for (more, link, expected) in [
        ("allow_tap = false", Some(Link::default()), "`allow_tap = false`"),
        ("", None, "the links of its run cannot be observed"),
    ] {
        let (endpoint, _) = free_endpoint();
        let _base = source(&endpoint, "");
        let _robot = robot(&endpoint, more, link.as_ref());
        let error = go_on(&mut tap_stage(&endpoint, ""), expected, |_| false).unwrap();
        assert!(error.starts_with("cannot observe `slam` of `robot-1`: ") && error.contains(expected), "{error}");
    }
}
