//! The tags that are certain in both maps.

use gridweave_runtime::ros::{CommonTag, TagEstimate};
use std::collections::BTreeMap;

/// The tags with at least the given certainty in both maps, by falling common precision (the lesser of the two
/// certainties) and then by id (section 4.1.3).
///
/// Estimates with a value that is not finite, or without an id, are ignored; of two estimates of one tag the first
/// counts.
pub fn common_tags(tags_a: &[TagEstimate], tags_b: &[TagEstimate], certainty: f64) -> Vec<CommonTag> {
    let certain = |tags: &'_ [TagEstimate]| {
        let mut by_id: BTreeMap<String, TagEstimate> = BTreeMap::new();
        for tag in tags.iter().filter(|tag| is_usable(tag) && tag.certainty >= certainty) {
            by_id.entry(tag.tag_id.clone()).or_insert_with(|| tag.clone());
        }
        by_id
    };
    let in_b = certain(tags_b);
    let pair = |(tag_id, a): (String, TagEstimate)| {
        let b = in_b.get(&tag_id)?;
        Some(CommonTag {
            tag_id,
            a: [a.x, a.y],
            b: [b.x, b.y],
            covariance_a: a.covariance,
            covariance_b: b.covariance,
            certainty_a: a.certainty,
            certainty_b: b.certainty,
        })
    };
    let mut common: Vec<CommonTag> = certain(tags_a).into_iter().filter_map(pair).collect();
    // The sort is stable, and the tags are sorted by id.
    common.sort_by(|one, other| other.common_precision().total_cmp(&one.common_precision()));
    common
}

/// Whether an estimate can be used.
pub(super) fn is_usable(tag: &TagEstimate) -> bool {
    let [xx, xy, yx, yy] = tag.covariance;
    let finite = [tag.x, tag.y, tag.certainty, xx, xy, yx, yy].iter().all(|value| value.is_finite());
    finite && xx >= 0.0 && yy >= 0.0 && !tag.tag_id.is_empty()
}
