//! Sends each message of the logs to the port of its channel.

use super::RobotMessages;
use super::carry::{Carried, Carry, Latch};
use super::channel::Stamp;
use super::channel_router::ChannelRouter;
use crate::names::{Names, Renamed};
use crate::reader::{Damage, LogFile, LogMessage};
use crate::reader::{SupplementKind, describes_its_file, read_attachment, read_metadata};
use crate::robots::Role;
use gridweave_runtime::stage::{Output, RobotTopics, StageError};
use std::collections::BTreeSet;
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
    names: Names,
    files: Arc<[LogFile]>,
    /// A message whose frames have other names than in the log.
    renamed: Vec<u8>,
    channels: ChannelRouter,
    /// For every file and channel number: what becomes of its messages, once it is known.
    by_number: Vec<Vec<Option<Target>>>,
    has_sent_supplements: bool,
}

impl Router {
    /// Sends the messages of `files`, from which whole maps are made of updates if `updates_maps`.
    pub(crate) fn new(robots: RobotTopics, names: Names, files: Arc<[LogFile]>, updates_maps: bool) -> Self {
        Self {
            channels: ChannelRouter::new(robots, names.channels(), updates_maps),
            names,
            renamed: Vec::new(),
            by_number: vec![Vec::new(); files.len()],
            files,
            has_sent_supplements: false,
        }
    }

    /// Sends a message. The output's log time is the message's.
    pub(crate) fn send(&mut self, message: &LogMessage<'_>, output: &Output<RobotMessages>) -> Result<(), StageError> {
        let Some(route) = self.route(message, output)? else { return Ok(()) };
        let stamp = Stamp { sequence: message.sequence, publish_time: message.publish_time };
        let mut renamed = std::mem::take(&mut self.renamed);
        let data = self.named_data(message, &mut renamed, output);
        let sent = self.channels.send(route, stamp, data, output);
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
        match self.channels.add(channel, output)? {
            Some(route) => self.channels.pass_on(route, Stamp { sequence: 0, publish_time: 0 }, body, output),
            None => Ok(()),
        }
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
        let Some((latch, role)) = self.channels.route(index).map(|route| (route.latch, route.role)) else {
            return Ok(());
        };
        if latch == Latch::No && !matches!(role, Role::Tf | Role::MapUpdate) {
            return Ok(());
        }
        let mut renamed = std::mem::take(&mut self.renamed);
        let message = LogMessage { data: self.named_data(message, &mut renamed, output), ..*message };
        carry.keep(index, latch, &message);
        self.channels.learn(index, message.data, output);
        self.renamed = renamed;
        Ok(())
    }

    /// Sends the maps of which updates have come since they were last sent.
    pub(crate) fn send_updated_maps(&mut self, output: &Output<RobotMessages>) -> Result<(), StageError> {
        self.channels.send_updated_maps(output)
    }

    /// Sends a message that was kept.
    pub(crate) fn send_carried(
        &mut self,
        route: usize,
        carried: &Carried,
        output: &Output<RobotMessages>,
    ) -> Result<(), StageError> {
        let stamp = Stamp { sequence: carried.sequence, publish_time: carried.publish_time };
        self.channels.send_learnt(route, stamp, &carried.data, output)
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
                let Some(index) = self.channels.add(channel, output)? else { return Ok(None) };
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

    /// Warns of what the logs were expected to hold, and do not.
    pub(crate) fn warn_of_missing(&self, output: &Output<RobotMessages>) {
        self.channels.warn_of_missing(output);
    }
}
