//! What a sender has to send, until the receiver has taken it.
//!
//! It knows no network. One batch is on its way at a time: all that was waiting, up to a size. It is sent again, the same bytes,
//! until it is answered; so nothing is lost, doubled or overtaken, and on a slow link batches grow instead of queues. What
//! waits beyond what may is dropped, and counted.

use super::difference::difference;
use super::wire::{Answer, Batch, Entry, Form, Link, Outcome, to_bytes};
use gridweave_logs::qos;
use gridweave_runtime::message::{LogTime, MessageHeader};
use std::collections::{BTreeMap, VecDeque};

/// A batch takes no further entries when it has this many bytes.
const BATCH_SIZE: usize = 128 * 1024;

/// How much may wait.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// Messages of a topic.
    pub(super) messages: usize,
    /// The same of a topic whose last message is all that holds, such as a map.
    pub(super) states: usize,
}

/// What a sender has done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Totals {
    /// Messages that were taken by the receiver.
    pub(super) sent: u64,
    /// Messages that were dropped because there was no room.
    pub(super) dropped: u64,
    /// Messages that waited for a receiver that began anew, and were left out for the last of their topic.
    pub(super) superseded: u64,
    /// Batches that were taken.
    pub(super) batches: u64,
    /// Bytes of these batches, as they were sent.
    pub(super) bytes: u64,
    /// Bytes of the messages in them.
    pub(super) message_bytes: u64,
}

/// What is to be sent.
#[derive(Debug)]
pub(super) struct Outbox {
    sender: String,
    session: u64,
    limits: Limits,
    links: Vec<Link>,
    /// The link of what this end has to tell of itself, which is not counted with what it was given.
    report: Option<u32>,
    last_log_time: Option<LogTime>,
    /// What waits, in its order.
    waiting: BTreeMap<u64, Waiting>,
    next_order: u64,
    /// By link and topic.
    topics: BTreeMap<(u32, String), Topic>,
    /// The channels that were announced, by link and number.
    channels: BTreeMap<(u32, u32), Entry>,
    /// The receiver that has answered the greeting.
    receiver: Option<u64>,
    clock_offset: i64,
    /// How often it has begun anew.
    greeting: u64,
    next_number: u64,
    on_its_way: Option<Sent>,
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
    /// Which of those that wait are its own.
    waiting: VecDeque<u64>,
    /// The last message: the next is told by what it has new, if the topic is one of states.
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
            greeting: 1,
            next_number: 0,
            on_its_way: None,
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

    /// Makes a link one of what this end has to tell of itself: it is not counted.
    pub(super) fn report_on(&mut self, link: usize) {
        self.report = u32::try_from(link).ok();
    }

    /// Tells something of this end, unless what it has told before still waits, or the end was said.
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

    /// The log time of the last message that it was given.
    pub(super) fn last_log_time(&self) -> Option<LogTime> {
        self.last_log_time
    }

    fn is_counted(&self, entry: &Entry) -> bool {
        entry.form != Form::Channel && Some(entry.link) != self.report
    }

    /// Takes a message of a link.
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
        self.make_room(&key, is_state, most.max(1));
        self.put(key, entry, bytes, is_state)
    }

    /// Drops the oldest of a topic. A state is told by the difference to the one before it: of them all that wait go, for one that
    /// is told as a whole.
    fn make_room(&mut self, key: &(u32, String), is_state: bool, most: usize) {
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
        let mut told = entry.clone();
        (told.form, told.bytes) = match (is_state, &topic.last) {
            (false, _) => (Form::Whole, bytes.to_vec()),
            (true, Some((_, last))) => (Form::Difference, difference(last, bytes).map_err(|error| error.to_string())?),
            (true, None) => (Form::Beginning, difference(&[], bytes).map_err(|error| error.to_string())?),
        };
        topic.last = Some((Entry { form: told.form, ..entry }, bytes.to_vec()));
        let order = self.wait(told, bytes.len() as u64);
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

    /// Nothing more will be pushed.
    pub(super) fn end(&mut self) {
        self.is_ended = true;
    }

    /// Whether nothing more will be pushed.
    pub(super) fn is_ended(&self) -> bool {
        self.is_ended
    }

    /// Whether the receiver has taken all, and the end.
    pub(super) fn is_done(&self) -> bool {
        self.is_end_taken
    }

    /// How many messages the receiver has not taken.
    pub(super) fn untaken(&self) -> usize {
        let on_its_way = self.on_its_way.iter().flat_map(|sent| sent.entries.iter().map(|(_, waiting)| waiting));
        self.waiting.values().chain(on_its_way).filter(|waiting| self.is_counted(&waiting.entry)).count()
    }

    pub(super) fn totals(&self) -> Totals {
        self.totals
    }

    /// Whether the next batch is a greeting.
    pub(super) fn is_greeting(&self) -> bool {
        self.receiver.is_none()
    }

    /// Whether there is something to send.
    fn has_batch(&self) -> bool {
        self.on_its_way.is_some()
            || self.receiver.is_none()
            || !self.waiting.is_empty()
            || (self.is_ended && !self.is_end_taken)
    }

    /// The batch to be sent to the receiver of the given number. One that is another than before is greeted.
    ///
    /// # Errors
    /// There is not enough memory.
    pub(super) fn batch_for(&mut self, receiver: u64) -> Result<Option<&[u8]>, String> {
        if self.receiver.is_some_and(|before| before != receiver) {
            self.begin_anew()?;
        }
        self.batch()
    }

    /// The batch to be sent, the same until it is answered; none if there is nothing to send.
    ///
    /// # Errors
    /// There is not enough memory.
    pub(super) fn batch(&mut self) -> Result<Option<&[u8]>, String> {
        if self.on_its_way.is_none() && self.has_batch() {
            let entries = if self.receiver.is_some() { self.take_waiting() } else { Vec::new() };
            let is_end = self.is_ended && self.waiting.is_empty() && self.receiver.is_some();
            let batch = Batch {
                sender: self.sender.clone(),
                session: self.session,
                greeting: self.greeting,
                number: self.next_number,
                receiver: self.receiver.unwrap_or(0),
                clock_offset: self.clock_offset,
                dropped: self.totals.dropped + self.totals.superseded,
                is_end,
                links: if self.receiver.is_none() { self.links.clone() } else { Vec::new() },
                entries: entries.iter().map(|(_, waiting)| waiting.entry.clone()).collect(),
            };
            let bytes = to_bytes(&batch)?;
            self.on_its_way = Some(Sent { bytes, number: batch.number, is_end, entries });
        }
        Ok(self.on_its_way.as_ref().map(|sent| sent.bytes.as_slice()))
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

    /// The receiver has answered. A greeting that it has taken tells by how much its clock is ahead.
    ///
    /// # Errors
    /// The receiver cannot read what it was sent, and says why. There is not enough memory.
    pub(super) fn answered(&mut self, answer: &Answer, clock_offset: Option<i64>) -> Result<(), String> {
        let Some(sent) = self.on_its_way.take_if(|sent| sent.number == answer.number) else { return Ok(()) };
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
                self.on_its_way = Some(sent);
                self.begin_anew()
            }
            (Outcome::Unreadable, _) => {
                self.on_its_way = Some(sent);
                self.begin_anew()?;
                Err(answer.text.clone())
            }
        }
    }

    /// Greets again, and then sends what waits, what was on its way, and the last message of each topic: the receiver is another
    /// than before, and has nothing of it.
    ///
    /// # Errors
    /// There is not enough memory.
    fn begin_anew(&mut self) -> Result<(), String> {
        (self.receiver, self.next_number, self.is_end_taken) = (None, 0, false);
        self.greeting += 1;
        let on_its_way = self.on_its_way.take().map(|sent| sent.entries).unwrap_or_default();
        for (order, waiting) in on_its_way.into_iter().rev() {
            if let Some(topic) = self.topics.get_mut(&(waiting.entry.link, waiting.entry.topic.clone())) {
                topic.waiting.push_front(order);
            }
            self.waiting.insert(order, waiting);
        }
        self.waiting.retain(|_, waiting| waiting.entry.form != Form::Channel);
        // Channels come before all else.
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
        self.send_last_again()
    }

    fn send_last_again(&mut self) -> Result<(), String> {
        for key in self.topics.keys().cloned().collect::<Vec<_>>() {
            let Some(topic) = self.topics.get_mut(&key) else { continue };
            let Some((entry, _)) = &topic.last else { continue };
            let is_state = entry.form != Form::Whole;
            // Of states those that wait are differences to what the receiver has not.
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
