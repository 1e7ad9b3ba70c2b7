//! The summary of a run against the truth.
//!
//! A robot counts as **right** if its map lies within 0.5 m and 1 degree of the truth, the distance taken at the middle
//! of its last map, and as **wrong** otherwise. A robot that the run did not merge is **refused**. In a log of robots
//! that have nothing to do with each other (the truth has no frames) to refuse is right, and every merged
//! robot is wrong. The reference robot is not counted.
//!
//! Where the truth knows places that two robots have both seen (`common`), it is measured how far apart the merge has them,
//! as the rigid frames lay them and as the maps are bent, and how far the frames lie from those that lay these places best.

use crate::common_places::{self, CommonPlace, CommonPlaces, normalised_error_squared, pose};
use crate::merge_text::short;
use crate::prose::broken;
use crate::table::Table;
use anyhow::{Context, Result, bail};
use gridweave_logs::summary::{Frame, Summary};
use gridweave_runtime::input_file;
use nalgebra::{Isometry2, Point2};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Metres. A robot is right below this error at the middle of its map.
pub const RIGHT_METRES: f64 = 0.5;
/// Degrees. A robot is right below this error of its direction.
pub const RIGHT_DEGREES: f64 = 1.0;

/// What became of one robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RobotOutcome {
    /// It is merged, and where it belongs.
    Right,
    /// It is merged, and not where it belongs.
    Wrong,
    /// It is not merged, though it belongs to the others.
    Refused,
    /// It is not merged, and does not belong to the others.
    RightlyRefused,
    /// The truth says nothing of it.
    NoTruth,
}

/// One robot of the summary, measured.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RobotResult {
    /// The robot.
    pub robot: String,
    /// What became of it.
    pub outcome: RobotOutcome,
    /// Error at the middle of its map, metres; none if there is nothing to compare.
    pub error_m: Option<f64>,
    /// Error of its direction, degrees, 0 to 180; none if there is nothing to compare.
    pub error_deg: Option<f64>,
    /// Squared error of its frame in x, y and yaw by the covariance that the run tells; none if there is nothing to compare,
    /// or no covariance. Of frames whose covariance is right 95 % are below 7.81, and the mean is 3.
    pub normalised_error_squared: Option<f64>,
    /// Why it is not merged.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// `T_true_found`: where its map frame was found to be, in the frame where it is in truth; none if there is nothing
    /// to compare. It takes a point of the map from its true place to its found one.
    #[serde(skip)]
    pub transform_true_found: Option<Isometry2<f64>>,
}

/// A run, measured.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Evaluation {
    /// The robot that the others are placed by; none if the run had no robots.
    pub reference: Option<String>,
    /// Whether the truth says that the robots belong together.
    pub related: bool,
    /// All other robots, by name.
    pub robots: Vec<RobotResult>,
    /// How many robots are right.
    pub right: usize,
    /// How many are wrong.
    pub wrong: usize,
    /// How many are not merged, rightly or not.
    pub refused: usize,
    /// How far apart the same places lie, if the truth knows such and the robots are merged.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub common: Option<CommonPlaces>,
}

#[derive(Deserialize)]
struct Truth {
    /// None if the robots have nothing to do with each other.
    frames: BTreeMap<String, Frame>,
    /// The middle of each robot's last map, in its map frame.
    #[serde(default)]
    centres: BTreeMap<String, [f64; 2]>,
    /// Places that the first two robots by name both have seen.
    #[serde(default)]
    common: Vec<CommonPlace>,
}

/// Measures the summary that `gridweave run --summary` wrote against a truth file. Where the truth has no frames, the
/// robots are taken as unrelated. A robot for which the truth gives no middle is measured at its map's origin.
///
/// # Errors
/// A file cannot be read or is not what it should be; or the truth knows robots, but not the summary's reference.
pub fn evaluate(summary: &Path, truth: &Path) -> Result<Evaluation> {
    let merge = read_summary(summary)?;
    evaluate_summary(&merge, truth)
        .with_context(|| format!("cannot compare {} with {}", summary.display(), truth.display()))
}

/// Measures what a merge has found against a truth file, as [`evaluate`] does.
///
/// # Errors
/// The truth cannot be read or is not what it should be; or it knows robots, but not the summary's reference.
pub fn evaluate_summary(summary: &Summary, truth: &Path) -> Result<Evaluation> {
    measure(summary, &read(truth, "a truth file")?)
}

/// What `--summary` has written.
pub(crate) fn read_summary(path: &Path) -> Result<Summary> {
    read(path, "the summary of a run")
}

/// Whether there is a truth that [`evaluate`] can read.
pub(crate) fn check_truth(path: &Path) -> Result<()> {
    read::<Truth>(path, "a truth file").map(|_| ())
}

/// A JSON file.
fn read<T: DeserializeOwned>(path: &Path, what: &str) -> Result<T> {
    let text = input_file::read(path, input_file::LONGEST_TEXT)
        .with_context(|| format!("cannot read {what}: {}", path.display()))?;
    serde_json::from_slice(&text).with_context(|| format!("{} is not {what}", path.display()))
}

fn measure(run: &Summary, truth: &Truth) -> Result<Evaluation> {
    let related = !truth.frames.is_empty();
    let transform_reference_truth = match &run.reference {
        Some(reference) if related => match truth.frames.get(reference) {
            Some(frame) => pose(frame).inverse(),
            None => {
                let known: Vec<&str> = truth.frames.keys().map(String::as_str).collect();
                bail!("the run's reference `{reference}` is not in the truth, which has {}", known.join(", "));
            }
        },
        _ => Isometry2::identity(),
    };
    let names: BTreeSet<&String> = run.frames.keys().chain(run.unmerged.keys()).chain(truth.frames.keys()).collect();
    let one = |robot: &&String| {
        let frame = run.frames.get(*robot);
        let found = frame.map(pose);
        let expected = truth.frames.get(*robot).map(|frame| transform_reference_truth * pose(frame));
        let errors = found.zip(expected).map(|(found, expected)| {
            let [x, y] = truth.centres.get(*robot).copied().unwrap_or_default();
            let metres = (found * Point2::new(x, y) - expected * Point2::new(x, y)).norm();
            (metres, (expected.inverse() * found).rotation.angle().abs().to_degrees())
        });
        let outcome = match (found, errors) {
            (Some(_), Some((metres, degrees))) if metres < RIGHT_METRES && degrees < RIGHT_DEGREES => {
                RobotOutcome::Right
            }
            (Some(_), Some(_)) => RobotOutcome::Wrong,
            (Some(_), None) if related => RobotOutcome::NoTruth,
            (Some(_), None) => RobotOutcome::Wrong,
            (None, _) if expected.is_some() => RobotOutcome::Refused,
            (None, _) if related => RobotOutcome::NoTruth,
            (None, _) => RobotOutcome::RightlyRefused,
        };
        let reason = match found {
            Some(_) => None,
            None => Some(run.unmerged.get(*robot).cloned().unwrap_or_else(|| "it is not in the summary".into())),
        };
        RobotResult {
            robot: (*robot).clone(),
            outcome,
            error_m: errors.map(|(metres, _)| metres),
            error_deg: errors.map(|(_, degrees)| degrees),
            normalised_error_squared: frame
                .zip(expected)
                .and_then(|(frame, expected)| normalised_error_squared(frame, &expected)),
            reason,
            transform_true_found: found.zip(expected).map(|(found, expected)| expected.inverse() * found),
        }
    };
    let robots: Vec<RobotResult> =
        names.iter().filter(|robot| Some(**robot) != run.reference.as_ref()).map(one).collect();
    let count = |outcomes: &[RobotOutcome]| robots.iter().filter(|robot| outcomes.contains(&robot.outcome)).count();
    let mut known = truth.frames.keys();
    let pair = known.next().zip(known.next());
    Ok(Evaluation {
        common: pair.and_then(|(first, second)| common_places::measure(run, [first, second], &truth.common)),
        reference: run.reference.clone(),
        related,
        right: count(&[RobotOutcome::Right]),
        wrong: count(&[RobotOutcome::Wrong]),
        refused: count(&[RobotOutcome::Refused, RobotOutcome::RightlyRefused]),
        robots,
    })
}

impl RobotOutcome {
    /// For people.
    pub fn words(self) -> &'static str {
        match self {
            Self::Right => "right",
            Self::Wrong => "wrong",
            Self::Refused => "refused",
            Self::RightlyRefused => "rightly refused",
            Self::NoTruth => "no truth",
        }
    }
}

impl Evaluation {
    /// A table for people in lines of at most `width` characters: every robot, and the counts.
    pub fn to_text(&self, width: Option<usize>) -> String {
        let number = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |value| format!("{value:.3}"));
        let mut table = Table::new(["robot", "outcome", "error m", "error deg", ""]);
        for robot in &self.robots {
            table.row([
                robot.robot.clone(),
                robot.outcome.words().to_owned(),
                number(robot.error_m),
                number(robot.error_deg),
                robot.reason.as_deref().map(|reason| short(reason).replace('\n', " ")).unwrap_or_default(),
            ]);
        }
        let unrelated = if self.related { "" } else { "; the truth has no frames: the robots are taken as unrelated" };
        let reference = self.reference.as_deref().unwrap_or("none");
        let Self { right, wrong, refused, .. } = self;
        let common =
            self.common.as_ref().map(|common| broken(&common.to_string(), 2, width) + "\n").unwrap_or_default();
        let table = table.fit(width);
        let counts = format!("right {right}, wrong {wrong}, refused {refused} (reference {reference}{unrelated})");
        format!("{table}{}\n{common}", broken(&counts, 2, width))
    }
}

#[cfg(test)]
mod tests;
