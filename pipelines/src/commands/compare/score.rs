//! Comparison of the summary of a run with the truth.

use crate::common_places::{self, PlacePair};
use crate::evaluate::{RobotOutcome, evaluate, read_summary};
use anyhow::Result;
use gridweave_logs::summary::Summary;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Metres. The median distance of common places may exceed that of the best rigid transform by this.
const RIGHT_MEDIAN: f64 = 0.5;
/// Metres. The 90 % quantile may exceed that of the best rigid transform by this.
const RIGHT_P90: f64 = 1.0;

/// The truth of a log.
#[derive(Debug)]
pub(super) enum CaseTruth {
    /// A truth file, as `evaluate` reads it.
    Frames(PathBuf),
    /// Places that two maps have in common.
    Places {
        /// Robots a and b.
        robots: [String; 2],
        places: PairTruth,
    },
}

/// The truth of a pair of map files.
#[derive(Debug, Deserialize)]
pub(super) struct PairTruth {
    /// `x_b, y_b, x_a, y_a`: a place in b's and the same in a's map frame, metres. Empty if the maps have nothing in
    /// common.
    common: Vec<PlacePair>,
    /// Median distance of the places under the best rigid transform, which the deformation of the maps causes, metres.
    #[serde(default)]
    rigid_median: f64,
    /// The 90 % quantile of these distances, metres.
    #[serde(default)]
    rigid_p90: f64,
}

/// Outcome and errors of a robot other than the reference.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Scored {
    pub(super) robot: String,
    pub(super) outcome: RobotOutcome,
    /// Metres, at the middle of its map; for a pair of map files, the median over the common places.
    pub(super) error_m: Option<f64>,
    pub(super) error_deg: Option<f64>,
}

impl CaseTruth {
    /// Scores the summary of a run.
    pub(super) fn score(&self, summary: &Path) -> Result<Vec<Scored>> {
        match self {
            Self::Frames(truth) => {
                let robots = evaluate(summary, truth)?.robots.into_iter();
                let scored = robots.map(|robot| Scored {
                    robot: robot.robot,
                    outcome: robot.outcome,
                    error_m: robot.error_m,
                    error_deg: robot.error_deg,
                });
                Ok(scored.collect())
            }
            Self::Places { robots: [a, b], places } => {
                let (outcome, errors) = places.score(&read_summary(summary)?, a, b);
                let (error_m, error_deg) = errors.unzip();
                Ok(vec![Scored { robot: b.clone(), outcome, error_m, error_deg }])
            }
        }
    }
}

impl PairTruth {
    /// Outcome of map b, and its error in metres and degrees.
    fn score(&self, run: &Summary, a: &str, b: &str) -> (RobotOutcome, Option<(f64, f64)>) {
        if !(run.frames.contains_key(a) && run.frames.contains_key(b)) {
            let refused = if self.common.is_empty() { RobotOutcome::RightlyRefused } else { RobotOutcome::Refused };
            return (refused, None);
        }
        let Some(measured) = common_places::measure(run, [a, b], &self.common) else {
            return (RobotOutcome::Wrong, None);
        };
        let (median, p90) = (measured.rigid.median_m, measured.rigid.p90_m);
        let is_right = median < RIGHT_MEDIAN + self.rigid_median && p90 < RIGHT_P90 + self.rigid_p90;
        let degrees = measured.from_best.map_or(f64::NAN, |from_best| from_best.degrees);
        (if is_right { RobotOutcome::Right } else { RobotOutcome::Wrong }, Some((median, degrees)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_logs::summary::Frame;

    fn summary(frames: &[(&str, [f64; 3])]) -> Summary {
        let frame =
            |&(robot, [x, y, yaw]): &(&str, [f64; 3])| (robot.to_owned(), Frame { x, y, yaw, ..Default::default() });
        Summary { frames: frames.iter().map(frame).collect(), ..Default::default() }
    }

    /// The pose `T_a_b` is (10, 0) with a quarter turn.
    fn truth() -> PairTruth {
        let common = [[0.0, 0.0], [4.0, 0.0], [0.0, 3.0], [2.0, 2.0]].map(|[x, y]| [x, y, 10.0 - y, x]).to_vec();
        PairTruth { common, rigid_median: 0.1, rigid_p90: 0.2 }
    }

    #[test]
    fn common_places_decide_whether_a_pair_is_right() {
        let quarter = std::f64::consts::FRAC_PI_2;
        for (frame_b, expected, metres) in [
            ([10.0, 0.0, quarter], RobotOutcome::Right, 0.0),
            ([10.0, 0.55, quarter], RobotOutcome::Right, 0.55),
            ([10.0, 0.65, quarter], RobotOutcome::Wrong, 0.65),
        ] {
            let (outcome, errors) = truth().score(&summary(&[("a", [0.0; 3]), ("b", frame_b)]), "a", "b");
            let (error_m, error_deg) = errors.unwrap();
            assert_eq!(outcome, expected);
            assert!((error_m - metres).abs() < 1e-9 && error_deg < 1e-6, "{error_m} {error_deg}");
        }
    }

    #[test]
    fn the_frame_of_the_first_map_need_not_be_the_world() {
        let run =
            summary(&[("a", [5.0, 1.0, 3.0]), ("b", [5.0 + 10.0 * 3f64.cos(), 1.0 + 10.0 * 3f64.sin(), 3.0 + 1.571])]);
        let (outcome, errors) = truth().score(&run, "a", "b");
        assert!(outcome == RobotOutcome::Right && errors.unwrap().1 < 0.02, "{errors:?}");
    }

    #[test]
    fn maps_with_nothing_in_common_must_not_be_merged() {
        let nothing = PairTruth { common: Vec::new(), rigid_median: 0.0, rigid_p90: 0.0 };
        let (merged, refused) = (summary(&[("a", [0.0; 3]), ("b", [0.0; 3])]), summary(&[("a", [0.0; 3])]));
        assert_eq!(nothing.score(&merged, "a", "b"), (RobotOutcome::Wrong, None));
        assert_eq!(nothing.score(&refused, "a", "b"), (RobotOutcome::RightlyRefused, None));
        assert_eq!(truth().score(&refused, "a", "b"), (RobotOutcome::Refused, None));
    }
}
