//! Errors of a merge against the truth.
//!
//! A robot counts as **right** if the pose of its map is within 0.5 m and 1 degree of the truth, the distance taken at
//! the middle of its last map, and as **wrong** otherwise. A robot that the run did not merge is **refused**. For
//! unrelated robots (the truth has no frames) refusal is right, and every merged robot is wrong. The reference robot is
//! not counted.
//!
//! Where the truth lists places that two robots have both seen (`common`), their distances in the merge are measured,
//! by the rigid frames and with the deformations, and the error of the frames against the best rigid fit of these
//! places.

use crate::common_places::{self, CommonPlaces, PlacePair, normalised_error_squared, pose};
use crate::merge_text::short;
use crate::table::Table;
use crate::text_wrapping::wrap;
use anyhow::{Context, Result, bail};
use gridweave_logs::summary::{Frame, Summary};
use gridweave_runtime::input_file;
use gridweave_runtime::pipeline::list_in_words;
use nalgebra::{Isometry2, Point2};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Metres. A robot is right below this error at the middle of its map.
pub const RIGHT_METRES: f64 = 0.5;
/// Degrees. A robot is right below this error of its direction.
pub const RIGHT_DEGREES: f64 = 1.0;

/// Outcome of a robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RobotOutcome {
    /// The robot is merged with the right pose.
    Right,
    /// The robot is merged with a wrong pose.
    Wrong,
    /// The robot is not merged, though it could be.
    Refused,
    /// The robot is not merged, and is unrelated to the others.
    RightlyRefused,
    /// The truth does not contain the robot.
    NoTruth,
}

/// Outcome and errors of a robot.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RobotResult {
    /// The robot.
    pub robot: String,
    /// The outcome.
    pub outcome: RobotOutcome,
    /// Error at the middle of its map, metres; none if there is nothing to compare.
    pub error_m: Option<f64>,
    /// Error of its direction, degrees, 0 to 180; none if there is nothing to compare.
    pub error_deg: Option<f64>,
    /// Normalised squared error of its frame in x, y and yaw by the covariance in the summary; none if there is nothing
    /// to compare, or no covariance. With a correct covariance 95 % are below 7.81, and the mean is 3.
    pub normalised_error_squared: Option<f64>,
    /// Why it is not merged.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// `T_true_found`: the estimated pose of its map frame in the true frame; none if there is nothing to compare.
    #[serde(skip)]
    pub transform_true_found: Option<Isometry2<f64>>,
}

/// Outcomes and errors of a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Evaluation {
    /// The reference robot; none if the run had no robots.
    pub reference: Option<String>,
    /// Whether the robots are related by the truth.
    pub related: bool,
    /// All other robots, by name.
    pub robots: Vec<RobotResult>,
    /// Number of robots that are right.
    pub right: usize,
    /// Number of robots that are wrong.
    pub wrong: usize,
    /// Number of robots that are not merged, rightly or not.
    pub refused: usize,
    /// Distances of common places, if the truth lists such and the robots are merged.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub common: Option<CommonPlaces>,
}

#[derive(Deserialize)]
struct TruthFile {
    /// Poses of the map frames; empty if the robots are unrelated.
    frames: BTreeMap<String, Frame>,
    /// The middle of each robot's last map, in its map frame.
    #[serde(default)]
    centres: BTreeMap<String, [f64; 2]>,
    /// Places that the first two robots by name have both seen.
    #[serde(default)]
    common: Vec<PlacePair>,
}

/// Compares the summary of `gridweave run --summary` with a truth file. Where the truth has no frames, the
/// robots are taken as unrelated. A robot without a middle in the truth is measured at the origin of its map.
///
/// # Errors
/// A file cannot be read or has the wrong contents; or the truth has robots, but not the reference of the summary.
pub fn evaluate(summary: &Path, truth: &Path) -> Result<Evaluation> {
    let merge = read_summary(summary)?;
    evaluate_summary(&merge, truth)
        .with_context(|| format!("cannot compare {} with {}", summary.display(), truth.display()))
}

/// Compares a summary with a truth file, as [`evaluate`] does.
///
/// # Errors
/// The truth cannot be read or has the wrong contents; or it has robots, but not the reference of the summary.
pub fn evaluate_summary(summary: &Summary, truth: &Path) -> Result<Evaluation> {
    measure(summary, &read(truth, "a truth file")?)
}

/// Reads a summary that `--summary` has written.
pub(crate) fn read_summary(path: &Path) -> Result<Summary> {
    read(path, "the summary of a run")
}

/// Checks that [`evaluate`] can read a truth file.
pub(crate) fn check_truth(path: &Path) -> Result<()> {
    read::<TruthFile>(path, "a truth file").map(|_| ())
}

/// Reads a JSON file.
fn read<T: DeserializeOwned>(path: &Path, what: &str) -> Result<T> {
    let text = input_file::read(path, input_file::LONGEST_TEXT)
        .with_context(|| format!("cannot read {what}: {}", path.display()))?;
    serde_json::from_slice(&text).with_context(|| format!("{} is not {what}", path.display()))
}

fn measure(run: &Summary, truth: &TruthFile) -> Result<Evaluation> {
    let related = !truth.frames.is_empty();
    let transform_reference_truth = match &run.reference {
        Some(reference) if related => match truth.frames.get(reference) {
            Some(frame) => pose(frame).inverse(),
            None => {
                let known = list_in_words(truth.frames.keys());
                bail!("the run's reference `{reference}` is not in the truth, which has {known}");
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
        let is_near = errors.map(|(metres, degrees)| metres < RIGHT_METRES && degrees < RIGHT_DEGREES);
        let reason = match found {
            Some(_) => None,
            None => Some(run.unmerged.get(*robot).cloned().unwrap_or_else(|| "it is not in the summary".into())),
        };
        RobotResult {
            robot: (*robot).clone(),
            outcome: RobotOutcome::of(found.is_some(), expected.is_some(), is_near, related),
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
    /// The outcome of a robot that `is_merged` or not, and is in the truth or not. `is_near` is whether its pose is near
    /// the true one, `None` if they cannot be compared. `related` is whether the truth relates the robots.
    fn of(is_merged: bool, is_in_truth: bool, is_near: Option<bool>, related: bool) -> Self {
        match (is_merged, is_near) {
            (true, Some(true)) => Self::Right,
            (true, Some(false)) => Self::Wrong,
            (true, None) if related => Self::NoTruth,
            (true, None) => Self::Wrong,
            (false, _) if is_in_truth => Self::Refused,
            (false, _) if related => Self::NoTruth,
            (false, _) => Self::RightlyRefused,
        }
    }

    /// The outcome as text.
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
    /// Formats a table of all robots, and the counts, in lines of at most `width` columns.
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
        let unrelated = if self.related { "" } else { "; the truth has no frames: the robots count as unrelated" };
        let reference = self.reference.as_deref().unwrap_or("none");
        let Self { right, wrong, refused, .. } = self;
        let common = self.common.as_ref().map(|common| wrap(&common.to_string(), 2, width) + "\n").unwrap_or_default();
        let table = table.fit(width);
        let counts = format!("right {right}, wrong {wrong}, refused {refused} (reference {reference}{unrelated})");
        format!("{table}{}\n{common}", wrap(&counts, 2, width))
    }
}

#[cfg(test)]
mod tests;
