//! Sends each message of the logs to the port of its channel.

use super::RobotMessages;
use super::carry::{Carried, Carry, Latch};
use super::channel::{Route, Stamp};
use super::derived::Derived;
use super::route::{RobotChannels, Role};
use crate::names::{Names, Renamed};
use crate::reader::{Damage, LogFile, LogMessage};
use crate::schemas::full_type_name;
use crate::supplement::{SupplementKind, describes_its_file, read_attachment, read_metadata};
use gridweave_runtime::message::{Channel, FixedText, MessageHeader};
use gridweave_runtime::ros::{OccupancyGrid, RosMessage};
use gridweave_runtime::stage::{Output, RobotTopics, StageError};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// What becomes of the messages of a channel.
#[derive(Clone, Copy)]
enum Target {
    /// They take the route of this index.
    Route(usize),
    /// Nobody asked for them, or they cannot be passed on.
    Nothing,
}

/// Sends messages to the ports that their channels call for.
pub(crate) struct Router {
    robots: RobotTopics,
    roles: RobotChannels,
    names: Names,
    files: Arc<[LogFile]>,
    /// A message whose frames have other names than in the log.
    renamed: Vec<u8>,
    routes: Vec<Route>,
    /// For every file and channel number: what becomes of its messages, once it is known.
    by_number: Vec<Vec<Option<Target>>>,
    by_channel: BTreeMap<Channel, usize>,
    derived: Derived,
    has_sent_supplements: bool,
}

impl Router {
    /// Sends the messages of `files`, from which whole maps are made of updates if `updates_maps`.
    pub(crate) fn new(robots: RobotTopics, names: Names, files: Arc<[LogFile]>, updates_maps: bool) -> Self {
        let roles = RobotChannels::new(robots.clone(), names.channels());
        Self {
            derived: Derived::new(&robots, &roles, updates_maps),
            roles,
            names,
            renamed: Vec::new(),
            robots,
            by_number: vec![Vec::new(); files.len()],
            files,
            routes: Vec::new(),
            by_channel: BTreeMap::new(),
            has_sent_supplements: false,
        }
    }

    /// Sends a message. The output's log time is the message's.
    pub(crate) fn send(&mut self, message: &LogMessage<'_>, output: &Output<RobotMessages>) -> Result<(), StageError> {
        let Some(route) = self.route(message, output)? else { return Ok(()) };
        let stamp = Stamp { sequence: message.sequence, publish_time: message.publish_time };
        let mut renamed = std::mem::take(&mut self.renamed);
        let data = self.named_data(message, &mut renamed, output);
        let sent = self.send_on(route, stamp, data, output).and_then(|()| match self.routes.get(route) {
            Some(route) => self.derived.send_map_if_due(route, &self.roles, data, output),
            None => Ok(()),
        });
        self.renamed = renamed;
        sent
    }

    /// Sends the attachments and metadata records of all logs, if that has not been done yet.
    pub(crate) fn send_supplements(&mut self, output: &Output<RobotMessages>) -> Result<(), StageError> {
        if std::mem::replace(&mut self.has_sent_supplements, true) {
            return Ok(());
        }
        let files = Arc::clone(&self.files);
        let mut sent = BTreeSet::new();
        for file in files.iter() {
            for (kind, body) in file.supplements() {
                let is_whole = match (kind, body.as_deref()) {
                    (_, None) => false,
                    (SupplementKind::Attachment, Some(body)) => read_attachment(body).is_some(),
                    (SupplementKind::Metadata, Some(body)) => match read_metadata(body) {
                        Some((name, _)) if describes_its_file(&name) => continue,
                        _ => true,
                    },
                };
                let Some(body) = body.filter(|_| is_whole) else {
                    output.warn(format!("{}: {}", file.path().display(), Damage::BadAttachment));
                    continue;
                };
                // The files of a split bag, and robots of one fleet, have some records in common.
                if kind == SupplementKind::Attachment || sent.insert(body.clone()) {
                    self.send_supplement(kind, &body, output)?;
                }
            }
        }
        Ok(())
    }

    fn send_supplement(
        &mut self,
        kind: SupplementKind,
        body: &[u8],
        output: &Output<RobotMessages>,
    ) -> Result<(), StageError> {
        let channel = kind.channel();
        let index = match self.by_channel.get(&channel) {
            Some(&index) => Some(index),
            None => self.add_route(channel, output)?,
        };
        let Some(route) = index.and_then(|index| self.routes.get_mut(index)) else { return Ok(()) };
        route.send(Stamp { sequence: 0, publish_time: 0 }, body, &output.other, output.log_time())
    }

    /// How topics and frames are called.
    pub(crate) fn names(&self) -> &Names {
        &self.names
    }

    /// The message with the names that its frames have beside those of other robots.
    fn named_data<'a>(
        &self,
        message: &LogMessage<'a>,
        renamed: &'a mut Vec<u8>,
        output: &Output<RobotMessages>,
    ) -> &'a [u8] {
        match self.names.rename_frames(message, renamed) {
            Renamed::Copied => renamed,
            Renamed::AsLogged => message.data,
            Renamed::Unreadable => {
                let topic = self.names.channel(message.file, message.channel).map_or("", |channel| &channel.topic);
                output
                    .warn(format!("messages on `{topic}` do not fit their type, and name frames as they were logged"));
                message.data
            }
        }
    }

    /// Takes up a message before the start: keeps what is latched, and learns the frames.
    pub(crate) fn keep(
        &mut self,
        message: &LogMessage<'_>,
        carry: &mut Carry,
        output: &Output<RobotMessages>,
    ) -> Result<(), StageError> {
        let Some(index) = self.route(message, output)? else { return Ok(()) };
        let Some(route) = self.routes.get(index) else { return Ok(()) };
        if route.latch == Latch::No && !matches!(route.role, Role::Tf | Role::MapUpdate) {
            return Ok(());
        }
        let mut renamed = std::mem::take(&mut self.renamed);
        let message = LogMessage { data: self.named_data(message, &mut renamed, output), ..*message };
        carry.keep(index, route.latch, &message);
        self.derived.learn(route, &self.roles, message.data, output);
        self.renamed = renamed;
        Ok(())
    }

    /// Sends the maps of which updates have come since they were last sent.
    pub(crate) fn send_updated_maps(&mut self, output: &Output<RobotMessages>) -> Result<(), StageError> {
        self.derived.send_updated_maps(output)
    }

    /// Sends a message that was kept.
    pub(crate) fn send_carried(
        &mut self,
        route: usize,
        carried: &Carried,
        output: &Output<RobotMessages>,
    ) -> Result<(), StageError> {
        let stamp = Stamp { sequence: carried.sequence, publish_time: carried.publish_time };
        self.send_on(route, stamp, &carried.data, output)
    }

    fn send_on(
        &mut self,
        index: usize,
        stamp: Stamp,
        data: &[u8],
        output: &Output<RobotMessages>,
    ) -> Result<(), StageError> {
        let Some(route) = self.routes.get_mut(index) else { return Ok(()) };
        self.derived.learn_map_frame(route, data);
        match route.role {
            Role::Map => route.send(stamp, data, &output.map, output.log_time()),
            Role::Tags => route.send(stamp, data, &output.tags, output.log_time()),
            Role::Topology => route.send(stamp, data, &output.topology, output.log_time()),
            Role::MapUpdate
            | Role::Pose(_)
            | Role::Odometry
            | Role::TagMessage
            | Role::Scan
            | Role::Tf
            | Role::Other => route.send(stamp, data, &output.other, output.log_time()),
        }?;
        self.derived.send(route, data, output)
    }

    /// The index of the message's route; `None` if nobody asked for it, if the log does not describe its channel, or if it
    /// cannot be passed on.
    fn route(&mut self, message: &LogMessage<'_>, output: &Output<RobotMessages>) -> Result<Option<usize>, StageError> {
        let number = usize::from(message.channel);
        match self.by_number.get(message.file).and_then(|file| file.get(number).copied().flatten()) {
            Some(Target::Route(index)) => return Ok(Some(index)),
            Some(Target::Nothing) => return Ok(None),
            None => {}
        }
        let Some(file) = self.files.get(message.file) else { return Ok(None) };
        let Some(channel) = self.names.channel(message.file, message.channel).cloned() else {
            let damage = Damage::UnknownChannel { channel: message.channel };
            output.warn(format!("{}: {damage}", file.path().display()));
            return Ok(None);
        };
        let target = match self.names.wants(message.file, message.channel) {
            false => Target::Nothing,
            true => {
                let index = match self.by_channel.get(&channel) {
                    Some(&index) => index,
                    None => match self.add_route(channel, output)? {
                        Some(index) => index,
                        None => return Ok(None),
                    },
                };
                if let Some(why) = self.names.frames_left(message.file, message.channel) {
                    output.warn(why);
                }
                Target::Route(index)
            }
        };
        if let Some(file) = self.by_number.get_mut(message.file) {
            file.resize(file.len().max(number + 1), None);
            file[number] = Some(target);
        }
        Ok(match target {
            Target::Route(index) => Some(index),
            Target::Nothing => None,
        })
    }

    /// Adds a route for a channel; `None` if its name is too long, and nothing that this program does needs it.
    fn add_route(&mut self, channel: Channel, output: &Output<RobotMessages>) -> Result<Option<usize>, StageError> {
        let index = self.routes.len();
        let doing = |what: &str| format!("read the topic `{}`: its {what} is too long", channel.topic);
        let classified = self.roles.classify(&channel);
        let topic = match FixedText::new(&channel.topic) {
            Err(error) if classified.role == Role::Other => {
                output.warn(format!("messages on a topic were left out: its name {error}"));
                return Ok(None);
            }
            topic => topic.map_err(|error| StageError::new(doing("name"), error))?,
        };
        let robot = match FixedText::new(classified.robot) {
            // What is passed on as it is needs no robot.
            Err(_) if classified.role == Role::Other => FixedText::EMPTY,
            robot => robot.map_err(|error| StageError::new(doing("robot's name"), error))?,
        };
        let header = MessageHeader {
            // 0 stands for messages that no log has described.
            channel: index as u32 + 1,
            robot,
            topic,
            ..Default::default()
        };
        if let Some(mismatch) = classified.mismatch {
            output.warn(mismatch);
        }
        let (role, robot) = (classified.role, classified.robot.to_owned());
        self.by_channel.insert(channel.clone(), index);
        let latch = Latch::of(&channel, role == Role::Map);
        let tag_reader = self.roles.tag_reader(&channel).filter(|_| role == Role::TagMessage);
        self.routes.push(Route {
            channel,
            role,
            robot,
            tag_reader,
            header,
            latch,
            announced: false,
            messages: 0,
            unreadable: 0,
        });
        Ok(Some(index))
    }

    /// Warns of what the logs were expected to hold, and do not.
    pub(crate) fn warn_of_missing(&self, output: &Output<RobotMessages>) {
        let routed = |role: fn(Role) -> bool| {
            self.routes.iter().any(|route| role(route.role) && route.messages > route.unreadable)
        };
        let draws_maps = output.scans.is_read() && routed(|role| role == Role::Scan);
        if output.map.is_read() && !draws_maps && !routed(|role| role == Role::Map) {
            let is_map = |route: &&Route| full_type_name(&route.channel.schema_name) == OccupancyGrid::NAME;
            let topics: Vec<_> = self.routes.iter().filter(is_map).map(|route| route.channel.topic.as_str()).collect();
            let others =
                if topics.is_empty() { String::new() } else { format!(" (there are maps on {})", topics.join(", ")) };
            output.warn(format!("no map was found: no topic fits `{}`{others}", self.robots.map));
        }
        if output.pose.is_read()
            && !routed(|role| matches!(role, Role::Pose(_)))
            && !self.derived.has_inferred_poses()
            && !self.derived.has_odometry()
        {
            match &self.robots.tf {
                Some(frames) => output.warn(format!(
                    "no pose was found: tf never ties `{}` to `{}`",
                    frames.base_frame, frames.map_frame
                )),
                None => output.warn(format!("no pose was found: no topic fits `{}`", self.robots.pose)),
            }
        }
        if output.tags.is_read() && !routed(|role| role == Role::Tags) && !self.derived.has_made_readings() {
            output.warn(format!("no reading of a tag was found: no topic fits `{}`", self.robots.tags));
        }
        if output.pose.is_read() && !self.derived.has_odometry() {
            self.derived.warn_of_missing_poses(output);
        }
    }
}
