//! What is sent of a decision: the alignment with its reason, and the evidence.

use crate::registration::Hypothesis;
use crate::registration::comparison::{Agreement, Deformed};
use crate::registration::judgement::Decision;
use crate::registration::scale::Scale;
use crate::shared::geometry::row_by_row;
use crate::shared::robot_pair::RobotPair;
use gridweave_runtime::ros::{Alignment, Evidence, Header};
use nalgebra::Matrix3;

/// Evidence of a decision on a pair, with the number of hypotheses, without a header.
pub(super) fn evidence(decision: &Decision, pair: &RobotPair, hypotheses: usize) -> Evidence {
    let Agreement { overlap, inlier_length, conflict_length, evidence, .. } = decision.candidate.agreement;
    let elsewhere = decision.second_best.as_ref().map_or(0.0, |second| second.agreement.evidence.max(0.0));
    Evidence {
        header: Header::default(),
        a: pair.a.clone(),
        b: pair.b.clone(),
        hypotheses: hypotheses as u32,
        overlap,
        wall_on_wall: inlier_length,
        wall_on_free: conflict_length,
        evidence_elsewhere: (elsewhere / evidence.max(1.0)).min(2.0),
    }
}

/// Alignment of a decision on hypotheses, of which those with a pose were judged, in their order.
pub(super) fn judged(decision: &Decision, proposed: &[&Alignment], reason: String) -> Alignment {
    let accepted = decision.refusal.is_none();
    let source = &decision.candidate.hypothesis.source;
    let mut judged = proposed.iter().filter(|alignment| Hypothesis::of(alignment).is_some());
    let mut alignment = judged.nth(decision.candidate.number).map_or_else(Alignment::default, |one| (*one).clone());
    if let Some(Deformed { transform_a_b, .. }) = &decision.candidate.deformed {
        alignment.set_transform_a_b(transform_a_b);
    }
    if let Some(covariance) = &decision.candidate.left_by_deformation {
        alignment.covariance = row_by_row(&(Matrix3::from_row_slice(&alignment.covariance) + covariance));
    }
    Alignment {
        accepted,
        provisional: false,
        rank: 0,
        hypotheses: 0,
        score: decision.probability,
        reason: if accepted { reason } else { with_other_sources(reason, source, proposed) },
        ..alignment
    }
}

/// Decision for a pair without a pose.
pub(super) fn refused(proposed: &[&Alignment]) -> Alignment {
    let Some(first) = proposed.first() else { return Alignment::default() };
    let reason = with_other_sources(first.reason.clone(), &first.source, proposed);
    Alignment { accepted: false, provisional: false, rank: 0, hypotheses: 0, reason, ..(*first).clone() }
}

/// First paragraph of the reason for a pair whose maps agree at another scale, where the cells of map b are `cell`
/// metres wide by its resolution.
pub(super) fn scale_reason(scale: &Scale, pair: &RobotPair, cell: f64) -> String {
    let Scale { factor, decision } = scale;
    let RobotPair { a, b } = pair;
    let Agreement { inlier_length, conflict_length, .. } = decision.candidate.agreement;
    format!(
        "the maps may fit if {b} is {factor:.3} times as large: {inlier_length:.0} m of wall agree, {conflict_length:.0} m do not\n\
         missing: the right resolution of {b}, or of {a}\n\
         try: cells of {side:.5} m instead of {cell:.5} m, if {a} is right: --resolution {b}={side:.5}\n\n",
        side = factor * cell,
    )
}

/// Adds the reasons of the other sources to a refusal, so that the user sees why none of them helped.
fn with_other_sources(reason: String, source: &str, proposed: &[&Alignment]) -> String {
    let others = proposed.iter().filter(|alignment| alignment.source != source && alignment.rank == 0);
    let others: Vec<String> =
        others.map(|other| format!("by the {}: {}", other.source, one_line(&other.reason))).collect();
    if others.is_empty() {
        return reason;
    }
    // Details follow after the empty line.
    let gap = if reason.contains("\n\n") { "\n" } else { "\n\n" };
    format!("{reason}{gap}{}", others.join("\n"))
}

fn one_line(reason: &str) -> String {
    reason.split('\n').filter(|line| !line.is_empty()).collect::<Vec<_>>().join("; ")
}
