//! What became of one pair of robots.

use super::kinds::Kind;
use super::worlds::PairWorld;
use crate::log::{last_maps, read_messages};
use crate::map_pairs::truth::{Closeness, NEAR, NEAR_DEGREES};
use anyhow::{Context, Result};
use gridweave::evaluate::{Evaluation, RobotOutcome, RobotResult, evaluate_summary};
use gridweave_logs::map_file::GridMap;
use gridweave_logs::summary::{Frame, Summary};
use gridweave_runtime::ros::{Evidence, RosMessage, decode};
use gridweave_runtime::stage::Registry;
use gridweave_stages::shared::geometry::{Pose2, pose};
use nalgebra::{Isometry2, Point2, Vector2};
use serde_json::Value;
use std::collections::BTreeMap;

/// What the verifier went by, and whether what it judged best is right.
#[derive(Clone, Copy, Debug)]
pub(super) struct Judged {
    /// Its score.
    pub(super) score: f64,
    /// Metres of wall that agree.
    pub(super) wall_on_wall: f64,
    /// Metres of wall on free space.
    pub(super) wall_on_free: f64,
    /// The most evidence elsewhere, as a share of that here.
    pub(super) evidence_elsewhere: f64,
    /// Whether its place is right, accepted or not.
    pub(super) is_right: bool,
}

/// One pair of robots.
#[derive(Clone, Debug)]
pub(super) struct PairTrial {
    name: String,
    pub(super) outcome: RobotOutcome,
    pub(super) error_m: Option<f64>,
    pub(super) error_deg: Option<f64>,
    reason: String,
    /// Share of the smaller map's known area that the other map knows, too; none if the truth does not contain it.
    pub(super) overlap: Option<f64>,
    pub(super) drift: Option<f64>,
    /// The kind of building, where there are many.
    pub(super) kind: Option<Kind>,
    /// None if no place was proposed.
    pub(super) judged: Option<Judged>,
}

impl PairTrial {
    pub(super) const HEADS: [&'static str; 13] = [
        "set",
        "world",
        "outcome",
        "overlap",
        "drift",
        "error m",
        "error deg",
        "score",
        "wall on wall m",
        "wall on free m",
        "evidence elsewhere",
        "best is right",
        "reason",
    ];

    pub(super) fn cells(&self, set: &str) -> Vec<String> {
        let number = |value: Option<f64>| value.map_or_else(String::new, |value| format!("{value:.5}"));
        let judged = |value: fn(&Judged) -> f64| number(self.judged.as_ref().map(value));
        vec![
            set.to_owned(),
            self.name.clone(),
            self.outcome.words().to_owned(),
            number(self.overlap),
            number(self.drift),
            number(self.error_m),
            number(self.error_deg),
            judged(|judged| judged.score),
            judged(|judged| judged.wall_on_wall),
            judged(|judged| judged.wall_on_free),
            judged(|judged| judged.evidence_elsewhere),
            self.judged.map_or_else(String::new, |judged| judged.is_right.to_string()),
            self.reason.clone(),
        ]
    }
}

/// Merges a world. Gives a trial for every robot but the reference; what was judged is known where there is one pair.
pub(super) fn merge(pair: &PairWorld, pipeline: &str, registry: &Registry) -> Result<Vec<PairTrial>> {
    let merge = pair.world.merge(pipeline, &[], registry)?;
    let is_pair = merge.evaluation.robots.len() == 1;
    let judged = if is_pair { judged(pair, &merge.summary)? } else { None };
    let overlap = if is_pair && merge.evaluation.related { overlap(pair)? } else { None };
    let outcome = match merge.evaluation.robots.first().map(|robot| robot.outcome) {
        Some(RobotOutcome::Right | RobotOutcome::Wrong) if is_place_right(&merge.evaluation) => RobotOutcome::Right,
        Some(RobotOutcome::Right) => RobotOutcome::Wrong,
        other => other.unwrap_or(RobotOutcome::NoTruth),
    };
    let Evaluation { robots, .. } = merge.evaluation;
    let trial = |robot: RobotResult| PairTrial {
        name: format!("{}, {}", pair.name, robot.robot),
        outcome: if is_pair { outcome } else { robot.outcome },
        error_m: robot.error_m,
        error_deg: robot.error_deg,
        reason: robot.reason.unwrap_or_default(),
        overlap,
        drift: pair.drift,
        kind: pair.kind,
        judged,
    };
    Ok(robots.into_iter().map(trial).collect())
}

/// Whether the relative pose of two robots is right: places that both have seen are within 0.5 m of each other in the
/// median, and nine of ten within 1 m. Where the truth lists none, the second robot is within 0.5 m and 3 degrees of
/// its true pose, as drift turns maps by that.
fn is_place_right(evaluation: &Evaluation) -> bool {
    let is_near =
        |robot: &RobotResult| robot.error_m.is_some_and(|m| m < 0.5) && robot.error_deg.is_some_and(|deg| deg < 3.0);
    let is_right = match &evaluation.common {
        Some(common) => common.rigid.median_m < 0.5 && common.rigid.p90_m < 1.0,
        None => evaluation.robots.first().is_some_and(is_near),
    };
    evaluation.related && is_right
}

impl PairWorld {
    /// Whether `T_a_b` is right by the world's truth.
    pub(crate) fn is_right(&self, robots: [&str; 2], transform_a_b: &Pose2) -> Result<bool> {
        Ok(is_place_right(&self.evaluation(robots, transform_a_b)?))
    }

    /// Error of `T_a_b` by the world's truth.
    pub(crate) fn closeness(&self, robots: [&str; 2], transform_a_b: &Pose2) -> Result<Closeness> {
        let evaluation = self.evaluation(robots, transform_a_b)?;
        let is_near = match &evaluation.common {
            Some(common) => common.rigid.median_m < NEAR,
            None => evaluation.robots.first().is_some_and(|robot| {
                robot.error_m.is_some_and(|metres| metres < NEAR)
                    && robot.error_deg.is_some_and(|degrees| degrees < NEAR_DEGREES)
            }),
        };
        Ok(match is_place_right(&evaluation) {
            true => Closeness::Right,
            false if evaluation.related && is_near => Closeness::Near,
            false => Closeness::Wrong,
        })
    }

    fn evaluation(&self, [a, b]: [&str; 2], transform_a_b: &Pose2) -> Result<Evaluation> {
        let (x, y, yaw) = (transform_a_b.translation.x, transform_a_b.translation.y, transform_a_b.rotation.angle());
        let placed = Frame { x, y, yaw, ..Default::default() };
        let frames = BTreeMap::from([(a.to_owned(), Frame::default()), (b.to_owned(), placed)]);
        let placed = Summary { reference: Some(a.to_owned()), frames, ..Default::default() };
        evaluate_summary(&placed, &self.world.truth)
    }
}

/// The verdict on the only pair, and whether its best hypothesis is right, even where it was refused.
fn judged(pair: &PairWorld, summary: &Summary) -> Result<Option<Judged>> {
    let mut last = None;
    read_messages(&pair.world.output(), Evidence::NAME, |_, data| last = decode::<Evidence>(data).ok())?;
    let Some((evidence, best)) = last.zip(summary.alignments.first()) else { return Ok(None) };
    let is_right = pair.is_right([&best.a, &best.b], &pose(best.x, best.y, best.yaw))?;
    Ok(Some(Judged {
        score: best.score,
        wall_on_wall: evidence.wall_on_wall,
        wall_on_free: evidence.wall_on_free,
        evidence_elsewhere: evidence.evidence_elsewhere,
        is_right,
    }))
}

/// The share of the smaller map's known area that the other one knows, too, by the truth.
fn overlap(pair: &PairWorld) -> Result<Option<f64>> {
    let maps = last_maps(&pair.world.log)?;
    let truth =
        std::fs::read(&pair.world.truth).with_context(|| format!("cannot read {}", pair.world.truth.display()))?;
    let truth: Value = serde_json::from_slice(&truth)?;
    let frame = |robot: &str| {
        let number = |field: &str| truth["frames"][robot][field].as_f64();
        Some(Isometry2::new(Vector2::new(number("x")?, number("y")?), number("yaw")?))
    };
    let mut members = maps.iter().filter_map(|(topic, map)| {
        let robot = topic.strip_prefix('/')?.strip_suffix("/map")?;
        Some((frame(robot)?, map))
    });
    let (Some((frame_a, a)), Some((frame_b, b))) = (members.next(), members.next()) else { return Ok(None) };
    let (known_a, known_b) = (known_area(a), known_area(b));
    let (common, least) = (common_area(a, b, &(frame_a.inverse() * frame_b)), known_a.min(known_b));
    Ok((least > 0.0).then(|| common / least))
}

fn known_area(map: &GridMap) -> f64 {
    let side = f64::from(map.info.resolution);
    map.cells.iter().filter(|cell| **cell >= 0).count() as f64 * side * side
}

/// The area of map b's known cells that map a knows, too.
fn common_area(a: &GridMap, b: &GridMap, transform_a_b: &Isometry2<f64>) -> f64 {
    let (origin_a, origin_b) = (a.info.origin.planar(), b.info.origin.planar());
    let (side_a, side_b) = (f64::from(a.info.resolution), f64::from(b.info.resolution));
    let transform = origin_a.inverse() * transform_a_b * origin_b;
    let known_to_a = |(number, _): &(usize, &i8)| {
        let (column, row) = (number % b.info.width as usize, number / b.info.width as usize);
        let point = transform * Point2::new((column as f64 + 0.5) * side_b, (row as f64 + 0.5) * side_b) / side_a;
        let inside =
            point.x >= 0.0 && point.y >= 0.0 && point.x < f64::from(a.info.width) && point.y < f64::from(a.info.height);
        inside && a.cells[point.y as usize * a.info.width as usize + point.x as usize] >= 0
    };
    let common = b.cells.iter().enumerate().filter(|(_, cell)| **cell >= 0).filter(known_to_a).count();
    common as f64 * side_b * side_b
}
