//! Names of topics and frames under their robots.
//!
//! Programs on each robot publish the map as `/map`, with frames such as `map` and `base_link`. To combine the logs of
//! several robots, each topic and frame needs the name of its robot as a prefix: the topic `/map` of `robot1` becomes
//! `/robot1/map`, and the frame `map` becomes `robot1/map` in every message. Transforms are the exception: those of all
//! robots are on `/tf` and `/tf_static`, where programs expect them.
//!
//! The robot is given by the user ([`Input`]), or by the file name where several logs have equal topics, or by a topic
//! such as `/robot1/tf`, which contains the frames of `robot1`, or by frames: those of the maps on `/map`, or of lidars on
//! one base.

mod channel;
mod clock;
mod error;
mod file_names;
mod first_frames;
mod infer_robots;
mod input;
mod lidars_of_one;
mod logged_name;
mod map_frame_robot;
mod naming;
mod one_name_for_two;
mod rename;
mod rename_advice;
mod rules;
mod shared_frames;
mod shown_robots;

#[cfg(test)]
mod tests;

pub(crate) use channel::{NamedChannel, Renamed};
pub use error::NameError;
pub use file_names::{FileNameError, name_map_files, robot_names};
pub use input::Input;
pub use rename::TopicRename;
pub use rename_advice::{rename_advice, scan_rename_advice};
pub use rules::{NameRules, TopicNaming};
pub(crate) use shared_frames::SharedFrames;

use crate::reader::{LogFile, LogMessage, LogReader, log_files};
use gridweave_runtime::message::Channel;
use gridweave_runtime::stage::RobotTopics;
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::Arc;

/// The channels of logs, named under their robots.
#[derive(Debug)]
pub struct Names {
    /// By file, and by channel number in the file.
    channels: Vec<BTreeMap<u16, NamedChannel>>,
    /// By file: the robot that the whole file was put under.
    robots: Vec<Option<String>>,
    note: Option<String>,
    /// The robots that the user has named.
    given: BTreeSet<String>,
}

/// Opens logs and names their channels. `robots` are the topic patterns.
///
/// # Errors
/// A log cannot be read, or the rules do not match the logs.
pub fn open(inputs: &[Input], rules: &NameRules, robots: &RobotTopics) -> Result<(LogReader, Names), NameError> {
    let paths: Vec<PathBuf> = inputs.iter().map(|input| input.path.clone()).collect();
    let (input_of, files): (Vec<usize>, Vec<PathBuf>) = log_files(&paths)?.into_iter().unzip();
    let mut files: Vec<LogFile> =
        files.into_iter().map(|file| LogFile::open_as(file, rules.thresholds)).collect::<Result<_, _>>()?;
    clock::align(&mut files, &input_of, rules.align_start);
    let inputs = name_maps(&files, &input_of, inputs)?;
    let files: Arc<[LogFile]> = files.into();
    let mut names = naming::name(&files, &input_of, &inputs, rules, robots)?;
    if rules.convention == TopicNaming::ByRobot {
        names.share_frames(&files, robots);
    }
    Ok((LogReader::of(files), names))
}

/// The inputs, in which map files without a robot are named after their file.
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
    /// The named channel with the given number in a file; `None` if the file does not describe it.
    pub fn channel(&self, file: usize, number: u16) -> Option<&Channel> {
        self.of_number(file, number).map(|named| &named.channel)
    }

    /// All named channels.
    pub fn channels(&self) -> impl Iterator<Item = &Channel> + Clone {
        self.channels.iter().flat_map(BTreeMap::values).map(|named| &named.channel)
    }

    /// The named channels that the rules select.
    pub(crate) fn wanted_channels(&self) -> impl Iterator<Item = &Channel> + Clone {
        let wanted = self.channels.iter().flat_map(BTreeMap::values).filter(|named| named.is_wanted);
        wanted.map(|named| &named.channel)
    }

    /// Whether the rules select a channel.
    pub fn wants(&self, file: usize, number: u16) -> bool {
        self.of_number(file, number).is_none_or(|named| named.is_wanted)
    }

    /// The robot that a whole file was put under.
    pub fn robot_of_file(&self, file: usize) -> Option<&str> {
        self.robots.get(file)?.as_deref()
    }

    /// The robots that the user has named: those of inputs, and those that are to be read.
    pub(crate) fn given_robots(&self) -> &BTreeSet<String> {
        &self.given
    }

    /// A note for the user about robot names that were inferred, if any.
    pub fn note(&self) -> Option<&str> {
        self.note.as_deref()
    }

    /// The reason why the frames in a channel's messages are not renamed, although they should be.
    pub fn unrenamed_frames(&self, file: usize, number: u16) -> Option<String> {
        self.of_number(file, number)?.unrenamed_frames()
    }

    /// The new name of a frame in a channel's messages.
    pub fn frame<'a>(&self, file: usize, number: u16, frame: &'a str) -> Cow<'a, str> {
        self.of_number(file, number).map_or(Cow::Borrowed(frame), |named| named.frame(frame))
    }

    /// Puts the frames of a message under its robot. If that changes anything, the result is in `copy`.
    pub(crate) fn rename_frames(&self, message: &LogMessage<'_>, copy: &mut Vec<u8>) -> Renamed {
        match self.of_number(message.file, message.channel) {
            Some(named) => named.rename_frames(message.data, copy),
            None => Renamed::AsLogged,
        }
    }

    /// The message with its frames under the robot; in `copy` if that changes anything.
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
