//! Topics and frames under the names of their robots.
//!
//! Programs of one robot call its map `/map` and its frames `map` and `base_link`, and so do those of the next. What several
//! robots have logged is one tree of frames, and one set of topics, only once each has the name of its robot before it: the
//! topic `/map` of `robot1` becomes `/robot1/map`, and the frame `map` becomes `robot1/map` in every message that names it.
//! Transforms are the exception: those of all robots are on `/tf` and `/tf_static`, where programs look for them.
//!
//! Which robot that is, is said by the user ([`Input`]), by the names of files where several logs look alike, or by the
//! topics of a log: `/robot1/tf` tells of the frames of `robot1`.

mod alike;
mod channel;
mod clock;
mod error;
mod file_names;
mod input;
mod naming;
mod rename;
mod rules;

#[cfg(test)]
mod tests;

pub(crate) use channel::{NamedChannel, Renamed};
pub use error::NameError;
pub use file_names::{FileNameError, robot_names};
pub use input::Input;
pub use rename::TopicRename;
pub use rules::{Convention, NameRules};

use crate::reader::{LogFile, LogMessage, LogReader, log_files};
use gridweave_runtime::message::Channel;
use gridweave_runtime::stage::RobotTopics;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// The channels of logs, as they are called beside those of other robots.
#[derive(Debug)]
pub struct Names {
    /// By file, and by the channel's number in it.
    channels: Vec<BTreeMap<u16, NamedChannel>>,
    /// By file: the robot that it was put under.
    robots: Vec<Option<String>>,
    remark: Option<String>,
}

/// Opens logs, and names what is in them. `robots` says how topics are told apart.
///
/// # Errors
/// A log cannot be read, or the rules do not fit what is in them.
pub fn open(inputs: &[Input], rules: &NameRules, robots: &RobotTopics) -> Result<(LogReader, Names), NameError> {
    let paths: Vec<PathBuf> = inputs.iter().map(|input| input.path.clone()).collect();
    let (input_of, files): (Vec<usize>, Vec<PathBuf>) = log_files(&paths)?.into_iter().unzip();
    let mut files: Vec<LogFile> =
        files.into_iter().map(|file| LogFile::open_as(file, rules.thresholds)).collect::<Result<_, _>>()?;
    clock::align(&mut files, &input_of, rules.align_start);
    let inputs = name_maps(&files, &input_of, inputs)?;
    let names = naming::name(&files, &input_of, &inputs, rules, robots)?;
    Ok((LogReader::new(files), names))
}

/// The inputs, and with map files the robots that are called as they are, where nothing else was said.
fn name_maps(files: &[LogFile], input_of: &[usize], inputs: &[Input]) -> Result<Vec<Input>, NameError> {
    let mut named = inputs.to_vec();
    for (_, &input) in files.iter().zip(input_of).filter(|(file, _)| file.is_map()) {
        if let Some(input) = named.get_mut(input).filter(|input| input.robot.is_none()) {
            input.robot = robot_names(std::slice::from_ref(&input.path))?.pop();
        }
    }
    Ok(named)
}

impl Names {
    /// The channel with the given number in a file, as it is called here; none if its file does not describe it.
    pub fn channel(&self, file: usize, number: u16) -> Option<&Channel> {
        self.of_number(file, number).map(|named| &named.channel)
    }

    /// All channels, as they are called here.
    pub fn channels(&self) -> impl Iterator<Item = &Channel> {
        self.channels.iter().flat_map(BTreeMap::values).map(|named| &named.channel)
    }

    /// Whether the rules ask for the messages of a channel.
    pub fn wants(&self, file: usize, number: u16) -> bool {
        self.of_number(file, number).is_none_or(|named| named.is_wanted)
    }

    /// The robot that all of a file was put under.
    pub fn robot_of_file(&self, file: usize) -> Option<&str> {
        self.robots.get(file)?.as_deref()
    }

    /// What the user should know of how robots were named without being asked.
    pub fn remark(&self) -> Option<&str> {
        self.remark.as_deref()
    }

    /// Why the frames in the messages of a channel stay as they were logged, although others get their robot's name.
    pub fn frames_left(&self, file: usize, number: u16) -> Option<String> {
        self.of_number(file, number)?.frames_left()
    }

    /// What a frame is called here that messages of a channel name.
    pub fn frame<'a>(&self, file: usize, number: u16, frame: &'a str) -> Cow<'a, str> {
        self.of_number(file, number).map_or(Cow::Borrowed(frame), |named| named.frame(frame))
    }

    /// Puts the frames in a message under its robot. Where that changes anything, the message is in `copy`.
    pub(crate) fn rename_frames(&self, message: &LogMessage<'_>, copy: &mut Vec<u8>) -> Renamed {
        match self.of_number(message.file, message.channel) {
            Some(named) => named.rename_frames(message.data, copy),
            None => Renamed::AsLogged,
        }
    }

    /// A message with the names that its frames have here; where these are others than in the log, in `copy`.
    pub fn named<'a>(&self, message: &LogMessage<'a>, copy: &'a mut Vec<u8>) -> &'a [u8] {
        match self.rename_frames(message, copy) {
            Renamed::Copied => copy,
            Renamed::AsLogged | Renamed::Unreadable => message.data,
        }
    }

    fn of_number(&self, file: usize, number: u16) -> Option<&NamedChannel> {
        self.channels.get(file)?.get(&number)
    }
}
