//! Which tags two robots have in common, and whether they agree (Tsardoulias et al., sections 4 and 4.1.3).
//!
//! - [`common_tags`] takes the tags that are certain in both maps and sorts them by their common precision.
//! - [`find_consensus`] finds the largest set of them that **one** rigid transform lays on each other. A tag that is mirrored
//!   in one map, or that was moved, is not in it; nor are the tags of another building that happen to bear the same ids.
//! - [`chance_of_agreement`] says how likely tags at random places would agree as well.
//! - [`judge`] puts this together: accepted or refused, with the reason in words.
//!
//! Two tags agree with everything that has them as far apart: what they say is **provisional**, for later stages to confirm.
//! Tags on one straight line are enough for a rigid transform. But mirroring a whole map at that line would
//! not move them, so they cannot tell that all of them are mirrored.

mod chance;
mod common;
mod consensus;
mod drift;
mod judge;
mod parameters;
mod stage;

#[cfg(test)]
mod judge_tests;

pub use chance::chance_of_agreement;
pub use common::common_tags;
pub use consensus::{Consensus, ConsensusSearch, TagPair, find_consensus};
pub use judge::{Judgement, RobotTags, judge};
pub use parameters::TagFilterParameters;
pub use stage::kind;
