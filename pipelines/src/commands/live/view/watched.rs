//! The state of the merge, from the links of a run.

use crate::commands::live::link_choice::{Link, all_links};
use crate::commands::live::running::Running;
use crate::merge_log::MergeState;
use anyhow::Result;
use gridweave_runtime::engine::WatchedLink;
use gridweave_runtime::message::{Channel, LogTime, Message, MessageFlags};
use gridweave_runtime::stage::{PortType, RobotTopics};
use std::collections::BTreeMap;

/// A watched run and the state of its merge.
pub(super) struct WatchedRun {
    links: Vec<TypedLink>,
    topics: RobotTopics,
    /// The state of the merge.
    pub(super) state: MergeState,
    /// The first and the last log time of the messages.
    span: Option<(LogTime, LogTime)>,
}

/// A watched link and the types of its messages.
struct TypedLink {
    link: WatchedLink,
    /// The type of the port, for messages without an announced channel.
    port_type: PortType,
    /// Announced channels by number.
    announced: BTreeMap<u32, Channel>,
    /// Channels of messages without an announced channel, by topic.
    typed: BTreeMap<String, Channel>,
}

impl WatchedRun {
    /// Watches all links of a run.
    ///
    /// # Errors
    /// A link cannot be watched: the run has ended, or it has too many watchers.
    pub(super) fn open(running: &Running) -> Result<Self> {
        let open = |Link { stage, port }: Link| -> Result<TypedLink> {
            let port_type = running.pipeline.stages[stage].kind.outputs[port].port_type;
            let link = WatchedLink::open(&running.run, &running.pipeline, stage, port)?;
            Ok(TypedLink { link, port_type, announced: BTreeMap::new(), typed: BTreeMap::new() })
        };
        let links = all_links(&running.pipeline).into_iter().map(open).collect::<Result<_>>()?;
        let topics = running.pipeline.robots.clone();
        Ok(Self { links, topics, state: MergeState::default(), span: None })
    }

    /// Ingests the messages since the last call. Returns whether there were any.
    ///
    /// # Errors
    /// A link cannot be read.
    pub(super) fn take(&mut self) -> Result<bool> {
        let mut has_changed = false;
        for watched in &mut self.links {
            let mut passed = Vec::new();
            watched.link.take(|_, message| passed.push(message))?;
            for message in &passed {
                let Some(channel) = watched.channel(message) else { continue };
                // A message that cannot be decoded is left out; the stages that read it warn of it.
                has_changed |= self.state.take(channel, &self.topics, message.bytes()).is_ok();
                let time = message.header().log_time;
                let (first, last) = self.span.get_or_insert((time, time));
                (*first, *last) = ((*first).min(time), (*last).max(time));
            }
        }
        Ok(has_changed)
    }

    /// Duration of the log time, seconds.
    pub(super) fn seconds(&self) -> f64 {
        self.span.map_or(0.0, |(first, last)| last.seconds_since(first))
    }

    /// Number of messages that were missed because the watcher was too slow.
    pub(super) fn missed(&self) -> u64 {
        self.links.iter().map(|watched| watched.link.missed()).sum()
    }
}

impl TypedLink {
    /// The channel of a message; `None` for an announcement or an unknown type.
    fn channel(&mut self, message: &Message) -> Option<&Channel> {
        let header = message.header();
        if header.flags.contains(MessageFlags::CHANNEL) {
            if let Ok(channel) = Channel::decode(message.bytes()) {
                self.announced.insert(header.channel, channel);
            }
            return None;
        }
        if header.channel != 0 && self.announced.contains_key(&header.channel) {
            return self.announced.get(&header.channel);
        }
        let PortType::Ros(name) = self.port_type else { return None };
        let topic = header.topic.as_str();
        if !self.typed.contains_key(topic) {
            let (message_encoding, schema_name) = ("cdr".to_owned(), name.to_owned());
            let channel = Channel { topic: topic.to_owned(), message_encoding, schema_name, ..Default::default() };
            self.typed.insert(topic.to_owned(), channel);
        }
        self.typed.get(topic)
    }
}
