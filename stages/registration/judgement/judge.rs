//! Which of all hypotheses for a pair of maps is right, if any.

use super::priors::prior;
use super::verdict::{Rival, Verdict};
use super::{Candidate, JudgementParameters, Listed, Refusal, Term};
use crate::registration::comparison::{ComparisonParameters, MapView};
use crate::registration::place_window::PlaceWindow;
use crate::registration::{Basis, Hypothesis};

/// What the user knows of a pair of robots.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct UserKnowledge {
    /// Where the maps can lie to each other; none if it is not known.
    pub window: Option<PlaceWindow>,
    /// The number of the hypothesis that is right, from 1, as they are listed in the reason of a refusal.
    pub hypothesis: Option<usize>,
}

/// Judges the hypotheses of all sources for one pair; `None` without any.
///
/// The most probable is the answer, and it is refused if it is not as probable as is asked for. Where the user knows where the maps can
/// lie to each other, only what lies there takes part; and a hypothesis that he has chosen is accepted.
pub fn judge(
    a: &MapView<'_>,
    b: &MapView<'_>,
    hypotheses: &[Hypothesis],
    known: &UserKnowledge,
    parameters: &JudgementParameters,
) -> Option<Verdict> {
    let comparison = parameters.comparison();
    let mut all = compared(a, b, hypotheses, &comparison);
    if let Some(window) = &known.window {
        let is_possible = |candidate: &Candidate| window.contains(&candidate.hypothesis.transform_a_b, 0.0, 0.0);
        if !all.iter().any(is_possible) {
            return all.into_iter().next().map(|candidate| unexpected(candidate, window));
        }
        all.retain(is_possible);
    }
    let listed = Listed::of(&all);
    let is_expected = known.window.is_some();
    let count = all.len();
    let chosen = known.hypothesis.map(|asked| (asked, asked.checked_sub(1).and_then(|index| all.get(index).cloned())));
    let candidates = places(all, a, b, &comparison);
    let log_odds: Vec<f64> = candidates.iter().map(|candidate| log_odds(candidate, is_expected)).collect();
    let probabilities = posterior(&log_odds);
    if let Some((asked, chosen)) = chosen {
        let number = chosen.as_ref().map_or(0, |chosen| chosen.number);
        let (place, probability) =
            candidates.iter().zip(&probabilities).find(|(place, _)| chosen.is_none() || place.has(number))?;
        let refusal = chosen.is_none().then_some(Refusal::NoSuchHypothesis { asked, count });
        // It lies where it was listed, and not where another at the place does.
        let candidate = chosen.map_or_else(|| place.clone(), |chosen| chosen.deform(a, b, &comparison));
        let chosen = refusal.is_none().then_some((asked, count));
        return Some(Verdict { refusal, chosen, listed, probability: *probability, ..Verdict::of(candidate) });
    }
    let most_probable = |numbers: &mut dyn Iterator<Item = usize>| {
        numbers.reduce(|best, other| if log_odds[other] > log_odds[best] { other } else { best })
    };
    let best = most_probable(&mut (0..candidates.len()).filter(|number| !candidates[*number].hypothesis.is_rival))?;
    let rival = most_probable(&mut (0..candidates.len()).filter(|number| *number != best));
    let rival = rival.map(|other| Rival::new(&candidates[best], &candidates[other], probabilities[other]));
    let probability = probabilities[best];
    let candidate = candidates.into_iter().nth(best)?;
    let mut verdict =
        Verdict { probability, rival, listed, prior: prior(&candidate, is_expected), ..Verdict::of(candidate) };
    verdict.refusal = refusal(&verdict, parameters);
    Some(verdict)
}

/// The places that hypotheses propose, each once, and what the maps say there: what [`judge`] sums up where nothing else is known.
pub fn candidates(
    a: &MapView<'_>,
    b: &MapView<'_>,
    hypotheses: &[Hypothesis],
    parameters: &ComparisonParameters,
) -> Vec<Candidate> {
    places(compared(a, b, hypotheses, parameters), a, b, parameters)
}

/// What the maps say at each hypothesis as they came, the best first.
fn compared(
    a: &MapView<'_>,
    b: &MapView<'_>,
    hypotheses: &[Hypothesis],
    parameters: &ComparisonParameters,
) -> Vec<Candidate> {
    let compare = |numbered| Candidate::new(numbered, a, b, parameters);
    let mut all: Vec<Candidate> = hypotheses.iter().enumerate().map(compare).collect();
    // What tags fix comes first, then what most speaks for; equals stay in the order of their sources and ranks.
    all.sort_by(|one, other| {
        let is_by_maps = |candidate: &Candidate| candidate.hypothesis.basis != Basis::Tags;
        let by_evidence = other.agreement.evidence.total_cmp(&one.agreement.evidence);
        is_by_maps(one).cmp(&is_by_maps(other)).then(by_evidence)
    });
    all
}

/// Each place once, deformed. Several places may be one once map b is deformed.
fn places(
    compared: Vec<Candidate>,
    a: &MapView<'_>,
    b: &MapView<'_>,
    parameters: &ComparisonParameters,
) -> Vec<Candidate> {
    united(united(compared).into_iter().map(|candidate| candidate.deform(a, b, parameters)).collect())
}

/// The probability of each of several exclusive hypotheses by their log-odds against none of them: `exp(s_i) / (1 + sum of exp(s_j))`.
pub fn posterior(log_odds: &[f64]) -> Vec<f64> {
    let most = log_odds.iter().copied().fold(0.0, f64::max);
    let sum = (-most).exp() + log_odds.iter().map(|odds| (odds - most).exp()).sum::<f64>();
    log_odds.iter().map(|odds| (odds - most).exp() / sum).collect()
}

/// Each place once, where map b lies deformed if it is.
fn united(all: Vec<Candidate>) -> Vec<Candidate> {
    let mut places: Vec<Candidate> = Vec::new();
    for candidate in all {
        match places.iter_mut().find(|place| place.is_at(&candidate.transform_a_b())) {
            Some(place) => place.unite(candidate),
            None => places.push(candidate),
        }
    }
    places
}

/// Those that a stage before has refused take part: the maps may lie there, though it is not known well enough.
fn log_odds(candidate: &Candidate, is_expected: bool) -> f64 {
    candidate.terms().log_odds() + prior(candidate, is_expected)
}

/// The judgement on a place at which the maps cannot lie by what the user knows.
fn unexpected(candidate: Candidate, window: &PlaceWindow) -> Verdict {
    let (shift, turn) = window.change(&candidate.hypothesis.transform_a_b);
    let refusal = match candidate.hypothesis.is_refused {
        false => Refusal::Unexpected { shift, turn: turn.to_degrees() },
        true => Refusal::Before(candidate.hypothesis.reason.clone()),
    };
    Verdict { refusal: Some(refusal), ..Verdict::of(candidate) }
}

/// Why a verdict is no acceptance; none if it is as probable as is asked for.
fn refusal(verdict: &Verdict, parameters: &JudgementParameters) -> Option<Refusal> {
    let JudgementParameters { accept, max_bend: most, .. } = *parameters;
    let Verdict { candidate, probability, rival, .. } = verdict;
    if candidate.hypothesis.is_refused {
        return Some(Refusal::Before(candidate.hypothesis.reason.clone()));
    }
    if *probability >= accept {
        let bend = candidate.deformed.map(|deformed| deformed.bend);
        return bend.filter(|bend| *bend > most).map(|bend| Refusal::Bent { bend, most });
    }
    // What is missing lies with another place, or with none.
    let of_none = 1.0 - probability - rival.as_ref().map_or(0.0, |rival| rival.probability);
    if let Some(rival) = rival.as_ref().filter(|rival| rival.probability > of_none) {
        let (shift, turn) = (rival.shift, rival.turn.to_degrees());
        let told_otherwise = rival.is_by_tags != candidate.rests_on(Basis::is_by_tags);
        return Some(match told_otherwise {
            true => Refusal::Elsewhere {
                source_of_rival: rival.source.clone(),
                shift,
                turn,
                rival: rival.agreement.inlier_length,
                here: candidate.agreement.inlier_length,
            },
            false => Refusal::Ambiguous { shift, turn, probability: rival.probability, listed: verdict.listed.clone() },
        });
    }
    let agreement = candidate.agreement;
    Some(match verdict.weakest_term() {
        Term::Residual | Term::InliersToCrossings | Term::CrossingConflicts | Term::Crossings => {
            Refusal::Contradiction { agreement }
        }
        weakest => Refusal::Chance { agreement, weakest, probability: *probability, accept },
    })
}
