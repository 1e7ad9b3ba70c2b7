//! Decides whether the tags that two robots have in common suffice for a merge.

use super::common::is_usable;
use super::drift::of_deformed_maps;
use super::{Consensus, TagFilterParameters, TagPair, chance_of_agreement, common_tags, find_consensus};
use crate::shared::geometry::RigidFit;
use gridweave_runtime::ros::{CommonTag, TagEstimate};
use std::collections::BTreeSet;

/// Least number of tags that agree only within drift: two at about the same distance are hardly any evidence.
const LEAST_AGREEING_WITH_DRIFT: usize = 3;

/// Verdict on the tags that two robots have in common.
#[derive(Clone, Debug, PartialEq)]
pub struct Judgement {
    /// If accepted, the tags that agree; otherwise all that are certain in both maps. By falling common precision and
    /// then by id.
    pub tags: Vec<CommonTag>,
    /// Whether they suffice.
    pub accepted: bool,
    /// Whether they suffice only if the directions and the walls of the maps confirm the transform.
    pub provisional: bool,
    /// Why they do not suffice; or how well they agree, and which were left out.
    pub reason: String,
    /// If accepted, the transform that they agree on.
    pub fit: Option<RigidFit>,
}

/// The tags of one robot.
#[derive(Clone, Copy, Debug)]
pub struct RobotTags<'a> {
    /// The robot's name.
    pub robot: &'a str,
    /// Its tags.
    pub tags: &'a [TagEstimate],
}

/// Judges whether the tags that two robots have in common suffice for a merge.
///
/// Besides the paper's conditions on certainties, the tags must agree on one rigid transform; the parameters define
/// how strong the agreement must be.
///
/// The maps of a SLAM drift. Where the positions of the tags do not agree, they are compared once more with the
/// uncertainty of drift, and are sent with it.
///
/// Two tags always agree on some transform, if their distance is the same in both maps. That may be chance, as may be
/// the agreement of three near each other. It suffices only if no other common tag contradicts it, and is
/// provisional.
pub fn judge(a: RobotTags<'_>, b: RobotTags<'_>, parameters: &TagFilterParameters) -> Judgement {
    let tags = common_tags(a.tags, b.tags, parameters.certainty);
    let outcome = enough_certain(a, b, &tags, parameters).and_then(|()| {
        let rigid = agreement(&tags, parameters).map(|agreement| (tags.clone(), agreement));
        rigid.or_else(|reason| {
            let tags = of_deformed_maps(&tags, parameters.map_drift);
            let parameters = TagFilterParameters {
                min_tags: parameters.min_tags.max(LEAST_AGREEING_WITH_DRIFT),
                ..parameters.clone()
            };
            agreement(&tags, &parameters).map(|agreement| (tags, agreement)).map_err(|_| reason)
        })
    });
    match outcome {
        Ok((tags, Agreement { consensus, doubt })) => {
            let provisional = doubt.is_some();
            let reason = summary(&tags, &consensus) + &doubt.unwrap_or_default();
            let members = consensus.members.iter().filter_map(|&index| tags.get(index).cloned()).collect();
            Judgement { tags: members, accepted: true, provisional, reason, fit: Some(consensus.fit) }
        }
        Err(reason) => Judgement { tags, accepted: false, provisional: false, reason, fit: None },
    }
}

/// The paper's conditions: the number of tags, and their certainty.
fn enough_certain(
    a: RobotTags<'_>,
    b: RobotTags<'_>,
    tags: &[CommonTag],
    parameters: &TagFilterParameters,
) -> Result<(), String> {
    let TagFilterParameters { certainty, best_certainty, min_tags, .. } = *parameters;
    let ids = |tags: &[TagEstimate]| -> BTreeSet<String> {
        tags.iter().filter(|tag| is_usable(tag)).map(|tag| tag.tag_id.clone()).collect()
    };
    let (in_a, in_b) = (ids(a.tags), ids(b.tags));
    let shared = in_a.intersection(&in_b).count();
    let (name_a, name_b) = (a.robot, b.robot);
    if shared == 0 {
        let (count_a, count_b) = (in_a.len(), in_b.len());
        return Err(format!(
            "{name_a} and {name_b} have no tag in common; {name_a} has located {}, {name_b} {count_b}",
            counted(count_a)
        ));
    }
    if tags.len() < min_tags {
        return Err(format!(
            "{name_a} and {name_b} have {} in common, of which {} a certainty of {certainty:.2} in both maps{}; {min_tags} \
             are needed",
            counted(shared),
            if tags.len() == 1 { "1 has".to_owned() } else { format!("{} have", tags.len()) },
            listed(tags.iter(), " (", ")"),
        ));
    }
    match tags.first() {
        Some(best) if best.common_precision() < best_certainty => Err(format!(
            "{name_a} and {name_b} have {} in common, but none has a certainty of {best_certainty:.2} in both maps; the \
             best is {} with {:.2}",
            counted(tags.len()),
            best.tag_id,
            best.common_precision(),
        )),
        _ => Ok(()),
    }
}

/// Tags that agree.
struct Agreement {
    consensus: Consensus,
    /// Why they do not suffice alone, as text after the evidence for them.
    doubt: Option<String>,
}

/// The conditions on the positions of the tags.
fn agreement(tags: &[CommonTag], parameters: &TagFilterParameters) -> Result<Agreement, String> {
    let TagFilterParameters { gate, map_stddev, min_tags, rival_distance, best_certainty, .. } = *parameters;
    let pairs: Vec<TagPair> = tags.iter().map(|tag| TagPair::new(tag, map_stddev)).collect();
    let search = find_consensus(&pairs, gate, rival_distance);
    let count = tags.len();
    let Some(best) = search.best.filter(|best| best.members.len() >= min_tags) else {
        return Err(format!(
            "of the {count} tags in common no {min_tags} have the same relative positions in both maps; tags of two \
             buildings may have the same ids"
        ));
    };
    let agreeing = best.members.len();
    let names = listed(best.members.iter().filter_map(|&index| tags.get(index)), " (", ")");
    if let [first, second] = best.members[..] {
        let [in_a, in_b] = pairs[first].lengths(&pairs[second]);
        if !pairs[first].lengths_agree(&pairs[second], gate) {
            return Err(format!(
                "the tags in common{names} are {in_a:.2} m apart in one map and {in_b:.2} m in the other; tags of two \
                 buildings may have the same ids"
            ));
        }
    }
    if agreeing as f64 <= parameters.min_agreement * count as f64 {
        return Err(format!(
            "only {agreeing} of the {count} tags in common agree on one transform{names}; tags of two buildings may have \
             the same ids"
        ));
    }
    let yaw_stddev = best.fit.yaw_stddev();
    if yaw_stddev > parameters.max_yaw_stddev {
        return Err(format!(
            "the {agreeing} tags in common that agree{names} determine the rotation to {:.1} degrees only: they are too near \
             to each other, or their positions too uncertain",
            yaw_stddev.to_degrees()
        ));
    }
    let chance = chance_of_agreement(&pairs, agreeing, gate);
    let may_be_chance = format!("as many would agree by chance with a probability of up to {:.1} %", 100.0 * chance);
    let is_provisional = agreeing == 2 || chance > parameters.max_chance;
    if is_provisional && (agreeing < count || chance > parameters.max_provisional_chance) {
        return Err(format!(
            "{agreeing} of the {count} tags in common agree on one transform{names}, but {may_be_chance}"
        ));
    }
    let doubt = is_provisional
        .then(|| format!("; but {may_be_chance}: the directions and the walls of the maps must confirm it"));
    if let Some(rival) = &search.rival {
        let size = rival.members.len();
        if size >= min_tags && size as f64 > parameters.max_rival_share * agreeing as f64 {
            return Err(format!(
                "{agreeing} of the {count} tags in common agree on one transform{names}, but {size} on another one{}: \
                 they do not decide which is right",
                listed(rival.members.iter().filter_map(|&index| tags.get(index)), " (", ")")
            ));
        }
    }
    let best_precision =
        best.members.iter().filter_map(|&index| tags.get(index)).map(CommonTag::common_precision).fold(0.0, f64::max);
    if best_precision < best_certainty {
        return Err(format!(
            "{agreeing} of the {count} tags in common agree on one transform{names}, but none of them has a certainty of \
             {best_certainty:.2} in both maps; the best has {best_precision:.2}"
        ));
    }
    Ok(Agreement { consensus: best, doubt })
}

/// Agreement of a consensus, and the residuals of tags outside of it.
fn summary(tags: &[CommonTag], consensus: &Consensus) -> String {
    let left_out: Vec<String> = tags
        .iter()
        .enumerate()
        .filter(|(index, _)| !consensus.members.contains(index))
        .map(|(_, tag)| {
            let off = (TagPair::new(tag, 0.0).residual(&consensus.fit)).norm();
            format!("{} (off by {off:.2} m)", tag.tag_id)
        })
        .collect();
    let (agreeing, count, rms) = (consensus.members.len(), tags.len(), consensus.fit.rms);
    match left_out.is_empty() {
        true => format!("all {count} tags in common agree within {rms:.3} m"),
        false => {
            format!("{agreeing} of {count} tags in common agree within {rms:.3} m; left out: {}", left_out.join(", "))
        }
    }
}

fn counted(count: usize) -> String {
    if count == 1 { "1 tag".to_owned() } else { format!("{count} tags") }
}

/// The ids of at most eight tags between `before` and `after`; nothing if there are none.
fn listed<'a>(tags: impl Iterator<Item = &'a CommonTag>, before: &str, after: &str) -> String {
    let ids: Vec<&str> = tags.map(|tag| tag.tag_id.as_str()).collect();
    match ids.len() {
        0 => String::new(),
        1..=8 => format!("{before}{}{after}", ids.join(", ")),
        _ => format!("{before}{}, ...{after}", ids[..8].join(", ")),
    }
}
