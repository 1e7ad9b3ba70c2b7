//! Which of all hypotheses for a pair of robots is right, if any.

use super::bending::BentPlace;
use super::found_by_walls::among_alike;
use super::refusal::{Hypotheses, Hypothesis};
use super::verdict::{Candidate, Verdict};
use super::{
    Agreement, Grounds, MapView, MergeVerifierParameters, Odds, Origin, Refusal, Rival, best_rival_nearby, compare,
};
use crate::place_window::PlaceWindow;
use gridweave_runtime::ros::Alignment;

/// What is less probable is no more probable than anything else: which of such hypotheses is told of goes by the evidence.
const NEXT_TO_NO_PROBABILITY: f64 = 1e-3;
/// Another place is like one if the share of the walls that agree is less by this at the most.
const LIKENESS_MARGIN: f64 = 0.15;
/// The share of the walls that agree at which nothing speaks against a place.
const CLEAR_AGREEMENT: f64 = 0.9;
/// Maps that agree in a smaller share of their walls, bent as they are, contradict each other.
const CONTRADICTION_IF_BENT: f64 = 0.7;

/// What the user knows of a pair of robots.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct UserKnowledge {
    /// Where the maps can lie to each other; none if it is not known.
    pub window: Option<PlaceWindow>,
    /// The number of the hypothesis that is right, from 1, as they are listed in the reason of a refusal.
    pub hypothesis: Option<usize>,
}

/// Judges the hypotheses of all sources for one pair. `None` if none of them has a place.
///
/// The first whose probability is as high as is asked for is accepted: those that rest on enough tags come first, and then
/// the others, by their evidence. If there is none, the most probable is the answer, refused; or the first, if none is
/// probable at all. Where the user knows where the maps can lie to each other, only what lies there takes part; and where he
/// has chosen a hypothesis, it is accepted.
pub fn judge<'a>(
    a: &MapView<'_>,
    b: &MapView<'_>,
    hypotheses: &[&'a Alignment],
    known: &UserKnowledge,
    parameters: &MergeVerifierParameters,
) -> Option<Verdict<'a>> {
    let mut all: Vec<Candidate<'a>> = hypotheses
        .iter()
        .filter(|alignment| has_place(alignment))
        .map(|alignment| Candidate::rigid(alignment, compare(a, b, &alignment.transform_a_b(), parameters)))
        .collect();
    // The sort is stable, so that equals stay in the order of their sources and ranks.
    let is_provisional = |candidate: &Candidate<'_>| candidate.alignment.provisional;
    all.sort_by(|one, other| {
        is_provisional(one)
            .cmp(&is_provisional(other))
            .then(other.agreement.evidence.total_cmp(&one.agreement.evidence))
    });
    if let Some(window) = &known.window {
        let is_possible = |candidate: &Candidate<'_>| window.contains(&candidate.alignment.transform_a_b(), 0.0, 0.0);
        if !all.iter().any(is_possible) {
            return all.first().map(|candidate| unexpected(candidate, window));
        }
        all.retain(is_possible);
    }
    let is_expected = known.window.is_some();
    if let Some(asked) = known.hypothesis {
        let judge_one = |candidate: &Candidate<'a>| judge_one(a, b, candidate, &all, is_expected, false, parameters);
        let count = all.len();
        let chosen = asked.checked_sub(1).and_then(|index| all.get(index));
        return match chosen {
            Some(chosen) => Some(Verdict { refusal: None, chosen: Some((asked, count)), ..judge_one(chosen) }),
            None => {
                let refusal = Some(Refusal::NoSuchHypothesis { asked, count });
                all.first().map(|first| Verdict { refusal, ..judge_one(first) })
            }
        };
    }
    let rigid = best_of(a, b, &all, is_expected, false, parameters)?;
    if parameters.bend <= 0.0 {
        return Some(rigid);
    }
    if rigid.refusal.is_none() {
        // The frame that is nearest to all of a bent map, and not to the part of it that registration has come to.
        return Some(Verdict { candidate: bent(a, b, &rigid.candidate, is_expected, parameters), ..rigid });
    }
    // Maps that contradict each other may do so because they are bent, and several places may be one if they are.
    let bent: Vec<Candidate<'a>> = all.iter().map(|candidate| bent(a, b, candidate, is_expected, parameters)).collect();
    let as_bent = best_of(a, b, &bent, is_expected, true, parameters);
    as_bent.filter(|verdict| verdict.refusal.is_none() || is_more_probable(verdict, &rigid)).or(Some(rigid))
}

fn is_more_probable(one: &Verdict<'_>, other: &Verdict<'_>) -> bool {
    one.score > other.score.max(NEXT_TO_NO_PROBABILITY)
}

/// The first hypothesis that is accepted; if none is, the most probable. `may_be_bent` tells that all were bent as far as that
/// makes them better.
fn best_of<'a>(
    a: &MapView<'_>,
    b: &MapView<'_>,
    all: &[Candidate<'a>],
    is_expected: bool,
    may_be_bent: bool,
    parameters: &MergeVerifierParameters,
) -> Option<Verdict<'a>> {
    let mut best: Option<Verdict<'a>> = None;
    for candidate in all {
        let verdict = judge_one(a, b, candidate, all, is_expected, may_be_bent, parameters);
        if verdict.refusal.is_none() {
            return Some(verdict);
        }
        if best.as_ref().is_none_or(|best| is_more_probable(&verdict, best)) {
            best = Some(verdict);
        }
    }
    best
}

/// A hypothesis with map b bent, if that makes it more probable, and with what a bend leaves uncertain if it does not. As it
/// takes long, only where more speaks for the hypothesis than against it, and where something does speak against it.
fn bent<'a>(
    a: &MapView<'_>,
    b: &MapView<'_>,
    rigid: &Candidate<'a>,
    is_expected: bool,
    parameters: &MergeVerifierParameters,
) -> Candidate<'a> {
    let Agreement { evidence, .. } = rigid.agreement;
    let is_worth_it = rigid.alignment.accepted && evidence > 0.0 && rigid.agreement.wall_agreement() < CLEAR_AGREEMENT;
    let bent = is_worth_it.then(|| BentPlace::new(a, b, &rigid.alignment.transform_a_b(), parameters)).flatten();
    let Some(place) = bent else { return *rigid };
    let left_by_bend = Some(place.covariance);
    let is_better = match Origin::of(rigid.alignment) {
        Origin::Search { .. } if !is_expected => {
            among_alike(0.0, &place.agreement, Some(place.cost)) > among_alike(0.0, &rigid.agreement, None)
        }
        _ => place.agreement.evidence - place.cost > evidence,
    };
    match is_better {
        true => Candidate { agreement: place.agreement, bent: Some(place), left_by_bend, ..*rigid },
        false => Candidate { left_by_bend, ..*rigid },
    }
}

/// The judgement on a place at which the maps cannot lie by what the user knows.
fn unexpected<'a>(candidate: &Candidate<'a>, window: &PlaceWindow) -> Verdict<'a> {
    let (shift, turn) = window.change(&candidate.alignment.transform_a_b());
    let refusal = match candidate.alignment.accepted {
        true => Refusal::Unexpected { shift, turn: turn.to_degrees() },
        false => Refusal::Before(candidate.alignment.reason.clone()),
    };
    Verdict {
        candidate: *candidate,
        refusal: Some(refusal),
        rival: None,
        evidence_elsewhere: 0.0,
        score: 0.0,
        found_too_by: None,
        chosen: None,
        hypotheses: Hypotheses::default(),
    }
}

/// Whether an alignment says where map b lies, in numbers.
fn has_place(alignment: &Alignment) -> bool {
    alignment.has_transform && [alignment.x, alignment.y, alignment.yaw].iter().all(|value| value.is_finite())
}

fn judge_one<'a>(
    a: &MapView<'_>,
    b: &MapView<'_>,
    candidate: &Candidate<'a>,
    all: &[Candidate<'a>],
    is_expected: bool,
    may_be_bent: bool,
    parameters: &MergeVerifierParameters,
) -> Verdict<'a> {
    let Candidate { alignment, agreement, bent, .. } = candidate;
    let transform_a_b = candidate.transform_a_b();
    let rival_of = |other: &Candidate<'_>| {
        let rival = Rival::of(&transform_a_b, &agreement.centre, &other.transform_a_b(), || other.agreement)?;
        let lead = match Origin::of(other.alignment) {
            Origin::Search { lead } => lead,
            Origin::Tags | Origin::FewTags => 0.0,
        };
        Some(Rival { lead, bend_cost: other.bent.map(|bent| bent.cost), ..rival })
    };
    let others = all.iter().filter(|other| other.alignment.accepted && other.alignment.source != alignment.source);
    let found_too = others.filter(|other| rival_of(other).is_none());
    let found_too_by = found_too.clone().next().map(|other| other.alignment.source.as_str());
    // The best of a search that has not looked at tags, and tags that suffice without walls.
    let is_best_of_search = |one: &Alignment| matches!(Origin::of(one), Origin::Search { .. }) && one.rank == 0;
    let found_by_tags_and_walls = |other: &Candidate<'_>| {
        let pair = [*alignment, other.alignment];
        pair.iter().any(|one| is_best_of_search(one)) && pair.iter().any(|one| one.source == "tags" && !one.provisional)
    };
    let found_by_tags_and_walls = found_too.clone().any(found_by_tags_and_walls);
    let is_found_by_walls_alone = matches!(Origin::of(alignment), Origin::Search { .. }) && found_too_by.is_none();
    let weight = |rival: &Rival| match is_found_by_walls_alone {
        true => among_alike(rival.lead, &rival.agreement, rival.bend_cost),
        false => rival.agreement.evidence,
    };
    let outdoes = |rival: &Rival| is_found_by_walls_alone && rival.outdoes(agreement, bent.map(|bent| bent.cost));
    let by_weight =
        |one: &Rival, other: &Rival| outdoes(one).cmp(&outdoes(other)).then(weight(one).total_cmp(&weight(other)));
    // Where a bend is no excuse, the maps cannot lie at a place at which they contradict each other, however much of them meets
    // there, if there is one at which they do not.
    let is_refuted = |other: &Candidate<'_>| {
        may_be_bent
            && agreement.wall_agreement() >= CLEAR_AGREEMENT
            && other.agreement.wall_agreement() < CONTRADICTION_IF_BENT
    };
    let another = all.iter().filter(|other| !is_refuted(other)).filter_map(|other| Some((other, rival_of(other)?)));
    let another = another.max_by(|(_, one), (_, other)| by_weight(one, other));
    let is_told = !alignment.provisional || found_too_by.is_some() || is_expected;
    let mut rival = another.map(|(_, rival)| rival);
    // A stage that has looked for others has sent the best of them.
    if alignment.accepted && !is_told && alignment.hypotheses == 0 {
        let nearby = best_rival_nearby(a, b, &transform_a_b, &agreement.centre, parameters);
        // Wherever more of the maps meets there is more evidence; what fits worse is not like it.
        let is_alike =
            |nearby: &Rival| nearby.agreement.wall_agreement() + LIKENESS_MARGIN > agreement.wall_agreement();
        rival = rival.into_iter().chain(nearby.filter(is_alike)).max_by(by_weight);
    }
    let grounds = Grounds {
        origin: Origin::of(alignment),
        found_too: found_too_by.is_some(),
        found_by_tags_and_walls,
        is_expected,
        agreement: *agreement,
        bend_cost: bent.map(|bent| bent.cost),
        rival,
    };
    let evidence_elsewhere = grounds.evidence_elsewhere();
    let odds = Odds::new(&grounds);
    let score = odds.probability();
    let refusal = match rival.filter(|_| odds.likeness <= odds.chance.min(odds.part)) {
        _ if !alignment.accepted => Some(Refusal::Before(alignment.reason.clone())),
        _ if score >= parameters.accept => None,
        Some(rival) => Some(likeness(
            candidate,
            &rival,
            another.filter(|_| !alignment.provisional || found_too_by.is_some()),
            evidence_elsewhere,
            all,
        )),
        None if odds.lacks_agreement(parameters.accept) => Some(Refusal::Contradiction {
            agree: agreement.wall_on_wall,
            against: agreement.wall_on_free,
            share: agreement.wall_agreement(),
        }),
        None => Some(Refusal::Chance {
            agree: agreement.wall_on_wall,
            against: agreement.wall_on_free,
            confirming: grounds.confirming(),
            runs_one_way: is_found_by_walls_alone && agreement.walls_either_way == 0,
            probability: score,
            accept: parameters.accept,
        }),
    };
    let hypotheses = listed(all);
    Verdict { candidate: *candidate, refusal, rival, evidence_elsewhere, score, found_too_by, chosen: None, hypotheses }
}

/// The refusal for another place that fits as well; or far better, where tags have told this one.
fn likeness(
    candidate: &Candidate<'_>,
    rival: &Rival,
    told_against: Option<(&Candidate<'_>, Rival)>,
    share: f64,
    all: &[Candidate<'_>],
) -> Refusal {
    let (shift, turn) = (rival.shift, rival.turn.to_degrees());
    match told_against {
        Some((other, _)) => Refusal::Elsewhere {
            source_of_rival: other.alignment.source.clone(),
            shift,
            turn,
            rival: other.agreement.wall_on_wall,
            here: candidate.agreement.wall_on_wall,
        },
        None => Refusal::Ambiguous { shift, turn, share, hypotheses: listed(all) },
    }
}

fn listed(all: &[Candidate<'_>]) -> Hypotheses {
    let hypothesis = |candidate: &Candidate<'_>| {
        let Alignment { x, y, yaw, .. } = *candidate.alignment;
        let Agreement { wall_on_wall, wall_on_free, .. } = candidate.agreement;
        Hypothesis { x, y, yaw, wall_on_wall, wall_on_free }
    };
    Hypotheses(all.iter().map(hypothesis).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::pose;
    use crate::test_world::floor_plan::{FloorPlan, drawing, seen};

    #[test]
    fn of_places_that_are_all_hopeless_the_one_with_the_most_evidence_is_told() {
        let draw = |plan: FloorPlan| plan.draw(seen(-1.0, -1.0, 21.0, 13.0), drawing(0.0, 0.0, 0.0));
        let (a, b) = (draw(FloorPlan::office()), draw(FloorPlan::another_office()));
        // One on the other, and where they do not meet at all: that does not contradict either.
        let places = [pose(0.0, 0.0, 0.0), pose(100.0, 0.0, 0.0)];
        let hypotheses: Vec<Alignment> = (0..)
            .zip(&places)
            .map(|(rank, place)| {
                let source = "maps".to_owned();
                let mut alignment =
                    Alignment { source, accepted: true, provisional: true, rank, hypotheses: 2, ..Default::default() };
                alignment.set_transform_a_b(place);
                alignment
            })
            .collect();
        let hypotheses: Vec<&Alignment> = hypotheses.iter().collect();
        let (known, parameters) = (UserKnowledge::default(), MergeVerifierParameters::default());
        let verdict = judge(&a.view(), &b.view(), &hypotheses, &known, &parameters).unwrap();
        assert!(verdict.refusal.is_some() && verdict.score < NEXT_TO_NO_PROBABILITY, "{verdict:?}");
        assert!(verdict.candidate.agreement.wall_on_wall > 1.0, "{verdict:?}");
    }
}
