//! The stage `mcap_source`.

use super::latched::{LatchedMessages, Window};
use super::router::Router;
use super::{RobotMessages, RobotReading, SourceParameters};
use crate::names::{self, TopicNaming};
use crate::reader::{LogFile, LogReader};
use crate::robots::CellValues;
use gridweave_runtime::message::LogTime;
use gridweave_runtime::pipeline::list_in_words;
use gridweave_runtime::stage::{Context, Output, Source, StageError};

/// The number of messages that are read at a time.
const BATCH: usize = 64;

/// The size of messages after which no more are read at a time, bytes.
const BATCH_BYTES: usize = 16 << 20;

/// Reads logs; see the [module](super).
pub struct McapSource {
    reader: LogReader,
    router: Router,
    window: Window,
    /// The latched messages before the start; `None` once they are sent.
    latched: Option<LatchedMessages>,
    begun: bool,
    /// Whether messages are assigned to robots.
    names_robots: bool,
}

impl McapSource {
    /// Opens the logs.
    pub fn new(parameters: SourceParameters, context: &Context) -> Result<Self, StageError> {
        let doing = "read the log";
        if parameters.files.is_empty() {
            return Err(StageError::new(doing, "no input file").with_help("give --input LOG or files = [...]"));
        }
        if let Some(tf) = &context.robots.tf
            && !(tf.map_frame.contains("{robot}") && tf.base_frame.contains("{robot}"))
        {
            return Err(StageError::new(
                doing,
                "the frames of `robots.tf` lack `{robot}`, the part that is the robot's name",
            )
            .with_help("write them as in map_frame = \"{robot}/map\""));
        }
        let rules = parameters.rules().map_err(|error| StageError::new(doing, error))?;
        let opened = names::open(&parameters.inputs(), &rules, &context.robots);
        let (reader, names) = opened.map_err(|error| StageError::new(doing, error))?;
        let origin = reader.files().iter().filter_map(LogFile::first_time).min().map_or(LogTime::MIN, LogTime);
        let names_robots = rules.convention == TopicNaming::ByRobot;
        // What keeps the names of the log keeps its bytes.
        let map_values = if names_robots { parameters.map_values } else { CellValues::Occupancy };
        let given: Vec<String> = parameters.lidars.keys().cloned().collect();
        let resized: Vec<String> = parameters.resolutions.keys().cloned().collect();
        let reading = RobotReading { map_values, resolutions: parameters.resolutions, lidars: parameters.lidars };
        let router = Router::new(context.robots.clone(), names, reader.files().clone(), names_robots, reading);
        if let Some(robot) = given.iter().find(|robot| !router.scanned().any(|scanned| scanned == *robot)) {
            let scanned: Vec<&str> = router.scanned().collect();
            let help = match scanned.is_empty() {
                true => "no map is built from scans in these logs".to_owned(),
                false => format!("maps are built from the scans of {}", list_in_words(scanned)),
            };
            let error = format!("`lidars` names `{robot}`, of whose scans no map is built");
            return Err(StageError::new(doing, error).with_help(help));
        }
        if let Some(robot) = resized.iter().find(|robot| !router.mapped().any(|mapped| mapped == *robot)) {
            let mapped: Vec<&str> = router.mapped().collect();
            let help = match mapped.is_empty() {
                true => "no robot has a map in these logs".to_owned(),
                false => format!("there are maps of {}", list_in_words(mapped)),
            };
            let error = format!("`resolutions` names `{robot}`, which has no map");
            return Err(StageError::new(doing, error).with_help(help));
        }
        Ok(Self {
            router,
            reader,
            window: Window::new(origin, parameters.start, parameters.end),
            latched: Some(LatchedMessages::default()),
            begun: false,
            names_robots,
        })
    }

    fn warn_of_damage(&mut self, output: &Output<RobotMessages>) {
        let files = self.reader.files().clone();
        let mut damage = self.reader.take_damage();
        if !std::mem::replace(&mut self.begun, true) {
            if let Some(note) = self.router.names().note() {
                output.warn(note);
            }
            let found_at_opening = |(index, file): (usize, &LogFile)| {
                file.damage().iter().map(move |damage| (index, damage.clone())).collect::<Vec<_>>()
            };
            damage.extend(files.iter().enumerate().flat_map(found_at_opening));
        }
        for (file, damage) in damage {
            if let Some(file) = files.get(file) {
                output.warn(format!("{}: {damage}", file.path().display()));
            }
        }
    }

    fn end(&mut self, output: &Output<RobotMessages>) -> Result<bool, StageError> {
        send_latched(&mut self.latched, self.window.start, &mut self.router, output)?;
        self.router.send_undecided_maps(output)?;
        self.router.send_updated_maps(output)?;
        self.router.send_supplements(output)?;
        self.warn_of_damage(output);
        if self.names_robots {
            self.router.warn_of_missing(output);
        }
        Ok(false)
    }
}

impl Source for McapSource {
    type Outputs = RobotMessages;

    fn next(&mut self, output: &Output<RobotMessages>) -> Result<bool, StageError> {
        let (mut count, mut bytes) = (0, 0);
        while count < BATCH && bytes < BATCH_BYTES {
            let Some(message) = self.reader.next_message() else { return self.end(output) };
            if message.log_time > self.window.end {
                return self.end(output);
            }
            count += 1;
            bytes += message.data.len();
            if message.log_time < self.window.start
                && let Some(latched) = &mut self.latched
            {
                self.router.keep(&message, latched, output)?;
                continue;
            }
            send_latched(&mut self.latched, self.window.start, &mut self.router, output)?;
            output.set_log_time(message.log_time);
            self.router.send_supplements(output)?;
            self.router.send_unmerged(output)?;
            self.router.send(&message, output)?;
        }
        self.warn_of_damage(output);
        Ok(true)
    }

    fn progress(&self) -> Option<f64> {
        Some(self.reader.progress())
    }
}

/// Sends the latched messages at the start of the window, once.
fn send_latched(
    latched: &mut Option<LatchedMessages>,
    start: LogTime,
    router: &mut Router,
    output: &Output<RobotMessages>,
) -> Result<(), StageError> {
    let Some(mut latched) = latched.take() else { return Ok(()) };
    let kept = latched.take();
    if !kept.is_empty() {
        output.set_log_time(start);
    }
    kept.iter().try_for_each(|(route, kept)| router.send_latched(*route, kept, output))?;
    router.send_updated_maps(output)
}
