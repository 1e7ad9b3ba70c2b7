//! Links of a live run on one machine, carried to a run on another over [Zenoh](https://zenoh.io).
//!
//! A `bridge_sink` is one end, a sender; a `bridge_source` the other, a receiver, of any number of senders. The links that are
//! carried keep their promises:
//!
//! - **Order.** The messages of a sender arrive as they were given to it, each once.
//! - **Nothing lost.** What was not taken is sent again; so a link that breaks delays, and no more. What waits beyond the room
//!   that there is, is dropped, counted, and told at both ends.
//! - **Progress.** An end is said. A sender that dies does not look like one that is done: it is told to be gone.
//!
//! # The protocol, version 1
//!
//! 1. **Presence.** Each end has a Zenoh session and a liveliness token of its own,
//!    `gridweave/bridge/BRIDGE/ROLE/NAME/NUMBER`. The numbers are those of the sessions: who is started again has another.
//! 2. **Batches.** A sender asks the receiver to take a batch (a query of Zenoh under the receiver's key), which holds all that
//!    waits, up to 128 KB. The receiver passes it on and then answers. What is not answered is asked again, the same bytes under
//!    the same number; the receiver answers again what it has taken already. So one batch is on its way at a time, and the
//!    slower the link, the larger it is.
//! 3. **Greeting.** Batch 0 says which links are carried, and carries nothing. Its answer says what the receiver's clock shows.
//! 4. **Beginning anew.** A receiver that does not know what a batch builds upon says so. The sender greets it, and sends all
//!    channels, what still waits, and the last message of each topic, as late readers of a link get it.
//! 5. **Differences.** Of topics whose last message is all that holds, such as maps, each message is told by its difference to
//!    the one before it, compressed; the receiver makes of it the same bytes.
//! 6. **Time.** Where the clocks differ by more than `clock_tolerance`, the receiver adds the difference that was measured to
//!    the log times and the times of publication. What stands in the messages themselves, such as their stamps, stays as it is:
//!    it is compared with other times of the same robot alone.
//! 7. **Taps.** A sender shows links of its run to programs that ask for them, whether it carries them or not: `tap/mod.rs`. An end
//!    that knows no taps does not answer them, and carries as ever.

mod absent;
mod certificates;
mod clock;
mod difference;
mod intake;
mod network;
mod outbox;
mod presence;
mod refusals;
mod report;
mod sender;
pub mod sink;
pub mod source;
mod tap;
#[cfg(test)]
mod tests;
mod wire;

use gridweave_runtime::stage::StageKind;
pub use refusals::hear;

/// The stage kinds of a bridge.
pub fn kinds() -> [StageKind; 3] {
    [source::kind(), sink::kind(), tap::kind()]
}
