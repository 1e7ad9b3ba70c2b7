//! Links of a sender's run, shown to programs that ask for them over the same network: also those that the sender does not carry.
//!
//! 1. **Who asks.** A program connects as a client to where the senders connect to, and has a liveliness token as
//!    `tapper/NAME/NUMBER`. When that is withdrawn, as when the program has died or its link is cut, the sender looks on no longer.
//! 2. **Asking.** It asks a sender (a query of Zenoh under the sender's key) which links its run has, and then for one of them.
//! 3. **Long polling.** The sender answers with what has passed, up to 128 KB or one message, as soon as there is something; with
//!    nothing after a while. The program says in the next request which batch it has: the one before it is answered again, the same.
//! 4. **Openings.** A request that builds upon what the sender does not know, as after it was started again, begins anew: with the
//!    last message of each topic, as late readers of a link get it, and under another number of the opening.
//! 5. **Bounds.** What waits beyond the room that there is, is dropped, the oldest first, and counted with what the sender itself
//!    has missed of the link.

mod server;
mod client;
mod sessions;
mod requests;
mod source;
#[cfg(test)]
mod tests;
mod message_queue;

pub(super) use server::Taps;
pub(super) use source::kind;
