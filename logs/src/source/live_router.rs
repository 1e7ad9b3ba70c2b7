//! Sends the messages of robots that come and go while a run goes on.

use super::RobotMessages;
use super::channel::Stamp;
use super::channel_router::ChannelRouter;
use crate::names::{NamedChannel, Renamed};
use crate::robots::Role;
use crate::tf::{is_static, tf_topic};
use gridweave_runtime::message::Channel;
use gridweave_runtime::ros::{OccupancyGrid, TagRange, TopologicalMap, decode};
use gridweave_runtime::stage::{Output, RobotTopics, StageError, match_robot};

/// Sends messages to the ports of a source as they come, of channels that become known one by one. Topics and frames get the
/// names of their robots as those of logs do.
pub struct LiveRouter {
    /// Topics of which messages are passed on although nothing is made of them.
    also: Vec<String>,
    channels: Vec<LiveChannel>,
    router: ChannelRouter,
    /// A message whose frames have other names than it came with.
    renamed: Vec<u8>,
}

/// A channel as it came, and as it is called beside those of other robots.
struct LiveChannel {
    original: Channel,
    named: NamedChannel,
}

/// A message that has come.
#[derive(Clone, Copy, Debug)]
pub struct LiveMessage<'a> {
    /// Its number among those of its sender.
    pub sequence: u32,
    /// When it was sent, nanoseconds.
    pub publish_time: u64,
    /// The message, encoded.
    pub data: &'a [u8],
}

impl LiveRouter {
    /// Nothing is known yet. `robots` says how topics are told apart; messages on the topics `also`, in which `{robot}` stands for
    /// any one part, are passed on as they are.
    pub fn new(robots: RobotTopics, also: Vec<String>) -> Self {
        Self { also, channels: Vec::new(), router: ChannelRouter::live(robots), renamed: Vec::new() }
    }

    /// Takes up a channel, of which there may be messages from here on. Gives its number, the same for the same channel. What
    /// others are of use for may change with it.
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

    /// Whether anything is made of the messages of a channel: others need not be asked for.
    pub fn is_of_use(&self, number: usize) -> bool {
        let is_of_use =
            |channel: &LiveChannel| self.role(channel) != Role::Other || self.is_asked_for(&channel.original);
        self.channels.get(number).is_some_and(is_of_use)
    }

    /// Whether the messages of a channel are passed on even if nothing is made of them.
    pub fn is_asked_for(&self, channel: &Channel) -> bool {
        let fits = |topic: &String| *topic == channel.topic || match_robot(topic, &channel.topic).is_some();
        self.also.iter().any(fits)
    }

    /// The robot whose scans a channel holds. They are of use as long as no channel with maps of the robot was added.
    pub fn scanning_robot<'a>(&self, channel: &'a Channel) -> Option<&'a str> {
        self.router.roles().scanning_robot(channel)
    }

    /// Why a channel is not what its topic lets one expect.
    pub fn mismatch(&self, number: usize) -> Option<String> {
        self.router.roles().classify(&self.channels.get(number)?.original).mismatch
    }

    /// Whether the messages of a channel are whole maps, of which only the last counts.
    pub fn is_map(&self, number: usize) -> bool {
        self.channels.get(number).is_some_and(|channel| self.role(channel) == Role::Map)
    }

    /// Whether a channel tells of one robot alone, so that two programs that send on it are two robots of one name.
    pub fn is_of_one_robot(&self, number: usize) -> bool {
        let of_one = |role| matches!(role, Role::Map | Role::MapUpdate | Role::Pose(_) | Role::Odometry | Role::Scan);
        self.channels.get(number).is_some_and(|channel| of_one(self.role(channel)))
    }

    /// Sends a message of a channel. The output's log time is the message's. One that does not fit its type is left out, and
    /// counted as a warning; one of a channel that is of no use any more is left out as well.
    ///
    /// # Errors
    /// The link has failed.
    pub fn send(
        &mut self,
        number: usize,
        message: LiveMessage<'_>,
        output: &Output<RobotMessages>,
    ) -> Result<(), StageError> {
        let Some(channel) = self.channels.get(number).filter(|_| self.is_of_use(number)) else { return Ok(()) };
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
        if let Some(why) = channel.named.frames_left() {
            output.warn(why);
        }
        let Some(route) = self.router.add(channel.named.channel.clone(), output)? else { return Ok(()) };
        let stamp = Stamp { sequence: message.sequence, publish_time: message.publish_time };
        self.router.send(route, stamp, data, output)
    }

    /// Sends the maps whose updates have not been sent. The output's log time is theirs.
    ///
    /// # Errors
    /// The link has failed.
    pub fn send_updated_maps(&mut self, output: &Output<RobotMessages>) -> Result<(), StageError> {
        self.router.send_updated_maps(output)
    }

    fn role(&self, channel: &LiveChannel) -> Role {
        self.router.roles().classify(&channel.original).role
    }

    /// Puts the frames of each channel under the robot that it is about, and transforms of one robot where those of all are.
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
    }
}

/// Whether a message can be read that stages are given as it came; those that others are made of are seen to where that is done.
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
    output.warn(format!("messages on `{}` that do not fit their type, {type_name}, were left out", channel.topic));
}
