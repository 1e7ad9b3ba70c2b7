//! Links of a live run on one machine, transported to a run on another over [Zenoh](https://zenoh.io).
//!
//! One end is a `bridge_sink`, a sender; the other is a `bridge_source`, a receiver of any number of senders. The
//! bridge gives the same guarantees as a link:
//!
//! - **Order.** The messages of a sender arrive in their order, each exactly once.
//! - **No loss.** Unacknowledged messages are sent again, so a broken connection only delays them. Messages beyond the
//!   limits of the queue are dropped, counted, and reported at both ends.
//! - **Progress.** The end of a stream is sent explicitly, so a sender that dies is not mistaken for one that has
//!   finished: the receiver reports that it is gone.
//!
//! # The protocol, version 1
//!
//! 1. **Presence.** Each end has its own Zenoh session and liveliness token,
//!    `gridweave/bridge/BRIDGE/ROLE/NAME/NUMBER`. The number is derived from the session: a restarted end has another
//!    one.
//! 2. **Batches.** A sender sends a batch with all pending messages, up to 128 KB, as a Zenoh query under the
//!    receiver's key. The receiver forwards the messages and then answers. A batch without an answer is sent again,
//!    with the same bytes and number; the receiver answers a batch that it has taken already again. So one batch is in
//!    flight at a time, and batches grow on a slow connection. A receiver keeps one batch of a session, and a limited
//!    number and size of all: what it does not keep ends without an answer.
//! 3. **Handshake.** Batch 0 lists the links, without messages. Its answer contains the receiver's clock.
//! 4. **Restart.** A receiver that misses the state that a batch depends on rejects it. The sender repeats the
//!    handshake, and sends all channels, the pending messages, and the last message of each topic, as for late joiners
//!    of a link.
//! 5. **Differences.** On topics with states, such as maps, each message is sent as its compressed difference to the
//!    previous one; the receiver restores the same bytes.
//! 6. **Time.** If the clocks differ by more than `clock_tolerance`, the receiver adds the measured offset to log times
//!    and publish times. Times inside messages, such as stamps, are unchanged, as they are only compared with times of
//!    the same robot.
//! 7. **Taps.** A sender provides links of its run to programs that request them, whether it transports them or not:
//!    `tap/mod.rs`. An end without support for taps does not answer the requests.

#![forbid(unsafe_code)]

mod absent_senders;
mod arrivals;
mod certificates;
mod channel_numbers;
pub mod clock;
mod connection_errors;
mod difference;
mod ingest;
mod network;
mod outbox;
mod presence;
mod report;
mod sender;
pub mod sink;
pub mod source;
mod tap;
#[cfg(test)]
mod tests;
mod warning_texts;
mod wire;
pub mod zenoh_session;

pub use connection_errors::on_log_warning;
use gridweave_runtime::stage::StageKind;

/// The stage kinds of a bridge.
pub fn kinds() -> [StageKind; 3] {
    [source::kind(), sink::kind(), tap::kind()]
}
