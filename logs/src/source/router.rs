//! Routes each message of the logs to the port of its channel.

use super::channel::Stamp;
use super::channel_router::ChannelRouter;
use super::latched::{Latch, LatchedMessage, LatchedMessages};
use super::preview::learn_ahead;
use super::{RobotMessages, RobotReading};
use crate::names::{Names, Renamed};
use crate::one_map::OneMap;
use crate::reader::{Damage, LogFile, LogMessage};
use crate::reader::{SupplementKind, describes_its_file, read_attachment, read_metadata};
use crate::robots::{Role, robots_with_unread_maps};
use gridweave_runtime::ros::UnmergedRobot;
use gridweave_runtime::stage::{Output, RobotTopics, StageError};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// The target of a channel's messages.
#[derive(Clone, Copy)]
enum Target {
    /// The route of this index.
    Route(usize),
    /// Dropped: not selected, or cannot be passed on.
    Nothing,
}

/// Routes the messages of logs to output ports.
pub(crate) struct Router {
    names: Names,
    files: Arc<[LogFile]>,
    /// Buffer for a message whose frames were renamed.
    renamed: Vec<u8>,
    channels: ChannelRouter,
    /// By file and channel number: the target of the messages, once known.
    by_number: Vec<Vec<Option<Target>>>,
    has_sent_supplements: bool,
    /// The robots that localise in one map; `None` once they are sent.
    one_map: Option<OneMap>,
    /// Robots whose maps are all of types that are not read, and what is said of them; empty once they are sent.
    with_unread_maps: BTreeMap<String, String>,
}

impl Router {
    /// Creates a router for the messages of `files`. If `updates_maps`, whole maps are derived from map updates, and
    /// frames that are logged late are read ahead.
    pub(crate) fn new(
        robots: RobotTopics,
        names: Names,
        files: Arc<[LogFile]>,
        updates_maps: bool,
        reading: RobotReading,
    ) -> Self {
        let one_map = updates_maps.then(|| OneMap::read(&files, &names, &robots)).flatten();
        let pattern = robots.map.clone();
        let mut channels = ChannelRouter::new(robots, names.channels(), updates_maps, reading);
        channels.set_given_robots(names.given_robots());
        if updates_maps {
            learn_ahead(&files, &names, &mut channels);
        }
        let with_unread_maps = match updates_maps {
            true => robots_with_unread_maps(names.wanted_channels(), channels.roles(), &pattern),
            false => BTreeMap::new(),
        };
        Self {
            with_unread_maps,
            channels,
            names,
            renamed: Vec::new(),
            by_number: vec![Vec::new(); files.len()],
            files,
            has_sent_supplements: false,
            one_map,
        }
    }

    /// Robots with scans and without maps, sorted by name.
    pub(crate) fn scanned(&self) -> impl Iterator<Item = &str> {
        self.channels.roles().scanned()
    }

    /// Robots with maps, sorted by name.
    pub(crate) fn mapped(&self) -> impl Iterator<Item = &str> {
        self.channels.roles().mapped()
    }

    /// Sends a message. The output's log time must be the message's.
    pub(crate) fn send(&mut self, message: &LogMessage<'_>, output: &Output<RobotMessages>) -> Result<(), StageError> {
        let Some(route) = self.route(message, output)? else { return Ok(()) };
        let stamp = Stamp { sequence: message.sequence, publish_time: message.publish_time };
        let mut renamed = std::mem::take(&mut self.renamed);
        let data = self.named_data(message, &mut renamed, output);
        let sent = self.channels.send(route, stamp, data, output);
        self.renamed = renamed;
        sent
    }

    /// Sends the attachments and metadata records of all logs, once.
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
                // The files of a split bag, and robots of one fleet, may contain equal records.
                if kind == SupplementKind::Attachment || sent.insert(body.clone()) {
                    self.send_supplement(kind, &body, output)?;
                }
            }
        }
        Ok(())
    }

    /// Sends the robots of which nothing is merged, once: they localise in one map, or their maps are not read.
    pub(crate) fn send_unmerged(&mut self, output: &Output<RobotMessages>) -> Result<(), StageError> {
        for (robot, reason) in std::mem::take(&mut self.with_unread_maps) {
            if !output.localised.is_read() {
                output.warn(format!("there is no map of {robot}: {reason}"));
            }
            output.localised.send(&robot, &UnmergedRobot { robot: robot.clone(), reason })?;
        }
        let Some(one_map) = self.one_map.take() else { return Ok(()) };
        let reason = self.channels.learn_one_map(&one_map);
        one_map.note().into_iter().for_each(|note| output.warn(note));
        one_map.idle.iter().try_for_each(|robot| {
            output.localised.send(robot, &UnmergedRobot { robot: robot.clone(), reason: reason.clone() })
        })
    }

    fn send_supplement(
        &mut self,
        kind: SupplementKind,
        body: &[u8],
        output: &Output<RobotMessages>,
    ) -> Result<(), StageError> {
        let channel = kind.channel();
        match self.channels.add(channel, output) {
            Some(route) => self.channels.pass_on(route, Stamp { sequence: 0, publish_time: 0 }, body, output),
            None => Ok(()),
        }
    }

    /// The names of topics and frames.
    pub(crate) fn names(&self) -> &Names {
        &self.names
    }

    /// The message with its frames under the names of their robots.
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
                output.warn(format!(
                    "messages on `{topic}` do not match their type and keep the frame names that they were logged with"
                ));
                message.data
            }
        }
    }

    /// Handles a message before the start: stores it if it is latched, and learns its frames.
    pub(crate) fn keep(
        &mut self,
        message: &LogMessage<'_>,
        latched: &mut LatchedMessages,
        output: &Output<RobotMessages>,
    ) -> Result<(), StageError> {
        let Some(index) = self.route(message, output)? else { return Ok(()) };
        let Some((latch, role)) = self.channels.route(index).map(|route| (route.latch, route.role)) else {
            return Ok(());
        };
        if latch == Latch::No && !matches!(role, Role::Tf | Role::MapUpdate) {
            return Ok(());
        }
        let mut renamed = std::mem::take(&mut self.renamed);
        let message = LogMessage { data: self.named_data(message, &mut renamed, output), ..*message };
        latched.keep(index, latch, &message);
        self.channels.learn(index, message.data, output);
        self.renamed = renamed;
        Ok(())
    }

    /// Sends the maps whose origin the log has left undecided.
    pub(crate) fn send_undecided_maps(&mut self, output: &Output<RobotMessages>) -> Result<(), StageError> {
        self.channels.pass_undecided(false, output)
    }

    /// Sends the maps that were updated since they were last sent.
    pub(crate) fn send_updated_maps(&mut self, output: &Output<RobotMessages>) -> Result<(), StageError> {
        self.channels.send_updated_maps(output)
    }

    /// Sends a stored latched message.
    pub(crate) fn send_latched(
        &mut self,
        route: usize,
        kept: &LatchedMessage,
        output: &Output<RobotMessages>,
    ) -> Result<(), StageError> {
        let stamp = Stamp { sequence: kept.sequence, publish_time: kept.publish_time };
        self.channels.send_learnt(route, stamp, &kept.data, output)
    }

    /// The index of the message's route; `None` if it is not selected, if the log does not describe its channel, or if
    /// it cannot be passed on.
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
                let Some(index) = self.channels.add(channel, output) else { return Ok(None) };
                if let Some(why) = self.names.unrenamed_frames(message.file, message.channel) {
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

    /// Warns of expected messages that the logs do not contain.
    pub(crate) fn warn_of_missing(&self, output: &Output<RobotMessages>) {
        self.channels.warn_of_missing(output);
    }
}
