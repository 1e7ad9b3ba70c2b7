//! What a program that taps and a sender say to each other.

use super::super::wire::Entry;
use serde::{Deserialize, Serialize};

/// What a program asks a sender.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Request {
    /// Who asks: the number of its token.
    pub(super) tapper: u64,
    /// The link, as STAGE.PORT; empty to ask which there are.
    pub(super) link: String,
    /// The opening that it goes on with; 0 for a first request.
    pub(super) opening: u64,
    /// The last batch that it has.
    pub(super) taken: u64,
}

/// What a sender answers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Answer {
    pub(super) state: State,
    /// The opening that this is of: another each time that the link is looked on at anew.
    pub(super) opening: u64,
    /// The number of the batch, from 1 on; where nothing has passed, that of the one before.
    pub(super) number: u64,
    /// How many messages of this opening were missed so far.
    pub(super) missed: u64,
    /// The links that there are, if that was asked.
    pub(super) links: Vec<Link>,
    /// What has passed.
    pub(super) passed: Vec<Passed>,
    /// Why it is refused, for people.
    pub(super) text: String,
}

impl Answer {
    /// What is said of a link: nothing has passed.
    pub(super) fn nothing(state: State, text: impl Into<String>) -> Self {
        Self { state, opening: 0, number: 0, missed: 0, links: Vec::new(), passed: Vec::new(), text: text.into() }
    }
}

/// How it stands with a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum State {
    /// More may follow.
    GoesOn,
    /// The run has ended, and this is the last of it.
    Ended,
    /// It cannot be seen.
    Refused,
}

/// A link of a sender's run.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Link {
    pub(super) stage: String,
    pub(super) output: String,
    /// The ROS 2 type of its messages; empty for any.
    pub(super) ros_type: String,
    /// The definition of that type, if Gridweave does not know it.
    pub(super) definition: String,
}

/// A message that has passed, or the announcement of a channel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Passed {
    /// Its number on the link.
    pub(super) sequence: u64,
    pub(super) entry: Entry,
}
