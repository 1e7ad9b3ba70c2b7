//! A search of the maps, for pairs whose hypotheses come from a source that has not looked for alternatives.

use super::numbered_map::NumberedMap;
use crate::registration::icp::IcpParameters;
use crate::registration::judgement::{Decision, UserKnowledge};
use crate::registration::search::MapAlignerParameters;
use crate::registration::{Basis, Hypothesis, PreparedPair};
use crate::shared::robot_pair::RobotPair;
use std::collections::BTreeMap;

/// Inlier ratio above which nothing contradicts the tags.
const CLEAR_AGREEMENT: f64 = 0.9;

/// Hypotheses of a search for pairs of robots, each for the last two maps that were searched.
#[derive(Debug, Default)]
pub(super) struct MapSearches(BTreeMap<RobotPair, Searched>);

#[derive(Debug)]
struct Searched {
    /// Numbers of the two maps among those of their robots.
    maps: (u64, u64),
    found: Vec<Hypothesis>,
}

impl MapSearches {
    /// Whether a search is needed: no source has looked whether the maps fit elsewhere as well, and no hypothesis has
    /// both enough tags and a high inlier ratio.
    pub(super) fn is_due(hypotheses: &[Hypothesis], decision: &Decision) -> bool {
        let usable = || hypotheses.iter().filter(|hypothesis| !hypothesis.is_refused);
        let is_by_search = |hypothesis: &Hypothesis| matches!(hypothesis.basis, Basis::Search { .. });
        let is_clear = decision.candidate.agreement.inlier_ratio() >= CLEAR_AGREEMENT
            && usable().any(|hypothesis| hypothesis.basis == Basis::Tags);
        usable().next().is_some() && !usable().any(is_by_search) && !is_clear && decision.chosen.is_none()
    }

    /// Peaks of the search of two maps.
    pub(super) fn of(
        &mut self,
        pair: &RobotPair,
        [a, b]: &[NumberedMap<'_>; 2],
        known: &UserKnowledge,
    ) -> &[Hypothesis] {
        let maps = (a.number, b.number);
        if self.0.get(pair).is_none_or(|searched| searched.maps != maps) {
            let (search, icp) = (MapAlignerParameters::default(), IcpParameters::default());
            let prepared = PreparedPair::new(a.view.grid, b.view.grid, &search);
            // Maps that fit nowhere have no alternative.
            let found = prepared.and_then(|prepared| prepared.hypotheses(known, &search, &icp)).unwrap_or_default();
            let found =
                found.into_iter().map(|hypothesis| Hypothesis { is_alternative_only: true, ..hypothesis }).collect();
            self.0.insert(pair.clone(), Searched { maps, found });
        }
        self.0.get(pair).map_or(&[], |searched| &searched.found)
    }
}
