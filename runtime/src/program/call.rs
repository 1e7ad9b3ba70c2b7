//! Calls of a program by its stage, over shared memory, one at a time.

use super::header::{CALL_VERSION, CallHeader, Reply, Request};
use super::process::{Launch, Process, ProcessError};
use crate::engine::RunFolder;
use crate::link::{LinkError, RunNames, SharedMemory};
use crate::message::MessageHeader;
use crate::stage::StageError;
use iceoryx2::node::Node;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{AllocationStrategy, BackpressureStrategy};
use iceoryx2::service::ipc::Service;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use std::fmt::Debug;
use std::time::Duration;

/// The credits of a program: the samples that may be pending for its stage.
pub const CREDITS: usize = 16;
/// The maximum number of messages that a program may borrow without copying them.
const MAX_BORROWED: usize = 32;
/// The time that a program has to end a call after its stage has failed.
const END_TIME: Duration = Duration::from_secs(5);
/// The maximum time by which a call times out before the engine kills the stage, so that the program can report where
/// it hangs.
const REPORT_MARGIN: Duration = Duration::from_secs(2);
/// The initial capacity of each sample, bytes of payload.
const INITIAL_CAPACITY: usize = 4 * 1024;

/// A running program, and the memory that it shares with its stage.
pub(super) struct Program {
    process: Process,
    ports: Option<Ports>,
    folder: Option<RunFolder>,
    shared_memory: SharedMemory,
    /// The maximum time of a call.
    longest: Option<Duration>,
    /// Whether it can still be called.
    is_alive: bool,
}

struct Ports {
    publisher: Publisher<Service, [u8], CallHeader>,
    subscriber: Subscriber<Service, [u8], CallHeader>,
    _node: Node<Service>,
}

impl Ports {
    fn open(names: &RunNames) -> Result<Self, LinkError> {
        let node = names.node::<Service>()?;
        let to = open(&node, names, "to", 1)?;
        let from = open(&node, names, "from", CREDITS)?;
        let publisher = to.publisher_builder().initial_max_slice_len(INITIAL_CAPACITY).max_loaned_samples(1);
        let publisher = publisher
            .allocation_strategy(AllocationStrategy::PowerOfTwo)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|error| failed("send to a program")(&error))?;
        let subscriber =
            from.subscriber_builder().create().map_err(|error| failed("receive from a program")(&error))?;
        Ok(Self { publisher, subscriber, _node: node })
    }
}

fn open(
    node: &Node<Service>,
    names: &RunNames,
    direction: &str,
    buffer: usize,
) -> Result<PortFactory<Service, [u8], CallHeader>, LinkError> {
    SharedMemory::default().check_free(0, || "share memory with a program".to_owned())?;
    node.service_builder(&names.call(direction)?)
        .publish_subscribe::<[u8]>()
        .user_header::<CallHeader>()
        .enable_safe_overflow(false)
        .history_size(0)
        .subscriber_max_buffer_size(buffer)
        .subscriber_max_borrowed_samples(MAX_BORROWED)
        .max_publishers(1)
        .max_subscribers(1)
        .max_nodes(2)
        .create()
        .map_err(|error| failed("share memory with a program")(&error))
}

fn failed(doing: &str) -> impl FnOnce(&dyn Debug) -> LinkError {
    LinkError::shared(doing.to_owned())
}

impl Program {
    /// Starts a program, each call of which may take `longest`.
    pub(super) fn start(launch: &Launch, longest: Option<Duration>) -> Result<Self, StageError> {
        let program = || format!("run `{}`", launch.program.display());
        let folder = RunFolder::create().map_err(|error| StageError::new(program(), error))?;
        let ports = Ports::open(&folder.names()).map_err(|error| StageError::new(program(), error))?;
        let process = Process::start(launch, folder.path()).map_err(|error| StageError::new(program(), error))?;
        let (ports, folder) = (Some(ports), Some(folder));
        // A little before the engine would kill the stage, which could not report where its program hangs.
        let longest = longest.map(|longest| longest - (longest / 4).min(REPORT_MARGIN));
        let mut started =
            Self { process, ports, folder, shared_memory: SharedMemory::default(), longest, is_alive: true };
        match started.process.wait(longest) {
            Ok(b'r') => Ok(started),
            Ok(other) => Err(StageError::new(
                program(),
                format!("it wrote the byte {other} to its standard output, which is not part of the protocol"),
            )),
            Err(lost) => Err(StageError::new(program(), lost)),
        }
    }

    /// Calls the program, and passes its outputs and warnings to `take` until `take` fails. After any other failure all
    /// later calls do nothing.
    pub(super) fn call(
        &mut self,
        what: Request,
        (port, wire): (usize, usize),
        (message, bytes): (&MessageHeader, &[u8]),
        take: impl FnMut(Reply, &CallHeader, &[u8]) -> Result<(), StageError>,
    ) -> Result<(), CallError> {
        if !self.is_alive {
            return Ok(());
        }
        let (port, wire) = (port as u32, wire as u32);
        let header = CallHeader { version: CALL_VERSION, what: what as u32, port, wire, message: *message };
        let result =
            self.send_request(header, bytes).map_err(CallError::from).and_then(|()| self.receive_replies(take));
        self.is_alive &= matches!(result, Ok(()) | Err(CallError::Stage(_)));
        result
    }

    fn send_request(&mut self, header: CallHeader, bytes: &[u8]) -> Result<(), LinkError> {
        let Some(ports) = &self.ports else { return Ok(()) };
        let doing = || format!("send {} bytes to a program", bytes.len());
        self.shared_memory.check_free(bytes.len(), doing)?;
        let sample = ports.publisher.loan_slice_uninit(bytes.len()).map_err(|error| failed(&doing())(&error))?;
        let start = std::ptr::from_ref(sample.user_header()).addr();
        self.shared_memory.commit(start..sample.payload().as_ptr_range().end.addr(), doing)?;
        let mut sample = sample.write_from_slice(bytes);
        *sample.user_header_mut() = header;
        sample.send().map_err(|error| failed(&doing())(&error))?;
        self.process.ring(b'm');
        Ok(())
    }

    /// Receives the replies of the program until it is done.
    fn receive_replies(
        &mut self,
        mut take: impl FnMut(Reply, &CallHeader, &[u8]) -> Result<(), StageError>,
    ) -> Result<(), CallError> {
        let Some(ports) = &self.ports else { return Ok(()) };
        // An output that cannot be forwarded ends the run. The program still completes its call, so that it can be
        // aborted.
        let mut refused: Option<StageError> = None;
        loop {
            let longest = match refused {
                Some(_) => Some(self.longest.map_or(END_TIME, |longest| longest.min(END_TIME))),
                None => self.longest,
            };
            if let Err(lost) = self.process.wait(longest) {
                self.is_alive = false;
                return Err(refused.map_or(CallError::Process(lost), CallError::Stage));
            }
            let sample = ports
                .subscriber
                .receive()
                .map_err(|error| CallError::Link(failed("receive from a program")(&error)))?;
            let header = sample.as_ref().map(|sample| *sample.user_header()).unwrap_or_default();
            let reply = Reply::of(header.what).filter(|_| header.version == CALL_VERSION);
            let (Some(sample), Some(reply)) = (sample, reply) else { return Err(CallError::Protocol) };
            self.process.ring(b'c');
            match reply {
                Reply::Done => return refused.map_or(Ok(()), |error| Err(CallError::Stage(error))),
                Reply::Failed => {
                    let says = || CallError::Failed(String::from_utf8_lossy(sample.payload()).into_owned());
                    return Err(refused.map_or_else(says, CallError::Stage));
                }
                reply if refused.is_none() => refused = take(reply, &header, sample.payload()).err(),
                _ => {}
            }
        }
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        self.process.end();
        self.ports = None;
        // What cannot be removed is left to the cleanup after killed runs.
        let _ = self.folder.take().map(RunFolder::remove);
    }
}

/// Why a call has failed.
#[derive(Debug, thiserror::Error)]
pub(super) enum CallError {
    /// The program has reported a failure.
    #[error("{0}")]
    Failed(String),
    /// The process of the program has ended or hangs.
    #[error("{0}")]
    Process(ProcessError),
    /// The shared memory failed.
    #[error("{0}")]
    Link(LinkError),
    /// The shared memory is full.
    #[error("there is no space left in /dev/shm, which it needs on every engine; free some")]
    Full,
    /// The program violates the protocol.
    #[error("it sent no known sample with its doorbell; its version of the protocol may differ")]
    Protocol,
    /// An output of the program could not be forwarded.
    #[error("{0}")]
    Stage(StageError),
}

impl From<LinkError> for CallError {
    fn from(error: LinkError) -> Self {
        match error {
            LinkError::Full { .. } => Self::Full,
            other => Self::Link(other),
        }
    }
}
