//! Routes the messages of robots that join and leave during a run.

use super::channel::Stamp;
use super::channel_router::ChannelRouter;
use super::live_frames::LiveFrames;
use super::{RobotMessages, RobotReading};
use crate::names::{NamedChannel, Renamed};
use crate::robots::Role;
use crate::tf::{is_static, tf_topic};
use gridweave_runtime::message::Channel;
use gridweave_runtime::ros::{OccupancyGrid, TagRange, TopologicalMap, decode};
use gridweave_runtime::stage::{Output, RobotTopics, StageError, match_robot};

/// Routes live messages to the ports of a source. Channels are added one by one. Topics and frames are put under the
/// names of their robots, as for logs.
pub struct LiveRouter {
    /// Topics whose messages are passed on even if no stage uses them.
    also: Vec<String>,
    channels: Vec<LiveChannel>,
    router: ChannelRouter,
    frames: LiveFrames,
    /// Buffer for a message whose frames were renamed.
    renamed: Vec<u8>,
}

/// A channel as received, and under the name of its robot.
struct LiveChannel {
    original: Channel,
    named: NamedChannel,
}

/// A received message.
#[derive(Clone, Copy, Debug)]
pub struct LiveMessage<'a> {
    /// The sequence number of its sender.
    pub sequence: u32,
    /// The time of publication, nanoseconds.
    pub publish_time: u64,
    /// The message, encoded.
    pub data: &'a [u8],
}

impl LiveRouter {
    /// Creates a router without channels. `robots` are the topic patterns; messages on the topics `also`, in which
    /// `{robot}` matches one part of the path, are passed on unchanged.
    pub fn new(robots: RobotTopics, also: Vec<String>, reading: RobotReading) -> Self {
        Self {
            also,
            channels: Vec::new(),
            router: ChannelRouter::live(robots, reading),
            frames: LiveFrames::default(),
            renamed: Vec::new(),
        }
    }

    /// Adds a channel. Returns its number, which is the same for equal channels. Adding a channel may change which
    /// other channels are used.
    pub fn add(&mut self, channel: Channel) -> usize {
        if let Some(known) = self.channels.iter().position(|known| known.original == channel) {
            return known;
        }
        let named = NamedChannel::new(channel.clone(), String::new(), false, 0, true);
        self.channels.push(LiveChannel { original: channel, named });
        self.router.set_channels(self.channels.iter().map(|known| &known.original));
        self.name_channels();
        self.channels.len() - 1
    }

    /// Whether anything uses the messages of a channel. There is no need to subscribe to other channels.
    pub fn is_of_use(&self, number: usize) -> bool {
        let is_of_use =
            |channel: &LiveChannel| self.role(channel) != Role::Other || self.is_asked_for(&channel.original);
        self.channels.get(number).is_some_and(is_of_use)
    }

    /// Whether the messages of a channel are passed on even if no stage uses them.
    pub fn is_asked_for(&self, channel: &Channel) -> bool {
        let fits = |topic: &String| *topic == channel.topic || match_robot(topic, &channel.topic).is_some();
        self.also.iter().any(fits)
    }

    /// The robot of a channel with scans. They are used until a channel with maps of the robot is added.
    pub fn scanning_robot<'a>(&self, channel: &'a Channel) -> Option<&'a str> {
        self.router.roles().scanning_robot(channel)
    }

    /// Why the channel's role is not the one that its topic suggests.
    pub fn mismatch(&self, number: usize) -> Option<String> {
        self.router.roles().classify(&self.channels.get(number)?.original).mismatch
    }

    /// Whether the messages of a channel are whole maps, of which only the latest is needed.
    pub fn is_map(&self, number: usize) -> bool {
        self.channels.get(number).is_some_and(|channel| self.role(channel) == Role::Map)
    }

    /// Whether a channel belongs to one robot, so that two programs that publish on it are two robots with the same
    /// name.
    pub fn is_of_one_robot(&self, number: usize) -> bool {
        let of_one = |role| matches!(role, Role::Map | Role::MapUpdate | Role::Pose(_) | Role::Odometry | Role::Scan);
        self.channels.get(number).is_some_and(|channel| of_one(self.role(channel)))
    }

    /// Sends a message of a channel. The output's log time must be the message's. A message that does not match its
    /// type is dropped and counted as a warning; a message on a channel that is no longer used is dropped.
    ///
    /// # Errors
    /// The link has failed.
    pub fn send(
        &mut self,
        number: usize,
        message: LiveMessage<'_>,
        output: &Output<RobotMessages>,
    ) -> Result<(), StageError> {
        if !self.is_of_use(number) {
            return Ok(());
        }
        self.learn_frames(number, message.data, output)?;
        let Some(channel) = self.channels.get(number) else { return Ok(()) };
        let role = self.role(channel);
        let data = match channel.named.rename_frames(message.data, &mut self.renamed) {
            Renamed::Copied => &self.renamed,
            Renamed::AsLogged => message.data,
            Renamed::Unreadable => {
                leave_out(&channel.original, output);
                return Ok(());
            }
        };
        if !is_readable(role, data) {
            leave_out(&channel.original, output);
            return Ok(());
        }
        if let Some(why) = channel.named.unrenamed_frames() {
            output.warn(why);
        }
        let Some(route) = self.router.add(channel.named.channel.clone(), output) else { return Ok(()) };
        let stamp = Stamp { sequence: message.sequence, publish_time: message.publish_time };
        self.router.send(route, stamp, data, output)
    }

    /// Sends the maps with unsent updates. The output's log time must be theirs.
    ///
    /// # Errors
    /// The link has failed.
    pub fn send_updated_maps(&mut self, output: &Output<RobotMessages>) -> Result<(), StageError> {
        self.router.send_updated_maps(output)
    }

    /// Learns which robots the frames in transforms of all robots follow, and renames them from now on.
    fn learn_frames(&mut self, number: usize, data: &[u8], output: &Output<RobotMessages>) -> Result<(), StageError> {
        let Some(channel) = self.channels.get(number) else { return Ok(()) };
        let classified = self.router.roles().classify(&channel.original);
        let has_changed = match classified.role {
            Role::Map => self.frames.note_map(classified.robot, data),
            Role::Tf if channel.named.is_shared_tf() => {
                self.frames.note_transforms(number, is_static(&channel.original.topic), data)
            }
            _ => false,
        };
        if !has_changed {
            return Ok(());
        }
        self.share_frames();
        // Of static transforms nothing more comes.
        for (number, data) in self.frames.kept() {
            let Some(channel) = self.channels.get(*number) else { continue };
            if channel.named.rename_frames(data, &mut self.renamed) == Renamed::Copied
                && let Some(route) = self.router.add(channel.named.channel.clone(), output)
            {
                self.router.learn(route, &self.renamed, output);
            }
        }
        Ok(())
    }

    fn share_frames(&mut self) {
        let all = self.channels.iter_mut().map(|channel| &mut channel.named);
        all.filter(|named| named.is_shared_tf()).for_each(|named| named.share_frames(self.frames.shared().cloned()));
    }

    fn role(&self, channel: &LiveChannel) -> Role {
        self.router.roles().classify(&channel.original).role
    }

    /// Puts the frames of each channel under its robot, and the transforms of one robot on the topic shared by all
    /// robots.
    fn name_channels(&mut self) {
        for channel in &mut self.channels {
            let classified = self.router.roles().classify(&channel.original);
            let is_map = matches!(classified.role, Role::Map | Role::MapUpdate);
            let is_robots = is_map
                || matches!(classified.role, Role::Pose(_) | Role::Odometry | Role::TagMessage | Role::Scan)
                || tf_topic(&channel.original).is_some();
            let robot = if is_robots { tf_topic(&channel.original).unwrap_or(classified.robot) } else { "" };
            let mut named = channel.original.clone();
            if tf_topic(&named).is_some() {
                named.topic = if is_static(&named.topic) { "/tf_static" } else { "/tf" }.to_owned();
            }
            channel.named = NamedChannel::new(named, robot.to_owned(), is_map, 0, true);
        }
        self.share_frames();
    }
}

/// Whether a message that stages get unchanged can be decoded; other messages are checked where they are converted.
fn is_readable(role: Role, data: &[u8]) -> bool {
    match role {
        Role::Map => decode::<OccupancyGrid<'_>>(data).is_ok(),
        Role::Tags => decode::<TagRange>(data).is_ok(),
        Role::Topology => decode::<TopologicalMap>(data).is_ok(),
        _ => true,
    }
}

fn leave_out(channel: &Channel, output: &Output<RobotMessages>) {
    let type_name = &channel.schema_name;
    output.warn(format!("messages on `{}` that do not match their type {type_name} were dropped", channel.topic));
}
