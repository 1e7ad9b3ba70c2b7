//! The receiver's state for its senders, independent of the network.
//!
//! It takes the batches of each sender in order, each once, and restores the original messages.
//!
//! The number of senders and what is kept for them are limited, for announced sessions apart from others: an honest
//! sender announces its session, and does not compete with invented ones.

use super::difference::{MAX_SIZE, message};
use super::wire::{Answer, Batch, Entry, Form, Link, Outcome, from_bytes};
use gridweave_runtime::message::{Channel, LogTime, MessageHeader};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// The limits for announced senders.
const OF_ANNOUNCED: IngestLimits = IngestLimits { senders: 1000, kept: 512 << 20 };
/// The limits for others. A sender is one of them until the network has told of its session.
const OF_OTHERS: IngestLimits = IngestLimits { senders: 100, kept: 64 << 20 };
/// The maximum size of the restored messages of a batch, bytes. They are in memory together.
const MAX_RESTORED: usize = 512 << 20;

/// The maximum number of senders, and of bytes that are kept for all of them: their links, and their last messages.
#[derive(Clone, Copy, Debug)]
struct IngestLimits {
    senders: usize,
    kept: usize,
}

/// An item of a batch.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Item {
    /// The messages of this link with the header's channel were logged on this one.
    Channel { link: Arc<Link>, number: u32, channel: Channel },
    /// A message.
    Message { link: Arc<Link>, header: MessageHeader, bytes: Vec<u8> },
}

/// The contents of a batch.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Taken {
    /// The name of the sender; empty if it cannot be read.
    pub(super) sender: String,
    pub(super) session: u64,
    /// The items that are no duplicates.
    pub(super) items: Vec<Item>,
    /// The number of messages that the sender has dropped since the previous batch.
    pub(super) dropped: u64,
    /// The new clock correction for the sender, nanoseconds, if it has changed; 0 if its clock is right.
    pub(super) clock: Option<i64>,
    /// Whether the sender has ended.
    pub(super) is_end: bool,
    /// The error, if the batch cannot be read.
    pub(super) wrong: Option<String>,
}

/// The receiver's state for its senders.
#[derive(Debug)]
pub(super) struct Ingest {
    receiver: u64,
    /// The maximum clock offset without correction, nanoseconds.
    tolerance: i64,
    /// The senders by session.
    senders: BTreeMap<u64, Sender>,
    /// The announced sessions.
    announced: BTreeSet<u64>,
}

#[derive(Debug, Default)]
struct Sender {
    links: Vec<Arc<Link>>,
    /// The number of the sender's last handshake.
    handshake: u64,
    /// The number of the next batch.
    next: u64,
    /// The correction added to the times of the sender, nanoseconds.
    correction: i64,
    dropped: u64,
    /// The last message of each link and topic whose messages are sent as differences.
    known: BTreeMap<(u32, String), Vec<u8>>,
}

impl Ingest {
    pub(super) fn new(receiver: u64, tolerance: i64) -> Self {
        Self { receiver, tolerance, senders: BTreeMap::new(), announced: BTreeSet::new() }
    }

    /// A session is announced until it is forgotten.
    pub(super) fn announce(&mut self, session: u64) {
        self.announced.insert(session);
    }

    /// Removes the state of a sender.
    pub(super) fn forget(&mut self, session: u64) {
        self.senders.remove(&session);
        self.announced.remove(&session);
    }

    /// Takes a batch. Returns its contents, and the answer to send once these were forwarded.
    pub(super) fn take(&mut self, bytes: &[u8]) -> (Taken, Answer) {
        let mut taken = Taken::default();
        let (number, outcome) = match from_bytes::<Batch>(bytes) {
            Ok(batch) => {
                (taken.sender, taken.session) = (batch.sender.clone(), batch.session);
                (batch.number, self.take_batch(batch, &mut taken))
            }
            Err(wrong) => (0, Err(wrong)),
        };
        taken.wrong = outcome.as_ref().err().cloned();
        let text = taken.wrong.clone().unwrap_or_default();
        let outcome = outcome.unwrap_or(Outcome::Unreadable);
        (taken, Answer { receiver: self.receiver, number, outcome, came: 0, answered: 0, text })
    }

    /// Puts the contents of a batch into `taken`. The error is why the batch cannot be taken.
    fn take_batch(&mut self, batch: Batch, taken: &mut Taken) -> Result<Outcome, String> {
        let known = self.senders.get(&batch.session).map(|sender| (sender.handshake, sender.next));
        // A delayed batch was taken before, or its messages were sent again after a restart.
        if known.is_some_and(|known| (batch.handshake, batch.number) < known) {
            return Ok(Outcome::Taken);
        }
        if batch.number == 0 {
            return self.take_handshake(batch);
        }
        let (limits, _, kept) = self.share_of(batch.session);
        let room = limits.kept.saturating_sub(kept);
        let is_next = known == Some((batch.handshake, batch.number)) && batch.receiver == self.receiver;
        let Some(sender) = self.senders.get_mut(&batch.session).filter(|_| is_next) else {
            return Ok(Outcome::Unknown);
        };
        let offset = batch.clock_offset;
        if offset.saturating_sub(sender.correction).saturating_abs() > self.tolerance {
            sender.correction = if offset.saturating_abs() > self.tolerance { offset } else { 0 };
            taken.clock = Some(sender.correction);
        }
        match sender.items(batch.entries, room) {
            Ok(items) => {
                sender.next += 1;
                (taken.items, taken.is_end) = (items, batch.is_end);
                taken.dropped = batch.dropped.saturating_sub(std::mem::replace(&mut sender.dropped, batch.dropped));
                Ok(Outcome::Taken)
            }
            Err(wrong) => {
                // The state of the sender is incomplete.
                self.senders.remove(&batch.session);
                Err(wrong)
            }
        }
    }

    /// Stores the links of a sender, from the first batch of a handshake.
    fn take_handshake(&mut self, batch: Batch) -> Result<Outcome, String> {
        let links_size: usize = batch.links.iter().map(size_of).sum();
        let is_new = !self.senders.contains_key(&batch.session);
        let (limits, senders, kept) = self.share_of(batch.session);
        if (is_new && senders >= limits.senders) || kept.saturating_add(links_size) > limits.kept {
            return Err("there are too many senders, or they have too many links".to_owned());
        }
        let links = batch.links.into_iter().map(Arc::new).collect();
        let Sender { correction, dropped, .. } = self.senders.remove(&batch.session).unwrap_or_default();
        let known = BTreeMap::new();
        let sender = Sender { links, handshake: batch.handshake, next: 1, correction, dropped, known };
        self.senders.insert(batch.session, sender);
        Ok(Outcome::Taken)
    }

    /// The limits for a session, and of those senders that share them the number, and the bytes that are kept.
    fn share_of(&self, session: u64) -> (IngestLimits, usize, usize) {
        let is_announced = self.announced.contains(&session);
        let sharing = self.senders.iter().filter(|(other, _)| self.announced.contains(other) == is_announced);
        let (senders, kept) = sharing.fold((0, 0), |(count, kept), (_, sender)| (count + 1, kept + sender.kept()));
        (if is_announced { OF_ANNOUNCED } else { OF_OTHERS }, senders, kept)
    }
}

/// The memory of a link or of a kept message beside its texts and bytes, roughly.
const LINK: usize = 64;

/// The number of bytes that a link takes.
fn size_of(link: &Link) -> usize {
    link.port.len() + link.ros_type.len() + LINK
}

impl Sender {
    /// The number of bytes that are kept.
    fn kept(&self) -> usize {
        let links: usize = self.links.iter().map(|link| size_of(link)).sum();
        links + self.known.iter().map(|((_, topic), bytes)| topic.len() + bytes.len() + LINK).sum::<usize>()
    }

    /// The items of a batch, of which at most `room` more bytes are kept.
    fn items(&mut self, entries: Vec<Entry>, mut room: usize) -> Result<Vec<Item>, String> {
        let mut left = MAX_RESTORED;
        entries.into_iter().map(|entry| self.item(entry, &mut left, &mut room)).collect()
    }

    fn item(&mut self, entry: Entry, left: &mut usize, room: &mut usize) -> Result<Item, String> {
        let link = self.links.get(entry.link as usize).cloned();
        let link = link.ok_or_else(|| format!("it has no link {}", entry.link))?;
        let text = |error: &dyn std::fmt::Display| format!("a message on `{}`: {error}", entry.topic);
        if entry.form == Form::Channel {
            let channel = Channel::decode(&entry.bytes).map_err(|error| text(&error))?;
            return Ok(Item::Channel { link, number: entry.channel, channel });
        }
        let corrected = |time: u64| time.saturating_add_signed(self.correction);
        let header = entry.header().map_err(|error| text(&error))?;
        let log_time = LogTime(corrected(entry.log_time));
        let header = MessageHeader { log_time, publish_time: corrected(entry.publish_time), ..header };
        let nothing = Vec::new();
        let key = (entry.link, entry.topic.clone());
        let known = match entry.form {
            Form::Difference => self.known.get(&key).ok_or_else(|| text(&"the previous message is unknown"))?,
            Form::Whole | Form::Beginning | Form::Channel => &nothing,
        };
        if entry.form == Form::Whole {
            return Ok(Item::Message { link, header, bytes: entry.bytes });
        }
        let before = self.known.get(&key).map_or(0, |known| known.len() + key.1.len() + LINK);
        let bytes = message(known, &entry.bytes, MAX_SIZE.min(*left)).map_err(|error| text(&error))?;
        *left -= bytes.len();
        let after = bytes.len() + key.1.len() + LINK;
        *room = (*room + before).checked_sub(after).ok_or_else(|| text(&"the senders have too many large messages"))?;
        self.known.insert(key, bytes.clone());
        Ok(Item::Message { link, header, bytes })
    }
}
