//! The sending end of a link.

use super::sample::Batch;
use super::{LinkError, PROTOCOL_VERSION, RunNames, SampleHeader, Wake, WakeEvents, Waker};
use crate::link::Sequence;
use crate::link::live::{MAX_OBSERVERS, OBSERVER_BUFFER};
use crate::message::{LogTime, MessageFlags, MessageHeader};
use iceoryx2::node::Node;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::prelude::{Alignment, AllocationStrategy, BackpressureStrategy};
use iceoryx2::service::Service;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use std::rc::Rc;

/// Messages above this size are sent by themselves, written in place; smaller ones are gathered.
const LARGEST_BATCHED: usize = 4 * 1024;
/// A batch is sent when it has reached this size.
const FULL_BATCH: usize = 64 * 1024;
/// How many samples a reader may hold beside those that wait for it; what comes on top of that is copied.
pub(super) const HELD_SAMPLES: usize = 64;

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
        let publisher = link_service(node, names, stage, port, readers.len(), depth)?
            .publisher_builder()
            .initial_max_slice_len(FULL_BATCH / 16)
            .max_loaned_samples(1)
            .allocation_strategy(AllocationStrategy::PowerOfTwo)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|e| LinkError::shared(format!("publish {stage}.{port}"))(&e))?;
        readers.iter().try_for_each(|(_, waker)| waker.wake(WakeEvents::DATA))?;
        Ok(Self {
            publisher,
            name: format!("{stage}.{port}"),
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
        let sample = self.publisher.loan_slice_uninit(payload.len()).map_err(|e| self.failed(&e))?;
        let mut sample = sample.write_from_slice(payload);
        *sample.user_header_mut() = header;
        let reached = sample.send().map_err(|e| self.failed(&e))?;
        self.batch.clear();
        self.sent(reached)
    }

    /// Sends one message by itself, copying its bytes once. Needs credit.
    pub(crate) fn send_bytes(&mut self, header: MessageHeader, bytes: &[u8]) -> Result<(), LinkError> {
        let sample = self.publisher.loan_slice_uninit(bytes.len()).map_err(|e| self.failed(&e))?;
        let mut sample = sample.write_from_slice(bytes);
        *sample.user_header_mut() = single(header);
        let reached = sample.send().map_err(|e| self.failed(&e))?;
        self.sent(reached)
    }

    /// Sends one message whose bytes `write` fills in place; before, they are zero. Needs credit.
    pub(crate) fn send_in_place<E: From<LinkError>>(
        &mut self,
        header: MessageHeader,
        write: impl FnOnce(&mut [u8]) -> Result<(), E>,
    ) -> Result<(), E> {
        let mut sample = self.publisher.loan_slice(header.length as usize).map_err(|e| self.failed(&e))?;
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

/// The service of a link, the same for its sender and its readers.
pub(super) fn link_service<S: Service>(
    node: &Node<S>,
    names: &RunNames,
    stage: &str,
    port: &str,
    readers: usize,
    depth: usize,
) -> Result<PortFactory<S, [u8], SampleHeader>, LinkError> {
    let failed = |cause: &dyn std::fmt::Debug| LinkError::shared(format!("open the link {stage}.{port}"))(cause);
    // Nobody sees a link from outside that does not leave the process.
    let observers = if names.is_shared() { MAX_OBSERVERS } else { 0 };
    node.service_builder(&names.link(stage, port)?)
        .publish_subscribe::<[u8]>()
        .user_header::<SampleHeader>()
        .payload_alignment(Alignment::new(8).ok_or_else(|| failed(&"alignment"))?)
        .enable_safe_overflow(false)
        .history_size(0)
        .subscriber_max_buffer_size(if names.is_shared() { (2 * depth).max(OBSERVER_BUFFER) } else { 2 * depth })
        .subscriber_max_borrowed_samples(depth + HELD_SAMPLES)
        .max_publishers(1)
        .max_subscribers(readers.max(1) + observers)
        .max_nodes(readers + 2 + observers)
        .open_or_create()
        .map_err(|e| failed(&e))
}
