//! Why the tags that two robots have in common do not suffice for a merge.

use gridweave_runtime::ros::CommonTag;
use std::fmt;

/// At most so many ids are listed.
const MOST_LISTED: usize = 8;

/// Why common tags do not suffice. The display text is for the user.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(super) enum TagRefusal {
    #[error("{a} and {b} have no tag in common; {a} has located {}, {b} {located_b}", counted(*located_a))]
    NoCommonTag { a: String, b: String, located_a: usize, located_b: usize },
    #[error(
        "{a} and {b} have {} in common, of which {} a certainty of {certainty:.2} in both maps{certain}; {min_tags} \
         are needed",
        counted(*shared),
        if certain.len() == 1 { "1 has".to_owned() } else { format!("{} have", certain.len()) }
    )]
    FewCertain { a: String, b: String, shared: usize, certain: TagIds, certainty: f64, min_tags: usize },
    #[error(
        "{a} and {b} have {} in common, but none has a certainty of {best_certainty:.2} in both maps; the \
         best is {best_id} with {precision:.2}",
        counted(*count)
    )]
    NoneCertain { a: String, b: String, count: usize, best_certainty: f64, best_id: String, precision: f64 },
    #[error(
        "of the {count} tags in common no {min_tags} have the same relative positions in both maps; tags of two \
         buildings may have the same ids"
    )]
    NoneAgree { count: usize, min_tags: usize },
    /// Distances in metres.
    #[error(
        "the tags in common{ids} are {in_a:.2} m apart in one map and {in_b:.2} m in the other; tags of two \
         buildings may have the same ids"
    )]
    OtherDistance { ids: TagIds, in_a: f64, in_b: f64 },
    #[error("only {agreeing}; tags of two buildings may have the same ids")]
    FewAgree { agreeing: AgreeingTags },
    /// Standard deviation of the yaw in degrees.
    #[error(
        "the {} tags in common that agree{ids} determine the rotation to {yaw_stddev:.1} degrees only: they are too near \
         to each other, or their positions too uncertain",
        ids.len()
    )]
    UncertainRotation { ids: TagIds, yaw_stddev: f64 },
    #[error("{agreeing}, but {by_chance}")]
    ByChance { agreeing: AgreeingTags, by_chance: ByChance },
    #[error("{agreeing}, but {} on another one{others}: they do not decide which is right", others.len())]
    OtherTransform { agreeing: AgreeingTags, others: TagIds },
    #[error(
        "{agreeing}, but none of them has a certainty of {best_certainty:.2} in both maps; the best has {precision:.2}"
    )]
    Imprecise { agreeing: AgreeingTags, best_certainty: f64, precision: f64 },
}

/// Common tags that agree on one transform, of all `count`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct AgreeingTags {
    pub(super) ids: TagIds,
    pub(super) count: usize,
}

/// Probability that as many tags at random positions agree, 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ByChance(pub(super) f64);

/// Ids of tags. Their text follows a word: in parentheses, and nothing if there are none.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct TagIds(Vec<String>);

impl TagIds {
    pub(super) fn of<'a>(tags: impl IntoIterator<Item = &'a CommonTag>) -> Self {
        Self(tags.into_iter().map(|tag| tag.tag_id.clone()).collect())
    }

    pub(super) fn len(&self) -> usize {
        self.0.len()
    }
}

impl fmt::Display for TagIds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.len() {
            0 => Ok(()),
            1..=MOST_LISTED => write!(f, " ({})", self.0.join(", ")),
            _ => write!(f, " ({}, ...)", self.0[..MOST_LISTED].join(", ")),
        }
    }
}

impl fmt::Display for AgreeingTags {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} of the {} tags in common agree on one transform{}", self.ids.len(), self.count, self.ids)
    }
}

impl fmt::Display for ByChance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "as many would agree by chance with a probability of up to {:.1} %", 100.0 * self.0)
    }
}

fn counted(count: usize) -> String {
    if count == 1 { "1 tag".to_owned() } else { format!("{count} tags") }
}
