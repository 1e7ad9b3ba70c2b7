//! The outbox of a sender: messages until the receiver has acknowledged them, independent of the network.
//!
//! One batch is in flight at a time: all pending messages, up to a size. It is sent again with the same bytes until it
//! is answered, so nothing is lost, duplicated or reordered, and on a slow connection batches grow instead of queues.
//! Messages beyond the limits are dropped and counted.

use super::difference::difference;
use super::wire::{Answer, Batch, Entry, Form, Link, Outcome, to_bytes};
use gridweave_logs::qos;
use gridweave_runtime::message::{LogTime, MessageHeader};
use std::collections::{BTreeMap, VecDeque};

/// The size at which a batch is full, bytes.
const BATCH_SIZE: usize = 128 * 1024;

/// The limits of the queue.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// The maximum number of pending messages of a topic.
    pub(super) messages: usize,
    /// The same for a topic with states, of which only the last message matters, such as maps.
    pub(super) states: usize,
}

/// The totals of a sender.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Totals {
    /// Messages that the receiver has acknowledged.
    pub(super) sent: u64,
    /// Messages that were dropped because the queue was full.
    pub(super) dropped: u64,
    /// Pending messages that were replaced by the last one of their topic after a restart of the receiver.
    pub(super) superseded: u64,
    /// Batches that were acknowledged.
    pub(super) batches: u64,
    /// The compressed size of these batches, bytes.
    pub(super) bytes: u64,
    /// The size of the messages in them, bytes.
    pub(super) message_bytes: u64,
}

/// The outbox of a sender.
#[derive(Debug)]
pub(super) struct Outbox {
    sender: String,
    session: u64,
    limits: Limits,
    links: Vec<Link>,
    /// The link of this end's own reports, which are not counted.
    report: Option<u32>,
    last_log_time: Option<LogTime>,
    /// The pending entries in order.
    waiting: BTreeMap<u64, Waiting>,
    next_order: u64,
    /// The topics by link and name.
    topics: BTreeMap<(u32, String), Topic>,
    /// The announced channels, by link and number.
    channels: BTreeMap<(u32, u32), Entry>,
    /// The receiver that has answered the handshake.
    receiver: Option<u64>,
    clock_offset: i64,
    /// The number of handshakes.
    handshake: u64,
    next_number: u64,
    in_flight: Option<Sent>,
    is_ended: bool,
    is_end_taken: bool,
    totals: Totals,
}

#[derive(Clone, Debug)]
struct Waiting {
    entry: Entry,
    /// Bytes of the message.
    size: u64,
}

/// The messages of one topic of a link.
#[derive(Debug, Default)]
struct Topic {
    /// The keys of its pending entries.
    waiting: VecDeque<u64>,
    /// The last message, to which the next one is sent as a difference if the topic has states.
    last: Option<(Entry, Vec<u8>)>,
}

#[derive(Debug)]
struct Sent {
    bytes: Vec<u8>,
    number: u64,
    is_end: bool,
    entries: Vec<(u64, Waiting)>,
}

impl Outbox {
    pub(super) fn new(sender: String, session: u64, links: Vec<Link>, limits: Limits) -> Self {
        Self {
            sender,
            session,
            limits,
            links,
            report: None,
            last_log_time: None,
            waiting: BTreeMap::new(),
            next_order: 0,
            topics: BTreeMap::new(),
            channels: BTreeMap::new(),
            receiver: None,
            clock_offset: 0,
            handshake: 1,
            next_number: 0,
            in_flight: None,
            is_ended: false,
            is_end_taken: false,
            totals: Totals::default(),
        }
    }

    /// Announces a channel of a link.
    pub(super) fn announce(&mut self, link: usize, number: u32, channel: Vec<u8>) {
        let header = MessageHeader { channel: number, ..Default::default() };
        let entry = entry(link, &header, Form::Channel, channel);
        if self.channels.insert((entry.link, number), entry.clone()).as_ref() != Some(&entry) {
            self.wait(entry, 0);
        }
    }

    /// Makes a link that of this end's own reports, which are not counted.
    pub(super) fn report_on(&mut self, link: usize) {
        self.report = u32::try_from(link).ok();
    }

    /// Adds a report, unless the previous one is still pending, or the stream has ended.
    ///
    /// # Errors
    /// There is not enough memory.
    pub(super) fn report(&mut self, header: &MessageHeader, bytes: &[u8]) -> Result<(), String> {
        let Some(link) = self.report.filter(|_| !self.is_ended) else { return Ok(()) };
        let key = (link, header.topic.as_str().to_owned());
        if self.topics.get(&key).is_some_and(|topic| !topic.waiting.is_empty()) {
            return Ok(());
        }
        self.put(key, entry(link as usize, header, Form::Whole, Vec::new()), bytes, true)
    }

    /// The log time of the last message that was pushed.
    pub(super) fn last_log_time(&self) -> Option<LogTime> {
        self.last_log_time
    }

    fn is_counted(&self, entry: &Entry) -> bool {
        entry.form != Form::Channel && Some(entry.link) != self.report
    }

    /// Adds a message of a link.
    ///
    /// # Errors
    /// There is not enough memory.
    pub(super) fn push(&mut self, link: usize, header: &MessageHeader, bytes: &[u8]) -> Result<(), String> {
        self.last_log_time = Some(header.log_time);
        let ros_type = self.links.get(link).map_or("", |link| link.ros_type.as_str());
        let is_state = qos::is_latched_result(header.topic.as_str(), ros_type);
        let entry = entry(link, header, Form::Whole, Vec::new());
        let key = (entry.link, entry.topic.clone());
        let most = if is_state { self.limits.states } else { self.limits.messages };
        self.drop_oldest(&key, is_state, most.max(1));
        self.put(key, entry, bytes, is_state)
    }

    /// Drops the oldest message of a full topic. States are sent as differences to the previous one, so all pending
    /// ones are dropped, and the next one is sent as a whole.
    fn drop_oldest(&mut self, key: &(u32, String), is_state: bool, most: usize) {
        let Some(topic) = self.topics.get_mut(key).filter(|topic| topic.waiting.len() >= most) else { return };
        let dropped: Vec<u64> = topic.waiting.drain(..if is_state { topic.waiting.len() } else { 1 }).collect();
        if is_state {
            topic.last = None;
        }
        for order in dropped {
            self.waiting.remove(&order);
            self.totals.dropped += 1;
        }
    }

    fn put(&mut self, key: (u32, String), entry: Entry, bytes: &[u8], is_state: bool) -> Result<(), String> {
        let topic = self.topics.entry(key.clone()).or_default();
        let mut pending = entry.clone();
        (pending.form, pending.bytes) = match (is_state, &topic.last) {
            (false, _) => (Form::Whole, bytes.to_vec()),
            (true, Some((_, last))) => (Form::Difference, difference(last, bytes).map_err(|error| error.to_string())?),
            (true, None) => (Form::Beginning, difference(&[], bytes).map_err(|error| error.to_string())?),
        };
        topic.last = Some((Entry { form: pending.form, ..entry }, bytes.to_vec()));
        let order = self.wait(pending, bytes.len() as u64);
        if let Some(topic) = self.topics.get_mut(&key) {
            topic.waiting.push_back(order);
        }
        Ok(())
    }

    fn wait(&mut self, entry: Entry, size: u64) -> u64 {
        let order = self.next_order;
        self.next_order += 1;
        self.waiting.insert(order, Waiting { entry, size });
        order
    }

    /// Ends the stream: nothing more will be pushed.
    pub(super) fn end(&mut self) {
        self.is_ended = true;
    }

    /// Whether the stream has ended.
    pub(super) fn is_ended(&self) -> bool {
        self.is_ended
    }

    /// Whether the receiver has acknowledged everything, including the end.
    pub(super) fn is_done(&self) -> bool {
        self.is_end_taken
    }

    /// The number of messages that the receiver has not acknowledged.
    pub(super) fn unacknowledged(&self) -> usize {
        let in_flight = self.in_flight.iter().flat_map(|sent| sent.entries.iter().map(|(_, waiting)| waiting));
        self.waiting.values().chain(in_flight).filter(|waiting| self.is_counted(&waiting.entry)).count()
    }

    pub(super) fn totals(&self) -> Totals {
        self.totals
    }

    /// Whether the next batch is a handshake.
    pub(super) fn is_handshake(&self) -> bool {
        self.receiver.is_none()
    }

    /// Whether there is something to send.
    fn has_batch(&self) -> bool {
        self.in_flight.is_some()
            || self.receiver.is_none()
            || !self.waiting.is_empty()
            || (self.is_ended && !self.is_end_taken)
    }

    /// The batch to be sent to the receiver with the given number; a handshake if it is another one than before.
    ///
    /// # Errors
    /// There is not enough memory.
    pub(super) fn batch_for(&mut self, receiver: u64) -> Result<Option<&[u8]>, String> {
        if self.receiver.is_some_and(|before| before != receiver) {
            self.restart()?;
        }
        self.batch()
    }

    /// The batch to be sent, the same until it is answered; none if nothing is pending.
    ///
    /// # Errors
    /// There is not enough memory.
    pub(super) fn batch(&mut self) -> Result<Option<&[u8]>, String> {
        if self.in_flight.is_none() && self.has_batch() {
            let entries = if self.receiver.is_some() { self.take_waiting() } else { Vec::new() };
            let is_end = self.is_ended && self.waiting.is_empty() && self.receiver.is_some();
            let batch = Batch {
                sender: self.sender.clone(),
                session: self.session,
                handshake: self.handshake,
                number: self.next_number,
                receiver: self.receiver.unwrap_or(0),
                clock_offset: self.clock_offset,
                dropped: self.totals.dropped + self.totals.superseded,
                is_end,
                links: if self.receiver.is_none() { self.links.clone() } else { Vec::new() },
                entries: entries.iter().map(|(_, waiting)| waiting.entry.clone()).collect(),
            };
            let bytes = to_bytes(&batch)?;
            self.in_flight = Some(Sent { bytes, number: batch.number, is_end, entries });
        }
        Ok(self.in_flight.as_ref().map(|sent| sent.bytes.as_slice()))
    }

    fn take_waiting(&mut self) -> Vec<(u64, Waiting)> {
        let (mut entries, mut size) = (Vec::new(), 0);
        while size < BATCH_SIZE
            && let Some((order, waiting)) = self.waiting.pop_first()
        {
            size += waiting.entry.bytes.len();
            if let Some(topic) = self.topics.get_mut(&(waiting.entry.link, waiting.entry.topic.clone())) {
                topic.waiting.retain(|other| *other != order);
            }
            entries.push((order, waiting));
        }
        entries
    }

    /// Handles an answer of the receiver. The answer to a handshake gives the clock offset of the receiver.
    ///
    /// # Errors
    /// The receiver cannot read the batch, or there is not enough memory.
    pub(super) fn answered(&mut self, answer: &Answer, clock_offset: Option<i64>) -> Result<(), String> {
        let Some(sent) = self.in_flight.take_if(|sent| sent.number == answer.number) else { return Ok(()) };
        match (answer.outcome, self.receiver) {
            (Outcome::Taken, None) => {
                self.receiver = Some(answer.receiver);
                self.clock_offset = clock_offset.unwrap_or(self.clock_offset);
                self.next_number = 1;
                Ok(())
            }
            (Outcome::Taken, Some(receiver)) if receiver == answer.receiver => {
                self.next_number += 1;
                self.is_end_taken |= sent.is_end;
                self.totals.batches += 1;
                self.totals.bytes += sent.bytes.len() as u64;
                for (_, waiting) in &sent.entries {
                    self.totals.sent += u64::from(self.is_counted(&waiting.entry));
                    self.totals.message_bytes += waiting.size;
                }
                Ok(())
            }
            (Outcome::Taken | Outcome::Unknown, _) => {
                self.in_flight = Some(sent);
                self.restart()
            }
            (Outcome::Unreadable, _) => {
                self.in_flight = Some(sent);
                self.restart()?;
                Err(answer.text.clone())
            }
        }
    }

    /// Restarts with a handshake for another receiver, followed by the pending entries, those in flight, and the last
    /// message of each topic.
    ///
    /// # Errors
    /// There is not enough memory.
    fn restart(&mut self) -> Result<(), String> {
        (self.receiver, self.next_number, self.is_end_taken) = (None, 0, false);
        self.handshake += 1;
        let in_flight = self.in_flight.take().map(|sent| sent.entries).unwrap_or_default();
        for (order, waiting) in in_flight.into_iter().rev() {
            if let Some(topic) = self.topics.get_mut(&(waiting.entry.link, waiting.entry.topic.clone())) {
                topic.waiting.push_front(order);
            }
            self.waiting.insert(order, waiting);
        }
        self.waiting.retain(|_, waiting| waiting.entry.form != Form::Channel);
        // Channels come first.
        let rest = std::mem::take(&mut self.waiting);
        let mut orders = BTreeMap::new();
        for channel in self.channels.values().cloned().collect::<Vec<_>>() {
            self.wait(channel, 0);
        }
        for (order, waiting) in rest {
            orders.insert(order, self.wait(waiting.entry, waiting.size));
        }
        for topic in self.topics.values_mut() {
            topic.waiting = topic.waiting.iter().filter_map(|order| orders.get(order).copied()).collect();
        }
        self.resend_last()
    }

    fn resend_last(&mut self) -> Result<(), String> {
        for key in self.topics.keys().cloned().collect::<Vec<_>>() {
            let Some(topic) = self.topics.get_mut(&key) else { continue };
            let Some((entry, _)) = &topic.last else { continue };
            let is_state = entry.form != Form::Whole;
            // Pending states are differences to messages that the receiver does not have.
            let superseded = if is_state { std::mem::take(&mut topic.waiting) } else { VecDeque::new() };
            if let Some((entry, bytes)) = topic.last.take_if(|_| is_state || topic.waiting.is_empty()) {
                self.totals.superseded += superseded.len().saturating_sub(1) as u64;
                for order in superseded {
                    self.waiting.remove(&order);
                }
                self.put(key, entry, &bytes, is_state)?;
            }
        }
        Ok(())
    }
}

fn entry(link: usize, header: &MessageHeader, form: Form, bytes: Vec<u8>) -> Entry {
    Entry::new(u32::try_from(link).unwrap_or(u32::MAX), header, form, bytes)
}
