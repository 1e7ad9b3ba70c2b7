//! Decides whether the tags that two robots have in common suffice for a merge.

use super::common::is_usable;
use super::drift::of_deformed_maps;
use super::refusal::{AgreeingTags, ByChance, TagIds, TagRefusal};
use super::{TagConsensus, TagFilterParameters, TagPair, chance_of_agreement, common_tags, find_consensus};
use crate::shared::geometry::RigidFit;
use gridweave_runtime::ros::{CommonTag, TagEstimate};
use std::collections::BTreeSet;

/// Least number of tags that agree only within drift: two at about the same distance are hardly any evidence.
const LEAST_AGREEING_WITH_DRIFT: usize = 3;

/// Verdict on the tags that two robots have in common.
#[derive(Clone, Debug, PartialEq)]
pub struct TagJudgement {
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
pub fn judge(a: RobotTags<'_>, b: RobotTags<'_>, parameters: &TagFilterParameters) -> TagJudgement {
    let tags = common_tags(a.tags, b.tags, parameters.certainty);
    let outcome = enough_certain(a, b, &tags, parameters).and_then(|()| {
        let rigid = agreement(&tags, parameters).map(|agreement| (tags.clone(), agreement));
        rigid.or_else(|refusal| {
            let tags = of_deformed_maps(&tags, parameters.map_drift);
            let parameters = TagFilterParameters {
                min_tags: parameters.min_tags.max(LEAST_AGREEING_WITH_DRIFT),
                ..parameters.clone()
            };
            agreement(&tags, &parameters).map(|agreement| (tags, agreement)).map_err(|_| refusal)
        })
    });
    match outcome {
        Ok((tags, TagAgreement { consensus, doubt })) => {
            let provisional = doubt.is_some();
            let doubt = doubt.map(|by_chance| {
                format!("; but {by_chance}: the directions and the walls of the maps must confirm it")
            });
            let reason = summary(&tags, &consensus) + &doubt.unwrap_or_default();
            let members = consensus.members.iter().filter_map(|&index| tags.get(index).cloned()).collect();
            TagJudgement { tags: members, accepted: true, provisional, reason, fit: Some(consensus.fit) }
        }
        Err(refusal) => {
            TagJudgement { tags, accepted: false, provisional: false, reason: refusal.to_string(), fit: None }
        }
    }
}

/// The paper's conditions: the number of tags, and their certainty.
fn enough_certain(
    a: RobotTags<'_>,
    b: RobotTags<'_>,
    tags: &[CommonTag],
    parameters: &TagFilterParameters,
) -> Result<(), TagRefusal> {
    let TagFilterParameters { certainty, best_certainty, min_tags, .. } = *parameters;
    let ids = |tags: &[TagEstimate]| -> BTreeSet<String> {
        tags.iter().filter(|tag| is_usable(tag)).map(|tag| tag.tag_id.clone()).collect()
    };
    let (in_a, in_b) = (ids(a.tags), ids(b.tags));
    let shared = in_a.intersection(&in_b).count();
    let [a, b] = [a, b].map(|robot| robot.robot.to_owned());
    if shared == 0 {
        return Err(TagRefusal::NoCommonTag { a, b, located_a: in_a.len(), located_b: in_b.len() });
    }
    if tags.len() < min_tags {
        return Err(TagRefusal::FewCertain { a, b, shared, certain: TagIds::of(tags), certainty, min_tags });
    }
    match tags.first().map(|best| (best, best.common_precision())) {
        Some((best, precision)) if precision < best_certainty => {
            let best_id = best.tag_id.clone();
            Err(TagRefusal::NoneCertain { a, b, count: tags.len(), best_certainty, best_id, precision })
        }
        _ => Ok(()),
    }
}

/// Tags that agree.
struct TagAgreement {
    consensus: TagConsensus,
    /// The probability of chance, if that is why they do not suffice alone.
    doubt: Option<ByChance>,
}

/// The conditions on the positions of the tags.
fn agreement(tags: &[CommonTag], parameters: &TagFilterParameters) -> Result<TagAgreement, TagRefusal> {
    let TagFilterParameters { gate, map_stddev, min_tags, rival_distance, best_certainty, .. } = *parameters;
    let pairs: Vec<TagPair> = tags.iter().map(|tag| TagPair::new(tag, map_stddev)).collect();
    let search = find_consensus(&pairs, gate, rival_distance);
    let count = tags.len();
    let Some(best) = search.best.filter(|best| best.members.len() >= min_tags) else {
        return Err(TagRefusal::NoneAgree { count, min_tags });
    };
    let ids = ids_of(&best, tags);
    if let [first, second] = best.members[..] {
        let [in_a, in_b] = pairs[first].lengths(&pairs[second]);
        if !pairs[first].lengths_agree(&pairs[second], gate) {
            return Err(TagRefusal::OtherDistance { ids, in_a, in_b });
        }
    }
    let size = best.members.len();
    let agreeing = AgreeingTags { ids, count };
    if size as f64 <= parameters.min_agreement * count as f64 {
        return Err(TagRefusal::FewAgree { agreeing });
    }
    let yaw_stddev = best.fit.yaw_stddev();
    if yaw_stddev > parameters.max_yaw_stddev {
        return Err(TagRefusal::UncertainRotation { ids: agreeing.ids, yaw_stddev: yaw_stddev.to_degrees() });
    }
    let chance = chance_of_agreement(&pairs, size, gate);
    let is_provisional = size == 2 || chance > parameters.max_chance;
    if is_provisional && (size < count || chance > parameters.max_provisional_chance) {
        return Err(TagRefusal::ByChance { agreeing, by_chance: ByChance(chance) });
    }
    if let Some(other) = &search.rival {
        let size_of_other = other.members.len();
        if size_of_other >= min_tags && size_of_other as f64 > parameters.max_rival_share * size as f64 {
            return Err(TagRefusal::OtherTransform { agreeing, others: ids_of(other, tags) });
        }
    }
    let members = best.members.iter().filter_map(|&index| tags.get(index));
    let precision = members.map(CommonTag::common_precision).fold(0.0, f64::max);
    if precision < best_certainty {
        return Err(TagRefusal::Imprecise { agreeing, best_certainty, precision });
    }
    Ok(TagAgreement { consensus: best, doubt: is_provisional.then_some(ByChance(chance)) })
}

fn ids_of(consensus: &TagConsensus, tags: &[CommonTag]) -> TagIds {
    TagIds::of(consensus.members.iter().filter_map(|&index| tags.get(index)))
}

/// Agreement of a consensus, and the residuals of tags outside of it.
fn summary(tags: &[CommonTag], consensus: &TagConsensus) -> String {
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
