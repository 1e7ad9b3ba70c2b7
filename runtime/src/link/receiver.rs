//! The reading end of a link.

use super::board::MAX_SENDERS;
use super::heap::HeapLink;
use super::heard::Heard;
use super::held::HeldSamples;
use super::protocol::NOTHING_HEARD;
use super::repeats::Repeats;
use super::service::{LinkShape, PortBoard, origin};
use super::stage_board::{StageBoard, StageNumber, StageState, WireNumber};
use super::{InputQueue, LinkError, Order, RunNames, SampleHeader, unpack};
use crate::message::{LogTime, MessageFlags, Storage};
use iceoryx2::node::Node;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::CallbackProgression;
use iceoryx2::sample::Sample;
use iceoryx2::service::Service;
use iceoryx2::service::port_factory::PortFactory as _;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use std::collections::{BTreeMap, VecDeque};
use std::rc::Rc;

/// One wire of a stage, as the reader and its senders know it.
#[derive(Clone)]
pub struct ReaderEnd {
    /// Where the stage notes how far it is.
    pub board: StageBoard,
    /// Which of its wires this is.
    pub wire: usize,
    /// How many samples of a sender it lets wait.
    pub depth: usize,
}

/// A sender, as its reader knows it. What one had sent that has gone may still wait.
struct Known {
    heard: Heard,
    /// The slot of its window, while it is there.
    slot: Option<usize>,
    /// There is room for its samples before this one.
    limit: u64,
}

/// A sample that is not handled to its end.
struct Waiting {
    origin: u64,
    number: u64,
    is_repeated: bool,
    /// How many of its messages wait.
    messages: usize,
}

/// One wire of a stage over a link.
pub struct LinkReceiver<S: Service> {
    service: PortFactory<S, [u8], SampleHeader>,
    subscriber: Subscriber<S, [u8], SampleHeader>,
    name: String,
    order: Order,
    end: ReaderEnd,
    owner: PortBoard,
    /// How many senders had come when it was last looked for them.
    senders: u64,
    /// The number of its greeting, once it has greeted the owner.
    greeting: Option<u64>,
    /// Whether it has counted what was sent before it came.
    has_counted: bool,
    /// For each slot of the board the sender that it is given to, 0 for none.
    slots: [u64; MAX_SENDERS],
    known: BTreeMap<u64, Known>,
    waiting: VecDeque<Waiting>,
    /// How many samples were handled since the owner was last woken for room.
    freed: usize,
    /// The log time that the owner had come to at the end.
    ended: Option<LogTime>,
    /// What was sent again by senders of whom nothing has come yet.
    repeats: Repeats,
    held: HeldSamples,
    most_held: usize,
    /// Where large payloads travel; none if that is in the samples.
    heap: Option<HeapLink>,
}

impl<S: Service + 'static> LinkReceiver<S> {
    /// The reading end of the link that is the output port `owner`.
    ///
    /// # Errors
    /// iceoryx2 refuses.
    pub fn new(
        node: &Node<S>,
        names: &RunNames,
        shape: &LinkShape<'_>,
        end: ReaderEnd,
        owner: PortBoard,
    ) -> Result<Self, LinkError> {
        let name = shape.name();
        let service = shape.open(node, names)?;
        let subscriber = service.subscriber_builder().buffer_size(shape.buffer(end.depth)).create();
        let subscriber = subscriber.map_err(|e| LinkError::shared(format!("subscribe to {name}"))(&e))?;
        Ok(Self {
            service,
            subscriber,
            heap: names.heap_link(&name),
            name,
            order: shape.order,
            most_held: shape.held(end.depth),
            end,
            owner,
            senders: 0,
            greeting: None,
            has_counted: false,
            slots: [0; MAX_SENDERS],
            known: BTreeMap::new(),
            waiting: VecDeque::new(),
            freed: 0,
            ended: None,
            repeats: Repeats::default(),
            held: HeldSamples::default(),
        })
    }

    /// Moves what has come in to `queue`: in a replay all of it, of a live link one sample at a time, as what waits in shared
    /// memory is what a sender can drop.
    pub(crate) fn receive(&mut self, queue: &mut InputQueue) -> Result<(), LinkError> {
        self.connect()?;
        while self.order == Order::LogTime || queue.is_empty() {
            match self.subscriber.receive().map_err(|e| self.failed("receive from", &e))? {
                Some(sample) => self.take_sample(sample, queue)?,
                None if !self.repeats.is_empty() => {
                    for (header, storage) in self.repeats.all() {
                        self.take_in(&header, storage, queue)?;
                    }
                }
                None => {
                    self.note_end(queue);
                    break;
                }
            }
        }
        Ok(())
    }

    /// Notes that the stage has taken one message of this wire. `true` if it was the last of its sample.
    pub(crate) fn taken(&mut self) -> bool {
        if let Some(first) = self.waiting.front_mut() {
            first.messages = first.messages.saturating_sub(1);
        }
        let is_last = self.waiting.front().is_some_and(|first| first.messages == 0);
        self.give_back();
        is_last
    }

    /// Lets more samples in than the depth allows where the stage could not go on otherwise: all that waits here is of
    /// one log time, so no watermark can tell the stage that it may take it.
    pub(crate) fn relieve(&mut self, queue: &InputQueue) {
        if queue.is_empty() || !queue.is_one_moment() {
            return;
        }
        let (board, wire, depth) = (&self.end.board, self.end.wire, self.end.depth as u64);
        for known in self.known.values_mut() {
            if known.heard.next() == Some(known.limit) {
                known.raise(known.limit + depth, board, wire);
                self.freed += 1;
            }
        }
    }

    /// Wakes the senders for what room there is. Called before the stage sleeps.
    pub(crate) fn ring_for_room(&mut self) {
        if std::mem::take(&mut self.freed) > 0 {
            self.owner.board.ring();
        }
    }

    /// Whether there is something to receive, or a sender has come, or nothing will follow any more.
    pub(crate) fn has_news(&self, queue: &InputQueue) -> Result<bool, LinkError> {
        if self.senders != self.owner.board.senders(self.owner.port) || !self.repeats.is_empty() {
            return Ok(true);
        }
        let has_samples = self.subscriber.has_samples().map_err(|e| self.failed("receive from", &e))?;
        Ok(has_samples || self.is_at_end() && !queue.has_ended())
    }

    /// Connects to senders that have come, and forgets those that have gone.
    fn connect(&mut self) -> Result<(), LinkError> {
        let senders = self.owner.board.senders(self.owner.port);
        if senders == self.senders {
            return Ok(());
        }
        self.senders = senders;
        let mut present = Vec::with_capacity(MAX_SENDERS);
        self.service.dynamic_config().list_publishers(|publisher| {
            present.push(origin(publisher.publisher_id.value()));
            CallbackProgression::Continue
        });
        self.subscriber.update_connections().map_err(|e| self.failed("connect to", &e))?;
        for (slot, sender) in self.slots.iter_mut().enumerate() {
            if *sender != 0 && !present.contains(sender) {
                self.end.board.window(self.end.wire, slot).give(0, 0);
                if let Some(known) = self.known.get_mut(sender) {
                    known.slot = None;
                }
                *sender = 0;
            }
        }
        for sender in present.iter().copied() {
            let free = self.slots.iter().position(|slot| *slot == 0);
            if let Some(slot) = free.filter(|_| !self.slots.contains(&sender)) {
                self.slots[slot] = sender;
                let known = self.known(sender);
                known.slot = Some(slot);
                let limit = known.limit;
                self.end.board.window(self.end.wire, slot).give(sender, limit);
            }
        }
        if self.greeting.is_none() && !present.is_empty() {
            self.count_lost();
            self.greeting = Some(self.owner.board.greet());
        }
        self.owner.board.ring();
        Ok(())
    }

    fn known(&mut self, sender: u64) -> &mut Known {
        let is_for_all = self.end.board.get(StageNumber::Restarts) == 0;
        let new = || Known { heard: Heard::new(is_for_all), slot: None, limit: NOTHING_HEARD };
        self.known.entry(sender).or_insert_with(new)
    }

    fn take_sample(&mut self, sample: Sample<S, [u8], SampleHeader>, queue: &mut InputQueue) -> Result<(), LinkError> {
        let header = *sample.user_header();
        let storage = match &self.heap {
            Some(heap) if header.has_payload() && sample.payload().is_empty() => heap.take(header.message.sequence)?,
            _ => self.held.hold(sample, self.most_held),
        };
        let flags = header.message.flags;
        if !flags.contains(MessageFlags::REPEATED) {
            for (header, storage) in self.repeats.before(&header) {
                self.take_in(&header, storage, queue)?;
            }
        } else if !flags.contains(MessageFlags::END) && self.known(header.origin).heard.next().is_none() {
            self.repeats.push((header, storage));
            return Ok(());
        }
        self.take_in(&header, storage, queue)
    }

    fn take_in(
        &mut self,
        header: &SampleHeader,
        storage: Rc<dyn Storage>,
        queue: &mut InputQueue,
    ) -> Result<(), LinkError> {
        let flags = header.message.flags;
        let is_repeated = flags.contains(MessageFlags::REPEATED);
        let depth = self.end.depth as u64;
        let known = self.known(header.origin);
        let (is_new, missing) = known.heard.note(header.number, is_repeated);
        if known.limit == NOTHING_HEARD && !is_repeated {
            known.limit = header.number.saturating_add(depth);
        }
        if missing != 0 {
            let dropped = self.end.board.get_wire(self.end.wire, WireNumber::Dropped);
            self.end.board.set_wire(self.end.wire, WireNumber::Dropped, dropped.saturating_add_signed(missing));
        }
        let mut messages = 0;
        if flags.contains(MessageFlags::END) {
            // What others have sent may come after the owner's last word.
            self.note_end_mark(header);
        } else if is_new {
            messages = self.unpack(header, storage, queue)?;
        }
        self.waiting.push_back(Waiting { origin: header.origin, number: header.number, is_repeated, messages });
        self.give_back();
        Ok(())
    }

    /// Hands the messages of a sample to the queue. Gives how many of them wait there.
    fn unpack(
        &mut self,
        header: &SampleHeader,
        storage: Rc<dyn Storage>,
        queue: &mut InputQueue,
    ) -> Result<usize, LinkError> {
        let before = queue.len();
        let mut taken = 0;
        unpack(header, storage, &self.name, |message| {
            taken += u64::from(message.header().flags.contains(MessageFlags::DATA));
            queue.push(message.on_wire(self.end.wire));
        })?;
        queue.note_sent_at(header.sent_at);
        self.end.board.add_wire(self.end.wire, WireNumber::Taken, taken);
        Ok(queue.len() - before)
    }

    /// Moves the windows on over samples that are handled to their end. Wakes the senders when half of the room is free, as
    /// each time costs them a wake-up.
    fn give_back(&mut self) {
        let (board, wire, depth) = (&self.end.board, self.end.wire, self.end.depth as u64);
        while let Some(sample) = self.waiting.pop_front_if(|sample| sample.messages == 0) {
            if let Some(known) = self.known.get_mut(&sample.origin).filter(|_| !sample.is_repeated) {
                known.raise(sample.number.saturating_add(1 + depth), board, wire);
                self.freed += 1;
            }
        }
        if 2 * self.freed >= self.end.depth && self.freed > 0 {
            self.ring_for_room();
        }
    }

    /// Nothing is there: that may be for good.
    fn note_end(&mut self, queue: &mut InputQueue) {
        if self.is_at_end() && !queue.has_ended() {
            queue.end(self.ended.unwrap_or_default());
            self.count_lost();
        }
    }

    /// The owner has said that it sends no more. Where it has yet to answer this reader, it will say so again.
    fn note_end_mark(&mut self, header: &SampleHeader) {
        let is_answered = self.greeting.is_some_and(|greeting| greeting <= header.message.sequence);
        if self.order == Order::LogTime || is_answered {
            self.ended = Some(header.message.log_time);
        }
    }

    /// Whether the owner has ended the link. A reader that was started again after it does not hear it.
    fn is_at_end(&self) -> bool {
        self.ended.is_some() || self.order == Order::Arrival && self.owner.board.state() == StageState::Ended
    }

    /// Counts as dropped, once, what was sent while a stage was away that was started again.
    fn count_lost(&mut self) {
        let (board, wire) = (&self.end.board, self.end.wire);
        if !std::mem::replace(&mut self.has_counted, true) && board.get(StageNumber::Restarts) > 0 {
            let had = board.get_wire(wire, WireNumber::Taken) + board.get_wire(wire, WireNumber::Dropped);
            let lost = self.owner.board.sent(self.owner.port).saturating_sub(had);
            board.add_wire(wire, WireNumber::Dropped, lost);
        }
    }

    fn failed(&self, doing: &str, cause: &dyn std::fmt::Debug) -> LinkError {
        LinkError::shared(format!("{doing} {}", self.name))(cause)
    }
}

impl Known {
    /// Gives room for the samples before `limit`.
    fn raise(&mut self, limit: u64, board: &StageBoard, wire: usize) {
        if self.limit == NOTHING_HEARD || limit > self.limit {
            self.limit = limit;
            if let Some(slot) = self.slot {
                board.window(wire, slot).set_limit(limit);
            }
        }
    }
}
