//! A channel with its names under a robot.

use super::shared_frames::SharedFrames;
use crate::dynamic::{Recoder, Schema};
use crate::tf::tf_topic;
use gridweave_runtime::message::Channel;
use gridweave_runtime::stage::frame_of_robot;
use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

/// A channel named so that it is unique among the channels of all robots.
#[derive(Debug)]
pub(crate) struct NamedChannel {
    pub(crate) channel: Channel,
    pub(super) is_wanted: bool,
    frames: Frames,
    /// Frames in the transforms of all robots that are put under one of them.
    shared: Option<Arc<SharedFrames>>,
}

/// The treatment of the frames in a channel's messages.
#[derive(Debug)]
enum Frames {
    /// Unchanged, or there are none.
    AsLogged,
    /// Put under a robot (unchanged if empty), with stamps shifted `later` by nanoseconds. With `is_map`, an empty
    /// frame name is the map frame. Frames that have the name `logged_as` of the robot in the log get the other
    /// instead.
    OfRobot { robot: String, logged_as: Option<String>, is_map: bool, later: i64, recoder: Arc<Recoder> },
    /// Unchanged, because the definition of the messages cannot be used, for this reason.
    Unknown(String),
}

/// The result of renaming the frames of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Renamed {
    /// The message is unchanged.
    AsLogged,
    /// The message was copied with other names.
    Copied,
    /// The message does not match its type and is unchanged.
    Unreadable,
}

/// The copiers of messages, shared by the channels of one schema; or why there is none.
#[derive(Debug, Default)]
pub(super) struct Recoders(HashMap<Channel, Result<Arc<Recoder>, String>>);

impl Recoders {
    fn of(&mut self, channel: &Channel) -> Result<Arc<Recoder>, String> {
        // All that a schema depends on.
        let key = Channel { topic: String::new(), metadata: BTreeMap::new(), ..channel.clone() };
        let make = || {
            let schema = Schema::of_channel(channel).map_err(|error| error.to_string())?;
            Recoder::new(schema).map(Arc::new).ok_or_else(|| "they contain wstring fields".to_owned())
        };
        self.0.entry(key).or_insert_with(make).clone()
    }
}

impl NamedChannel {
    /// Creates a named channel. Its frames are put under `robot`, or unchanged if that is empty; its stamps are shifted
    /// `later` by nanoseconds.
    pub(crate) fn new(channel: Channel, robot: String, is_map: bool, later: i64, is_wanted: bool) -> Self {
        Self::sharing(&mut Recoders::default(), channel, robot, is_map, later, is_wanted)
    }

    /// The same, with a parsed schema that is shared with other channels.
    pub(super) fn sharing(
        recoders: &mut Recoders,
        channel: Channel,
        robot: String,
        is_map: bool,
        later: i64,
        is_wanted: bool,
    ) -> Self {
        let frames = match robot.is_empty() && later == 0 {
            true => Frames::AsLogged,
            false => match recoders.of(&channel) {
                Err(why) => Frames::Unknown(why),
                Ok(recoder) => match recoder {
                    recoder if recoder.names_frames() || later != 0 && recoder.has_stamps() => {
                        Frames::OfRobot { robot, logged_as: None, is_map, later, recoder }
                    }
                    _ => Frames::AsLogged,
                },
            },
        };
        Self { channel, is_wanted, frames, shared: None }
    }

    /// The same channel, in a log that has another name for the robot.
    pub(super) fn logged_as(mut self, name: Option<&str>) -> Self {
        if let Frames::OfRobot { logged_as, .. } = &mut self.frames {
            *logged_as = name.map(str::to_owned);
        }
        self
    }

    /// Whether the channel has the transforms of all robots.
    pub(crate) fn is_shared_tf(&self) -> bool {
        let is_of_a_robot = matches!(&self.frames, Frames::OfRobot { robot, .. } if !robot.is_empty());
        tf_topic(&self.channel) == Some("") && !is_of_a_robot
    }

    /// Puts the frames in the transforms of all robots under the robots that they belong to.
    pub(crate) fn share_frames(&mut self, shared: Option<Arc<SharedFrames>>) {
        self.shared = shared;
    }

    /// The new name of a frame in the channel's messages.
    pub(super) fn frame<'a>(&self, frame: &'a str) -> Cow<'a, str> {
        match &self.frames {
            Frames::OfRobot { robot, logged_as, is_map, .. } => {
                name(robot, logged_as.as_deref(), frame, if *is_map { "map" } else { "" })
            }
            Frames::AsLogged | Frames::Unknown(_) => Cow::Borrowed(frame),
        }
    }

    /// The reason why frames are unchanged that should be put under a robot.
    pub(crate) fn unrenamed_frames(&self) -> Option<String> {
        let Frames::Unknown(why) = &self.frames else { return None };
        Some(format!("frames and stamps in messages on `{}` are not renamed: {why}", self.channel.topic))
    }

    /// Puts the frames of a message under the robot, in a copy if that changes anything.
    pub(crate) fn rename_frames(&self, message: &[u8], copy: &mut Vec<u8>) -> Renamed {
        let renamed = self.put_under_robot(message, copy);
        let data = if renamed == Renamed::Copied { copy.as_slice() } else { message };
        match self.shared.as_ref().and_then(|shared| shared.renamed(data)) {
            Some(data) => {
                *copy = data;
                Renamed::Copied
            }
            None => renamed,
        }
    }

    fn put_under_robot(&self, message: &[u8], copy: &mut Vec<u8>) -> Renamed {
        let Frames::OfRobot { robot, logged_as, is_map, later, recoder } = &self.frames else {
            return Renamed::AsLogged;
        };
        copy.clear();
        let unnamed = if *is_map { "map" } else { "" };
        match recoder.rename_frames(message, &|frame| name(robot, logged_as.as_deref(), frame, unnamed), *later, copy) {
            Ok(true) => Renamed::Copied,
            Ok(false) => Renamed::AsLogged,
            Err(_) => Renamed::Unreadable,
        }
    }
}

/// The name of a frame of a robot that the log may call `logged_as`. An empty frame name is replaced by `unnamed`.
fn name<'a>(robot: &str, logged_as: Option<&str>, frame: &'a str, unnamed: &'static str) -> Cow<'a, str> {
    if robot.is_empty() {
        return Cow::Borrowed(frame);
    }
    let frame = if frame.is_empty() { unnamed } else { frame };
    let own = logged_as.and_then(|logged| frame.trim_start_matches('/').strip_prefix(logged)?.strip_prefix(['/', '_']));
    frame_of_robot(robot, own.unwrap_or(frame))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn channels_of_one_schema_share_it() {
        let channel = |topic: &str, text: &str| Channel {
            topic: topic.into(),
            message_encoding: "cdr".into(),
            schema_name: "a/msg/A".into(),
            schema_encoding: "ros2msg".into(),
            schema: text.into(),
            ..Default::default()
        };
        let mut recoders = Recoders::default();
        let mut of = |topic, text| recoders.of(&channel(topic, text)).unwrap();
        let one = of("/one", "string frame_id");
        assert!(Arc::ptr_eq(&one, &of("/two", "string frame_id")));
        assert!(!Arc::ptr_eq(&one, &of("/two", "string other_frame_id")));
    }
}
