//! The reading end of a link.

use super::borrowed_samples::BorrowedSamples;
use super::counters::MAX_SENDERS;
use super::heap::HeapLink;
use super::pending_samples::MOST_PENDING_BYTES;
use super::protocol::NOTHING_RECEIVED;
use super::repeats::Repeats;
use super::sample_tracker::SampleTracker;
use super::service::{LinkShape, PortCounters, origin};
use super::stage_counters::{StageCounter, StageCounters, StageState, WireCounter};
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

/// A wire of a stage, as both the reader and its senders refer to it.
#[derive(Clone)]
pub struct ReaderEnd {
    /// The counters of the reading stage.
    pub counters: StageCounters,
    /// The index of the wire within the stage.
    pub wire: usize,
    /// The credit per sender, samples.
    pub depth: usize,
}

/// The reader's state for one sender. It outlives the sender, whose last samples may still be pending.
struct Known {
    tracker: SampleTracker,
    /// The slot of its window while it is connected.
    slot: Option<usize>,
    /// The number of its first sample for which there is no credit.
    limit: u64,
}

/// A sample of which messages may still be pending.
struct Waiting {
    origin: u64,
    number: u64,
    is_repeated: bool,
    /// The number of its pending messages.
    messages: usize,
}

/// The reading end of a link, for one wire of a stage.
pub struct LinkReceiver<S: Service> {
    service: PortFactory<S, [u8], SampleHeader>,
    subscriber: Subscriber<S, [u8], SampleHeader>,
    name: String,
    order: Order,
    end: ReaderEnd,
    owner: PortCounters,
    /// The sender count of the port at the last connect.
    senders: u64,
    /// The number of its history request, once it was made.
    history_request: Option<u64>,
    /// Whether the messages sent while the stage was being restarted have been counted.
    has_counted: bool,
    /// The sender that each window slot is assigned to, 0 for none.
    slots: [u64; MAX_SENDERS],
    known: BTreeMap<u64, Known>,
    waiting: VecDeque<Waiting>,
    /// The number of samples released since the senders were last woken for credit.
    freed: usize,
    /// The log time of the end, once the owner has sent it.
    ended: Option<LogTime>,
    /// Repeated samples of senders from which nothing else has been received yet.
    repeats: Repeats,
    borrowed: BorrowedSamples,
    max_borrowed: usize,
    /// The heap payloads; none if payloads are part of the samples.
    heap: Option<HeapLink>,
}

impl<S: Service + 'static> LinkReceiver<S> {
    /// Creates the reading end of the link of the output port `owner`.
    ///
    /// # Errors
    /// iceoryx2 fails.
    pub fn new(
        node: &Node<S>,
        names: &RunNames,
        shape: &LinkShape<'_>,
        end: ReaderEnd,
        owner: PortCounters,
    ) -> Result<Self, LinkError> {
        let name = shape.name();
        let service = shape.open(node, names)?;
        let creation = names.begin_creation(|| format!("open the link {name}"))?;
        let subscriber = service.subscriber_builder().buffer_size(shape.buffer(end.depth)).create();
        let subscriber = subscriber.map_err(|e| LinkError::shared(format!("subscribe to {name}"))(&e))?;
        drop(creation);
        Ok(Self {
            service,
            subscriber,
            heap: names.heap_link(&name),
            name,
            order: shape.order,
            max_borrowed: shape.max_borrowed(end.depth),
            end,
            owner,
            senders: 0,
            history_request: None,
            has_counted: false,
            slots: [0; MAX_SENDERS],
            known: BTreeMap::new(),
            waiting: VecDeque::new(),
            freed: 0,
            ended: None,
            repeats: Repeats::default(),
            borrowed: BorrowedSamples::default(),
        })
    }

    /// Moves received messages to `queue`: all of them in a replay, one sample at a time on a live link, because a
    /// sender can drop only what still waits in shared memory.
    pub(crate) fn receive(&mut self, queue: &mut InputQueue) -> Result<(), LinkError> {
        self.connect()?;
        while self.order == Order::LogTime || queue.is_empty() {
            let has_sample = self.order == Order::LogTime && self.has_samples()?;
            match self.subscriber.receive().map_err(|e| self.failed("receive from", &e))? {
                Some(sample) => self.take_sample(sample, queue)?,
                // iceoryx2 discards a sample whose memory it cannot map, and reports none. In a replay the sender would
                // wait for it without end; in a live run its sender may be gone, and the gap in the numbers is counted.
                None if has_sample => {
                    return Err(self.failed("receive from", &format_args!("that a sample cannot be mapped")));
                }
                None if !self.repeats.is_empty() => {
                    for (header, storage) in self.repeats.take_all() {
                        self.ingest(&header, storage, queue)?;
                    }
                }
                None => {
                    self.end_queue(queue);
                    break;
                }
            }
        }
        Ok(())
    }

    /// Records that the stage has taken a message of this wire. Returns whether it was the last of its sample.
    pub(crate) fn record_taken(&mut self) -> bool {
        if let Some(first) = self.waiting.front_mut() {
            first.messages = first.messages.saturating_sub(1);
        }
        let is_last = self.waiting.front().is_some_and(|first| first.messages == 0);
        self.release();
        is_last
    }

    /// Grants credit beyond the depth, or beyond the memory of pending samples, where the stage would be stuck
    /// otherwise: if all pending messages have the same log time, no watermark can pass it, and the stage cannot take
    /// them.
    pub(crate) fn extend_credit(&mut self, queue: &InputQueue) {
        if queue.is_empty() || !queue.has_single_log_time() {
            return;
        }
        let (counters, wire, depth) = (&self.end.counters, self.end.wire, self.end.depth as u64);
        let is_large = queue.bytes() as u64 >= MOST_PENDING_BYTES;
        for known in self.known.values_mut() {
            // To the sender, all that was received counts as taken.
            if let Some(next) = known.tracker.next()
                && next + depth > known.limit
                && (next == known.limit || is_large)
            {
                known.raise(next + depth, counters, wire);
                self.freed += 1;
            }
        }
    }

    /// Wakes the senders if there is credit that they were not woken for. Called before the stage sleeps.
    pub(crate) fn ring_for_credit(&mut self) {
        if std::mem::take(&mut self.freed) > 0 {
            self.owner.counters.ring();
        }
    }

    /// Whether there is something to receive, a sender to connect to, or an end of the stream to handle.
    pub(crate) fn has_pending(&self, queue: &InputQueue) -> Result<bool, LinkError> {
        if self.senders != self.owner.counters.senders(self.owner.port) || !self.repeats.is_empty() {
            return Ok(true);
        }
        Ok(self.has_samples()? || self.is_at_end() && !queue.has_ended())
    }

    fn has_samples(&self) -> Result<bool, LinkError> {
        self.subscriber.has_samples().map_err(|e| self.failed("receive from", &e))
    }

    /// Connects to senders that have joined, and frees the windows of those that have left.
    fn connect(&mut self) -> Result<(), LinkError> {
        let senders = self.owner.counters.senders(self.owner.port);
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
                self.end.counters.window(self.end.wire, slot).assign(0, 0);
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
                self.end.counters.window(self.end.wire, slot).assign(sender, limit);
            }
        }
        if self.history_request.is_none() && !present.is_empty() {
            self.count_lost();
            self.history_request = Some(self.owner.counters.request_history());
        }
        self.owner.counters.ring();
        Ok(())
    }

    fn known(&mut self, sender: u64) -> &mut Known {
        let is_for_all = self.end.counters.get(StageCounter::Restarts) == 0;
        let new = || Known { tracker: SampleTracker::new(is_for_all), slot: None, limit: NOTHING_RECEIVED };
        self.known.entry(sender).or_insert_with(new)
    }

    fn take_sample(&mut self, sample: Sample<S, [u8], SampleHeader>, queue: &mut InputQueue) -> Result<(), LinkError> {
        let header = *sample.user_header();
        let storage = match &self.heap {
            Some(heap) if header.has_payload() && sample.payload().is_empty() => heap.take(header.message.sequence)?,
            _ => self.borrowed.borrow(sample, self.max_borrowed),
        };
        let flags = header.message.flags;
        if !flags.contains(MessageFlags::REPEATED) {
            for (header, storage) in self.repeats.before(&header) {
                self.ingest(&header, storage, queue)?;
            }
        } else if !flags.contains(MessageFlags::END) && self.known(header.origin).tracker.next().is_none() {
            self.repeats.push((header, storage));
            return Ok(());
        }
        self.ingest(&header, storage, queue)
    }

    fn ingest(
        &mut self,
        header: &SampleHeader,
        storage: Rc<dyn Storage>,
        queue: &mut InputQueue,
    ) -> Result<(), LinkError> {
        let flags = header.message.flags;
        let is_repeated = flags.contains(MessageFlags::REPEATED);
        let depth = self.end.depth as u64;
        let known = self.known(header.origin);
        let (is_new, missing) = known.tracker.record(header.number, is_repeated);
        if known.limit == NOTHING_RECEIVED && !is_repeated {
            known.limit = header.number.saturating_add(depth);
        }
        if missing != 0 {
            let dropped = self.end.counters.get_wire(self.end.wire, WireCounter::Dropped);
            self.end.counters.set_wire(self.end.wire, WireCounter::Dropped, dropped.saturating_add_signed(missing));
        }
        let mut messages = 0;
        if flags.contains(MessageFlags::END) {
            // Messages of other senders may arrive after the owner's end mark.
            self.record_end_mark(header);
        } else if is_new {
            messages = self.unpack(header, storage, queue)?;
        }
        self.waiting.push_back(Waiting { origin: header.origin, number: header.number, is_repeated, messages });
        self.release();
        Ok(())
    }

    /// Pushes the messages of a sample to the queue. Returns how many of them are pending there.
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
        queue.set_sent_at(header.sent_at);
        self.end.counters.add_wire(self.end.wire, WireCounter::Taken, taken);
        Ok(queue.len() - before)
    }

    /// Advances the windows past samples without pending messages. Wakes the senders only when half of the credit is
    /// free, as each wake-up is expensive.
    fn release(&mut self) {
        let (counters, wire, depth) = (&self.end.counters, self.end.wire, self.end.depth as u64);
        while let Some(sample) = self.waiting.pop_front_if(|sample| sample.messages == 0) {
            if let Some(known) = self.known.get_mut(&sample.origin).filter(|_| !sample.is_repeated) {
                known.raise(sample.number.saturating_add(1 + depth), counters, wire);
                self.freed += 1;
            }
        }
        if 2 * self.freed >= self.end.depth && self.freed > 0 {
            self.ring_for_credit();
        }
    }

    /// Ends the queue if the stream has ended. Called when there is nothing to receive.
    fn end_queue(&mut self, queue: &mut InputQueue) {
        if self.is_at_end() && !queue.has_ended() {
            queue.end(self.ended.unwrap_or_default());
            self.count_lost();
        }
    }

    /// Records the owner's end mark. If the owner has not answered this reader's history request, it will repeat the
    /// mark.
    fn record_end_mark(&mut self, header: &SampleHeader) {
        let is_answered =
            self.history_request.is_some_and(|history_request| history_request <= header.message.sequence);
        if self.order == Order::LogTime || is_answered {
            self.ended = Some(header.message.log_time);
        }
    }

    /// Whether the owner has ended the link. A reader that was restarted after that sees it only in the shared
    /// counters.
    fn is_at_end(&self) -> bool {
        self.ended.is_some() || self.order == Order::Arrival && self.owner.counters.state() == StageState::Ended
    }

    /// Counts, once, the messages that were sent while the stage was being restarted as dropped.
    fn count_lost(&mut self) {
        let (counters, wire) = (&self.end.counters, self.end.wire);
        if !std::mem::replace(&mut self.has_counted, true) && counters.get(StageCounter::Restarts) > 0 {
            let had = counters.get_wire(wire, WireCounter::Taken) + counters.get_wire(wire, WireCounter::Dropped);
            let lost = self.owner.counters.sent(self.owner.port).saturating_sub(had);
            counters.add_wire(wire, WireCounter::Dropped, lost);
        }
    }

    fn failed(&self, doing: &str, cause: &dyn std::fmt::Debug) -> LinkError {
        LinkError::shared(format!("{doing} {}", self.name))(cause)
    }
}

impl Known {
    /// Grants credit for the samples before `limit`.
    fn raise(&mut self, limit: u64, counters: &StageCounters, wire: usize) {
        if self.limit == NOTHING_RECEIVED || limit > self.limit {
            self.limit = limit;
            if let Some(slot) = self.slot {
                counters.window(wire, slot).set_limit(limit);
            }
        }
    }
}
