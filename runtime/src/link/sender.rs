//! The sending end of a link.

use super::counters::monotonic_nanoseconds;
use super::heap::HeapLink;
use super::history::History;
use super::pending_samples::PendingSamples;
use super::protocol::ring;
use super::reader_credit::Reader;
use super::receiver::ReaderEnd;
use super::sample::Batch;
use super::service::origin;
use super::service::{INITIAL_CAPACITY, LinkShape, PortCounters};
use super::shared_memory::SharedMemory;
use super::stage_counters::{StageCounter, StageCounters, StageState};
use super::{LinkError, Order, RunNames, SampleHeader, Sequence};
use crate::message::{LogTime, MessageFlags, MessageHeader, Write, write_all, write_vec};
use crate::pipeline::Overflow;
use crate::stage::StageError;
use iceoryx2::node::Node;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::sample_mut::SampleMut;
use iceoryx2::sample_mut_uninit::SampleMutUninit;
use iceoryx2::service::Service;
use std::mem::MaybeUninit;

/// The largest message that is batched, bytes. A larger one is written in place in a sample of its own.
const LARGEST_BATCHED: usize = 4 * 1024;
/// The size at which a batch is sent, bytes.
const FULL_BATCH: usize = 64 * 1024;

/// The role of a sender on a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SenderRole {
    /// The stage that the link belongs to.
    Owner,
    /// The stage that the link belongs to, whose messages are sent by programs outside of the run.
    PassiveOwner,
    /// A program outside of the run.
    External,
}

/// A sending end of a link.
pub struct LinkSender<S: Service> {
    publisher: Publisher<S, [u8], SampleHeader>,
    name: String,
    order: Order,
    overflow: Overflow,
    role: SenderRole,
    readers: Vec<Reader>,
    /// The output port of the owner.
    port: PortCounters,
    /// The history, if this is the owner of a live link.
    history: Option<History<S>>,
    /// The heap payloads; none if payloads are part of the samples.
    heap: Option<HeapLink>,
    /// The shared memory of the samples; none if they do not leave the process.
    shared_memory: Option<SharedMemory>,
    origin: u64,
    /// The number of the next sample.
    number: u64,
    pending: PendingSamples,
    /// The log time of the end of the stream, once it was sent.
    ended: Option<LogTime>,
    sequence: Sequence,
    batch: Batch,
    batches: bool,
}

impl<S: Service + 'static> LinkSender<S> {
    /// Creates a sender of the link of an output port. In a replay small messages are batched if `batches` is set.
    ///
    /// # Errors
    /// iceoryx2 fails, or the link has the maximum number of senders.
    pub fn new(
        node: &Node<S>,
        names: &RunNames,
        shape: &LinkShape<'_>,
        readers: Vec<ReaderEnd>,
        port: PortCounters,
        role: SenderRole,
        batches: bool,
    ) -> Result<Self, LinkError> {
        let name = shape.name();
        let service = shape.open(node, names)?;
        let creation = names.begin_creation(|| format!("open the link {name}"))?;
        let publisher = shape.publisher(&service)?;
        drop(creation);
        let origin = origin(publisher.id().value());
        let is_first = port.counters.get(StageCounter::Restarts) == 0;
        let has_history = shape.order == Order::Arrival && role != SenderRole::External;
        let mut history = has_history.then(|| History::new(service, &name, origin, is_first));
        if let Some(history) = history.as_mut().filter(|_| role == SenderRole::PassiveOwner) {
            history.subscribe()?;
        }
        port.counters.add_sender(port.port);
        ring(readers.iter().map(|reader| reader.counters.doorbell()));
        Ok(Self {
            heap: names.heap_link(&name),
            shared_memory: names.is_shared().then(SharedMemory::default),
            publisher,
            name,
            order: shape.order,
            overflow: shape.overflow,
            role,
            readers: readers.into_iter().map(Reader::new).collect(),
            port,
            history,
            origin,
            number: 0,
            pending: PendingSamples::default(),
            ended: None,
            sequence: Sequence::new(shape.order),
            batch: Batch::default(),
            batches: batches && shape.order == Order::LogTime,
        })
    }

    /// Whether there is credit for the next sample.
    pub(crate) fn has_credit(&mut self) -> bool {
        if self.overflow == Overflow::DropOldest {
            return true;
        }
        let (order, origin, number) = (self.order, self.origin, self.number);
        self.readers.iter_mut().all(|reader| {
            if number >= reader.limit {
                if order == Order::Arrival && !reader.end.counters.is_alive() {
                    return true;
                }
                reader.limit = reader.limit(origin, number).unwrap_or_default();
            }
            number < reader.limit
        }) && self.has_memory()
    }

    /// Whether the samples that a reader has not taken leave memory for another one. Live links have a few samples at
    /// most.
    fn has_memory(&mut self) -> bool {
        if self.order == Order::LogTime && self.pending.is_full() {
            let (origin, number) = (self.origin, self.number);
            let taken = self.readers.iter_mut().map(|reader| reader.taken(origin, number)).min();
            self.pending.release(taken.unwrap_or(number));
        }
        self.order == Order::Arrival || !self.pending.is_full()
    }

    /// Whether every live reader is connected to this sender.
    pub(crate) fn is_connected(&self) -> bool {
        let is_connected = |reader: &Reader| reader.end.counters.limit_of(reader.end.wire, self.origin).is_some();
        self.readers.iter().all(|reader| self.is_gone(reader) || is_connected(reader))
    }

    /// Whether every live reader has taken all samples of this sender.
    pub(crate) fn is_taken(&mut self) -> bool {
        let (origin, number) = (self.origin, self.number);
        self.readers.iter_mut().all(|reader| {
            let all = number + reader.end.depth as u64;
            !reader.end.counters.is_alive() || reader.limit(origin, number).is_some_and(|limit| limit >= all)
        })
    }

    /// Whether every live reader has taken the end of the stream and borrows no samples.
    pub(crate) fn is_acknowledged(&self) -> bool {
        let has_ended = |reader: &Reader| reader.end.counters.state() == StageState::Ended;
        self.readers.iter().all(|reader| self.is_gone(reader) || has_ended(reader))
    }

    /// Whether a reader is gone and must not be waited for; never in a replay.
    fn is_gone(&self, reader: &Reader) -> bool {
        self.order == Order::Arrival && !reader.end.counters.is_alive()
    }

    /// The log time that the link has reached.
    pub(crate) fn reached(&self) -> LogTime {
        self.sequence.reached()
    }

    /// Assigns a message its sequence number.
    pub(crate) fn stamp(&mut self, header: &mut MessageHeader) -> Result<(), StageError> {
        self.sequence.stamp(header)
    }

    /// Counts a message that was sent or batched.
    pub(crate) fn count(&self, header: &MessageHeader) {
        // The owner counts what others send on the link.
        if self.role == SenderRole::Owner && header.flags.contains(MessageFlags::DATA) {
            self.port.counters.add_sent(self.port.port, 1);
        }
    }

    /// Whether a message of this size is batched.
    pub(crate) fn is_batched(&self, length: usize) -> bool {
        self.batches && length <= LARGEST_BATCHED
    }

    /// Adds a small message to the batch. Returns whether the batch should be sent.
    pub(crate) fn add_to_batch(&mut self, header: &MessageHeader, bytes: &[u8]) -> bool {
        self.batch.push(header, bytes);
        self.batch.len() >= FULL_BATCH
    }

    /// Whether the batch has messages.
    pub(crate) fn has_batch(&self) -> bool {
        !self.batch.is_empty()
    }

    /// Sends the batch. Needs credit.
    pub(crate) fn send_batch(&mut self) -> Result<(), LinkError> {
        let mut batch = std::mem::take(&mut self.batch);
        let (header, payload) = batch.sample();
        let sent = self.send_payload(header, payload);
        batch.clear();
        self.batch = batch;
        sent
    }

    /// Sends one message in a sample of its own, copying its bytes once. Needs credit.
    pub(crate) fn send_bytes(&mut self, message: MessageHeader, bytes: &[u8]) -> Result<(), LinkError> {
        self.send_payload(SampleHeader::single(message), bytes)
    }

    /// Sends one message that `write` writes in place. Needs credit.
    pub(crate) fn send_in_place(&mut self, message: MessageHeader, write: &mut Write<'_>) -> Result<(), StageError> {
        let length = message.length as usize;
        let header = SampleHeader::single(message);
        if let Some(heap) = self.heap_for(length) {
            let buffer = write_vec(heap.buffer(length)?, length, write)?;
            heap.push(message.sequence, buffer, self.readers.len());
            return Ok(self.send_payload(header, &[])?);
        }
        let mut sample = self.loan(length)?;
        write_all(sample.payload_mut(), write)?;
        // SAFETY: `write_all` has succeeded, so every byte of the payload is written.
        #[allow(unsafe_code)]
        let sample = unsafe { sample.assume_init() };
        Ok(self.send_sample(header, sample)?)
    }

    /// Sends the readers a watermark if it is later than the last one. Needs credit.
    pub(crate) fn raise(&mut self, watermark: LogTime) -> Result<(), LinkError> {
        match self.sequence.raise(watermark) {
            true => {
                let flags = MessageFlags::WATERMARK;
                self.send_bytes(MessageHeader { flags, log_time: watermark, ..Default::default() }, &[])
            }
            false => Ok(()),
        }
    }

    /// Whether a watermark would be later than the last one. Live links have no watermarks.
    pub(crate) fn can_raise(&self, watermark: LogTime) -> bool {
        self.order == Order::LogTime && watermark > self.reached()
    }

    /// Sends the end of the stream at the given log time; `answered_requests` is the number of history requests that
    /// the owner has answered. Needs credit.
    pub(crate) fn end(&mut self, time: LogTime, answered_requests: u64) -> Result<(), LinkError> {
        self.ended = Some(time);
        self.send_bytes(end_mark(time, answered_requests), &[])
    }

    /// Repeats the history, if this is the owner of a live link, and the end of the stream, if it was sent.
    /// `answered_requests` includes the history requests that this answers.
    pub(crate) fn repeat(&mut self, answered_requests: u64) -> Result<(), LinkError> {
        self.ingest()?;
        let Some(history) = &self.history else { return Ok(()) };
        for (header, bytes) in history.messages() {
            self.send_repeated(*header, bytes)?;
        }
        if let Some(time) = self.ended {
            let header = SampleHeader::single(end_mark(time, answered_requests));
            // The end mark was the last sample.
            self.send_repeated(
                SampleHeader { origin: self.origin, number: self.number.saturating_sub(1), ..header },
                &[],
            )?;
        }
        self.ring();
        Ok(())
    }

    /// Repeats a sample with its original number and origin.
    fn send_repeated(&self, mut header: SampleHeader, bytes: &[u8]) -> Result<(), LinkError> {
        header.message.flags.0 |= MessageFlags::REPEATED.0;
        header.sent_at = monotonic_nanoseconds();
        let mut sample = self.loan(bytes.len())?.write_from_slice(bytes);
        *sample.user_header_mut() = header;
        sample.send().map_err(|e| self.failed(&e))?;
        Ok(())
    }

    /// Ingests what was sent on the link by any sender, if this is the owner of a live link: retains and counts it.
    pub(crate) fn ingest(&mut self) -> Result<(), LinkError> {
        let Some(history) = &mut self.history else { return Ok(()) };
        let count = history.ingest()?;
        if count > 0 {
            self.port.counters.add_sent(self.port.port, count);
        }
        Ok(())
    }

    /// Whether there is something for the owner to ingest.
    pub(crate) fn has_pending(&self) -> Result<bool, LinkError> {
        self.history.as_ref().map_or(Ok(false), History::has_pending)
    }

    /// The heap payloads for a payload of this size; none if it is part of its sample.
    fn heap_for(&self, length: usize) -> Option<&HeapLink> {
        self.heap.as_ref().filter(|_| length > INITIAL_CAPACITY)
    }

    /// Sends a sample whose payload may be passed on the heap.
    fn send_payload(&mut self, header: SampleHeader, mut payload: &[u8]) -> Result<(), LinkError> {
        if let Some(heap) = self.heap_for(payload.len()) {
            let mut buffer = heap.buffer(payload.len())?;
            buffer.extend_from_slice(payload);
            heap.push(header.message.sequence, buffer, self.readers.len());
            payload = &[];
        }
        let sample = self.loan(payload.len())?.write_from_slice(payload);
        self.send_sample(header, sample)
    }

    fn loan(&self, length: usize) -> Result<SampleMutUninit<S, [MaybeUninit<u8>], SampleHeader>, LinkError> {
        let doing = || format!("send {length} bytes on {}", self.name);
        if let Some(shared_memory) = &self.shared_memory {
            shared_memory.check_free(length, doing)?;
        }
        let sample = self.publisher.loan_slice_uninit(length).map_err(|e| self.failed(&e))?;
        if let Some(shared_memory) = &self.shared_memory {
            // The headers precede the payload, and iceoryx2 has written them already, into space that was checked to be
            // free.
            let start = std::ptr::from_ref(sample.user_header()).addr();
            shared_memory.commit(start..sample.payload().as_ptr_range().end.addr(), doing)?;
        }
        Ok(sample)
    }

    /// Sends a sample, and wakes those that wait for it.
    fn send_sample(
        &mut self,
        mut header: SampleHeader,
        mut sample: SampleMut<S, [u8], SampleHeader>,
    ) -> Result<(), LinkError> {
        (header.origin, header.number) = (self.origin, self.number);
        if self.order == Order::Arrival {
            header.sent_at = monotonic_nanoseconds();
        }
        *sample.user_header_mut() = header;
        if let Some(history) = &mut self.history {
            history.record(&header, sample.payload())?;
        }
        let reached = sample.send().map_err(|e| self.failed(&e))?;
        // Observers are counted too, if their buffers have space.
        if self.order == Order::LogTime && reached < self.readers.len() {
            return Err(LinkError::Lost { link: self.name.clone(), reached, readers: self.readers.len() });
        }
        if self.order == Order::LogTime && header.count == 1 && header.message.length > LARGEST_BATCHED as u64 {
            self.pending.push(self.number, header.message.length);
        }
        self.number += 1;
        self.ring();
        self.ingest()
    }

    /// Wakes the readers, and the owner if this is another sender, so that it ingests the sample.
    fn ring(&self) {
        let owner = (self.role == SenderRole::External).then_some(&self.port.counters);
        let counters = self.readers.iter().map(|reader| &reader.end.counters).chain(owner);
        ring(counters.map(StageCounters::doorbell));
    }

    fn failed(&self, cause: &dyn std::fmt::Debug) -> LinkError {
        LinkError::shared(format!("send on {}", self.name))(cause)
    }
}

/// The end mark of a stream. A live reader whose history request is not among the answered ones waits for the next
/// mark.
fn end_mark(log_time: LogTime, answered_requests: u64) -> MessageHeader {
    MessageHeader { flags: MessageFlags::END, log_time, sequence: answered_requests, ..Default::default() }
}
