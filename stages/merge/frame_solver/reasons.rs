//! Why an alignment was left out, and why a robot is not merged, for the user.

use super::UncertainPose;
use super::solution::{Alignments, OpenCycle, Solution};
use crate::shared::robot_pair::RobotPair;
use gridweave_runtime::pipeline::list_in_words;
use gridweave_runtime::ros::Alignment;
use std::collections::{BTreeMap, BTreeSet};

/// Reason of an alignment that the others show to be wrong.
pub(super) fn contradicts(cycle: &OpenCycle) -> String {
    format!("it contradicts other alignments, which agree with each other ({})", gap(cycle))
}

/// Reason of a disputed alignment.
pub(super) fn disputed(cycle: &OpenCycle) -> String {
    format!("alignments contradict each other, and the others do not decide which is wrong ({})", gap(cycle))
}

fn gap(cycle: &OpenCycle) -> String {
    let pairs: Vec<String> = cycle.pairs.iter().map(|pair| pair.robots().join("-")).collect();
    format!(
        "{} do not close by {:.2} m and {:.1} degrees, {:.0} standard deviations",
        list_in_words(&pairs),
        cycle.metres,
        cycle.radians.to_degrees(),
        cycle.deviations
    )
}

/// Reason for every robot that the solution has no frame for.
pub(super) fn unmerged(
    robots: &BTreeSet<String>,
    solution: &Solution,
    alignments: &Alignments,
) -> BTreeMap<String, String> {
    let outside = || robots.iter().filter(|robot| !solution.frames.contains_key(*robot)).map(String::as_str);
    let refusals = UnusedAlignments::new(&outside().collect(), alignments.iter(), &solution.left_out);
    outside().map(|robot| (robot.to_owned(), reason(robot, solution, &refusals))).collect()
}

/// The same for the robots that an alignment of `pair` concerns: those of the pair, and those connected with them. The
/// work goes with their alignments, not with those of all robots.
pub(super) fn of_pair(
    pair: &RobotPair,
    robots: &BTreeSet<String>,
    solution: &Solution,
    alignments: &Alignments,
) -> BTreeMap<String, String> {
    let group = |robot: &str| solution.groups.iter().find(|group| group.frames.contains_key(robot));
    let members = pair.robots().into_iter().filter_map(group).flat_map(|group| group.frames.keys().map(String::as_str));
    let outside = pair.robots().into_iter().filter(|robot| !solution.frames.contains_key(*robot));
    let concerned: BTreeSet<&str> = outside.chain(members).collect();
    let pairs = concerned.iter().flat_map(|robot| robots.iter().map(|other| RobotPair::by_name(*robot, other)));
    let theirs: BTreeMap<&RobotPair, &Alignment> = pairs.filter_map(|pair| alignments.get_key_value(&pair)).collect();
    let refusals = UnusedAlignments::new(&concerned, theirs, &solution.left_out);
    concerned.iter().map(|robot| ((*robot).to_owned(), reason(robot, solution, &refusals))).collect()
}

fn reason(robot: &str, solution: &Solution, refusals: &UnusedAlignments<'_>) -> String {
    let Solution { frames, groups, disputed, .. } = solution;
    if let Some(reason) = disputed.get(robot) {
        return reason.clone();
    }
    let Some(group) = groups.iter().find(|group| group.frames.contains_key(robot)) else {
        return no_alignment(robot, frames, refusals);
    };
    let others: Vec<String> = group.frames.keys().filter(|other| *other != robot).cloned().collect();
    // The alignment that keeps the group apart may be one of another member only.
    let members = std::iter::once(robot).chain(others.iter().map(String::as_str));
    let known = members.clone().find_map(|member| disputed.get(member).cloned());
    let refused = || members.clone().find_map(|member| refusals.most_informative(member, frames));
    let why = known.or_else(refused).unwrap_or_else(|| "no alignment connects them with a merged robot".into());
    format!("it is connected with {} only, not with the reference: {why}", list_in_words(&others))
}

fn no_alignment(robot: &str, frames: &BTreeMap<String, UncertainPose>, refusals: &UnusedAlignments<'_>) -> String {
    refusals.most_informative(robot, frames).unwrap_or_else(|| {
        format!("no alignment with any robot was found: {robot} has no tag readings, or none of a tag that another robot has read")
    })
}

/// An alignment that was not used, from the view of one of its robots.
#[derive(Clone, Copy)]
struct UnusedAlignment<'a> {
    other: &'a str,
    score: f64,
    reason: &'a str,
}

/// For robots outside, their alignments that were not used. Gathered once: there are as many as pairs of robots.
struct UnusedAlignments<'a>(BTreeMap<&'a str, Vec<UnusedAlignment<'a>>>);

impl<'a> UnusedAlignments<'a> {
    fn new(
        outside: &BTreeSet<&'a str>,
        alignments: impl IntoIterator<Item = (&'a RobotPair, &'a Alignment)>,
        left_out: &'a BTreeMap<RobotPair, String>,
    ) -> Self {
        let mut by_robot: BTreeMap<&str, Vec<UnusedAlignment<'_>>> =
            outside.iter().map(|robot| (*robot, Vec::new())).collect();
        for (pair, alignment) in alignments {
            let reason = match alignment.accepted {
                true => left_out.get(pair),
                false => Some(&alignment.reason),
            };
            let Some(reason) = reason else { continue };
            for (robot, other) in [(&pair.a, &pair.b), (&pair.b, &pair.a)] {
                if let Some(refusals) = by_robot.get_mut(robot.as_str()) {
                    refusals.push(UnusedAlignment { other, score: alignment.score, reason });
                }
            }
        }
        Self(by_robot)
    }

    /// The most informative refusal of a robot: towards merged robots if there are any, and of these the one with the
    /// highest score. `None` if no alignment was tried.
    fn most_informative(&self, robot: &str, frames: &BTreeMap<String, UncertainPose>) -> Option<String> {
        let mut refusals = self.0.get(robot)?.clone();
        if refusals.iter().any(|refusal| frames.contains_key(refusal.other)) {
            refusals.retain(|refusal| frames.contains_key(refusal.other));
        }
        refusals.sort_by(|one, next| next.score.total_cmp(&one.score).then_with(|| one.other.cmp(next.other)));
        let most_informative = refusals.first()?;
        let same: Vec<String> = refusals
            .iter()
            .filter(|refusal| refusal.reason == most_informative.reason)
            .map(|refusal| refusal.other.to_owned())
            .collect();
        let reason = if most_informative.reason.is_empty() { "no reason was given" } else { most_informative.reason };
        // A reason of several lines begins on a line of its own.
        let gap = if reason.contains('\n') { "\n" } else { " " };
        Some(format!("no alignment with {}:{gap}{reason}", list_in_words(&same)))
    }
}
