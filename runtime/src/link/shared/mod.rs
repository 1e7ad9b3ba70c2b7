//! Links over iceoryx2, generic over its service variant: `local` between threads, `ipc` between processes.
//!
//! # The protocol, version 2
//!
//! All names stand below the run's prefix. A link is a publish-subscribe service `PREFIX/link/STAGE/PORT` with one
//! publisher and the output's readers as subscribers. Its payload is `[u8]`, aligned to 8 as its user header is, a
//! [`SampleHeader`].
//!
//! Each stage has one event service, `PREFIX/wake/STAGE`, with one listener. iceoryx2 counts events, so that an event
//! can carry a number: how often it was sent. [`WakeEvents`] gives the meaning of the ids.
//!
//! 1. The sender makes its listener, then its publisher, then sends [`WakeEvents::DATA`] to each reader.
//! 2. A reader makes its listener and its subscriber, waits until the publisher is there, connects to it, and says
//!    that it is ready: it sends its first credit. Without this, what is sent before the reader has connected can be
//!    lost.
//! 3. The sender spends one credit of every reader on each sample, and waits while a reader has given none. It never
//!    blocks inside iceoryx2.
//! 4. A reader gives credit back when the stage has taken all messages of a sample; the memory goes back when the last
//!    of them is dropped. A reader that holds many samples copies those that come on top of them.
//! 5. A sample is one message, or a batch of small ones. Within one process, where other programs cannot look on, a
//!    large payload travels on the heap, and its sample has none. Before it sleeps, a stage sends what it has gathered, and a
//!    watermark on every link that has credit.
//! 6. The sender's last message says that the stream has ended. A reader acknowledges it when its stage is done and has
//!    dropped all it held; the sender keeps its publisher until then.

mod activity;
mod error;
mod heap;
mod held;
mod names;
mod outputs;
mod receiver;
mod sample;
mod sender;
mod service;
mod wake;

pub use activity::Activity;
pub use error::LinkError;
pub(crate) use held::HeldSamples;
pub use names::RunNames;
pub use outputs::SharedOutputs;
pub use receiver::{LinkReceiver, SenderEnd};
pub(crate) use sample::unpack;
pub use sample::{PROTOCOL_VERSION, SampleHeader};
pub use sender::LinkSender;
pub use wake::{Wake, WakeEvents, Waker};
