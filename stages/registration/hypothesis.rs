//! A hypothesis: a proposed relative pose of two maps.

use crate::shared::geometry::Pose2;
use gridweave_runtime::ros::Alignment;
use nalgebra::Matrix3;

/// Values of the field `source` of an [`Alignment`] for hypotheses from maps and from tags.
const MAPS: &str = "maps";
const TAGS: &str = "tags";

/// The evidence that a hypothesis rests on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Basis {
    /// A search over all relative poses of the two maps.
    Search {
        /// Peak significance: how much the score exceeds the second-best one, in units of the spread of all others; 0
        /// if it does not. By chance it is more than `t` with probability `exp(-t)`.
        significance: f64,
        /// By how much the score exceeds what chance reaches with these maps, as a share of it, 0 to 1.
        margin: f64,
    },
    /// Common tags, enough to confirm each other.
    Tags,
    /// Common tags, too few to confirm each other.
    FewTags,
    /// Anything else. It is trusted no more than any relative pose of the maps.
    Unknown,
}

impl Basis {
    /// Basis of an alignment, by its source; for the search by its method as well, as the score of other methods on
    /// maps is no significance.
    pub fn of(alignment: &Alignment) -> Self {
        let is_by_search = alignment.hypotheses > 0 && alignment.method.split('+').next() == Some(MAPS);
        match alignment.source.as_str() {
            MAPS if is_by_search => {
                // What is not a number is no evidence.
                let [score, margin] = [alignment.score, alignment.margin]
                    .map(|value| if value.is_nan() { 0.0 } else { value.clamp(0.0, 1.0) });
                let by_chance = (1.0 - score).max(f64::MIN_POSITIVE);
                Self::Search { significance: -by_chance.ln(), margin }
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

/// A proposed relative pose of two maps.
#[derive(Clone, Debug, PartialEq)]
pub struct Hypothesis {
    /// Pose of map b in map a, `T_a_b`.
    pub transform_a_b: Pose2,
    /// Covariance of (x, y, yaw), metres and radians.
    pub covariance: Matrix3<f64>,
    /// The evidence that it rests on.
    pub basis: Basis,
    /// Name of that evidence for the user.
    pub source: String,
    /// Why it was proposed, or why it was refused, for the user.
    pub reason: String,
    /// Whether the stage that sent it has refused it.
    pub is_refused: bool,
    /// Whether it only competes with other hypotheses, and may not be accepted itself.
    pub is_alternative_only: bool,
}

impl Hypothesis {
    /// The hypothesis of an alignment; none if its pose is missing or not finite.
    pub fn of(alignment: &Alignment) -> Option<Self> {
        let has_pose =
            alignment.has_transform && [alignment.x, alignment.y, alignment.yaw].iter().all(|value| value.is_finite());
        has_pose.then(|| Self {
            transform_a_b: alignment.transform_a_b(),
            covariance: Matrix3::from_row_slice(&alignment.covariance),
            basis: Basis::of(alignment),
            source: alignment.source.clone(),
            reason: alignment.reason.clone(),
            is_refused: !alignment.accepted,
            is_alternative_only: false,
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
    fn only_the_search_and_tags_have_a_basis_of_their_own() {
        let Basis::Search { significance, .. } = Basis::of(&alignment("maps", "maps+icp")) else { panic!() };
        assert!((significance - 100.0_f64.ln()).abs() < 1e-9);
        let unknown = Alignment { score: f64::NAN, margin: f64::NAN, ..alignment("maps", "maps") };
        assert_eq!(Basis::of(&unknown), Basis::Search { significance: 0.0, margin: 0.0 });
        assert_eq!(Basis::of(&alignment("tags", "tags+directions+icp")), Basis::Tags);
        assert_eq!(Basis::of(&Alignment { provisional: true, ..alignment("tags", "tags") }), Basis::FewTags);
        for (source, method) in [("maps", "radon"), ("topology", "topology"), ("a plug-in", "tags"), ("", "")] {
            assert_eq!(Basis::of(&alignment(source, method)), Basis::Unknown, "{source} {method}");
        }
    }

    #[test]
    fn an_alignment_without_a_finite_pose_is_no_hypothesis() {
        let good = Alignment { has_transform: true, ..alignment("maps", "maps") };
        assert!(Hypothesis::of(&good).is_some());
        assert_eq!(Hypothesis::of(&Alignment { x: f64::NAN, ..good.clone() }), None);
        assert_eq!(Hypothesis::of(&Alignment { has_transform: false, ..good }), None);
    }
}
