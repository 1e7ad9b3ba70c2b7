//! The stage `scan_mapper`.

use super::joint_refinement::refine_together;
use super::reasons::{
    TOO_LARGE, lost_way, lost_way_so_far, too_large, turned_lidar, upside_down, why_bad, wrong_scale,
};
use super::robot::{Robot, ScanOutcome};
use super::slam_map::TagSighting;
use super::{MappingMode, ScanBeams, ScanMapperParameters};
use crate::mapping::slam::MOST_SCALE_ERROR;
use crate::shared::geometry::{GridGeometry, Pose2};
use crate::shared::robot_clock::Leap;
use crate::shared::scan_grid::SnapshotMap;
use crate::tags::tag_localizer::sighting_deviation;
use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::{
    Header, OccupancyGrid, PoseStamped, PoseWithCovarianceStamped, RangeScan, TagPosition, UnmergedRobot,
};
use gridweave_runtime::stage::{Out, Output, OutputPorts, Outputs, Received, StageError, StageKind};
use nalgebra::{Matrix2, Vector2};
use std::collections::BTreeMap;

/// The stage kind `scan_mapper`.
pub fn kind() -> StageKind {
    StageKind::stage(
        "scan_mapper",
        "Builds the maps of robots from the scans of their lidars, for robots without maps: at the poses of a localizer, or, with \
         odometry only, of a SLAM with loop closures.",
        |parameters: ScanMapperParameters, _| {
            Ok(ScanMapper { parameters, robots: BTreeMap::new(), recorded: BTreeMap::new() })
        },
    )
    .optional_input("pose", "poses of the robots in their maps", ScanMapper::receive_pose)
    .optional_input("odometry", "odometry of robots without poses", ScanMapper::receive_odometry)
    .input("scan", "scans, relative to the bases of the robots", ScanMapper::receive_scan)
    .optional_input("positions", "positions at which tags are seen from the robots", ScanMapper::receive_tag)
    .optional_input(
        "map",
        "maps that robots have sent themselves: none is drawn for these from there on",
        ScanMapper::receive_map,
    )
    .finish(ScanMapper::finish)
    .build()
}

/// From so many scans on a robot has probably moved.
const SCANS_OF_A_DRIVE: usize = 50;
/// Error of the ways of odometry that is worth a warning, as a share.
const ODOMETRY_ERROR: f64 = 0.05;
/// Turn of the ways by scans against those by odometry that is worth a warning, radians: lidars are mounted to a degree or two, and
/// odometry that is late adds as much.
const LIDAR_YAW_ERROR: f64 = 0.12;

struct ScanMapper {
    parameters: ScanMapperParameters,
    robots: BTreeMap<String, Robot>,
    /// The last maps of robots that have sent maps of their own.
    recorded: BTreeMap<String, SnapshotMap>,
}

struct Drawn {
    map: Out<OccupancyGrid<'static>>,
    pose: Out<PoseWithCovarianceStamped>,
    lost: Out<UnmergedRobot>,
}

impl Outputs for Drawn {
    fn declare(ports: &mut OutputPorts) -> Self {
        Self {
            map: ports.output_on("/{robot}/drawn_map", "map", "the maps of the robots with scans, growing"),
            pose: ports.output_on(
                "/{robot}/matched_pose",
                "pose",
                "where robots with odometry only are in the maps that were drawn of their scans",
            ),
            lost: ports.output_on("/{robot}/lost", "lost", "why a robot with scans has no map: it has lost its way"),
        }
    }
}

impl ScanMapper {
    fn receive_pose(
        &mut self,
        message: Received<'_, PoseWithCovarianceStamped>,
        output: &Output<Drawn>,
    ) -> Result<(), StageError> {
        let parameters = self.parameters;
        let Some(robot) = self.robot(message.robot(), output) else { return Ok(()) };
        let (time, leap) = robot.clock.time("pose", message.header.stamp, message.log_time());
        warn_of_leap(message.robot(), leap, output);
        let frame = robot.frame.get_or_insert_with(|| message.header.frame_id.clone());
        if *frame != message.header.frame_id {
            output.warn(format!(
                "poses of {} in frame `{}` are left out, because its first pose is in frame `{frame}`",
                message.robot(),
                message.header.frame_id
            ));
            return Ok(());
        }
        let pose = message.pose.pose.planar();
        if !is_finite(&pose) || !robot.add_pose(time, &pose, &parameters) {
            output.warn(format!(
                "poses of {} that are not finite, late, or after the start of its map by odometry are left out",
                message.robot()
            ));
            return Ok(());
        }
        self.draw_and_send(message.robot(), false, output)
    }

    fn receive_odometry(
        &mut self,
        message: Received<'_, PoseWithCovarianceStamped>,
        output: &Output<Drawn>,
    ) -> Result<(), StageError> {
        let parameters = self.parameters;
        let is_offline = parameters.mode == MappingMode::Offline;
        let Some(robot) = self.robot(message.robot(), output) else { return Ok(()) };
        let (time, leap) = robot.clock.time("odometry", message.header.stamp, message.log_time());
        warn_of_leap(message.robot(), leap, output);
        let pose = message.pose.pose.planar();
        let followed = is_finite(&pose).then(|| robot.add_odometry(time, &pose, is_offline)).flatten();
        let Some(pose) = followed else {
            output.warn(format!("odometry of {} that is not finite or late is left out", message.robot()));
            return Ok(());
        };
        robot.decide(&parameters, false);
        self.draw_and_send(message.robot(), false, output)?;
        match self.robots.get(message.robot()).filter(|_| !is_offline) {
            Some(robot) => send_pose(message.robot(), robot, time, &pose, output),
            None => Ok(()),
        }
    }

    fn receive_scan(&mut self, message: Received<'_, RangeScan>, output: &Output<Drawn>) -> Result<(), StageError> {
        let scan = ScanBeams::of(&message, &self.parameters);
        let parameters = self.parameters;
        let Some(robot) = self.robot(message.robot(), output) else { return Ok(()) };
        let (time, leap) = robot.clock.time("scan", message.header.stamp, message.log_time());
        warn_of_leap(message.robot(), leap, output);
        let scan = match scan {
            Ok(scan) => scan,
            Err(problem) => {
                robot.usage.reject_scan(problem);
                output.warn(format!("scans of {} were left out: {problem}", message.robot()));
                return Ok(());
            }
        };
        robot.add_scan(time, scan);
        robot.decide(&parameters, false);
        self.draw_and_send(message.robot(), false, output)
    }

    fn receive_tag(&mut self, message: Received<'_, TagPosition>, output: &Output<Drawn>) -> Result<(), StageError> {
        let [xx, xy, yx, yy] = message.covariance;
        let (place, covariance) = (Vector2::new(message.x, message.y), Matrix2::new(xx, xy, yx, yy));
        let deviation = sighting_deviation(&place, &covariance, self.parameters.sighting_stddev);
        let Some(robot) = self.robot(message.robot(), output) else { return Ok(()) };
        let (time, leap) = robot.clock.time("position", message.header.stamp, message.log_time());
        warn_of_leap(message.robot(), leap, output);
        match deviation.filter(|_| !message.tag_id.is_empty()) {
            Some(deviation) => {
                robot.add_tag(time, TagSighting { tag: message.tag_id.clone(), place: place.into(), deviation });
            }
            None => output.warn(format!("tags of {} without id or position are left out", message.robot())),
        }
        Ok(())
    }

    /// A robot has sent its own map, which must not be replaced by another.
    fn receive_map(
        &mut self,
        message: Received<'_, OccupancyGrid<'_>>,
        output: &Output<Drawn>,
    ) -> Result<(), StageError> {
        let name = message.robot();
        let map = SnapshotMap { geometry: GridGeometry::from(&message.info), cells: message.cells().to_vec() };
        if self.recorded.insert(name.to_owned(), map).is_some() {
            return Ok(());
        }
        if self.robots.remove(name).is_some_and(|robot| robot.sent_until.is_some()) {
            output.warn(format!(
                "{name} has sent a map after one was built from its scans: from then on its own map is used. Results from the \
                 other one are valid only if both are in one frame"
            ));
        }
        Ok(())
    }

    /// The robot of a name, created at its first message. There must be a name. `None` as well if it has its own map.
    fn robot(&mut self, name: &str, output: &Output<Drawn>) -> Option<&mut Robot> {
        if name.is_empty() {
            output.warn("scans and poses without a robot are left out");
            return None;
        }
        if self.recorded.contains_key(name) {
            return None;
        }
        Some(self.robots.entry(name.to_owned()).or_insert_with(Robot::new))
    }

    /// Adds the scans with known poses, and sends the map if it is time.
    fn draw_and_send(&mut self, name: &str, is_end: bool, output: &Output<Drawn>) -> Result<(), StageError> {
        self.draw(name, is_end, output);
        self.send(name, is_end, output)
    }

    /// Adds the scans with known poses.
    fn draw(&mut self, name: &str, is_end: bool, output: &Output<Drawn>) {
        let Some(robot) = self.robots.get_mut(name) else { return };
        robot.draw(&self.parameters, is_end, |outcome| match outcome {
            ScanOutcome::Used => {}
            ScanOutcome::NoPose => {
                output.warn(format!(
                    "scans of {name} were left out: there is no pose of it at most {} s before their time. For poses at a lower rate, \
                     give --set mapper.max_pose_age=SECONDS",
                    self.parameters.max_pose_age
                ))
            }
            ScanOutcome::NotMatched => {
                output.warn(format!(
                    "scans of {name} lie on none of its earlier ones: their poses are those of its odometry, or of its motion before"
                ));
            }
            ScanOutcome::TooLarge => output.warn(too_large(name)),
        });
        let is_online = self.parameters.mode == MappingMode::Online && !is_end;
        if let Some(seconds) = robot.take_new_session().filter(|_| is_online) {
            output.warn(lost_way_so_far(name, seconds));
        }
    }

    /// Sends the poses that are known, and the map if it is time.
    fn send(&mut self, name: &str, is_end: bool, output: &Output<Drawn>) -> Result<(), StageError> {
        let Some(robot) = self.robots.get_mut(name) else { return Ok(()) };
        let Some([first, last]) = robot.drawn else { return Ok(()) };
        let is_offline = self.parameters.mode == MappingMode::Offline && robot.is_by_slam();
        if !is_offline {
            for (time, odometry) in robot.take_odometry() {
                send_pose(name, robot, time, &odometry, output)?;
            }
        }
        let is_due =
            is_end || !is_offline && last.seconds_since(robot.sent_until.unwrap_or(first)) >= self.parameters.interval;
        if !is_due || robot.sent_until == Some(last) {
            return Ok(());
        }
        robot.sent_until = Some(last);
        if let Some(contradictions) = robot.test_map(is_end).filter(|_| is_end) {
            output.count("scans that see walls again", contradictions.revisiting as u64);
            output.count("scans that contradict walls", contradictions.contradicting.len() as u64);
        }
        if robot.sees_nothing() {
            return Ok(());
        }
        if let Some(bad) = robot.bad_scans() {
            return send_lost(name, &why_bad(&bad, bad.since.seconds_since(first)), output);
        }
        if robot.is_mirrored() {
            return send_lost(name, &upside_down(name), output);
        }
        for (time, odometry) in robot.take_odometry() {
            send_pose(name, robot, time, &odometry, output)?;
        }
        send_map(name, robot, last, output)
    }

    fn finish(&mut self, output: &Output<Drawn>) -> Result<(), StageError> {
        let names: Vec<String> = self.robots.keys().cloned().collect();
        for name in &names {
            if let Some(robot) = self.robots.get_mut(name) {
                robot.decide(&self.parameters, true);
            }
            self.draw(name, true, output);
        }
        if self.parameters.joint_refinement {
            let mut robots: Vec<&mut Robot> = self.robots.values_mut().collect();
            let count = refine_together(&mut robots, self.recorded.values(), &self.parameters);
            output.count("robots refined together", count as u64);
        } else {
            for robot in self.robots.values_mut().filter(|robot| robot.session_count() > 1) {
                refine_together(&mut [robot], std::iter::empty(), &self.parameters);
            }
        }
        for name in names {
            if let Some((seconds, cause)) = self.robots.get(&name).and_then(Robot::lost_way) {
                output.warn(lost_way(&name, seconds, cause));
            }
            self.send(&name, true, output)?;
            if let Some(robot) = self.robots.get_mut(&name) {
                explain(&name, robot, &self.parameters, output)?;
            }
        }
        Ok(())
    }
}

/// Why a robot has no map, or a small one, at the end.
fn explain(
    name: &str,
    robot: &mut Robot,
    parameters: &ScanMapperParameters,
    output: &Output<Drawn>,
) -> Result<(), StageError> {
    if let Some(seconds) = robot.odometry_leap() {
        output.warn(format!(
            "the odometry of {name} leaps, for the first time {seconds:.1} s after its first scan, as where its driver starts \
             again: the robot is taken to be where it was"
        ));
    }
    if let Some(scale) = robot.odometry_scale().filter(|scale| (scale - 1.0).abs() > ODOMETRY_ERROR) {
        output.warn(wrong_scale(name, scale, "and is corrected by that"));
    } else if let Some((correction, _)) =
        robot.odometry_correction().filter(|(correction, _)| (correction.scale - 1.0).abs() > MOST_SCALE_ERROR)
    {
        output.warn(wrong_scale(name, correction.scale, "which is more than is corrected"));
    }
    if let Some((correction, yaw)) =
        robot.odometry_correction().filter(|(correction, _)| correction.turn.abs() > LIDAR_YAW_ERROR)
    {
        output.warn(turned_lidar(name, correction.turn, yaw));
    }
    if let Some(scans) = robot.scans_at_a_standstill().filter(|scans| *scans >= SCANS_OF_A_DRIVE) {
        output.warn(format!(
            "the odometry of {name} stands still, so that only the first of {scans} scans is used. If the robot moved, leave its \
             odometry out: --rename '/{{robot}}/odom=/{{robot}}/unused'"
        ));
    }
    if let Some(reason) = robot.why_none_is_used() {
        return send_lost(name, &reason, output);
    }
    if robot.drawn.is_some() && (robot.sees_nothing() || robot.map().is_none() && robot.bad_scans().is_none()) {
        let is_too_large = robot.is_by_slam() && !robot.sees_nothing();
        let reason = match is_too_large {
            true => TOO_LARGE.to_owned(),
            false => format!("its scans show nothing within {} m", parameters.max_range),
        };
        return send_lost(name, &reason, output);
    }
    Ok(())
}

/// Sends the reason why a robot has no map.
fn send_lost(name: &str, reason: &str, output: &Output<Drawn>) -> Result<(), StageError> {
    output.warn(format!("no map of {name}: {reason}"));
    output.lost.send(name, &UnmergedRobot { robot: name.to_owned(), reason: format!("it has no map: {reason}") })
}

fn warn_of_leap(name: &str, leap: Option<Leap>, output: &Output<Drawn>) {
    if let Some(leap) = leap {
        output.warn(leap.warning(name));
    }
}

fn send_map(name: &str, robot: &mut Robot, drawn_until: LogTime, output: &Output<Drawn>) -> Result<(), StageError> {
    let map = robot.map();
    (0..robot.take_left_out()).for_each(|_| output.warn(too_large(name)));
    let Some(map) = map else { return Ok(()) };
    let prefix = map.geometry.prefix(Header::new(drawn_until, map_frame(name, robot)));
    output.map.send_grid(name, &prefix, |blank| blank.copy_cells(&map.cells))
}

/// Sends the pose in the map for a pose by odometry.
fn send_pose(
    name: &str,
    robot: &Robot,
    time: LogTime,
    odometry: &Pose2,
    output: &Output<Drawn>,
) -> Result<(), StageError> {
    let Some(pose) = robot.in_map(time, odometry) else { return Ok(()) };
    let header = Header::new(time, map_frame(name, robot));
    output.pose.send(name, &PoseStamped { header, pose: pose.into() }.into())
}

/// Frame of a robot's map: that of its poses, or else the usual one.
fn map_frame(name: &str, robot: &Robot) -> String {
    robot.frame.clone().unwrap_or_else(|| format!("{name}/map"))
}

fn is_finite(pose: &Pose2) -> bool {
    pose.translation.vector.iter().all(|value| value.is_finite()) && pose.rotation.angle().is_finite()
}
