//! The messages between a tap and a sender.

use super::super::wire::Entry;
use serde::{Deserialize, Serialize};

/// A request of a tap.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Request {
    /// The number of the tap's token.
    pub(super) tapper: u64,
    /// The link, as STAGE.PORT; empty to request the list of links.
    pub(super) link: String,
    /// The number of the opening to continue; 0 for a first request.
    pub(super) opening: u64,
    /// The number of the last received batch.
    pub(super) taken: u64,
}

/// The answer of a sender.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct TapAnswer {
    pub(super) state: State,
    /// The number of the opening: another one each time that the link is opened.
    pub(super) opening: u64,
    /// The number of the batch, from 1; without messages, the number of the previous one.
    pub(super) number: u64,
    /// The number of missed messages of this opening.
    pub(super) missed: u64,
    /// The list of links, if it was requested.
    pub(super) links: Vec<TapLink>,
    /// The messages.
    pub(super) passed: Vec<Passed>,
    /// The reason of a refusal, for people.
    pub(super) text: String,
}

impl TapAnswer {
    /// An answer without messages.
    pub(super) fn nothing(state: State, text: impl Into<String>) -> Self {
        Self { state, opening: 0, number: 0, missed: 0, links: Vec::new(), passed: Vec::new(), text: text.into() }
    }
}

/// The state of a tapped link.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum State {
    /// More may follow.
    GoesOn,
    /// The run has ended, and these are the last messages.
    Ended,
    /// The link cannot be tapped.
    Refused,
}

/// A link of a sender's run.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct TapLink {
    pub(super) stage: String,
    pub(super) output: String,
    /// The ROS 2 type of its messages; empty for any.
    pub(super) ros_type: String,
    /// The definition of that type, if it is not a built-in one.
    pub(super) definition: String,
}

/// A message of a tapped link, or the announcement of a channel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Passed {
    /// Its sequence number on the link.
    pub(super) sequence: u64,
    pub(super) entry: Entry,
}
