//! The stage `tag_localizer`.

use super::{
    CovarianceProblem, Position, ReadingProblem, TagLocalizer, TagLocalizerParameters, heading_variance,
    position_covariance,
};
use crate::shared::geometry::Point2;
use crate::shared::robot_clock::RobotClock;
use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::{
    Header, PoseStamped, PoseWithCovarianceStamped, TagBearing, TagEstimate, TagEstimates, TagPosition, TagRange, Time,
};
use gridweave_runtime::stage::{Out, Output, OutputPorts, Outputs, Received, StageError, StageKind};
use nalgebra::{Matrix2, Vector2};
use std::collections::BTreeMap;

/// The stage kind `tag_localizer`.
pub fn kind() -> StageKind {
    StageKind::stage(
        "tag_localizer",
        "Locates tags in each robot's map from range readings of radio tags (Tsardoulias et al., section 3), and from \
         positions or directions in which a sensor perceives them. Sends all tags of a \
         robot whenever one of them gets out of reach, and at the end.",
        |parameters, _| Ok(TagLocalizerStage { parameters, robots: BTreeMap::new() }),
    )
    .inputs(
        "pose",
        "poses of the robots in their maps; a covariance of zeros counts as unknown",
        TagLocalizerStage::receive_pose,
    )
    .input("tags", "range readings of tags", TagLocalizerStage::receive_reading)
    .optional_input(
        "positions",
        "positions at which tags are seen from the robots",
        TagLocalizerStage::receive_position,
    )
    .optional_input(
        "bearings",
        "directions in which tags are perceived from the robots",
        TagLocalizerStage::receive_bearing,
    )
    .finish(TagLocalizerStage::finish)
    .build()
}

struct TagLocalizerStage {
    parameters: TagLocalizerParameters,
    robots: BTreeMap<String, Robot>,
}

struct Robot {
    localizer: TagLocalizer,
    clock: RobotClock,
    /// Largest distance at which a tag is read, metres.
    reach: f64,
    frame_id: Option<String>,
    sent: bool,
}

struct Estimates {
    estimates: Out<TagEstimates>,
    pose: Out<PoseStamped>,
}

impl Outputs for Estimates {
    fn declare(ports: &mut OutputPorts) -> Self {
        Self {
            estimates: ports.output("estimates", "all tags of one robot, the most certain first"),
            pose: ports.side_output_on(
                "/{robot}/matched_pose",
                "pose",
                "with `drift`: where a robot whose odometry drifts was, as estimated with the tags. Each estimate is sent from \
                 the first pose on, with the times of the poses in the headers",
            ),
        }
    }
}

impl TagLocalizerStage {
    fn receive_pose(
        &mut self,
        pose: Received<'_, PoseWithCovarianceStamped>,
        output: &Output<Estimates>,
    ) -> Result<(), StageError> {
        match self.robot(pose.robot(), output) {
            Some(robot) => robot.add_pose(&pose, output),
            None => Ok(()),
        }
    }

    fn receive_reading(
        &mut self,
        reading: Received<'_, TagRange>,
        output: &Output<Estimates>,
    ) -> Result<(), StageError> {
        if let Some(robot) = self.robot(reading.robot(), output) {
            robot.add_reading(&reading, output);
        }
        Ok(())
    }

    fn receive_position(
        &mut self,
        position: Received<'_, TagPosition>,
        output: &Output<Estimates>,
    ) -> Result<(), StageError> {
        if let Some(robot) = self.robot(position.robot(), output) {
            robot.add_position(&position, output);
        }
        Ok(())
    }

    fn receive_bearing(
        &mut self,
        bearing: Received<'_, TagBearing>,
        output: &Output<Estimates>,
    ) -> Result<(), StageError> {
        if let Some(robot) = self.robot(bearing.robot(), output) {
            robot.add_bearing(&bearing, output);
        }
        Ok(())
    }

    /// The robot of a name, created at its first message. There must be a name.
    fn robot(&mut self, name: &str, output: &Output<Estimates>) -> Option<&mut Robot> {
        if name.is_empty() {
            output.warn("poses and tag readings without a robot are left out");
            return None;
        }
        let parameters = &self.parameters;
        Some(self.robots.entry(name.to_owned()).or_insert_with(|| Robot {
            localizer: TagLocalizer::new(parameters.clone()),
            clock: RobotClock::default(),
            reach: parameters.reach,
            frame_id: None,
            sent: false,
        }))
    }

    fn finish(&mut self, output: &Output<Estimates>) -> Result<(), StageError> {
        for (name, robot) in &mut self.robots {
            robot.localizer.place_pending(|problem| output.warn(problem.to_string()));
            for _ in 0..robot.localizer.too_far() {
                output.warn(ReadingProblem::TooFar.to_string());
            }
            if robot.localizer.read_out_all() || !robot.sent {
                robot.send(name, output)?;
            }
        }
        Ok(())
    }
}

impl Robot {
    fn add_pose(
        &mut self,
        pose: &Received<'_, PoseWithCovarianceStamped>,
        output: &Output<Estimates>,
    ) -> Result<(), StageError> {
        let (name, header) = (pose.robot(), &pose.header);
        let frame_id = self.frame_id.get_or_insert_with(|| header.frame_id.clone());
        if *frame_id != header.frame_id {
            output.warn(format!(
                "poses of {name} in frame `{}` are left out, because its first pose is in frame `{frame_id}`",
                header.frame_id
            ));
            return Ok(());
        }
        let position = pose.pose.pose.position;
        let place = Point2::new(position.x, position.y);
        if !place.iter().all(|value| value.is_finite()) {
            output.warn("poses with a value that is not finite are left out");
            return Ok(());
        }
        let [x, y, .., [.., yaw_variance]] = pose.pose.covariance;
        let (covariance, problem) = position_covariance(&[x, y], self.reach);
        match problem {
            Some(CovarianceProblem::Impossible) => {
                output.warn(format!("invalid covariances of poses of {name} (not finite, or below 0) count as unknown"))
            }
            Some(CovarianceProblem::Huge) => output.warn(format!(
                "poses of {name} are more uncertain than `reach`: readings there are hardly any evidence"
            )),
            None => {}
        }
        let yaw = pose.pose.pose.planar().rotation.angle();
        let yaw_variance = heading_variance(yaw_variance);
        let position = Position { place, covariance, yaw, yaw_variance };
        let time = self.time(name, "pose", header.stamp, pose.log_time(), output);
        if !self.localizer.add_pose(time, position, |problem| output.warn(problem.to_string())) {
            output.warn("poses that are older than the one before are left out");
        }
        match self.localizer.read_out_lost() {
            true => self.send(name, output),
            false => Ok(()),
        }
    }

    /// The time of a message of this kind on the clock of the robot.
    fn time(
        &mut self,
        name: &str,
        kind: &'static str,
        stamp: Time,
        log_time: LogTime,
        output: &Output<Estimates>,
    ) -> LogTime {
        let (time, leap) = self.clock.time(kind, stamp, log_time);
        if let Some(leap) = leap {
            output.warn(leap.warning(name));
        }
        time
    }

    fn add_reading(&mut self, reading: &Received<'_, TagRange>, output: &Output<Estimates>) {
        let time = self.time(reading.robot(), "range", reading.header.stamp, reading.log_time(), output);
        if let Err(problem) = self.localizer.add_reading(time, &reading.tag_id, reading.range, reading.range_stddev) {
            output.warn(problem.to_string());
        }
    }

    fn add_position(&mut self, seen: &Received<'_, TagPosition>, output: &Output<Estimates>) {
        let time = self.time(seen.robot(), "position", seen.header.stamp, seen.log_time(), output);
        let [xx, xy, yx, yy] = seen.covariance;
        let (place, covariance) = (Vector2::new(seen.x, seen.y), Matrix2::new(xx, xy, yx, yy));
        if let Err(problem) = self.localizer.add_sighting(time, &seen.tag_id, place, &covariance) {
            output.warn(problem.to_string());
        }
    }

    fn add_bearing(&mut self, seen: &Received<'_, TagBearing>, output: &Output<Estimates>) {
        let time = self.time(seen.robot(), "bearing", seen.header.stamp, seen.log_time(), output);
        let sensor = Vector2::new(seen.x, seen.y);
        if let Err(problem) = self.localizer.add_bearing(time, &seen.tag_id, sensor, seen.bearing, seen.bearing_stddev)
        {
            output.warn(problem.to_string());
        }
    }

    fn send(&mut self, name: &str, output: &Output<Estimates>) -> Result<(), StageError> {
        self.sent = true;
        let mut tags: Vec<TagEstimate> = self
            .localizer
            .modes()
            .map(|(id, mode, readings)| TagEstimate {
                tag_id: id.to_owned(),
                x: mode.position.x,
                y: mode.position.y,
                covariance: [mode.covariance.m11, mode.covariance.m12, mode.covariance.m21, mode.covariance.m22],
                certainty: mode.certainty,
                readings,
            })
            .collect();
        // The sort is stable, and the tags are sorted by id.
        tags.sort_by(|a, b| b.certainty.total_cmp(&a.certainty));
        let frame_id = self.frame_id.clone().unwrap_or_default();
        for (time, pose) in self.localizer.take_estimated_poses() {
            output.pose.send(name, &PoseStamped { header: Header::new(time, &frame_id), pose: pose.into() })?;
        }
        let header = Header::new(output.log_time(), frame_id);
        output.estimates.send(name, &TagEstimates { header, robot: name.to_owned(), tags })
    }
}
