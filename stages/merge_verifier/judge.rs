//! Which of all hypotheses for a pair of robots is right, if any.

use super::refusal::{Hypotheses, Hypothesis};
use super::{
    Agreement, MapView, MergeVerifierParameters, Refusal, Rival, best_rival_nearby, compare, evidence_elsewhere,
    probability,
};
use gridweave_runtime::ros::Alignment;

/// A hypothesis, and what the maps say of each other there.
#[derive(Clone, Copy, Debug)]
pub struct Candidate<'a> {
    /// The hypothesis.
    pub alignment: &'a Alignment,
    /// What the maps say.
    pub agreement: Agreement,
    /// Metres of wall that speak for it, see [`Agreement::evidence`].
    pub evidence: f64,
}

/// The judgement on all hypotheses for a pair.
#[derive(Clone, Debug)]
pub struct Verdict<'a> {
    /// The hypothesis that is right, or came nearest to it.
    pub candidate: Candidate<'a>,
    /// Why it is not accepted; none if it is.
    pub refusal: Option<Refusal>,
    /// The best place elsewhere, if there is one.
    pub rival: Option<Rival>,
    /// The most evidence for another place, as a share of that for this one.
    pub evidence_elsewhere: f64,
    /// The probability that it is right, 0 to 1, see [`probability`].
    pub score: f64,
    /// Another source that has found the same place.
    pub found_too_by: Option<&'a str>,
}

impl Verdict<'_> {
    /// What speaks for it, or against it, in plain words.
    pub fn reason(&self) -> String {
        let Agreement { wall_on_wall, wall_on_free, overlap, .. } = self.candidate.agreement;
        let found = &self.candidate.alignment.reason;
        if let Some(refusal) = &self.refusal {
            return match refusal {
                Refusal::Before(reason) => reason.clone(),
                refusal => format!("{found}; the maps do not confirm it: {refusal}"),
            };
        }
        let too = self.found_too_by.map_or_else(String::new, |source| format!(", found by the {source}, too"));
        let elsewhere = self.rival.map_or_else(String::new, |Rival { agreement, .. }| {
            let share = 100.0 * agreement.wall_agreement();
            format!("; at the best of other places {share:.0} % of {:.0} m agree", agreement.wall_seen())
        });
        format!(
            "{found}{too}; the maps confirm it: {wall_on_wall:.0} m of wall agree and {wall_on_free:.0} m lie on free space, in \
             {overlap:.0} m2 that both maps know (acceptance index {:.3}){elsewhere}",
            self.candidate.agreement.acceptance_index(),
        )
    }
}

/// Judges the hypotheses of all sources for one pair. `None` if none of them has a place.
///
/// The first that meets all that is asked of it is accepted: those that rest on enough tags, and then the others, by their
/// evidence. A provisional one must be the best by far of all places that anybody has proposed; one that rests on enough
/// tags only must not be much worse than another.
pub fn judge<'a>(
    a: &MapView<'_>,
    b: &MapView<'_>,
    hypotheses: &[&'a Alignment],
    parameters: &MergeVerifierParameters,
) -> Option<Verdict<'a>> {
    let mut candidates: Vec<Candidate<'a>> = hypotheses
        .iter()
        .filter(|alignment| has_place(alignment))
        .map(|alignment| {
            let agreement = compare(a, b, &alignment.transform_a_b(), parameters);
            Candidate { alignment, agreement, evidence: agreement.evidence(parameters.free_space_penalty) }
        })
        .collect();
    // The sort is stable, so that equals stay in the order of their sources and ranks. What rests on enough tags is believed
    // first, where the maps do not speak against it.
    let is_provisional = |candidate: &Candidate<'_>| candidate.alignment.provisional;
    candidates.sort_by(|one, other| {
        is_provisional(one).cmp(&is_provisional(other)).then(other.evidence.total_cmp(&one.evidence))
    });
    let mut first = None;
    for candidate in &candidates {
        let verdict = judge_one(a, b, candidate, &candidates, parameters);
        if verdict.refusal.is_none() {
            return Some(verdict);
        }
        first.get_or_insert(verdict);
    }
    first
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
    parameters: &MergeVerifierParameters,
) -> Verdict<'a> {
    let Candidate { alignment, agreement, .. } = candidate;
    let transform_a_b = alignment.transform_a_b();
    let rival_of = |other: &Candidate<'_>| {
        Rival::of(&transform_a_b, &agreement.centre, &other.alignment.transform_a_b(), || other.agreement)
    };
    let found_too_by = all
        .iter()
        .filter(|other| other.alignment.accepted && other.alignment.source != alignment.source)
        .find(|other| rival_of(other).is_none())
        .map(|other| other.alignment.source.as_str());
    let elsewhere = all.iter().filter_map(|other| Some((other, rival_of(other)?)));
    let another = elsewhere.max_by(|(one, _), (other, _)| one.evidence.total_cmp(&other.evidence));
    let is_strict = alignment.provisional && found_too_by.is_none();
    let mut rival = another.map(|(_, rival)| rival);

    let bounds = match is_strict {
        true => parameters.provisional_bounds(alignment.hypotheses > 0),
        false => parameters.bounds(),
    };
    let refusal = match alignment.accepted {
        false => Some(Refusal::Before(alignment.reason.clone())),
        true => Refusal::by_bounds(agreement, &bounds)
            .or_else(|| {
                let (other, rival) = another?;
                match is_strict {
                    true => ambiguity(candidate, other, &rival, all, parameters),
                    false => contradiction(candidate, other, &rival, parameters),
                }
            })
            .or_else(|| {
                if !is_strict {
                    return None;
                }
                // A stage that has looked for others has sent the best of them.
                let alike = match alignment.hypotheses {
                    0 => best_rival_nearby(a, b, &transform_a_b, &agreement.centre, parameters)?,
                    _ => all
                        .iter()
                        .filter_map(rival_of)
                        .filter(|rival| rival.counts(parameters))
                        .max_by(Rival::by_share)?,
                };
                rival = Some(alike);
                by_rival(agreement, &alike, parameters)
            }),
    };
    let rivals = all.iter().filter_map(rival_of).chain(rival);
    let evidence_elsewhere = evidence_elsewhere(agreement, rivals, parameters.free_space_penalty);
    let score = probability(agreement, evidence_elsewhere);
    Verdict { candidate: *candidate, refusal, rival, evidence_elsewhere, score, found_too_by }
}

/// A provisional hypothesis must be better by far than the best elsewhere.
fn ambiguity(
    candidate: &Candidate<'_>,
    other: &Candidate<'_>,
    rival: &Rival,
    all: &[Candidate<'_>],
    parameters: &MergeVerifierParameters,
) -> Option<Refusal> {
    let most = parameters.max_rival_evidence;
    let is_clear = other.evidence <= most * candidate.evidence;
    (!is_clear).then(|| Refusal::Ambiguous {
        shift: rival.shift,
        turn: rival.turn.to_degrees(),
        share: other.evidence / candidate.evidence,
        most,
        hypotheses: Hypotheses(all.iter().map(hypothesis).collect()),
    })
}

/// Tags that put the maps where they fit far worse than where another source has them are wrong somewhere, or the maps are.
fn contradiction(
    candidate: &Candidate<'_>,
    other: &Candidate<'_>,
    rival: &Rival,
    parameters: &MergeVerifierParameters,
) -> Option<Refusal> {
    let is_sound = Refusal::by_bounds(&other.agreement, &parameters.provisional_bounds(false)).is_none();
    let is_far_worse = candidate.evidence <= parameters.max_rival_evidence * other.evidence;
    (is_sound && is_far_worse).then(|| Refusal::Elsewhere {
        source_of_rival: other.alignment.source.clone(),
        shift: rival.shift,
        turn: rival.turn.to_degrees(),
        rival: other.agreement.wall_on_wall,
        here: candidate.agreement.wall_on_wall,
    })
}

/// Wherever else enough of the maps meets, a smaller share of the walls must agree: where as large a share does, what a
/// robot happens to have seen of the one place and not of the other is all that speaks for the one.
fn by_rival(agreement: &Agreement, rival: &Rival, parameters: &MergeVerifierParameters) -> Option<Refusal> {
    let (share, margin) = (agreement.wall_agreement(), parameters.rival_margin);
    let is_clear = share - rival.agreement.wall_agreement() >= margin;
    (!is_clear).then(|| Refusal::Rival {
        share,
        rival: rival.agreement.wall_agreement(),
        shift: rival.shift,
        turn: rival.turn.to_degrees(),
        margin,
    })
}

fn hypothesis(candidate: &Candidate<'_>) -> Hypothesis {
    let Alignment { x, y, yaw, .. } = *candidate.alignment;
    Hypothesis { x, y, yaw: yaw.to_degrees(), evidence: candidate.evidence }
}
