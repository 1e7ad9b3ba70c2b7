//! The reading end of a live link.

use super::sender::origin;
use super::service::{HELD_SAMPLES, LinkShape, PortBoard, REPEAT_ROOM};
use crate::link::board::{MAX_SENDERS, NOTHING_HEARD, StageBoard, StageNumber, StageState, WireNumber};
use crate::link::shared::{HeldSamples, LinkError, RunNames, SampleHeader, WakeEvents, Waker, unpack};
use crate::message::{LogTime, Message, MessageFlags};
use crate::pipeline::Overflow;
use iceoryx2::node::Node;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::CallbackProgression;
use iceoryx2::service::Service;
use iceoryx2::service::port_factory::PortFactory as _;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use std::collections::BTreeMap;

/// What has come from one sender.
#[derive(Clone, Copy, Debug)]
struct Heard {
    /// Whether all that it has sent was meant for this reader: not if that was started again.
    is_for_all: bool,
    /// The number of the first message that was not repeated.
    first: u64,
    /// Which number comes next.
    next: u64,
    /// The number of the last repeated message, and how many there were.
    repeated: Option<u64>,
    repeats: u64,
}

impl Heard {
    fn new(is_for_all: bool) -> Self {
        Self { is_for_all, first: u64::MAX, next: 0, repeated: None, repeats: 0 }
    }

    /// Notes a message. Gives whether it has not come before, and how many more are missing: less than 0 if it is one
    /// that was missing.
    fn note(&mut self, sequence: u64, is_repeated: bool) -> (bool, i64) {
        let is_begun = self.first != u64::MAX;
        if is_repeated {
            let is_new = sequence < self.first && self.repeated.is_none_or(|last| sequence > last);
            if is_new {
                self.repeated = Some(sequence);
                self.repeats += 1;
            }
            return (is_new, -i64::from(is_new && is_begun && self.is_for_all));
        }
        let missing = match (is_begun, self.is_for_all) {
            (true, _) => sequence.saturating_sub(self.next),
            (false, true) => sequence.saturating_sub(self.repeats),
            (false, false) => 0,
        };
        let missing = i64::try_from(missing).unwrap_or(i64::MAX);
        self.first = self.first.min(sequence);
        self.next = sequence.saturating_add(1);
        (true, missing)
    }
}

/// A message that waits for its turn.
pub(crate) struct Arrived {
    /// When it was sent, on the monotonic clock, nanoseconds.
    pub(crate) sent_at: u64,
    /// The message.
    pub(crate) message: Message,
}

/// The reader of a link: one wire of a stage.
pub struct ReaderEnd {
    /// Where the stage notes how far it is.
    pub board: StageBoard,
    /// Which of its wires this is.
    pub wire: usize,
    /// How far it may be behind.
    pub depth: usize,
    /// Its number among all readers of the stage that owns the link.
    pub number: usize,
    /// How many these are.
    pub owner_readers: usize,
}

/// One wire of a stage over a live link.
pub struct LiveReceiver<S: Service> {
    service: PortFactory<S, [u8], SampleHeader>,
    subscriber: Subscriber<S, [u8], SampleHeader>,
    name: String,
    reader: ReaderEnd,
    owner: PortBoard,
    /// How to wake the owner.
    waker: Waker<S>,
    greeted: bool,
    /// For each slot of the board the sender that it is given to, 0 for none.
    slots: [u64; MAX_SENDERS],
    heard: BTreeMap<u64, Heard>,
    head: Option<Arrived>,
    /// How many samples were taken since the owner was last woken for room.
    taken: usize,
    ended: Option<LogTime>,
    done: bool,
    held: HeldSamples,
}

impl<S: Service + 'static> LiveReceiver<S> {
    /// The reading end of a link that is the output port `owner`, whose stage is woken by `waker`.
    pub fn new(
        node: &Node<S>,
        names: &RunNames,
        shape: &LinkShape<'_>,
        reader: ReaderEnd,
        owner: PortBoard,
        waker: Waker<S>,
    ) -> Result<Self, LinkError> {
        let name = shape.name();
        let service = shape.open(node, names)?;
        let room = match shape.overflow {
            Overflow::Wait => reader.depth + REPEAT_ROOM,
            Overflow::DropOldest => reader.depth,
        };
        let subscriber = service.subscriber_builder().buffer_size(room).create();
        let subscriber = subscriber.map_err(|e| LinkError::shared(format!("subscribe to {name}"))(&e))?;
        Ok(Self {
            service,
            subscriber,
            name,
            reader,
            owner,
            waker,
            greeted: false,
            slots: [0; MAX_SENDERS],
            heard: BTreeMap::new(),
            head: None,
            taken: 0,
            ended: None,
            done: false,
            held: HeldSamples::default(),
        })
    }

    /// Connects to senders that have come, and forgets those that have gone.
    pub(crate) fn connect(&mut self) -> Result<(), LinkError> {
        let mut present = [0; MAX_SENDERS];
        let mut count = 0;
        self.service.dynamic_config().list_publishers(|publisher| {
            if let Some(place) = present.get_mut(count) {
                *place = origin(publisher.publisher_id.value());
                count += 1;
            }
            CallbackProgression::Continue
        });
        let is_same = present[..count].iter().all(|sender| self.slots.contains(sender))
            && self.slots.iter().filter(|sender| **sender != 0).count() == count;
        if is_same {
            return Ok(());
        }
        self.subscriber.update_connections().map_err(|e| self.failed("connect to", &e))?;
        for (slot, sender) in self.slots.iter_mut().enumerate() {
            // What a sender that has gone had sent may still wait: its numbers are kept.
            if *sender != 0 && !present.contains(sender) {
                *sender = 0;
                self.reader.board.set_origin(self.reader.wire, slot, 0, 0);
            }
        }
        for sender in present[..count].iter().filter(|sender| **sender != 0) {
            let free = self.slots.iter().position(|slot| *slot == 0);
            if let Some(slot) = free.filter(|_| !self.slots.contains(sender)) {
                self.slots[slot] = *sender;
                let next = self.heard.get(sender).map_or(NOTHING_HEARD, |heard| heard.next);
                self.reader.board.set_origin(self.reader.wire, slot, *sender, next);
            }
        }
        if !self.greeted && count > 0 {
            self.greeted = true;
            self.count_lost();
            // An owner that is not there has nothing to repeat.
            let _ = self.waker.wake(self.events().credit(self.reader.number));
        }
        Ok(())
    }

    /// Counts as dropped what was sent while a stage was away that was started again.
    fn count_lost(&self) {
        let had =
            [WireNumber::Taken, WireNumber::Dropped].map(|number| self.reader.board.get_wire(self.reader.wire, number));
        let lost = self.owner.board.sent(self.owner.port).saturating_sub(had.iter().sum());
        if self.reader.board.get(StageNumber::Restarts) > 0 {
            self.reader.board.add_wire(self.reader.wire, WireNumber::Dropped, lost);
        }
    }

    /// The message whose turn it is, if one has arrived.
    pub(crate) fn head(&mut self) -> Result<Option<&Arrived>, LinkError> {
        while self.head.is_none() && !self.done {
            let Some(sample) = self.subscriber.receive().map_err(|e| self.failed("receive from", &e))? else {
                // The owner's last word may come before what others have sent. A reader that was started again after it
                // does not hear it.
                self.done = self.ended.is_some() || self.owner.board.state() == StageState::Ended;
                if self.done && !self.greeted {
                    self.greeted = true;
                    self.count_lost();
                }
                break;
            };
            let header = *sample.user_header();
            let flags = header.message.flags;
            if flags.contains(MessageFlags::END) {
                self.ended = Some(header.message.log_time);
            }
            let is_for_all = self.reader.board.get(StageNumber::Restarts) == 0;
            let heard = self.heard.entry(header.origin).or_insert_with(|| Heard::new(is_for_all));
            let (is_new, missing) = heard.note(header.message.sequence, flags.contains(MessageFlags::REPEATED));
            let slot = self.slots.iter().position(|slot| *slot == header.origin);
            if let Some(slot) = slot.filter(|_| heard.first != u64::MAX) {
                self.reader.board.set_next(self.reader.wire, slot, heard.next);
            }
            self.taken += 1;
            if 2 * self.taken >= self.reader.depth
                && self.reader.board.get_wire(self.reader.wire, WireNumber::OwnerWaits) != 0
            {
                self.taken = 0;
                self.reader.board.set_wire(self.reader.wire, WireNumber::OwnerWaits, 0);
                let _ = self.waker.wake(WakeEvents::DATA);
            }
            if missing != 0 {
                let dropped =
                    self.reader.board.get_wire(self.reader.wire, WireNumber::Dropped).saturating_add_signed(missing);
                self.reader.board.set_wire(self.reader.wire, WireNumber::Dropped, dropped);
            }
            let is_data = flags.contains(MessageFlags::DATA);
            if !is_new || !(is_data || flags.contains(MessageFlags::CHANNEL)) {
                continue;
            }
            if is_data {
                self.reader.board.add_wire(self.reader.wire, WireNumber::Taken, 1);
            }
            let storage = self.held.hold(sample, HELD_SAMPLES - 2);
            let mut arrived = None;
            unpack(&header, storage, &self.name, |message| {
                arrived = Some(Arrived { sent_at: header.sent_at, message: message.on_wire(self.reader.wire) });
            })?;
            self.head = arrived;
            self.reader.board.set_wire(self.reader.wire, WireNumber::Waiting, 1);
        }
        Ok(self.head.as_ref())
    }

    /// Takes the message whose turn it is.
    pub(crate) fn take(&mut self) -> Option<Arrived> {
        self.reader.board.set_wire(self.reader.wire, WireNumber::Waiting, 0);
        self.head.take()
    }

    /// Whether the owner has ended the link and all that was sent is taken.
    pub(crate) fn is_done(&self) -> bool {
        self.done
    }

    /// The log time that the owner had come to at the end.
    pub(crate) fn end_time(&self) -> LogTime {
        self.ended.unwrap_or_default()
    }

    /// Acknowledges the end of the stream.
    pub(crate) fn acknowledge(&self) {
        // An owner that has gone needs no word.
        let _ = self.waker.wake(self.events().acknowledged(self.reader.number));
    }

    /// The meaning of the owner's events.
    fn events(&self) -> WakeEvents {
        WakeEvents::new(self.reader.owner_readers)
    }

    fn failed(&self, doing: &str, cause: &dyn std::fmt::Debug) -> LinkError {
        LinkError::shared(format!("{doing} {}", self.name))(cause)
    }
}

#[cfg(test)]
mod tests {
    use super::Heard;

    #[test]
    fn what_was_had_already_is_left_out_and_what_is_missing_counted() {
        let mut heard = Heard::new(false);
        assert_eq!(heard.note(5, false), (true, 0), "what came before the reader is not missing");
        assert_eq!(heard.note(6, false), (true, 0));
        assert_eq!(heard.note(9, false), (true, 2));
        assert_eq!(heard.note(6, true), (false, 0));
        assert_eq!(heard.note(2, true), (true, 0), "from before the reader came");
        assert_eq!(heard.note(4, true), (true, 0));
        assert_eq!(heard.note(2, true), (false, 0), "repeated once more");
        assert_eq!(heard.note(10, false), (true, 0));
    }

    #[test]
    fn repeated_messages_may_come_first() {
        let mut heard = Heard::new(false);
        assert_eq!([3, 7, 3].map(|sequence| heard.note(sequence, true).0), [true, true, false]);
        assert_eq!(heard.note(8, false), (true, 0));
    }

    #[test]
    fn a_reader_that_was_there_from_the_beginning_misses_the_first_messages_as_well() {
        let mut heard = Heard::new(true);
        assert_eq!(heard.note(1, true), (true, 0));
        assert_eq!(heard.note(4, false), (true, 3), "0, 2 and 3");
        assert_eq!(heard.note(3, true), (true, -1), "it came after all");
        assert_eq!(heard.note(3, true), (false, 0));
        assert_eq!(heard.note(6, false), (true, 1));
    }
}
