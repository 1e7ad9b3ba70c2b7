//! Decides which of all hypotheses for a pair of maps is right, if any.

use super::competition::Competition;
use super::{Candidate, Comparisons, Decision, JudgementParameters, Refusal};
use crate::registration::comparison::{ComparisonParameters, MapView};
use crate::registration::pose_window::PoseWindow;
use crate::registration::{Basis, Hypothesis};
use crate::shared::geometry::Pose2;

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
) -> Option<Decision> {
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
) -> Option<Decision> {
    comparisons.begin();
    let comparison = parameters.comparison();
    let all = compared(a, b, hypotheses, &comparison, comparisons);
    let choices = match competing(all, known.window.as_ref()) {
        Ok(choices) => choices,
        Err(decision) => return Some(*decision),
    };
    let candidates = deformed(choices.clone(), a, b, &comparison, comparisons);
    let competition = Competition::new(choices, candidates, known.window.is_some());
    match known.hypothesis {
        Some(asked) => {
            competition.chosen_by_user(asked, |choice| deformed(vec![choice], a, b, &comparison, comparisons).pop())
        }
        None => competition.most_probable(parameters),
    }
}

/// The candidates that the initial poses allow; if these allow none, the decision on the best of all.
fn competing(all: Vec<Candidate>, window: Option<&PoseWindow>) -> Result<Vec<Candidate>, Box<Decision>> {
    let Some(window) = window else { return Ok(merged(all)) };
    let is_possible = |candidate: &Candidate| window.contains(&candidate.hypothesis.transform_a_b, 0.0, 0.0);
    let (possible, others): (Vec<Candidate>, Vec<Candidate>) = all.into_iter().partition(is_possible);
    match others.into_iter().next() {
        Some(best) if possible.is_empty() => Err(Box::new(unexpected(best, window))),
        _ => Ok(merged(possible)),
    }
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

/// Decision on a candidate that the initial poses do not allow.
fn unexpected(candidate: Candidate, window: &PoseWindow) -> Decision {
    let (shift, turn) = window.change(&candidate.hypothesis.transform_a_b);
    let refusal = match candidate.hypothesis.is_refused {
        false => Refusal::OutsideWindow { shift, turn: turn.to_degrees() },
        true => Refusal::RefusedUpstream(candidate.hypothesis.reason.clone()),
    };
    Decision { refusal: Some(refusal), ..Decision::of(candidate) }
}
