//! A search of the maps themselves, for pairs whose hypotheses come from a source that has not looked for other places.

use crate::registration::icp::IcpParameters;
use crate::registration::judgement::{UserKnowledge, Verdict};
use crate::registration::search::MapAlignerParameters;
use crate::registration::{Basis, Hypothesis, PreparedPair};
use crate::shared::geometry::Grid;
use crate::shared::robot_pair::RobotPair;
use std::collections::BTreeMap;

/// The inlier ratio from which on nothing contradicts what tags say.
const CLEAR_AGREEMENT: f64 = 0.9;

/// The places that were found of pairs of robots, each for the last two maps that were searched.
#[derive(Debug, Default)]
pub(super) struct PlaceSearches(BTreeMap<RobotPair, Searched>);

#[derive(Debug)]
struct Searched {
    /// The numbers of the two maps among those of their robots.
    maps: (u64, u64),
    found: Vec<Hypothesis>,
}

impl PlaceSearches {
    /// Whether hypotheses need a search beside them: nobody has looked whether the maps fit elsewhere as well, and no place is both fixed by
    /// enough tags and clear.
    pub(super) fn is_due(hypotheses: &[Hypothesis], verdict: &Verdict) -> bool {
        let usable = || hypotheses.iter().filter(|hypothesis| !hypothesis.is_refused);
        let is_by_search = |hypothesis: &Hypothesis| matches!(hypothesis.basis, Basis::Search { .. });
        let is_clear = verdict.candidate.agreement.inlier_ratio() >= CLEAR_AGREEMENT
            && usable().any(|hypothesis| hypothesis.basis == Basis::Tags);
        usable().next().is_some() && !usable().any(is_by_search) && !is_clear && verdict.chosen.is_none()
    }

    /// The places of map b on map a, each map with its number among those of its robot.
    pub(super) fn of(
        &mut self,
        pair: &RobotPair,
        (a, b): ((u64, Grid<'_>), (u64, Grid<'_>)),
        known: &UserKnowledge,
    ) -> &[Hypothesis] {
        let maps = (a.0, b.0);
        if self.0.get(pair).is_none_or(|searched| searched.maps != maps) {
            let (search, icp) = (MapAlignerParameters::default(), IcpParameters::default());
            let prepared = PreparedPair::new(a.1, b.1, &search);
            // Maps that fit nowhere have no other place.
            let found = prepared.and_then(|prepared| prepared.hypotheses(known, &search, &icp)).unwrap_or_default();
            let found = found.into_iter().map(|hypothesis| Hypothesis { is_rival: true, ..hypothesis }).collect();
            self.0.insert(pair.clone(), Searched { maps, found });
        }
        self.0.get(pair).map_or(&[], |searched| &searched.found)
    }
}
