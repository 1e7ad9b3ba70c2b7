//! Links: one output with all its readers.
//!
//! A link keeps three promises, whatever carries it:
//!
//! - **Order.** Messages of a sender arrive as they were sent, and in a replay never go back in log time.
//! - **Nothing lost.** A reader grants room, and a sender without room waits; a live link may be told to drop the oldest
//!   message instead, and every drop is counted.
//! - **Progress.** In a replay a *watermark* tells a reader that nothing before a log time will follow, so that a stage with
//!   several inputs can go on while one of them is silent. The end of the stream is a message of its own, so a sender
//!   that dies never looks like one that is done.
//!
//! [`direct`] carries messages between stages of one thread. All else goes over iceoryx2, generic over its service variant:
//! `local` between threads, `ipc` between processes. One protocol serves replays and live runs. What differs is a setting:
//! the [`Order`] in which a stage takes its inputs, and for a live link what becomes of a message for which there is no room.
//!
//! # The protocol, version 4
//!
//! All names stand below the run's prefix. A link is a publish-subscribe service `PREFIX/link/STAGE/PORT`. The stage is its
//! *owner*. The payload is `[u8]`, aligned to 8 as its user header is, a [`SampleHeader`]. What its ends tell each other beside
//! the messages are numbers on the [`Board`] of the run.
//!
//! 1. **Senders.** The owner sends; on a live link, programs outside of the run may send as well, if the owner is a source whose
//!    messages come from outside. A sender is known by its *origin*, and numbers its samples. It makes its publisher, counts
//!    itself on the board among the senders that have come to the port, and wakes the readers.
//! 2. **Readers.** A reader that finds a sender that has come connects to it, and then gives it a *window* on the board: the
//!    sender's origin, and the number of the first sample for which there is no room. Without this, what is sent before the
//!    reader has connected could be lost. While the reader has had nothing of a sender, it does not know where the
//!    numbers stand: the window says so, and there is room for as many samples as the reader is deep.
//! 3. **Room.** A sender sends a sample that lies within the windows of all readers, and waits for the others. It never blocks
//!    inside iceoryx2. In a replay it waits for every reader. In a live run it does not wait for one whose process is gone,
//!    nor at all on a link that drops the oldest: iceoryx2 drops it, and the reader counts what is missing among the numbers.
//! 4. **Giving back.** A reader moves the window on when the stage has taken all messages of a sample. The memory goes back when
//!    the last of them is dropped. A reader that holds many samples copies those that come on top of them.
//! 5. **Sleeping.** Each stage has a *bell* on the board. A stage that has nothing to do says there that it sleeps, looks once
//!    more at all that it waits for, and sleeps. Whoever changes something that the stage may wait for looks at the bell
//!    afterwards, and wakes it if it sleeps. Senders outside of the run sleep at the bell of the owner. A reader rings for
//!    room when half of it is free, or when it goes to sleep itself.
//! 6. **Batches.** A sample is one message, or in a replay a batch of small ones. Within one process, where other programs cannot
//!    look on, a large payload travels on the heap, and its sample has none. Before it sleeps, a stage of a replay sends what
//!    it has gathered, and a watermark on every link that has room.
//! 7. **Late readers.** The owner of a live link keeps the last message of each topic. A reader that comes, or a program that
//!    looks on, counts itself among the greetings of the owner, which then sends what it keeps again: marked as
//!    repeated, with the number and the origin that it had. A reader leaves out what it had already.
//! 8. **The end.** The owner's last message says that the stream has ended, and how many greetings it had answered. A live
//!    reader whose own is not among them, as one that was just started again, waits: the owner answers it, and says it
//!    again. A reader takes what is left, and is noted on the board as ended when its stage is done and holds nothing any
//!    more; the owner keeps its publisher until then.

mod board;
pub mod direct;
mod error;
mod heap;
mod heard;
mod held;
mod histogram;
mod input_queue;
mod kept;
mod names;
mod observer;
mod order;
mod outputs;
mod protocol;
#[cfg(test)]
mod protocol_model;
mod receiver;
mod repeats;
mod room;
mod sample;
mod sender;
mod sequence;
mod service;
mod sleeper;
mod stage_board;

pub use board::{Board, MAX_SENDERS, monotonic_nanoseconds};
pub use error::LinkError;
pub use histogram::Histogram;
pub use input_queue::InputQueue;
pub use names::RunNames;
pub use observer::Observer;
pub use order::{Order, latest, lower_bound, next_input};
pub use outputs::Outputs;
pub use receiver::{LinkReceiver, ReaderEnd};
pub(crate) use room::{Room, SHARED_MEMORY};
pub(crate) use sample::unpack;
pub use sample::{PROTOCOL_VERSION, SampleHeader};
pub use sender::{LinkSender, SenderRole};
pub(crate) use sequence::Sequence;
pub use service::{LinkShape, PortBoard};
pub use sleeper::{Control, Sleeper};
pub use stage_board::{StageBoard, StageNumber, StageState, WireNumber};
