//! The reading end of a link.

use super::heap::HeapLink;
use super::held::HeldSamples;
use super::sample::unpack;
use super::service::{HELD_SAMPLES, link_service};
use super::{LinkError, RunNames, SampleHeader, WakeEvents, Waker};
use crate::link::InputQueue;
use iceoryx2::node::Node;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::service::Service;
use iceoryx2::service::port_factory::PortFactory as _;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use std::collections::VecDeque;

/// One wire of a stage over shared memory.
pub struct LinkReceiver<S: Service> {
    service: PortFactory<S, [u8], SampleHeader>,
    subscriber: Subscriber<S, [u8], SampleHeader>,
    name: String,
    sender: Waker<S>,
    events: WakeEvents,
    /// This reader's number among all readers of the sending stage.
    reader: usize,
    wire: usize,
    depth: usize,
    connected: bool,
    /// For each sample that is not handled to its end: how many of its messages wait.
    waiting: VecDeque<usize>,
    /// The credit that the sender has and may still spend.
    granted: usize,
    held: HeldSamples,
    /// Where large payloads travel; none if that is in the samples.
    heap: Option<HeapLink>,
}

/// The sending end of a wire, as its reader knows it.
pub struct SenderEnd<'a, S: Service> {
    /// The sending stage.
    pub stage: &'a str,
    /// Its output port.
    pub port: &'a str,
    /// How many readers the port has.
    pub port_readers: usize,
    /// The largest depth of the port's readers.
    pub port_depth: usize,
    /// How many readers the stage has over all its ports.
    pub stage_readers: usize,
    /// This reader's number among them.
    pub reader: usize,
    /// How to wake the stage.
    pub waker: Waker<S>,
}

impl<S: Service + 'static> LinkReceiver<S> {
    /// The wire with number `wire` of a stage, which lets `depth` samples wait.
    pub fn new(
        node: &Node<S>,
        names: &RunNames,
        sender: SenderEnd<'_, S>,
        wire: usize,
        depth: usize,
    ) -> Result<Self, LinkError> {
        let name = format!("{}.{}", sender.stage, sender.port);
        let service = link_service(node, names, sender.stage, sender.port, sender.port_readers, sender.port_depth)?;
        let subscriber = service
            .subscriber_builder()
            .buffer_size(2 * sender.port_depth)
            .create()
            .map_err(|e| LinkError::shared(format!("subscribe to {name}"))(&e))?;
        Ok(Self {
            service,
            subscriber,
            heap: names.heap_link(&name),
            name,
            events: WakeEvents::new(sender.stage_readers),
            reader: sender.reader,
            sender: sender.waker,
            wire,
            depth,
            connected: false,
            waiting: VecDeque::new(),
            granted: 0,
            held: HeldSamples::default(),
        })
    }

    /// Connects to the sender once it is there, and says so by the first credit.
    pub(crate) fn connect(&mut self) -> Result<bool, LinkError> {
        if !self.connected && self.service.dynamic_config().number_of_publishers() > 0 {
            self.subscriber.update_connections().map_err(|e| self.failed("connect to", &e))?;
            self.connected = true;
            self.grant(self.depth)?;
        }
        Ok(self.connected)
    }

    /// Moves what has come in to `queue`.
    pub(crate) fn receive(&mut self, queue: &mut InputQueue) -> Result<(), LinkError> {
        while let Some(sample) = self.subscriber.receive().map_err(|e| self.failed("receive from", &e))? {
            self.granted = self.granted.saturating_sub(1);
            let header = *sample.user_header();
            let storage = match &self.heap {
                Some(heap) if header.has_payload() && sample.payload().is_empty() => {
                    heap.take(header.message.sequence)?
                }
                _ => self.held.hold(sample, self.depth + HELD_SAMPLES - 2),
            };
            let before = queue.len();
            unpack(&header, storage, &self.name, |message| queue.push(message.on_wire(self.wire)))?;
            self.waiting.push_back(queue.len() - before);
        }
        self.handled_empty_samples()
    }

    /// Notes that the stage has taken one message of this wire. `true` if it was the last of its sample.
    pub(crate) fn taken(&mut self) -> Result<bool, LinkError> {
        if let Some(first) = self.waiting.front_mut() {
            *first = first.saturating_sub(1);
        }
        let is_last = self.waiting.front() == Some(&0);
        self.handled_empty_samples()?;
        Ok(is_last)
    }

    /// Lets more samples in than the depth allows where the stage could not go on otherwise: all that waits here is of
    /// one log time, so no watermark can tell the stage that it may take it.
    pub(crate) fn relieve(&mut self, queue: &InputQueue) -> Result<(), LinkError> {
        match self.granted == 0 && !queue.is_empty() && queue.is_one_moment() {
            true => self.grant(self.depth),
            false => Ok(()),
        }
    }

    /// Acknowledges the end of the stream.
    pub(crate) fn acknowledge(&self) -> Result<(), LinkError> {
        self.sender.wake(self.events.acknowledged(self.reader))
    }

    /// Gives credit back for samples that are handled to their end; by half the depth at a time, as each time wakes
    /// the sender.
    fn handled_empty_samples(&mut self) -> Result<(), LinkError> {
        while self.waiting.front() == Some(&0) {
            self.waiting.pop_front();
        }
        let free = self.depth.saturating_sub(self.waiting.len() + self.granted);
        match free > 0 && 2 * free >= self.depth {
            true => self.grant(free),
            false => Ok(()),
        }
    }

    fn grant(&mut self, credit: usize) -> Result<(), LinkError> {
        self.granted += credit;
        (0..credit).try_for_each(|_| self.sender.wake(self.events.credit(self.reader)))
    }

    fn failed(&self, doing: &str, cause: &dyn std::fmt::Debug) -> LinkError {
        LinkError::shared(format!("{doing} {}", self.name))(cause)
    }
}
