//! The wire protocol of DDS, the default middleware of ROS 2: DDSI-RTPS 2.3, as far as it takes to publish and
//! subscribe among Fast DDS and Cyclone DDS. What messages say is not looked into.
//!
//! - Participants find each other by multicast, or on known machines one by one ([`network`]), and announce what they
//!   are ([`discovered`]). A participant is gone if it is silent for the time of its lease, or disposes of itself ([`disposal`]).
//! - Endpoints are announced by writers of their own. A writer and a reader of one topic and one type match if the
//!   writer offers what the reader requests ([`policies`]).
//! - A [`writer`] keeps its last samples, and sends again what reliable readers ask for; late joiners get them, too,
//!   if both sides want that. A [`reader`] puts samples into their order. Large samples come in fragments
//!   ([`assembly`]).
//! - What comes from the network is not trusted: what cannot be read is left out, and memory is taken for what has come
//!   only.
//!
//! Not spoken: keys of topics, content filters, security, TCP, IPv6, shared memory.

mod assembly;
mod cursor;
mod discovered;
mod disposal;
mod guid;
mod locator;
mod message;
mod network;
mod number_set;
mod outgoing;
mod parameters;
mod participant;
mod policies;
mod reader;
mod receiver;
mod state;
mod submessage;
#[cfg(test)]
mod tests;
mod writer;

pub(crate) use cursor::{Cursor, push_text};
pub(crate) use discovered::EndpointData;
pub(crate) use guid::{EntityId, Guid, Prefix};
pub(crate) use network::{LAST_DOMAIN, Reach};
pub(crate) use participant::{Participant, Reading, Watch, Writing};
pub(crate) use policies::Policies;
pub(crate) use reader::Sample;
pub(crate) use state::Mismatch;
