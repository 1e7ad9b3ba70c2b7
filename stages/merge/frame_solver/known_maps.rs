//! What is known of the robots' maps: which can be used, what is wrong with others, and why robots have none.

use super::solution::Alignments;
use gridweave_runtime::pipeline::list_in_words;
use gridweave_runtime::ros::{Alignment, GridError, Verdict};
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

/// What is known of the robots' maps.
pub(super) struct KnownMaps {
    /// Whether robots without a map are reported even if no robot has one.
    are_expected: bool,
    /// Whether no map will come any more.
    is_over: bool,
    /// The robots that have sent a map that can be used.
    mapped: BTreeSet<String>,
    /// What is wrong with the maps of robots that have sent none that can be used.
    unusable: BTreeMap<String, GridError>,
    /// Why robots have no map.
    without_map: BTreeMap<String, String>,
}

impl KnownMaps {
    /// Of no robot. Maps are expected where nothing else gives frames to robots.
    pub(super) fn new(are_expected: bool) -> Self {
        Self {
            are_expected,
            is_over: false,
            mapped: BTreeSet::new(),
            unusable: BTreeMap::new(),
            without_map: BTreeMap::new(),
        }
    }

    /// Learns whether a map of a robot can be used. Returns whether that changes what is known.
    pub(super) fn receive(&mut self, robot: &str, check: Result<(), GridError>) -> bool {
        match check {
            Ok(()) => {
                self.mapped.insert(robot.to_owned());
                self.unusable.remove(robot).is_some()
            }
            Err(error) if !self.mapped.contains(robot) => self.unusable.insert(robot.to_owned(), error).is_none(),
            Err(_) => false,
        }
    }

    /// Learns why a robot has no map. Returns whether that changes what is known.
    pub(super) fn set_without_map(&mut self, robot: String, reason: String) -> bool {
        self.without_map.insert(robot, reason.clone()) != Some(reason)
    }

    /// Learns that no map will come any more. Returns whether that adds to the reasons of robots.
    pub(super) fn input_ended(&mut self) -> bool {
        self.is_over = true;
        self.are_expected && self.mapped.is_empty()
    }

    /// Whether a robot has sent a map, usable or not.
    pub(super) fn has_sent(&self, robot: &str) -> bool {
        self.mapped.contains(robot) || self.unusable.contains_key(robot)
    }

    /// Whether a robot has sent maps, and none that can be used.
    pub(super) fn is_unusable(&self, robot: &str) -> bool {
        self.unusable.contains_key(robot)
    }

    /// Robots that have no map, with the reason.
    pub(super) fn without_map(&self) -> impl Iterator<Item = (String, String)> {
        self.without_map.iter().map(|(robot, reason)| (robot.clone(), reason.clone()))
    }

    /// `robots` without those of which nothing can be merged: it is known why they have no map, and they are aligned
    /// with none.
    pub(super) fn mergeable<'a>(
        &self,
        robots: &'a BTreeSet<String>,
        alignments: &Alignments,
    ) -> Cow<'a, BTreeSet<String>> {
        match robots.iter().any(|robot| self.is_without_map(robot)) {
            false => Cow::Borrowed(robots),
            true => {
                let is_left = |robot: &&String| !self.is_without_map(robot) || is_aligned(robot, alignments);
                Cow::Owned(robots.iter().filter(is_left).cloned().collect())
            }
        }
    }

    fn is_without_map(&self, robot: &str) -> bool {
        self.without_map.contains_key(robot) && !self.has_sent(robot)
    }

    /// Reasons why robots are not merged, as alignments give them, with what is known of their maps: where a map cannot
    /// be used, or it is known why there is none, that is the reason; where a robot has none, it has only tags.
    pub(super) fn explain(
        &self,
        mut reasons: BTreeMap<String, String>,
        alignments: &Alignments,
    ) -> BTreeMap<String, String> {
        for (robot, reason) in &mut reasons {
            if let Some(error) = self.unusable.get(robot) {
                *reason = format!("its map cannot be used: {error}");
            } else if (self.is_without_map(robot) || self.lacks_map(robot)) && !is_aligned(robot, alignments) {
                *reason = match self.without_map.get(robot) {
                    Some(known) => known.clone(),
                    None => format!("it has sent no map, and by its tags alone: {reason}"),
                };
            }
        }
        reasons
    }

    /// Puts before the reasons of refused alignments, at the end, which of the two robots has sent no map. Where it is
    /// known of both why they have none, there was nothing to decide, and the verdict is left out.
    pub(super) fn explain_pairs(&self, verdicts: &mut Vec<Verdict>) {
        let have_none = |Alignment { a, b, .. }: &Alignment| self.is_without_map(a) && self.is_without_map(b);
        verdicts.retain(|verdict| verdict.alignment.accepted || !have_none(&verdict.alignment));
        for Alignment { a, b, accepted, reason, .. } in verdicts.iter_mut().map(|verdict| &mut verdict.alignment) {
            let lacking = [&*a, &*b].into_iter().filter(|robot| self.lacks_map(robot));
            let lacking: Vec<String> = lacking.cloned().collect();
            if self.is_over && !*accepted && !lacking.is_empty() {
                let verb = if lacking.len() == 1 { "has" } else { "have" };
                *reason = format!("{} {verb} sent no map, and by tags alone: {reason}", list_in_words(&lacking));
            }
        }
    }

    /// Whether a robot has sent no map where others have, or where maps were expected to the end.
    fn lacks_map(&self, robot: &str) -> bool {
        (self.are_expected && self.is_over || !self.mapped.is_empty()) && !self.has_sent(robot)
    }
}

/// Whether a robot is aligned with another. There are as many alignments as pairs: it is asked last.
fn is_aligned(robot: &str, alignments: &Alignments) -> bool {
    alignments.values().any(|alignment| alignment.accepted && (alignment.a == robot || alignment.b == robot))
}
