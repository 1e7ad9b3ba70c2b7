//! A proposed place of map b on map a.

use crate::shared::geometry::Pose2;
use gridweave_runtime::ros::Alignment;
use nalgebra::Matrix3;

/// What `source` of an [`Alignment`] says where it rests on the maps, and where it rests on tags.
const MAPS: &str = "maps";
const TAGS: &str = "tags";

/// What a hypothesis rests on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Basis {
    /// A search over all places of the two maps.
    Search {
        /// How far the peak stands out: how much its score exceeds that of the best place elsewhere, in units of the spread of all
        /// others; 0 if it does not. By chance it is more than `t` with the probability `exp(-t)`.
        significance: f64,
    },
    /// Tags that both robots have seen, enough of them to agree with each other.
    Tags,
    /// Tags that both robots have seen, too few to confirm each other.
    FewTags,
    /// Something else. It is trusted no more than any place of the maps.
    Unknown,
}

impl Basis {
    /// What an alignment rests on, by its source, and for the search by its method: the score of other methods on maps is no
    /// significance.
    pub fn of(alignment: &Alignment) -> Self {
        let is_by_search = alignment.hypotheses > 0 && alignment.method.split('+').next() == Some(MAPS);
        match alignment.source.as_str() {
            MAPS if is_by_search => {
                let by_chance = (1.0 - alignment.score.clamp(0.0, 1.0)).max(f64::MIN_POSITIVE);
                Self::Search { significance: -by_chance.ln() }
            }
            TAGS if alignment.provisional => Self::FewTags,
            TAGS => Self::Tags,
            _ => Self::Unknown,
        }
    }

    /// Whether it rests on tags, which are independent of the maps.
    pub fn is_by_tags(self) -> bool {
        matches!(self, Self::Tags | Self::FewTags)
    }
}

/// A proposed place of map b on map a.
#[derive(Clone, Debug, PartialEq)]
pub struct Hypothesis {
    /// `T_a_b`.
    pub transform_a_b: Pose2,
    /// Covariance of (x, y, yaw), metres and radians.
    pub covariance: Matrix3<f64>,
    /// What it rests on.
    pub basis: Basis,
    /// The name of what it rests on, for people.
    pub source: String,
    /// Why it was proposed, for people; or why it may not be used.
    pub reason: String,
    /// Whether the stage that sent it has refused it.
    pub is_refused: bool,
    /// Whether it only stands against others, and nobody has proposed it.
    pub is_rival: bool,
}

impl Hypothesis {
    /// The hypothesis that an alignment stands for; none if it has no place in numbers.
    pub fn of(alignment: &Alignment) -> Option<Self> {
        let has_place =
            alignment.has_transform && [alignment.x, alignment.y, alignment.yaw].iter().all(|value| value.is_finite());
        has_place.then(|| Self {
            transform_a_b: alignment.transform_a_b(),
            covariance: Matrix3::from_row_slice(&alignment.covariance),
            basis: Basis::of(alignment),
            source: alignment.source.clone(),
            reason: alignment.reason.clone(),
            is_refused: !alignment.accepted,
            is_rival: false,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn alignment(source: &str, method: &str) -> Alignment {
        Alignment { source: source.into(), method: method.into(), hypotheses: 2, score: 0.99, ..Default::default() }
    }

    #[test]
    fn only_the_search_and_tags_are_trusted_for_what_they_are() {
        let Basis::Search { significance } = Basis::of(&alignment("maps", "maps+icp")) else { panic!() };
        assert!((significance - 100.0_f64.ln()).abs() < 1e-9);
        assert_eq!(Basis::of(&alignment("tags", "tags+directions+icp")), Basis::Tags);
        assert_eq!(Basis::of(&Alignment { provisional: true, ..alignment("tags", "tags") }), Basis::FewTags);
        for (source, method) in [("maps", "radon"), ("topology", "topology"), ("a plug-in", "tags"), ("", "")] {
            assert_eq!(Basis::of(&alignment(source, method)), Basis::Unknown, "{source} {method}");
        }
    }

    #[test]
    fn a_place_that_is_no_number_is_no_hypothesis() {
        let good = Alignment { has_transform: true, ..alignment("maps", "maps") };
        assert!(Hypothesis::of(&good).is_some());
        assert_eq!(Hypothesis::of(&Alignment { x: f64::NAN, ..good.clone() }), None);
        assert_eq!(Hypothesis::of(&Alignment { has_transform: false, ..good }), None);
    }
}
