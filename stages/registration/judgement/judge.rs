//! Decides which of all hypotheses for a pair of maps is right, if any.

use super::priors::prior;
use super::verdict::{Rival, Verdict};
use super::{Candidate, Comparisons, JudgementParameters, Listed, Refusal, Term};
use crate::registration::comparison::{ComparisonParameters, MapView};
use crate::registration::pose_window::PoseWindow;
use crate::registration::{Basis, Hypothesis};
use crate::shared::geometry::Pose2;

/// Deformations are shown in centimetres: one that exceeds the allowed one by no more than they are rounded by is not
/// refused, metres.
const ROUNDING: f64 = 0.005;

/// What the user knows about a pair of robots.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct UserKnowledge {
    /// Relative poses that the initial poses allow; none if they are not known.
    pub window: Option<PoseWindow>,
    /// Number of the hypothesis that the user has chosen, from 1, in the list that is part of the reason of a
    /// refusal.
    pub hypothesis: Option<usize>,
}

/// Judges the hypotheses of all sources for one pair; `None` if there are none.
///
/// The most probable one is returned, refused unless it is as probable as the parameters require. If the user's
/// initial poses are known, only hypotheses that they allow compete. A hypothesis that the user has chosen is
/// accepted.
pub fn judge(
    a: &MapView<'_>,
    b: &MapView<'_>,
    hypotheses: &[Hypothesis],
    known: &UserKnowledge,
    parameters: &JudgementParameters,
) -> Option<Verdict> {
    judge_again(a, b, hypotheses, known, parameters, &mut Comparisons::default())
}

/// The same for maps that may have been judged before, with the comparisons of that time.
pub fn judge_again(
    a: &MapView<'_>,
    b: &MapView<'_>,
    hypotheses: &[Hypothesis],
    known: &UserKnowledge,
    parameters: &JudgementParameters,
    comparisons: &mut Comparisons,
) -> Option<Verdict> {
    comparisons.begin();
    let comparison = parameters.comparison();
    let mut all = compared(a, b, hypotheses, &comparison, comparisons);
    if let Some(window) = &known.window {
        let is_possible = |candidate: &Candidate| window.contains(&candidate.hypothesis.transform_a_b, 0.0, 0.0);
        if !all.iter().any(is_possible) {
            return all.into_iter().next().map(|candidate| unexpected(candidate, window));
        }
        all.retain(is_possible);
    }
    let mut all = merged(all);
    let is_expected = known.window.is_some();
    let candidates = deformed(all.clone(), a, b, &comparison, comparisons);
    let log_odds: Vec<f64> = candidates.iter().map(|candidate| log_odds(candidate, is_expected)).collect();
    sort_by_log_odds(&mut all, &candidates, &log_odds);
    let listed = Listed::of(&all);
    let count = all.len();
    let chosen = known.hypothesis.map(|asked| (asked, asked.checked_sub(1).and_then(|index| all.get(index).cloned())));
    let probabilities = posterior(&log_odds);
    if let Some((asked, chosen)) = chosen {
        let number = chosen.as_ref().map_or(0, |chosen| chosen.number);
        let (found, probability) =
            candidates.iter().zip(&probabilities).find(|(candidate, _)| chosen.is_none() || candidate.has(number))?;
        let refusal = chosen.is_none().then_some(Refusal::NoSuchHypothesis { asked, count });
        // The chosen pose is used, and not another one of its candidate.
        let chosen = chosen.and_then(|chosen| deformed(vec![chosen], a, b, &comparison, comparisons).pop());
        let candidate = chosen.unwrap_or_else(|| found.clone());
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
    let of_others = probabilities.iter().sum::<f64>() - probability;
    let candidate = candidates.into_iter().nth(best)?;
    let mut verdict =
        Verdict { probability, rival, listed, prior: prior(&candidate, is_expected), ..Verdict::of(candidate) };
    verdict.refusal = refusal(&verdict, of_others, parameters);
    Some(verdict)
}

/// Merges equal hypotheses and compares the maps at each: the candidates that [`judge`] chooses from if nothing else
/// is known.
pub fn candidates(
    a: &MapView<'_>,
    b: &MapView<'_>,
    hypotheses: &[Hypothesis],
    parameters: &ComparisonParameters,
) -> Vec<Candidate> {
    let mut comparisons = Comparisons::default();
    let all = merged(compared(a, b, hypotheses, parameters, &mut comparisons));
    deformed(all, a, b, parameters, &mut comparisons)
}

/// Agreement of the maps at each hypothesis, without deformation, the best first.
fn compared(
    a: &MapView<'_>,
    b: &MapView<'_>,
    hypotheses: &[Hypothesis],
    parameters: &ComparisonParameters,
    comparisons: &mut Comparisons,
) -> Vec<Candidate> {
    let poses: Vec<Pose2> = hypotheses.iter().map(|hypothesis| hypothesis.transform_a_b).collect();
    let agreements = comparisons.agreements(a, b, &poses, parameters);
    let numbered = hypotheses.iter().enumerate().zip(agreements);
    let mut all: Vec<Candidate> = numbered.map(|(numbered, agreement)| Candidate::new(numbered, agreement)).collect();
    // What tags determine comes first, then what has most evidence; equals stay in the order of their sources and
    // ranks.
    all.sort_by(|one, other| {
        let is_by_maps = |candidate: &Candidate| candidate.hypothesis.basis != Basis::Tags;
        let by_evidence = other.agreement.evidence.total_cmp(&one.agreement.evidence);
        is_by_maps(one).cmp(&is_by_maps(other)).then(by_evidence)
    });
    all
}

/// Deforms map b at each candidate, and merges those whose poses are the same after it.
fn deformed(
    candidates: Vec<Candidate>,
    a: &MapView<'_>,
    b: &MapView<'_>,
    parameters: &ComparisonParameters,
    comparisons: &mut Comparisons,
) -> Vec<Candidate> {
    let worth = candidates.iter().filter(|candidate| candidate.is_worth_deforming(parameters));
    let poses: Vec<Pose2> = worth.map(|candidate| candidate.hypothesis.transform_a_b).collect();
    let mut found = comparisons.deformations(a, b, &poses, parameters).into_iter();
    let deform = |candidate: Candidate| match candidate.is_worth_deforming(parameters) {
        true => candidate.deform(found.next().flatten()),
        false => candidate.deform(None),
    };
    merged(candidates.into_iter().map(deform).collect())
}

/// Probability of each of several exclusive hypotheses by their log-odds against none of them: `exp(s_i) / (1 + sum
/// of exp(s_j))`.
pub fn posterior(log_odds: &[f64]) -> Vec<f64> {
    let most = log_odds.iter().copied().fold(0.0, f64::max);
    let sum = (-most).exp() + log_odds.iter().map(|odds| (odds - most).exp()).sum::<f64>();
    log_odds.iter().map(|odds| (odds - most).exp() / sum).collect()
}

/// Sorts candidates by the log-odds of those that they have become by deformation, the most probable first: the order
/// of the list that the user chooses from.
fn sort_by_log_odds(all: &mut [Candidate], deformed: &[Candidate], log_odds: &[f64]) {
    let of = |candidate: &Candidate| {
        let known = deformed.iter().position(|deformed| deformed.has(candidate.number));
        known.map_or(f64::NEG_INFINITY, |number| log_odds[number])
    };
    all.sort_by(|one, other| of(other).total_cmp(&of(one)));
}

/// Merges candidates with the same relative pose.
fn merged(all: Vec<Candidate>) -> Vec<Candidate> {
    let mut distinct: Vec<Candidate> = Vec::new();
    for candidate in all {
        match distinct.iter_mut().find(|known| known.is_at(&candidate.transform_a_b())) {
            Some(known) => known.unite(candidate),
            None => distinct.push(candidate),
        }
    }
    distinct
}

/// Log-odds of a candidate. Those that an earlier stage has refused compete, too: they may be right, though not
/// certain enough.
fn log_odds(candidate: &Candidate, is_expected: bool) -> f64 {
    candidate.terms().log_odds() + prior(candidate, is_expected)
}

/// Verdict on a candidate that the initial poses do not allow.
fn unexpected(candidate: Candidate, window: &PoseWindow) -> Verdict {
    let (shift, turn) = window.change(&candidate.hypothesis.transform_a_b);
    let refusal = match candidate.hypothesis.is_refused {
        false => Refusal::OutsideWindow { shift, turn: turn.to_degrees() },
        true => Refusal::RefusedUpstream(candidate.hypothesis.reason.clone()),
    };
    Verdict { refusal: Some(refusal), ..Verdict::of(candidate) }
}

/// Why a verdict is refused, where one of all other candidates is right with a probability; none if it is as probable
/// as required.
fn refusal(verdict: &Verdict, of_others: f64, parameters: &JudgementParameters) -> Option<Refusal> {
    let JudgementParameters { accept, max_bend: most, .. } = *parameters;
    let Verdict { candidate, probability, rival, .. } = verdict;
    if candidate.hypothesis.is_refused {
        return Some(Refusal::RefusedUpstream(candidate.hypothesis.reason.clone()));
    }
    if *probability >= accept {
        let rms = candidate.deformed.map(|deformed| deformed.rms);
        return rms.filter(|rms| rms - most > ROUNDING).map(|rms| Refusal::Deformed { rms, most });
    }
    // The missing probability is that of other candidates, or of none of them.
    let of_none = 1.0 - probability - of_others;
    if let Some(rival) = rival.as_ref().filter(|_| of_others > of_none) {
        let (shift, turn) = (rival.shift, rival.turn.to_degrees());
        let is_other_source = rival.is_by_tags != candidate.rests_on(Basis::is_by_tags);
        return Some(match is_other_source {
            true => Refusal::SourcesDisagree {
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
        Term::ConflictingWalls => Refusal::Contradiction { agreement },
        Term::ShortSegments if agreement.details.contradict() => Refusal::Contradiction { agreement },
        weakest => Refusal::Chance { agreement, weakest, probability: *probability, accept },
    })
}
