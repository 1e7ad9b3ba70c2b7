//! The sending end of a live link.

use super::kept::Kept;
use super::service::{LinkShape, PortBoard};
use crate::link::board::{
    MAX_SENDERS, NOTHING_HEARD, StageBoard, StageNumber, StageState, WireNumber, monotonic_nanoseconds,
};
use crate::link::shared::{LinkError, PROTOCOL_VERSION, RunNames, SampleHeader, Wake, WakeEvents, Waker};
use crate::message::{LogTime, MessageFlags, MessageHeader};
use crate::pipeline::Overflow;
use crate::stage::{OutputSink, StageError};
use iceoryx2::node::Node;
use iceoryx2::port::publisher::{Publisher, PublisherCreateError};
use iceoryx2::prelude::{AllocationStrategy, BackpressureStrategy};
use iceoryx2::sample_mut::SampleMut;
use iceoryx2::service::Service;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// A sender that waits for room looks so often. The owner of a link is woken before.
const LOOK_INTERVAL: Duration = Duration::from_millis(1);

/// A reader of a link, as its senders know it.
pub struct LiveReader<S: Service> {
    /// How to wake it.
    pub waker: Waker<S>,
    /// Where it notes how far it is.
    pub board: StageBoard,
    /// Which of its wires this is.
    pub wire: usize,
    /// How far it may be behind.
    pub depth: usize,
    /// Its number among all readers of the sending stage.
    pub number: usize,
}

impl<S: Service> LiveReader<S> {
    /// Whether its process runs and takes messages.
    fn is_there(&self) -> bool {
        matches!(self.board.state(), StageState::Starting | StageState::Running)
    }
}

/// How a sender waits, and learns that it should not any longer.
#[derive(Clone)]
pub enum Pause<S: Service> {
    /// As a stage of the run, which can be woken.
    Stage(Rc<Wake<S>>),
    /// As a program outside of the run, which stops when this is set.
    Program(Arc<AtomicBool>),
}

impl<S: Service> Pause<S> {
    fn pause(&self) -> Result<(), LinkError> {
        match self {
            Self::Stage(wake) => wake.sleep_for(LOOK_INTERVAL),
            Self::Program(stop) if stop.load(Ordering::Relaxed) => Err(LinkError::Stopped),
            Self::Program(_) => {
                std::thread::sleep(LOOK_INTERVAL);
                Ok(())
            }
        }
    }
}

/// What a sender knows of a reader.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    /// There is room for the messages before this one.
    room_until: u64,
    /// When the stage was started that had heard nothing yet, and the message that was then the next.
    started: u64,
    first: u64,
}

impl Seen {
    /// Which number the reader expects next, as the board says; none while it is not connected.
    fn expected<S: Service>(&mut self, reader: &LiveReader<S>, origin: u64, sequence: u64) -> Option<u64> {
        match reader.board.next_of(reader.wire, origin)? {
            NOTHING_HEARD => {
                let started = reader.board.get(StageNumber::Started);
                if self.started != started {
                    (self.started, self.first) = (started, sequence);
                }
                Some(self.first)
            }
            next => Some(next),
        }
    }
}

/// One sender of a live link.
pub struct LiveSender<S: Service> {
    publisher: Publisher<S, [u8], SampleHeader>,
    name: String,
    overflow: Overflow,
    readers: Vec<LiveReader<S>>,
    /// What is known of each reader.
    seen: Vec<Seen>,
    pause: Pause<S>,
    /// How to wake the owner, if this is another.
    owner: Option<Waker<S>>,
    /// The last messages, if this is the owner.
    kept: Option<Kept<S>>,
    /// Where the owner counts.
    port: PortBoard,
    origin: u64,
    sequence: u64,
    waited: Duration,
}

impl<S: Service + 'static> LiveSender<S> {
    /// A sender of the link that is an output port: of its stage, or of another program, which is told how to wake the stage,
    /// the `owner`.
    pub fn new(
        node: &Node<S>,
        names: &RunNames,
        shape: &LinkShape<'_>,
        readers: Vec<LiveReader<S>>,
        pause: Pause<S>,
        port: PortBoard,
        owner: Option<Waker<S>>,
    ) -> Result<Self, LinkError> {
        let name = shape.name();
        let service = shape.open(node, names)?;
        let kept = owner
            .is_none()
            .then(|| Kept::new(&service, &name, port.board.get(StageNumber::Restarts) == 0))
            .transpose()?;
        let publisher = service
            .publisher_builder()
            .initial_max_slice_len(4096)
            .max_loaned_samples(1)
            .allocation_strategy(AllocationStrategy::PowerOfTwo)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|e| match e {
                PublisherCreateError::ExceedsMaxSupportedPublishers => {
                    LinkError::Crowded { doing: "send on".into(), link: name.clone(), most: MAX_SENDERS - 1 }
                }
                other => LinkError::shared(format!("publish {name}"))(&other),
            })?;
        readers.iter().map(|reader| &reader.waker).for_each(|waker| drop(waker.wake(WakeEvents::DATA)));
        let seen = vec![Seen::default(); readers.len()];
        Ok(Self {
            origin: origin(publisher.id().value()),
            publisher,
            name,
            overflow: shape.overflow,
            readers,
            seen,
            pause,
            owner,
            kept,
            port,
            sequence: 0,
            waited: Duration::ZERO,
        })
    }

    /// Sends one message whose bytes lie in `sample`. There must be room.
    fn send_sample(
        &mut self,
        mut message: MessageHeader,
        mut sample: SampleMut<S, [u8], SampleHeader>,
    ) -> Result<(), LinkError> {
        message.sequence = self.sequence;
        *sample.user_header_mut() = self.header(message, self.origin);
        sample.send().map_err(|e| self.failed(&e))?;
        self.sequence += 1;
        self.wake_readers();
        self.look_at_all()
    }

    /// Sends one message, copying its bytes once.
    fn send_bytes(&mut self, message: MessageHeader, bytes: &[u8]) -> Result<(), LinkError> {
        self.wait_for_room()?;
        let sample = self.publisher.loan_slice_uninit(bytes.len()).map_err(|e| self.failed(&e))?;
        self.send_sample(message, sample.write_from_slice(bytes))
    }

    /// Waits until every reader that is there is connected and has room, if the link waits.
    fn wait_for_room(&mut self) -> Result<(), LinkError> {
        if self.overflow == Overflow::DropOldest {
            return Ok(());
        }
        for (reader, seen) in self.readers.iter().zip(&mut self.seen) {
            while self.sequence >= seen.room_until && reader.is_there() {
                let expected = seen.expected(reader, self.origin, self.sequence);
                seen.room_until = expected.map_or(0, |expected| expected.saturating_add(reader.depth as u64));
                if self.sequence >= seen.room_until {
                    reader.board.set_wire(reader.wire, WireNumber::OwnerWaits, u64::from(self.owner.is_none()));
                    let start = Instant::now();
                    self.pause.pause()?;
                    self.waited += start.elapsed();
                }
            }
        }
        Ok(())
    }

    /// How long it has waited for room.
    pub fn waited(&self) -> Duration {
        self.waited
    }

    /// Sends the last message of each topic again.
    pub fn repeat(&mut self) -> Result<(), LinkError> {
        self.look_at_all()?;
        let Some(kept) = &self.kept else { return Ok(()) };
        for (header, bytes) in kept.messages() {
            // A program of another may say a length that its sample does not have.
            let Some(bytes) = bytes.bytes().get(..header.message.length as usize) else { continue };
            let sample = self.publisher.loan_slice_uninit(bytes.len()).map_err(|e| self.failed(&e))?;
            let mut sample = sample.write_from_slice(bytes);
            let flags = MessageFlags(header.message.flags.0 | MessageFlags::REPEATED.0);
            *sample.user_header_mut() = self.header(MessageHeader { flags, ..header.message }, header.origin);
            sample.send().map_err(|e| self.failed(&e))?;
        }
        self.wake_readers();
        Ok(())
    }

    /// Lets the owner take in what was sent on the link, by whomever, so that it can be repeated, and count it.
    pub fn look_at_all(&mut self) -> Result<(), LinkError> {
        if let Some(kept) = &mut self.kept {
            let count = kept.update(&self.name)?;
            self.port.board.add_sent(self.port.port, count);
        }
        Ok(())
    }

    /// Says that the stream has ended, having come to the given log time.
    pub fn end(&mut self, log_time: LogTime) -> Result<(), LinkError> {
        self.send_bytes(MessageHeader { flags: MessageFlags::END, log_time, ..Default::default() }, &[])
    }

    /// The numbers, among all readers of the stage, of those that are there.
    pub fn present_readers(&self) -> impl Iterator<Item = usize> {
        self.readers.iter().filter(|reader| reader.is_there()).map(|reader| reader.number)
    }

    /// Whether every reader that is there is connected to this sender.
    pub fn is_connected(&self) -> bool {
        let is_connected = |reader: &LiveReader<S>| reader.board.next_of(reader.wire, self.origin).is_some();
        self.readers.iter().all(|reader| !reader.is_there() || is_connected(reader))
    }

    /// Whether every reader that is there has taken all that this sender has sent.
    pub fn is_taken(&mut self) -> bool {
        self.readers.iter().zip(&mut self.seen).all(|(reader, seen)| {
            let expected = seen.expected(reader, self.origin, self.sequence);
            !reader.is_there() || expected.is_some_and(|expected| expected >= self.sequence)
        })
    }

    fn header(&self, message: MessageHeader, origin: u64) -> SampleHeader {
        SampleHeader { version: PROTOCOL_VERSION, count: 1, sent_at: monotonic_nanoseconds(), origin, message }
    }

    fn wake_readers(&self) {
        // One that is not there cannot be woken and need not be.
        let wakers = self.readers.iter().map(|reader| &reader.waker).chain(&self.owner);
        wakers.for_each(|waker| drop(waker.wake(WakeEvents::DATA)));
    }

    fn failed(&self, cause: &dyn std::fmt::Debug) -> LinkError {
        LinkError::shared(format!("send on {}", self.name))(cause)
    }
}

impl<S: Service + 'static> OutputSink for LiveSender<S> {
    fn send(&mut self, header: MessageHeader, bytes: &[u8]) -> Result<(), StageError> {
        Ok(self.send_bytes(header, bytes)?)
    }

    fn send_in_place(
        &mut self,
        header: MessageHeader,
        write: &mut dyn FnMut(&mut [u8]) -> Result<(), StageError>,
    ) -> Result<(), StageError> {
        self.wait_for_room()?;
        let mut sample = self.publisher.loan_slice(header.length as usize).map_err(|e| self.failed(&e))?;
        write(sample.payload_mut())?;
        Ok(self.send_sample(header, sample)?)
    }
}

/// The number by which readers know a sender, made of iceoryx2's for its publisher; never 0.
pub(super) fn origin(publisher: u128) -> u64 {
    ((publisher >> 64) as u64 ^ publisher as u64).max(1)
}
