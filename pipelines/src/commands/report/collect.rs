//! Collects the data of the page from logs, moment by moment.

use super::grids::grid;
use super::model::{Findings, FrameRow, HypothesisRow, PageData, PairRow, RegistrationRow, Robot, TagMark};
use crate::job::NamingOptions;
use crate::merge_log::{MergeState, Opened, PlacedRobot, Placing, RobotState};
use anyhow::Result;
use gridweave_logs::picture::robot_colour;
use gridweave_runtime::covariance_ellipse::CovarianceEllipse;
use gridweave_runtime::ros::{IcpErrors, OccupancyGrid, RobotFrame, RobotFrames, RosMessage};
use nalgebra::{Matrix2, Point2, Vector2};
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

/// Limits of the size of a page.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// Maximum number of moments.
    pub(super) steps: usize,
    /// Maximum number of cells along a side of a map.
    pub(super) side: usize,
}

/// Maximum number of points of a path.
const MAX_POINTS: usize = 4000;
/// Size of the ellipses, standard deviations.
const DEVIATIONS: f64 = 2.0;
/// Width and height of a curve, pixels.
const CURVE: [f64; 2] = [160.0, 40.0];

/// Finds the moments at which something changes on the page: seconds from the first message, in order.
pub(super) fn moments(logs: &[PathBuf], naming: &NamingOptions) -> Result<Vec<f64>> {
    let mut times = Vec::new();
    let mut opened = Opened::new(logs, naming)?;
    opened.read_until(None, |seconds, channel| {
        let is_shown = [OccupancyGrid::NAME, RobotFrames::NAME].contains(&channel.schema_name.as_str());
        if is_shown && times.last() != Some(&seconds) {
            times.push(seconds);
        }
    });
    Ok(times)
}

/// Picks some of the moments, evenly, including the last.
fn some_of(times: &[f64], most: usize) -> Vec<f64> {
    let count = times.len().min(most.max(1));
    let nth = |n: usize| times[(n + 1) * times.len() / count - 1];
    (0..count).map(nth).collect()
}

/// Collects the data at some of the moments.
pub(super) fn collect(logs: &[PathBuf], naming: &NamingOptions, times: &[f64], limits: Limits) -> Result<PageData> {
    let mut opened = Opened::new(logs, naming)?;
    let times = some_of(times, limits.steps);
    let mut report =
        PageData { logs: logs.iter().map(|log| log.display().to_string()).collect(), ..PageData::default() };
    report.metadata = opened.metadata();
    let mut robots: BTreeMap<String, Robot> = BTreeMap::new();
    for (step, time) in times.iter().enumerate() {
        // The last moment includes all messages to the end.
        let is_last = step + 1 == times.len();
        opened.read_until((!is_last).then_some(*time), |_, _| {});
        take_moment(&mut report, &mut robots, &opened.state, step, is_last, limits.side)?;
    }
    report.times = times;
    report.robots = robots.into_iter().map(|(name, robot)| Robot { name, ..robot }).collect();
    add_tables(&mut report, &opened.state);
    report.problems = opened.problems.into_iter().collect();
    Ok(report)
}

/// Collects the data at one moment only, for a run in progress.
pub(super) fn collect_moment(name: &str, state: &MergeState, seconds: f64, side: usize) -> Result<PageData> {
    let mut report = PageData { logs: vec![name.to_owned()], times: vec![round(seconds)], ..PageData::default() };
    let mut robots = BTreeMap::new();
    take_moment(&mut report, &mut robots, state, 0, true, side)?;
    report.robots = robots.into_iter().map(|(name, robot)| Robot { name, ..robot }).collect();
    add_tables(&mut report, state);
    Ok(report)
}

/// Adds the state at a moment of the given number; at the last one also each robot's map in its own frame.
fn take_moment(
    report: &mut PageData,
    robots: &mut BTreeMap<String, Robot>,
    state: &MergeState,
    step: usize,
    is_last: bool,
    side: usize,
) -> Result<()> {
    let of_message = |map: Option<OccupancyGrid<'_>>| match map {
        Some(map) => grid(&map.info, map.cells(), side),
        None => Ok(None),
    };
    report.merged.add(step, of_message(state.merged())?);
    report.conflicts.add(step, of_message(state.conflicts())?);
    for placed in &Placing::of(state, &BTreeSet::new(), false).robots {
        let robot = robots.entry(placed.name.clone()).or_default();
        let map = placed.map.as_ref().map(|map| grid(&map.info, &map.cells, side)).transpose()?;
        robot.map.add(step, map.flatten());
        robot.findings.add(step, findings(placed, &state.robots[&placed.name]));
        if is_last {
            robot.colour = hex(robot_colour(placed.index));
            robot.own = of_message(state.robots[&placed.name].map())?;
            let pose = &placed.transform_world_map;
            robot.pose = [pose.translation.x, pose.translation.y, pose.rotation.angle()];
        }
    }
    Ok(())
}

fn hex([red, green, blue]: [u8; 3]) -> String {
    format!("#{red:02x}{green:02x}{blue:02x}")
}

/// Rounds to a tenth of a millimetre, which keeps the page small.
fn round(value: f64) -> f64 {
    // JSON cannot represent others.
    if value.is_finite() { (value * 1e4).round() / 1e4 } else { 0.0 }
}

fn rounded(place: Point2<f64>) -> [f64; 2] {
    [round(place.x), round(place.y)]
}

/// Collects what was found in a robot's map, in the frame of the page.
fn findings(robot: &PlacedRobot, known: &RobotState) -> Findings {
    let place = |x: f64, y: f64| rounded(robot.place(&Point2::new(x, y)));
    let rigid = |x: f64, y: f64| rounded(robot.transform_world_map * Point2::new(x, y));
    let turn = robot.transform_world_map.rotation.angle();
    let segments = known.segments.iter().flat_map(|found| &found.segments).map(|segment| {
        let ([x1, y1], [x2, y2]) = (place(segment.x1, segment.y1), place(segment.x2, segment.y2));
        [x1, y1, x2, y2, round(segment.reliability), f64::from(segment.inliers)]
    });
    let direction = known.direction.as_ref().filter(|direction| direction.valid).map(|direction| {
        let [x, y] = place(0.0, 0.0);
        [x, y, round(direction.direction + turn), round(direction.deviation), round(direction.agreement)]
    });
    let tags = known.tags.iter().flat_map(|found| &found.tags).map(|tag| {
        let [x, y] = place(tag.x, tag.y);
        let ellipse = ellipse(&tag.covariance, turn);
        TagMark { id: tag.tag_id.clone(), x, y, ellipse, certainty: round(tag.certainty), readings: tag.readings }
    });
    let merged = known.path.as_ref().filter(|_| robot.is_merged);
    let path: Vec<[f64; 2]> = match merged {
        Some(path) => path.poses.iter().map(|pose| rounded(pose.pose.planar().translation.vector.into())).collect(),
        None => known.trail.iter().map(|point| place(point.x, point.y)).collect(),
    };
    let every = path.len().div_ceil(MAX_POINTS).max(1);
    let deformation = robot.deformation.as_ref().and(known.deformation.as_ref());
    let bends = deformation.iter().flat_map(|deformation| &deformation.nodes).map(|node| {
        let ([x, y], by) = (rigid(node.x, node.y), robot.transform_world_map.rotation * Vector2::new(node.dx, node.dy));
        [x, y, round(by.x), round(by.y), round(node.dyaw)]
    });
    let topology = known.topology.iter();
    let places = topology.clone().flat_map(|map| &map.nodes).map(|node| {
        let [x, y] = rigid(node.x, node.y);
        (x, y, node.kind.clone())
    });
    let ways = topology.flat_map(|map| &map.paths);
    Findings {
        segments: segments.collect(),
        direction,
        tags: tags.collect(),
        path: path.into_iter().step_by(every).collect(),
        bends: bends.collect(),
        places: places.collect(),
        ways: ways.map(|way| way.points.iter().map(|point| rigid(point.x, point.y)).collect()).collect(),
    }
}

/// Half axes of two standard deviations and the direction of the first, for a rotated map.
fn ellipse(covariance: &[f64; 4], turn: f64) -> [f64; 3] {
    let ellipse = CovarianceEllipse::new(&Matrix2::from_row_slice(covariance), DEVIATIONS);
    ellipse.map_or([0.0; 3], |CovarianceEllipse { half_axes: [first, second], direction }| {
        [round(first), round(second), round(direction + turn)]
    })
}

/// Adds the tables of the final state.
fn add_tables(report: &mut PageData, state: &MergeState) {
    if let Some(frames) = &state.frames {
        let of = |reference: &str, frames: &[RobotFrame]| -> Vec<FrameRow> {
            frames.iter().map(|frame| frame_row(frame, reference)).collect()
        };
        report.frames = of(&frames.reference, &frames.frames);
        report.frames.extend(frames.groups.iter().flat_map(|group| of(&group.reference, &group.frames)));
        report.unmerged = frames.unmerged.iter().map(|robot| (robot.robot.clone(), robot.reason.clone())).collect();
    }
    report.pairs = state.verdicts.iter().flat_map(|verdicts| &verdicts.verdicts).map(pair_row).collect();
    report.agreement = state
        .agreement
        .as_ref()
        .map(|agreement| [agreement.known_to_one, agreement.known_to_several, agreement.in_conflict]);
    let with_pose = state.hypotheses.iter().flat_map(|((topic, ..), hypotheses)| {
        hypotheses.iter().filter(|hypothesis| hypothesis.has_transform).map(move |hypothesis| (topic, hypothesis))
    });
    let rows = with_pose.map(|(topic, hypothesis)| HypothesisRow {
        topic: topic.clone(),
        a: hypothesis.a.clone(),
        b: hypothesis.b.clone(),
        x: round(hypothesis.x),
        y: round(hypothesis.y),
        yaw: if hypothesis.yaw.is_finite() { hypothesis.yaw } else { 0.0 },
        yaw_degrees: format!("{:.2}", hypothesis.yaw.to_degrees()),
        rank: hypothesis.rank,
        score: score(hypothesis.score),
        accepted: hypothesis.accepted,
        method: hypothesis.method.clone(),
        reason: hypothesis.reason.clone(),
    });
    report.hypotheses = rows.collect();
    report.registrations = registrations(state.icp_errors.values());
}

/// Makes the curves of ICP errors, all to one scale.
fn registrations<'a>(registrations: impl Iterator<Item = &'a IcpErrors> + Clone) -> Vec<RegistrationRow> {
    let finite =
        |icp: &IcpErrors| -> Vec<f64> { icp.errors.iter().copied().filter(|error| error.is_finite()).collect() };
    let top = registrations.clone().flat_map(finite).fold(f64::MIN_POSITIVE, f64::max);
    let longest = registrations.clone().map(|icp| finite(icp).len()).max().unwrap_or_default();
    let row = |icp: &IcpErrors| {
        let errors = finite(icp);
        let point = |(number, error): (usize, &f64)| {
            let x = CURVE[0] * number as f64 / longest.saturating_sub(1).max(1) as f64;
            format!("{}{x:.1} {:.1}", if number == 0 { 'M' } else { 'L' }, CURVE[1] * (1.0 - error / top))
        };
        let metres = |error: Option<&f64>| error.map_or_else(|| "-".to_owned(), |error| format!("{error:.3}"));
        RegistrationRow {
            a: icp.a.clone(),
            b: icp.b.clone(),
            source: icp.source.clone(),
            rank: icp.rank,
            accepted: icp.accepted,
            iterations: errors.len(),
            first: metres(errors.first()),
            last: metres(errors.last()),
            curve: errors.iter().enumerate().map(point).collect(),
        }
    };
    registrations.map(row).collect()
}

fn score(score: f64) -> String {
    format!("{score:.4}")
}

fn pair_row(verdict: &gridweave_runtime::ros::Verdict) -> PairRow {
    let alignment = &verdict.alignment;
    PairRow {
        a: alignment.a.clone(),
        b: alignment.b.clone(),
        accepted: alignment.accepted,
        checked: verdict.checked,
        score: score(alignment.score),
        method: alignment.method.clone(),
        reason: alignment.reason.clone(),
    }
}

fn frame_row(frame: &RobotFrame, reference: &str) -> FrameRow {
    let deviation = |index: usize| frame.covariance[index].max(0.0).sqrt();
    FrameRow {
        robot: frame.robot.clone(),
        reference: reference.to_owned(),
        x: format!("{:.3}", frame.x),
        y: format!("{:.3}", frame.y),
        yaw: format!("{:.3}", frame.yaw.to_degrees()),
        deviations: [
            format!("{:.3}", deviation(0)),
            format!("{:.3}", deviation(4)),
            format!("{:.3}", deviation(8).to_degrees()),
        ],
        covariance: frame
            .covariance
            .chunks(3)
            .map(|row| row.iter().map(|value| format!("{value:.2e}")).collect())
            .collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn some_moments_are_picked_evenly_with_the_last() {
        let times: Vec<f64> = (0..10).map(f64::from).collect();
        assert_eq!(some_of(&times, 24), times);
        assert_eq!(some_of(&times, 3), [2.0, 5.0, 9.0]);
        assert_eq!(some_of(&times, 1), [9.0]);
        assert_eq!(some_of(&[], 3), [0.0; 0]);
    }

    #[test]
    fn curves_of_errors_are_drawn_to_one_scale() {
        let icp = |errors: &[f64]| IcpErrors { errors: errors.to_vec(), ..Default::default() };
        let rows = registrations([icp(&[0.4, f64::NAN, 0.1]), icp(&[0.2, 0.2, 0.0]), icp(&[])].iter());
        let drawn: Vec<(usize, &str, &str)> =
            rows.iter().map(|row| (row.iterations, row.last.as_str(), row.curve.as_str())).collect();
        let expected =
            [(2, "0.100", "M0.0 0.0L80.0 30.0"), (3, "0.000", "M0.0 20.0L80.0 20.0L160.0 40.0"), (0, "-", "")];
        assert_eq!(drawn, expected);
    }

    #[test]
    fn an_ellipse_has_two_standard_deviations_and_rotates_with_its_map() {
        let [first, second, angle] = ellipse(&[0.04, 0.0, 0.0, 0.01], 0.5);
        let (long, along) = if first > second { (first, angle) } else { (second, angle + std::f64::consts::FRAC_PI_2) };
        assert!((long - 0.4).abs() < 1e-9 && ((along - 0.5) % std::f64::consts::PI).abs() < 1e-3, "{along}");
        assert_eq!(ellipse(&[f64::NAN; 4], 0.0), [0.0; 3]);
    }
}
