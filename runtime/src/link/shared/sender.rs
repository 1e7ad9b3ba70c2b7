//! The sending end of a link.

use super::heap::HeapLink;
use super::sample::Batch;
use super::service::{FIRST_PLACE, link_publisher, link_service};
use super::{LinkError, PROTOCOL_VERSION, RunNames, SampleHeader, Wake, WakeEvents, Waker};
use crate::link::Sequence;
use crate::message::{LogTime, MessageFlags, MessageHeader};
use iceoryx2::node::Node;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::service::Service;
use std::rc::Rc;

/// Messages above this size are sent by themselves, written in place; smaller ones are gathered.
const LARGEST_BATCHED: usize = 4 * 1024;
/// A batch is sent when it has reached this size.
const FULL_BATCH: usize = 64 * 1024;

/// One output port over shared memory.
pub struct LinkSender<S: Service> {
    publisher: Publisher<S, [u8], SampleHeader>,
    name: String,
    wake: Rc<Wake<S>>,
    /// For each reader: its number among all readers of the stage, and how to wake it.
    readers: Vec<(usize, Waker<S>)>,
    sequence: Sequence,
    batch: Batch,
    gather: bool,
    /// Where large payloads travel; none if that is in the samples.
    heap: Option<HeapLink>,
}

impl<S: Service> LinkSender<S> {
    /// The output `port` of `stage`. `readers` are the readers' numbers among all readers of the stage and their
    /// wakers; `depth` is the largest of their depths. Small messages are gathered if `gather` is set, and sent at
    /// once otherwise.
    #[allow(clippy::too_many_arguments)]
    pub fn new(
        node: &Node<S>,
        names: &RunNames,
        stage: &str,
        port: &str,
        depth: usize,
        wake: Rc<Wake<S>>,
        readers: Vec<(usize, Waker<S>)>,
        gather: bool,
    ) -> Result<Self, LinkError> {
        let name = format!("{stage}.{port}");
        let service = link_service(node, names, stage, port, readers.len(), depth)?;
        let publisher = link_publisher(&service).map_err(|e| LinkError::shared(format!("publish {name}"))(&e))?;
        readers.iter().try_for_each(|(_, waker)| waker.wake(WakeEvents::DATA))?;
        Ok(Self {
            publisher,
            heap: names.heap_link(&name),
            name,
            wake,
            readers,
            sequence: Sequence::default(),
            batch: Batch::default(),
            gather,
        })
    }

    /// Whether every reader has given credit.
    pub(crate) fn has_credit(&self) -> bool {
        self.readers.iter().all(|(reader, _)| self.wake.has_credit(*reader))
    }

    /// The log time that the link has reached.
    pub(crate) fn reached(&self) -> LogTime {
        self.sequence.reached()
    }

    /// Numbers a message.
    pub(crate) fn stamp(&mut self, header: &mut MessageHeader) -> Result<(), crate::stage::StageError> {
        self.sequence.stamp(header)
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

    /// Sends what was gathered. Needs credit.
    pub(crate) fn send_batch(&mut self) -> Result<(), LinkError> {
        let (header, payload) = self.batch.sample();
        let reached = self.send_payload(header, payload)?;
        self.batch.clear();
        self.sent(reached)
    }

    /// Sends one message by itself, copying its bytes once. Needs credit.
    pub(crate) fn send_bytes(&mut self, header: MessageHeader, bytes: &[u8]) -> Result<(), LinkError> {
        let reached = self.send_payload(single(header), bytes)?;
        self.sent(reached)
    }

    /// Sends one message whose bytes `write` fills in place; before, they are zero. Needs credit.
    pub(crate) fn send_in_place<E: From<LinkError>>(
        &mut self,
        header: MessageHeader,
        write: impl FnOnce(&mut [u8]) -> Result<(), E>,
    ) -> Result<(), E> {
        let length = header.length as usize;
        if let Some(heap) = self.heap_for(length) {
            let mut buffer = heap.buffer(length)?;
            buffer.resize(length, 0);
            write(&mut buffer)?;
            heap.leave(header.sequence, buffer, self.readers.len());
            let reached = self.send_sample(single(header), &[])?;
            return Ok(self.sent(reached)?);
        }
        let mut sample = self.publisher.loan_slice(length).map_err(|e| self.failed(&e))?;
        *sample.user_header_mut() = single(header);
        write(sample.payload_mut())?;
        let reached = sample.send().map_err(|e| self.failed(&e))?;
        Ok(self.sent(reached)?)
    }

    /// Tells the readers that nothing before `watermark` will follow, if they do not know it. Needs credit.
    pub(crate) fn raise(&mut self, watermark: LogTime) -> Result<(), LinkError> {
        match self.sequence.raise(watermark) {
            true => self.send_mark(MessageFlags::WATERMARK, watermark),
            false => Ok(()),
        }
    }

    /// Whether the readers do not know that nothing before `watermark` will follow.
    pub(crate) fn can_raise(&self, watermark: LogTime) -> bool {
        watermark > self.reached()
    }

    /// Says that the stream has ended, and that it has come to the given log time. Needs credit.
    pub(crate) fn end(&mut self, time: LogTime) -> Result<(), LinkError> {
        self.send_mark(MessageFlags::END, time)
    }

    /// Whether every reader has acknowledged the end.
    pub(crate) fn is_acknowledged(&self) -> bool {
        self.readers.iter().all(|(reader, _)| self.wake.has_acknowledged(*reader))
    }

    fn send_mark(&mut self, flags: MessageFlags, log_time: LogTime) -> Result<(), LinkError> {
        self.send_bytes(MessageHeader { flags, log_time, ..Default::default() }, &[])
    }

    /// Where a payload of this size travels; none if that is in its sample.
    fn heap_for(&self, length: usize) -> Option<&HeapLink> {
        self.heap.as_ref().filter(|_| length > FIRST_PLACE)
    }

    /// Sends a sample, whose payload may travel on the heap. Gives how many have got it.
    fn send_payload(&self, header: SampleHeader, payload: &[u8]) -> Result<usize, LinkError> {
        let Some(heap) = self.heap_for(payload.len()) else { return self.send_sample(header, payload) };
        let mut buffer = heap.buffer(payload.len())?;
        buffer.extend_from_slice(payload);
        heap.leave(header.message.sequence, buffer, self.readers.len());
        self.send_sample(header, &[])
    }

    /// Sends a sample with its payload. Gives how many have got it.
    fn send_sample(&self, header: SampleHeader, payload: &[u8]) -> Result<usize, LinkError> {
        let sample = self.publisher.loan_slice_uninit(payload.len()).map_err(|e| self.failed(&e))?;
        let mut sample = sample.write_from_slice(payload);
        *sample.user_header_mut() = header;
        sample.send().map_err(|e| self.failed(&e))
    }

    fn sent(&mut self, reached: usize) -> Result<(), LinkError> {
        // Those that look on get it as well, if they have room.
        if reached < self.readers.len() {
            return Err(LinkError::Lost { link: self.name.clone(), reached, readers: self.readers.len() });
        }
        for (reader, waker) in &self.readers {
            self.wake.spend(*reader);
            waker.wake(WakeEvents::DATA)?;
        }
        Ok(())
    }

    fn failed(&self, cause: &dyn std::fmt::Debug) -> LinkError {
        LinkError::shared(format!("send on {}", self.name))(cause)
    }
}

fn single(message: MessageHeader) -> SampleHeader {
    SampleHeader { version: PROTOCOL_VERSION, count: 1, message, ..Default::default() }
}
