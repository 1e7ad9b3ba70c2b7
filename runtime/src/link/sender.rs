//! The sending end of a link.

use super::board::monotonic_nanoseconds;
use super::heap::HeapLink;
use super::kept::Kept;
use super::protocol::{NOTHING_HEARD, ring};
use super::receiver::ReaderEnd;
use super::room::Room;
use super::sample::Batch;
use super::service::origin;
use super::service::{FIRST_PLACE, LinkShape, PortBoard};
use super::stage_board::{StageBoard, StageNumber, StageState};
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

/// Messages above this size are sent by themselves, written in place; smaller ones are gathered.
const LARGEST_BATCHED: usize = 4 * 1024;
/// A batch is sent when it has reached this size.
const FULL_BATCH: usize = 64 * 1024;

/// Who sends on a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SenderRole {
    /// The stage that it belongs to.
    Owner,
    /// The stage that it belongs to, whose messages come from programs outside of the run.
    FedOwner,
    /// A program outside of the run.
    Guest,
}

/// A reader, and what the sender knows of it.
struct Reader {
    end: ReaderEnd,
    /// There is room for the samples before this one.
    limit: u64,
    /// When the stage was started that had heard nothing yet, and the sample that was then the next.
    started: u64,
    first: u64,
}

impl Reader {
    /// Which samples there is room for, as the board says; none while it is not connected to the sender `origin`, whose next
    /// sample is `number`.
    fn limit(&mut self, origin: u64, number: u64) -> Option<u64> {
        match self.end.board.limit_of(self.end.wire, origin)? {
            NOTHING_HEARD => {
                let started = self.end.board.get(StageNumber::Started);
                if self.started != started {
                    (self.started, self.first) = (started, number);
                }
                Some(self.first.saturating_add(self.end.depth as u64))
            }
            limit => Some(limit),
        }
    }
}

/// One sender of a link.
pub struct LinkSender<S: Service> {
    publisher: Publisher<S, [u8], SampleHeader>,
    name: String,
    order: Order,
    overflow: Overflow,
    role: SenderRole,
    readers: Vec<Reader>,
    /// The port of the owner.
    port: PortBoard,
    /// The last messages, if this is the owner of a live link.
    kept: Option<Kept<S>>,
    /// Where large payloads travel; none if that is in the samples.
    heap: Option<HeapLink>,
    /// Where samples take room; none if they do not leave the process.
    room: Option<Room>,
    origin: u64,
    /// The number of the next sample.
    number: u64,
    /// The log time to which the stream had come at its end.
    ended: Option<LogTime>,
    sequence: Sequence,
    batch: Batch,
    gather: bool,
}

impl<S: Service + 'static> LinkSender<S> {
    /// A sender of the link that is an output port. Small messages are gathered if `gather` is set, and sent at once
    /// otherwise.
    ///
    /// # Errors
    /// iceoryx2 refuses, or too many programs send on the link.
    pub fn new(
        node: &Node<S>,
        names: &RunNames,
        shape: &LinkShape<'_>,
        readers: Vec<ReaderEnd>,
        port: PortBoard,
        role: SenderRole,
        gather: bool,
    ) -> Result<Self, LinkError> {
        let name = shape.name();
        let service = shape.open(node, names)?;
        let publisher = shape.publisher(&service)?;
        let origin = origin(publisher.id().value());
        let is_first = port.board.get(StageNumber::Restarts) == 0;
        let is_keeper = shape.order == Order::Arrival && role != SenderRole::Guest;
        let mut kept = is_keeper.then(|| Kept::new(service, &name, origin, is_first));
        if let Some(kept) = kept.as_mut().filter(|_| role == SenderRole::FedOwner) {
            kept.listen()?;
        }
        port.board.add_sender(port.port);
        ring(readers.iter().map(|reader| reader.board.bell()));
        let reader = |end: ReaderEnd| Reader { end, limit: 0, started: 0, first: 0 };
        Ok(Self {
            heap: names.heap_link(&name),
            room: names.is_shared().then(Room::default),
            publisher,
            name,
            order: shape.order,
            overflow: shape.overflow,
            role,
            readers: readers.into_iter().map(reader).collect(),
            port,
            kept,
            origin,
            number: 0,
            ended: None,
            sequence: Sequence::new(shape.order),
            batch: Batch::default(),
            gather: gather && shape.order == Order::LogTime,
        })
    }

    /// Whether the next sample can be sent.
    pub(crate) fn has_room(&mut self) -> bool {
        if self.overflow == Overflow::DropOldest {
            return true;
        }
        let (order, origin, number) = (self.order, self.origin, self.number);
        self.readers.iter_mut().all(|reader| {
            if number >= reader.limit {
                if order == Order::Arrival && !reader.end.board.is_there() {
                    return true;
                }
                reader.limit = reader.limit(origin, number).unwrap_or_default();
            }
            number < reader.limit
        })
    }

    /// Whether every reader that is there is connected to this sender.
    pub(crate) fn is_connected(&self) -> bool {
        let is_connected = |reader: &Reader| reader.end.board.limit_of(reader.end.wire, self.origin).is_some();
        self.readers.iter().all(|reader| self.is_gone(reader) || is_connected(reader))
    }

    /// Whether every reader that is there has taken all that this sender has sent.
    pub(crate) fn is_taken(&mut self) -> bool {
        let (origin, number) = (self.origin, self.number);
        self.readers.iter_mut().all(|reader| {
            let all = number + reader.end.depth as u64;
            !reader.end.board.is_there() || reader.limit(origin, number).is_some_and(|limit| limit >= all)
        })
    }

    /// Whether every reader that is there has taken the end of the stream, and holds nothing any more.
    pub(crate) fn is_acknowledged(&self) -> bool {
        let has_ended = |reader: &Reader| reader.end.board.state() == StageState::Ended;
        self.readers.iter().all(|reader| self.is_gone(reader) || has_ended(reader))
    }

    /// Whether a reader is not to be waited for: in a replay that is never so.
    fn is_gone(&self, reader: &Reader) -> bool {
        self.order == Order::Arrival && !reader.end.board.is_there()
    }

    /// The log time that the link has reached.
    pub(crate) fn reached(&self) -> LogTime {
        self.sequence.reached()
    }

    /// Numbers a message.
    pub(crate) fn stamp(&mut self, header: &mut MessageHeader) -> Result<(), StageError> {
        self.sequence.stamp(header)
    }

    /// Notes that a message was sent, or gathered.
    pub(crate) fn count(&self, header: &MessageHeader) {
        // What others send on the link is counted by its owner.
        if self.role == SenderRole::Owner && header.flags.contains(MessageFlags::DATA) {
            self.port.board.add_sent(self.port.port, 1);
        }
    }

    /// Whether a message of this size is gathered with others.
    pub(crate) fn is_gathered(&self, length: usize) -> bool {
        self.gather && length <= LARGEST_BATCHED
    }

    /// Gathers a small message. `true` if the batch should be sent.
    pub(crate) fn gather(&mut self, header: &MessageHeader, bytes: &[u8]) -> bool {
        self.batch.push(header, bytes);
        self.batch.len() >= FULL_BATCH
    }

    /// Whether messages were gathered and not sent.
    pub(crate) fn has_batch(&self) -> bool {
        !self.batch.is_empty()
    }

    /// Sends what was gathered. Needs room.
    pub(crate) fn send_batch(&mut self) -> Result<(), LinkError> {
        let mut batch = std::mem::take(&mut self.batch);
        let (header, payload) = batch.sample();
        let sent = self.send_payload(header, payload);
        batch.clear();
        self.batch = batch;
        sent
    }

    /// Sends one message by itself, copying its bytes once. Needs room.
    pub(crate) fn send_bytes(&mut self, message: MessageHeader, bytes: &[u8]) -> Result<(), LinkError> {
        self.send_payload(SampleHeader::single(message), bytes)
    }

    /// Sends one message that `write` writes in place. Needs room.
    pub(crate) fn send_in_place(&mut self, message: MessageHeader, write: &mut Write<'_>) -> Result<(), StageError> {
        let length = message.length as usize;
        let header = SampleHeader::single(message);
        if let Some(heap) = self.heap_for(length) {
            let buffer = write_vec(heap.buffer(length)?, length, write)?;
            heap.leave(message.sequence, buffer, self.readers.len());
            return Ok(self.send_payload(header, &[])?);
        }
        let mut sample = self.loan(length)?;
        write_all(sample.payload_mut(), write)?;
        // SAFETY: `write_all` has succeeded, so every byte of the payload is written.
        #[allow(unsafe_code)]
        let sample = unsafe { sample.assume_init() };
        Ok(self.send_sample(header, sample)?)
    }

    /// Tells the readers that nothing before `watermark` will follow, if they do not know it. Needs room.
    pub(crate) fn raise(&mut self, watermark: LogTime) -> Result<(), LinkError> {
        match self.sequence.raise(watermark) {
            true => {
                let flags = MessageFlags::WATERMARK;
                self.send_bytes(MessageHeader { flags, log_time: watermark, ..Default::default() }, &[])
            }
            false => Ok(()),
        }
    }

    /// Whether the readers do not know that nothing before `watermark` will follow. Live ones need not.
    pub(crate) fn can_raise(&self, watermark: LogTime) -> bool {
        self.order == Order::LogTime && watermark > self.reached()
    }

    /// Says that the stream has ended, and that it has come to the given log time, when the owner had answered so many
    /// greetings. Needs room.
    pub(crate) fn end(&mut self, time: LogTime, greeted: u64) -> Result<(), LinkError> {
        self.ended = Some(time);
        self.send_bytes(end_mark(time, greeted), &[])
    }

    /// Sends the last message of each topic again, if this is the owner of a live link, and that the stream has ended, if it
    /// has. With this so many greetings are answered.
    pub(crate) fn repeat(&mut self, greeted: u64) -> Result<(), LinkError> {
        self.look()?;
        let Some(kept) = &self.kept else { return Ok(()) };
        for (header, bytes) in kept.messages() {
            self.send_again(*header, bytes)?;
        }
        if let Some(time) = self.ended {
            let header = SampleHeader::single(end_mark(time, greeted));
            // The number of the mark itself, which was the last sample.
            self.send_again(
                SampleHeader { origin: self.origin, number: self.number.saturating_sub(1), ..header },
                &[],
            )?;
        }
        self.ring();
        Ok(())
    }

    /// Sends a sample that was sent before, with the number and the origin that it had.
    fn send_again(&self, mut header: SampleHeader, bytes: &[u8]) -> Result<(), LinkError> {
        header.message.flags.0 |= MessageFlags::REPEATED.0;
        header.sent_at = monotonic_nanoseconds();
        let mut sample = self.loan(bytes.len())?.write_from_slice(bytes);
        *sample.user_header_mut() = header;
        sample.send().map_err(|e| self.failed(&e))?;
        Ok(())
    }

    /// Lets the owner take in what was sent on the link, by whomever, so that it can be repeated, and count it.
    pub(crate) fn look(&mut self) -> Result<(), LinkError> {
        let Some(kept) = &mut self.kept else { return Ok(()) };
        let count = kept.update()?;
        if count > 0 {
            self.port.board.add_sent(self.port.port, count);
        }
        Ok(())
    }

    /// Whether there is something for the owner to take in.
    pub(crate) fn has_news(&self) -> Result<bool, LinkError> {
        self.kept.as_ref().map_or(Ok(false), Kept::has_news)
    }

    /// Where a payload of this size travels; none if that is in its sample.
    fn heap_for(&self, length: usize) -> Option<&HeapLink> {
        self.heap.as_ref().filter(|_| length > FIRST_PLACE)
    }

    /// Sends a sample, whose payload may travel on the heap.
    fn send_payload(&mut self, header: SampleHeader, mut payload: &[u8]) -> Result<(), LinkError> {
        if let Some(heap) = self.heap_for(payload.len()) {
            let mut buffer = heap.buffer(payload.len())?;
            buffer.extend_from_slice(payload);
            heap.leave(header.message.sequence, buffer, self.readers.len());
            payload = &[];
        }
        let sample = self.loan(payload.len())?.write_from_slice(payload);
        self.send_sample(header, sample)
    }

    fn loan(&self, length: usize) -> Result<SampleMutUninit<S, [MaybeUninit<u8>], SampleHeader>, LinkError> {
        let doing = || format!("send {length} bytes on {}", self.name);
        if let Some(room) = &self.room {
            room.ask(length, doing)?;
        }
        let sample = self.publisher.loan_slice_uninit(length).map_err(|e| self.failed(&e))?;
        if let Some(room) = &self.room {
            // The headers lie before it, and were written already: where it was free a moment ago, if not taken.
            let start = std::ptr::from_ref(sample.user_header()).addr();
            room.take(start..sample.payload().as_ptr_range().end.addr(), doing)?;
        }
        Ok(sample)
    }

    /// Sends a sample, and wakes those who wait for it.
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
        if let Some(kept) = &mut self.kept {
            kept.show(&header, sample.payload())?;
        }
        let reached = sample.send().map_err(|e| self.failed(&e))?;
        // Those that look on get it as well, if they have room.
        if self.order == Order::LogTime && reached < self.readers.len() {
            return Err(LinkError::Lost { link: self.name.clone(), reached, readers: self.readers.len() });
        }
        self.number += 1;
        self.ring();
        self.look()
    }

    /// Wakes the readers, and the owner if it keeps what others send.
    fn ring(&self) {
        let owner = (self.role == SenderRole::Guest).then_some(&self.port.board);
        let boards = self.readers.iter().map(|reader| &reader.end.board).chain(owner);
        ring(boards.map(StageBoard::bell));
    }

    fn failed(&self, cause: &dyn std::fmt::Debug) -> LinkError {
        LinkError::shared(format!("send on {}", self.name))(cause)
    }
}

/// The mark of the end of a stream. A live reader whose own greeting is not among the answered ones waits for the next.
fn end_mark(log_time: LogTime, greeted: u64) -> MessageHeader {
    MessageHeader { flags: MessageFlags::END, log_time, sequence: greeted, ..Default::default() }
}
