//! The tags that two robots have in common, and whether they agree (Tsardoulias et al., sections 4 and 4.1.3).
//!
//! - [`common_tags`] takes the tags that are certain in both maps and sorts them by their common precision.
//! - [`find_consensus`] finds the largest set of them that agree on **one** rigid transform. A tag that is mirrored
//!   in one map, or that was moved, is not in it; nor are the tags of another building with the same ids.
//! - [`chance_of_agreement`] is the probability that tags at random positions would agree as well.
//! - [`judge`] combines these: accepted or refused, with the reason as text.
//!
//! Two tags agree with every map in which their distance is the same: they are **provisional**, for later stages to
//! confirm. Tags on one straight line are enough for a rigid transform. But mirroring a whole map at that line would
//! not move them, so a mirrored map is not detected.

mod chance;
mod common;
mod consensus;
mod drift;
mod judge;
mod parameters;
mod refusal;
mod stage;

#[cfg(test)]
mod judge_tests;

pub use chance::chance_of_agreement;
pub use common::common_tags;
pub use consensus::{ConsensusSearch, TagConsensus, TagPair, find_consensus};
pub use judge::{RobotTags, TagJudgement, judge};
pub use parameters::TagFilterParameters;
pub use stage::kind;
