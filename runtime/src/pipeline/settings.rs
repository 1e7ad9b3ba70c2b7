//! The sections `[pipeline]` and `[robots]`.

use super::diagnostic::{Diagnostic, Location, Problems};
use super::document::{Entry, Item, Value};
use super::initial_poses::{complete, read_robot, read_typed};
use super::live::{Mode, read_keyword};
use super::overrides::Overrides;
use super::tag_fields::read_tag_fields;
use super::values::{entries, text, unknown_key, wrong_type};
use crate::message::{FixedText, LONGEST_ROBOT_NAME};
use crate::stage::{InitialPoses, RobotTopics, TfFrames};
use std::time::Duration;

/// The default for the samples that an input can queue.
pub const DEFAULT_DEPTH: usize = 16;

/// The maximum for the samples that an input can queue.
pub const MAX_DEPTH: usize = 4096;

/// The default for the maximum time of a stage for one message.
const DEFAULT_STALL_TIMEOUT: Duration = Duration::from_secs(300);

/// The default for the maximum memory of an input's pending messages of one log time, bytes: more than the content that
/// a log may have at one time.
pub const DEFAULT_SAME_TIME_LIMIT: u64 = 2 << 30;

/// The settings of `[pipeline]` and `[robots]`.
#[derive(Debug)]
pub(super) struct Settings {
    pub(super) name: String,
    pub(super) mode: Mode,
    pub(super) reference: Option<String>,
    pub(super) seed: u64,
    pub(super) depth: usize,
    pub(super) batch: bool,
    pub(super) stall_timeout: Option<Duration>,
    pub(super) memory_limit: Option<u64>,
    pub(super) same_time_limit: u64,
    pub(super) robots: RobotTopics,
    pub(super) initial_poses: InitialPoses,
}

impl Settings {
    /// The default settings of a pipeline called `name`.
    pub(super) fn new(name: &str) -> Self {
        let robots = RobotTopics::default();
        let stall_timeout = Some(DEFAULT_STALL_TIMEOUT);
        Self {
            name: name.into(),
            mode: Mode::default(),
            reference: None,
            seed: 0,
            depth: DEFAULT_DEPTH,
            batch: true,
            stall_timeout,
            memory_limit: None,
            same_time_limit: DEFAULT_SAME_TIME_LIMIT,
            robots,
            initial_poses: InitialPoses::new(),
        }
    }

    /// Reads the section `[pipeline]`.
    pub(super) fn read_pipeline(&mut self, section: &Item, problems: &mut Problems) {
        const KEYS: [&str; 9] =
            ["name", "mode", "reference", "seed", "depth", "batch", "stall_timeout", "memory_limit", "same_time_limit"];
        for Entry { key, key_at, item } in entries(section, "[pipeline]", problems) {
            match key.as_str() {
                "name" => match text(key, item, problems) {
                    Some("") => problems.push(empty("the name of the pipeline", &item.at)),
                    Some(name) => self.name = name.to_owned(),
                    None => {}
                },
                "mode" => self.mode = read_keyword(key, item, problems).unwrap_or_default(),
                "reference" => {
                    if let Some(robot) = text(key, item, problems) {
                        check_reference(robot, &item.at, problems);
                        self.reference = Some(robot.to_owned());
                    }
                }
                "seed" => match read_seed(item) {
                    Some(seed) => self.seed = seed,
                    None => problems.push(wrong_type(key, item, "a whole number of at least 0")),
                },
                "depth" => self.depth = depth(item, problems).unwrap_or(DEFAULT_DEPTH),
                "batch" => match item.as_bool() {
                    Some(batch) => self.batch = batch,
                    None => problems.push(wrong_type(key, item, "true or false")),
                },
                "stall_timeout" => match read_seconds(item) {
                    Some(seconds) => self.stall_timeout = Some(seconds).filter(|seconds| !seconds.is_zero()),
                    None => problems.push(wrong_type(key, item, "seconds, 0 or more")),
                },
                "memory_limit" => match read_bytes(item) {
                    Some(bytes) => self.memory_limit = Some(bytes).filter(|bytes| *bytes > 0),
                    None => problems.push(wrong_type(key, item, "bytes, 0 or more")),
                },
                "same_time_limit" => match read_bytes(item) {
                    Some(bytes) => self.same_time_limit = bytes,
                    None => problems.push(wrong_type(key, item, "bytes, 0 or more")),
                },
                _ => problems.push(unknown_key(key, key_at, "[pipeline]", &KEYS)),
            }
        }
    }

    /// Reads the section `[robots]`.
    pub(super) fn read_robots(&mut self, section: &Item, problems: &mut Problems) {
        const KEYS: [&str; 6] = ["map", "pose", "tags", "topology", "scan", "tf"];
        for Entry { key, key_at, item } in entries(section, "[robots]", problems) {
            let mut item = item;
            if key == "tags" && matches!(item.value, Value::Table(_)) {
                let (topic, fields) = read_tag_fields(item, key_at, problems);
                self.robots.tag_fields = Some(fields);
                let Some(topic) = topic else { continue };
                item = topic;
            }
            let topic = match key.as_str() {
                "map" => &mut self.robots.map,
                "pose" => &mut self.robots.pose,
                "tags" => &mut self.robots.tags,
                "topology" => &mut self.robots.topology,
                "scan" => &mut self.robots.scan,
                "tf" => {
                    self.robots.tf = read_frames(item, key_at, problems);
                    continue;
                }
                _ => {
                    match &item.value {
                        Value::Table(known) => read_robot(key, known, &mut self.initial_poses, problems),
                        _ => problems.push(unknown_key(key, key_at, "[robots]", &KEYS)),
                    }
                    continue;
                }
            };
            let Some(pattern) = text(key, item, problems) else { continue };
            check_pattern(pattern, &item.at, problems);
            if !pattern.starts_with('/') {
                let label = "a topic starts with `/`";
                problems.push(Diagnostic::new("this pattern matches no topic").at(&item.at, label));
            }
            pattern.clone_into(topic);
        }
    }

    /// Applies the settings of the command line.
    pub(super) fn override_with(&mut self, overrides: &Overrides, problems: &mut Problems) {
        if let Some(robot) = &overrides.reference {
            let text = format!("reference = \"{robot}\"");
            let value = text.len() - robot.len() - 2..text.len();
            let source = problems.add_source("command line", text);
            check_reference(robot, &Location::new(source, value), problems);
            self.reference = Some(robot.clone());
        }
        self.seed = overrides.seed.unwrap_or(self.seed);
        for typed in &overrides.initial_poses {
            read_typed(typed, &mut self.initial_poses, problems);
        }
        complete(&mut self.initial_poses, self.reference.as_deref(), problems);
    }
}

fn read_seconds(item: &Item) -> Option<Duration> {
    let seconds = item.as_float().or_else(|| item.as_integer().map(|seconds| seconds as f64))?;
    Duration::try_from_secs_f64(seconds).ok()
}

fn read_bytes(item: &Item) -> Option<u64> {
    u64::try_from(item.as_integer()?).ok()
}

/// Reads a seed. TOML has no integers above 2^63, so a larger seed is a string.
fn read_seed(item: &Item) -> Option<u64> {
    match item.as_str() {
        Some(text) => text.parse().ok(),
        None => item.as_integer()?.try_into().ok(),
    }
}

fn read_frames(item: &Item, key_at: &Location, problems: &mut Problems) -> Option<TfFrames> {
    const KEYS: [&str; 2] = ["map_frame", "base_frame"];
    let (mut map_frame, mut base_frame) = (None, None);
    for Entry { key, key_at, item } in entries(item, "tf", problems) {
        let frame = match key.as_str() {
            "map_frame" => &mut map_frame,
            "base_frame" => &mut base_frame,
            _ => {
                problems.push(unknown_key(key, key_at, "tf", &KEYS));
                continue;
            }
        };
        let pattern = text(key, item, problems);
        if let Some(pattern) = pattern {
            check_pattern(pattern, &item.at, problems);
        }
        *frame = Some(pattern.unwrap_or_default().to_owned());
    }
    if map_frame.is_none() || base_frame.is_none() {
        let example = "tf = { map_frame = \"{robot}/map\", base_frame = \"{robot}/base_link\" }";
        let missing = if map_frame.is_none() { "map_frame" } else { "base_frame" };
        let problem = Diagnostic::new(format!("`tf` has no `{missing}`")).at(key_at, "a pose needs both frames");
        problems.push(problem.help(format!("write `{example}`")));
    }
    Some(TfFrames { map_frame: map_frame?, base_frame: base_frame? })
}

/// Checks that a pattern contains `{robot}` exactly once, and no other placeholder.
fn check_pattern(pattern: &str, at: &Location, problems: &mut Problems) {
    let count = pattern.matches("{robot}").count();
    let others = pattern.replace("{robot}", "");
    if count != 1 {
        let label =
            format!("expected `{{robot}}` once, found it {}", if count == 0 { "nowhere" } else { "twice or more" });
        let problem = Diagnostic::new("this pattern does not distinguish the robots").at(at, label);
        problems.push(problem.help("write `{robot}` for the name of the robot, as in `/{robot}/map`".to_owned()));
    } else if others.contains(['{', '}']) {
        let label = "the only placeholder is `{robot}`";
        problems.push(Diagnostic::new("this pattern has an unknown placeholder").at(at, label));
    }
}

fn check_reference(robot: &str, at: &Location, problems: &mut Problems) {
    if robot.is_empty() {
        let problem = empty("the reference robot", at);
        problems.push(problem.help("leave `reference` out to take the first robot by name".to_owned()));
    } else if let Err(error) = FixedText::<LONGEST_ROBOT_NAME>::new(robot) {
        problems.push(Diagnostic::new("the name of the reference robot is too long").at(at, error.to_string()));
    } else if robot.contains('/') {
        let label = "a robot's name is one part of a path";
        problems.push(Diagnostic::new("the reference is not a robot's name").at(at, label));
    }
}

/// Reads the number of samples that an input can queue.
pub(super) fn depth(item: &Item, problems: &mut Problems) -> Option<usize> {
    let depth = item.as_integer().and_then(|depth| usize::try_from(depth).ok());
    let depth = depth.filter(|depth| (1..=MAX_DEPTH).contains(depth));
    if depth.is_none() {
        let problem = wrong_type("depth", item, &format!("a whole number from 1 to {MAX_DEPTH}"));
        problems.push(problem.note("`depth` is the number of samples that an input can queue before the sender waits"));
    }
    depth
}

fn empty(what: &str, at: &Location) -> Diagnostic {
    Diagnostic::new(format!("{what} is empty")).at(at, "expected a name")
}
