//! Links: one output port with all its readers.
//!
//! A link keeps three promises, whatever transport carries it:
//!
//! - **Order.** Messages of a sender arrive in the order in which they were sent. In a replay their log time never
//!   decreases.
//! - **No loss.** A reader grants credit, and a sender without credit waits (backpressure). A live link can be
//!   configured to drop the oldest message instead; every drop is counted.
//! - **Progress.** In a replay a *watermark* guarantees a reader that no message before a log time will follow, so that a
//!   stage with several inputs can continue while one of them is silent. The end of a stream is a message too, so a
//!   sender that died is never mistaken for one that has finished.
//!
//! [`direct`] links connect stages of one thread. All other links use iceoryx2 and are generic over its service
//! variant: `local` between threads, `ipc` between processes. Replays and live runs share one protocol. They differ in
//! two settings: the [`Order`] in which a stage takes its inputs, and what a live link does with a message for which
//! there is no credit.
//!
//! # The protocol, version 4
//!
//! All names start with the prefix of the run. A link is the publish-subscribe service `PREFIX/link/STAGE/PORT`. The
//! stage is its *owner*. The payload is `[u8]`, aligned to 8 bytes like its user header, a [`SampleHeader`]. Everything
//! else that the two ends exchange are numbers in the [`SharedCounters`] of the run.
//!
//! 1. **Senders.** The owner sends. On a live link, programs outside of the run may send too if the owner is a source
//!    whose messages come from outside. Each sender has an *origin*, a unique number, and numbers its samples. It
//!    creates its publisher, increments the port's sender count in the shared counters, and wakes the readers.
//! 2. **Readers.** A reader that sees a higher sender count connects to the sender, and then assigns it a *window* in
//!    the shared counters: the sender's origin, and the number of the first sample for which there is no credit.
//!    Without the window, samples sent before the reader has connected could be lost. Before its first sample of a
//!    sender, a reader does not know the sender's current number: the window says so, and the credit is the reader's
//!    depth.
//! 3. **Credit.** A sender sends a sample that lies within the windows of all readers, and waits otherwise. It never
//!    blocks inside iceoryx2. In a replay it waits for every reader, and also while samples that a reader has not taken
//!    take much memory. In a live run it does not wait for a reader whose process is gone, and never waits on a link
//!    that drops the oldest message: iceoryx2 drops it, and the reader counts the gap in the numbers.
//! 4. **Release.** A reader advances the window when the stage has taken all messages of a sample. The memory is
//!    released when the last of them is dropped. A reader that already borrows many samples copies further ones.
//! 5. **Sleeping.** Each stage has a *doorbell* (an event) in the shared counters. A stage with nothing to do marks the
//!    doorbell as slept on, checks all its conditions once more, and sleeps. Whoever changes something that a stage may
//!    wait for checks the doorbell afterwards, and wakes the stage if it sleeps. Senders outside of the run sleep on
//!    the doorbell of the owner. A reader rings for credit when half of the credit is free, or before it sleeps.
//! 6. **Batches.** A sample is one message or, in a replay, a batch of small messages. Within one process, where no
//!    other program can observe the link, a large payload travels on the heap and its sample is empty. Before it
//!    sleeps, a stage of a replay sends its batches, and a watermark on every link that has credit.
//! 7. **Late joiners.** The owner of a live link retains the last message of each topic. A reader or an observer that
//!    joins requests this history through the shared counters. The owner then sends the retained messages again: marked
//!    as repeated, with their original number and origin. A reader ignores those that it has received already.
//! 8. **End.** The owner's last message says that the stream has ended, and how many history requests it had answered.
//!    A live reader whose request is not among them, for example after a restart, waits: the owner answers it and
//!    repeats the end. A reader takes what is left, and its stage is marked as ended when it is done and borrows no
//!    samples; until then the owner keeps its publisher.

mod borrowed_samples;
mod counters;
pub mod direct;
mod error;
mod heap;
mod histogram;
mod history;
mod input_queue;
mod names;
mod observer;
mod order;
mod outputs;
mod pending_samples;
mod protocol;
#[cfg(test)]
mod protocol_model;
mod reader_credit;
mod receiver;
mod repeats;
mod sample;
mod sample_tracker;
mod sender;
mod sequence;
mod service;
mod shared_memory;
mod sleeper;
mod stage_counters;
#[cfg(test)]
mod unmapped_sample_test;

pub use counters::{MAX_SENDERS, SharedCounters, monotonic_nanoseconds};
pub use error::LinkError;
pub use histogram::Histogram;
pub use input_queue::InputQueue;
pub use names::RunNames;
pub use observer::Observer;
pub use order::{Order, latest, lower_bound, next_input};
pub use outputs::Outputs;
pub use receiver::{LinkReceiver, ReaderEnd};
pub(crate) use sample::unpack;
pub use sample::{PROTOCOL_VERSION, SampleHeader};
pub use sender::{LinkSender, SenderRole};
pub(crate) use sequence::Sequence;
pub use service::{LinkShape, PortCounters};
pub(crate) use shared_memory::{SHARED_MEMORY_FOLDER, SharedMemory};
pub use sleeper::{Control, Sleeper};
pub use stage_counters::{StageCounter, StageCounters, StageState, WireCounter};
