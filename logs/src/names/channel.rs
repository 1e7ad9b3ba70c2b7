//! One channel with its names.

use crate::dynamic::{Recoder, Schema};
use gridweave_runtime::message::Channel;
use gridweave_runtime::stage::frame_of_robot;
use std::borrow::Cow;

/// A channel as it is called beside those of other robots.
#[derive(Debug)]
pub(crate) struct NamedChannel {
    pub(crate) channel: Channel,
    pub(super) is_wanted: bool,
    frames: Frames,
}

/// What becomes of the frames in a channel's messages.
#[derive(Debug)]
enum Frames {
    /// They stay, or there are none.
    AsLogged,
    /// They are put under a robot (empty: under none), and stamps are `later` by so many nanoseconds. `is_map`: a frame without a
    /// name is that of its map.
    OfRobot { robot: String, is_map: bool, later: i64, recoder: Recoder },
    /// They should be, but nobody knows where in the messages they are, for this reason.
    Unknown(String),
}

/// What was done to a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Renamed {
    /// It stays as it was logged.
    AsLogged,
    /// It was copied with other names.
    Copied,
    /// It does not fit its type, and stays as it was logged.
    Unreadable,
}

impl NamedChannel {
    /// A channel whose frames are put under `robot`, without a robot they stay as they were logged; and whose clock is set
    /// `later` by so many nanoseconds.
    pub(crate) fn new(channel: Channel, robot: String, is_map: bool, later: i64, is_wanted: bool) -> Self {
        let frames = match robot.is_empty() && later == 0 {
            true => Frames::AsLogged,
            false => match Schema::of_channel(&channel) {
                Err(error) => Frames::Unknown(error.to_string()),
                Ok(schema) => match Recoder::new(schema) {
                    None => Frames::Unknown("there are wide texts (wstring) in them".to_owned()),
                    Some(recoder) if recoder.names_frames() || later != 0 && recoder.has_stamps() => {
                        Frames::OfRobot { robot, is_map, later, recoder }
                    }
                    Some(_) => Frames::AsLogged,
                },
            },
        };
        Self { channel, is_wanted, frames }
    }

    /// What a frame is called that its messages name.
    pub(super) fn frame<'a>(&self, frame: &'a str) -> Cow<'a, str> {
        match &self.frames {
            Frames::OfRobot { robot, is_map, .. } => name(robot, frame, if *is_map { "map" } else { "" }),
            Frames::AsLogged | Frames::Unknown(_) => Cow::Borrowed(frame),
        }
    }

    /// Why frames stay as they were logged that should be put under a robot.
    pub(crate) fn frames_left(&self) -> Option<String> {
        let Frames::Unknown(why) = &self.frames else { return None };
        Some(format!("frames and stamps in messages on `{}` stay as they were logged: {why}", self.channel.topic))
    }

    /// Puts the frames of a message under the robot, in a copy if that changes anything.
    pub(crate) fn rename_frames(&self, message: &[u8], copy: &mut Vec<u8>) -> Renamed {
        let Frames::OfRobot { robot, is_map, later, recoder } = &self.frames else { return Renamed::AsLogged };
        copy.clear();
        let unnamed = if *is_map { "map" } else { "" };
        match recoder.rename_frames(message, &|frame| name(robot, frame, unnamed), *later, copy) {
            Ok(true) => Renamed::Copied,
            Ok(false) => Renamed::AsLogged,
            Err(_) => Renamed::Unreadable,
        }
    }
}

/// The name of a robot's frame; `unnamed` is the one without a name.
fn name<'a>(robot: &str, frame: &'a str, unnamed: &'static str) -> Cow<'a, str> {
    match robot {
        "" => Cow::Borrowed(frame),
        robot => frame_of_robot(robot, if frame.is_empty() { unnamed } else { frame }),
    }
}
