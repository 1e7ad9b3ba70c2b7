//! Taps: links of a sender's run that other programs observe over the same network, including links that the sender
//! does not transport.
//!
//! 1. **Discovery.** A program connects as a client to the address that the senders connect to, and has the liveliness
//!    token `tapper/NAME/NUMBER`. When the token is withdrawn, because the program has died or is disconnected, the
//!    sender stops observing.
//! 2. **Requests.** It requests the links of a sender's run (a Zenoh query under the sender's key), and then the
//!    messages of one.
//! 3. **Long polling.** The sender answers with the pending messages, up to 128 KB or one message, as soon as there are
//!    any, or with none after a timeout. The next request names the last received batch: if it is the one before, the
//!    last batch is sent again.
//! 4. **Openings.** A request whose state the sender does not know, for example after a restart, starts a new opening,
//!    with another number: it begins with the last message of each topic, as for late joiners of a link.
//! 5. **Limits.** Pending messages beyond the limits are dropped, the oldest first, and counted together with those
//!    that the sender itself has missed on the link.

mod client;
mod message_queue;
mod requests;
mod server;
mod sessions;
mod source;
#[cfg(test)]
mod tests;

pub(super) use server::Taps;
pub(super) use source::kind;
