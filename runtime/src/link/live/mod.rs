//! Live links over iceoryx2: messages by arrival, senders and readers that come and go, and a choice of what is dropped.
//!
//! # The protocol
//!
//! Names, samples and events are those of [`shared`](super::shared). A link is a publish-subscribe service
//! `PREFIX/link/STAGE/PORT`. Each sample holds one message, with the time at which it was sent and the number of its
//! *origin*, the sender that has numbered it. What differs from a replay:
//!
//! 1. The stage that the link belongs to is its *owner*. Programs outside of the run may send on the links of a source
//!    whose messages come from outside; all senders of a link are alike but for rules 4 and 5.
//! 2. A reader notes on the [board](super::board) which senders it is connected to, and which number it expects next of
//!    each. On a link that waits, a sender sends while every reader is connected and less than its depth behind; a reader
//!    whose process is gone is not waited for. An owner that waits says so on the board, and the reader wakes it when half
//!    of the room is free; other senders look every millisecond.
//! 3. On a link that drops the oldest, iceoryx2 drops it. A reader sees this from the numbers, and counts it.
//! 4. The owner keeps the last message of each topic. A reader that comes greets the owner, by the event that gives
//!    credit in a replay; the owner sends what it keeps again, marked as repeated, and with the number and the origin
//!    that it had. A reader leaves out what it had already.
//! 5. Only the owner ends a link. A reader then takes what is left, and acknowledges it as in a replay.

mod kept;
mod receiver;
mod sender;
mod service;

pub use receiver::{LiveReceiver, ReaderEnd};
pub use sender::{LiveReader, LiveSender, Pause};
pub use service::{LinkShape, Observer, PortBoard};
pub(crate) use service::{MAX_OBSERVERS, OBSERVER_BUFFER};
