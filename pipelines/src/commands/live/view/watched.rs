//! What the links of a run tell of its merge.

use crate::commands::live::link_choice::{Link, all_links};
use crate::commands::live::running::Running;
use crate::merge_log::MergeState;
use anyhow::Result;
use gridweave_runtime::engine::WatchedLink;
use gridweave_runtime::message::{Channel, LogTime, Message, MessageFlags};
use gridweave_runtime::stage::{PortType, RobotTopics};
use std::collections::BTreeMap;

/// A run that is watched, and what is known of its merge.
pub(super) struct WatchedRun {
    links: Vec<Watched>,
    topics: RobotTopics,
    /// What is known.
    pub(super) state: MergeState,
    /// The first and the last log time of what came.
    span: Option<(LogTime, LogTime)>,
}

/// A link, and the types of its messages.
struct Watched {
    link: WatchedLink,
    /// That of the port, for messages that come on no channel of their own.
    port_type: PortType,
    /// By the number that was announced.
    announced: BTreeMap<u32, Channel>,
    /// The channels of the port's own messages, by topic.
    own: BTreeMap<String, Channel>,
}

impl WatchedRun {
    /// Watches all links of a run.
    ///
    /// # Errors
    /// A link cannot be watched: the run has gone, or too many look on.
    pub(super) fn open(running: &Running) -> Result<Self> {
        let open = |Link { stage, port }: Link| -> Result<Watched> {
            let port_type = running.pipeline.stages[stage].kind.outputs[port].port_type;
            let link = WatchedLink::open(&running.run, &running.pipeline, stage, port)?;
            Ok(Watched { link, port_type, announced: BTreeMap::new(), own: BTreeMap::new() })
        };
        let links = all_links(&running.pipeline).into_iter().map(open).collect::<Result<_>>()?;
        let topics = running.pipeline.robots.clone();
        Ok(Self { links, topics, state: MergeState::default(), span: None })
    }

    /// Takes up what has passed. Gives whether anything came.
    ///
    /// # Errors
    /// A link cannot be read.
    pub(super) fn take(&mut self) -> Result<bool> {
        let mut came = false;
        for watched in &mut self.links {
            let mut passed = Vec::new();
            watched.link.take(|_, message| passed.push(message))?;
            for message in &passed {
                let Some(channel) = watched.channel(message) else { continue };
                // A message that cannot be read tells nothing; the stages that read it say so.
                came |= self.state.take(channel, &self.topics, message.bytes()).is_ok();
                let time = message.header().log_time;
                let (first, last) = self.span.get_or_insert((time, time));
                (*first, *last) = ((*first).min(time), (*last).max(time));
            }
        }
        Ok(came)
    }

    /// How much log time has passed, seconds.
    pub(super) fn seconds(&self) -> f64 {
        self.span.map_or(0.0, |(first, last)| last.seconds_since(first))
    }

    /// How many messages it was too slow for.
    pub(super) fn missed(&self) -> u64 {
        self.links.iter().map(|watched| watched.link.missed()).sum()
    }
}

impl Watched {
    /// The channel of a message; none of an announcement, or of what is of no known type.
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
        if !self.own.contains_key(topic) {
            let (message_encoding, schema_name) = ("cdr".to_owned(), name.to_owned());
            let channel = Channel { topic: topic.to_owned(), message_encoding, schema_name, ..Default::default() };
            self.own.insert(topic.to_owned(), channel);
        }
        self.own.get(topic)
    }
}
