//! The competition of the candidates for a pair of maps: how probable each is, and which of them is returned.

use super::decision::{Decision, SecondBest};
use super::priors::prior;
use super::{Candidate, JudgementParameters, Listed, Refusal, Term};
use crate::registration::Basis;

/// Deformations are shown in centimetres: one that exceeds the allowed one by no more than they are rounded by is not
/// refused, metres.
const ROUNDING: f64 = 0.005;

/// Candidates of which one at most is right.
pub(super) struct Competition {
    /// Without deformation, the most probable first: the list that the user chooses from.
    choices: Vec<Candidate>,
    /// The same with map b deformed, by the order of their sources and their evidence.
    candidates: Vec<Candidate>,
    /// Log-odds of each candidate.
    log_odds: Vec<f64>,
    /// Probability of each candidate, 0 to 1.
    probabilities: Vec<f64>,
    /// Whether initial poses allow the candidates.
    is_expected: bool,
}

impl Competition {
    /// Weighs candidates, which have become of `choices` by deformation.
    pub(super) fn new(mut choices: Vec<Candidate>, candidates: Vec<Candidate>, is_expected: bool) -> Self {
        let log_odds: Vec<f64> = candidates.iter().map(|candidate| log_odds(candidate, is_expected)).collect();
        sort_by_log_odds(&mut choices, &candidates, &log_odds);
        let probabilities = posterior(&log_odds);
        Self { choices, candidates, log_odds, probabilities, is_expected }
    }

    /// Accepts the choice with number `asked`, from 1, at its own pose, and not at that of another hypothesis of its
    /// candidate. Refuses the first candidate if there is no such choice. `None` if there are no candidates.
    pub(super) fn chosen_by_user(
        self,
        asked: usize,
        deform: impl FnOnce(Candidate) -> Option<Candidate>,
    ) -> Option<Decision> {
        let (count, listed) = (self.choices.len(), Listed::of(&self.choices));
        let mut weighed = self.candidates.into_iter().zip(self.probabilities);
        let Some(choice) = asked.checked_sub(1).and_then(|index| self.choices.into_iter().nth(index)) else {
            let (first, probability) = weighed.next()?;
            let refusal = Some(Refusal::NoSuchHypothesis { asked, count });
            return Some(Decision { refusal, listed, probability, ..Decision::of(first) });
        };
        let (_, probability) = weighed.find(|(candidate, _)| candidate.has(choice.number))?;
        let chosen = Some((asked, count));
        Some(Decision { chosen, listed, probability, ..Decision::of(deform(choice)?) })
    }

    /// Judges the most probable candidate against all others. `None` if there is none that may be accepted.
    pub(super) fn most_probable(self, parameters: &JudgementParameters) -> Option<Decision> {
        let numbers = 0..self.candidates.len();
        let may_be_accepted = |number: &usize| !self.candidates[*number].hypothesis.is_alternative_only;
        let best = self.most_probable_of(numbers.clone().filter(may_be_accepted))?;
        let second = self.most_probable_of(numbers.filter(|number| *number != best));
        let second_best = second.map(|second| {
            SecondBest::new(&self.candidates[best], &self.candidates[second], self.probabilities[second])
        });
        let probability = self.probabilities[best];
        let of_others = self.probabilities.iter().sum::<f64>() - probability;
        let listed = Listed::of(&self.choices);
        let candidate = self.candidates.into_iter().nth(best)?;
        let prior = prior(&candidate, self.is_expected);
        let mut decision = Decision { probability, second_best, listed, prior, ..Decision::of(candidate) };
        decision.refusal = refusal(&decision, of_others, parameters);
        Some(decision)
    }

    /// The number with the highest log-odds; of equals the first.
    fn most_probable_of(&self, numbers: impl Iterator<Item = usize>) -> Option<usize> {
        numbers.reduce(|best, other| if self.log_odds[other] > self.log_odds[best] { other } else { best })
    }
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

/// Log-odds of a candidate. Those that an earlier stage has refused compete, too: they may be right, though not
/// certain enough.
fn log_odds(candidate: &Candidate, is_expected: bool) -> f64 {
    candidate.terms().log_odds() + prior(candidate, is_expected)
}

/// Why a decision is refused, where one of all other candidates is right with a probability; none if it is as probable
/// as required.
fn refusal(decision: &Decision, of_others: f64, parameters: &JudgementParameters) -> Option<Refusal> {
    let JudgementParameters { accept, max_bend: most, .. } = *parameters;
    let Decision { candidate, probability, second_best, .. } = decision;
    if candidate.hypothesis.is_refused {
        return Some(Refusal::RefusedUpstream(candidate.hypothesis.reason.clone()));
    }
    if *probability >= accept {
        let rms = candidate.deformed.map(|deformed| deformed.rms);
        return rms.filter(|rms| rms - most > ROUNDING).map(|rms| Refusal::Deformed { rms, most });
    }
    // The missing probability is that of other candidates, or of none of them.
    let of_none = 1.0 - probability - of_others;
    if let Some(second) = second_best.as_ref().filter(|_| of_others > of_none) {
        let (shift, turn) = (second.shift, second.turn.to_degrees());
        let is_other_source = second.is_by_tags != candidate.rests_on(Basis::is_by_tags);
        return Some(match is_other_source {
            true => Refusal::SourcesDisagree {
                other_source: second.source.clone(),
                shift,
                turn,
                there: second.agreement.inlier_length,
                here: candidate.agreement.inlier_length,
            },
            false => {
                Refusal::Ambiguous { shift, turn, probability: second.probability, listed: decision.listed.clone() }
            }
        });
    }
    let agreement = candidate.agreement;
    Some(match decision.weakest_term() {
        weakest @ (Term::ConflictingWalls | Term::ThingsOnOpenFloor) => Refusal::Contradiction { agreement, weakest },
        weakest @ Term::ShortSegments if agreement.details.contradict() => {
            Refusal::Contradiction { agreement, weakest }
        }
        weakest => Refusal::Chance { agreement, weakest, probability: *probability, accept },
    })
}
