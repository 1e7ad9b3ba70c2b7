//! The path placer as a stage.

use super::Drive;
use crate::shared::placement::{Placed, Placement};
use gridweave_runtime::ros::{
    Header, MapDeformation, Path, PoseStamped, PoseWithCovarianceStamped, RobotFrame, RobotFrames, Time,
};
use gridweave_runtime::stage::{
    Context, Out, Output, OutputPorts, Outputs, Parameters, Received, StageError, StageKind,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// Parameters of the path placer.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct PathPlacerParameters {
    /// Least distance of a pose from the one before, metres; nearer ones are left out.
    #[schemars(range(min = 0.0))]
    spacing: f64,
}

impl Default for PathPlacerParameters {
    fn default() -> Self {
        Self { spacing: 0.1 }
    }
}

impl Parameters for PathPlacerParameters {}

/// The kind `path_placer`.
pub fn kind() -> StageKind {
    StageKind::stage(
        "path_placer",
        "Transforms each placed robot's path into the merged frame, by its map's deformation and frame. Sent when frames or \
         deformations change, and at the end if any robot has moved since; at the end also as poses.",
        |parameters: PathPlacerParameters, _: &Context| Ok(PathPlacer { parameters, ..PathPlacer::default() }),
    )
    .inputs("pose", "the robots' poses in their maps", PathPlacer::receive_pose)
    .optional_input(
        "matched_pose",
        "poses as they were matched with something, which stand in for those of the robot on `pose`; one that is older than \
         the one before it begins a matched drive from the start",
        PathPlacer::receive_matched_pose,
    )
    .optional_input("deformation", "the deformations of the maps", PathPlacer::receive_deformation)
    .input("frames", "the poses of the maps", PathPlacer::receive_frames)
    .finish(PathPlacer::finish)
    .build()
}

struct Paths {
    path: Out<Path>,
    pose: Out<PoseStamped>,
}

impl Outputs for Paths {
    fn declare(ports: &mut OutputPorts) -> Self {
        let summary = "the path of the robot, in the frame `world`; each pose with its own time";
        Self {
            path: ports.output_on("/{robot}/merged_path", "path", summary),
            pose: ports.side_output_on(
                "/{robot}/merged_pose",
                "pose",
                "the poses of the last path, one by one, each with its own time in the header: for programs that read poses, \
                 such as evo. Sent at the end, when no frame changes any more",
            ),
        }
    }
}

#[derive(Default)]
struct PathPlacer {
    parameters: PathPlacerParameters,
    drives: BTreeMap<String, Drive>,
    /// The frames that the last poses of the robots name.
    pose_frames: BTreeMap<String, String>,
    /// Of robots whose poses were matched: the drive as matched, and the time of its last pose.
    matched: BTreeMap<String, (Drive, Time)>,
    placement: Placement,
    /// Robots whose last path has poses.
    on_the_map: BTreeSet<String>,
    /// Whether a deformation has arrived that is in no path that was sent.
    has_new_deformations: bool,
    /// The same for a pose.
    has_new_poses: bool,
}

impl PathPlacer {
    fn receive_pose(
        &mut self,
        pose: Received<'_, PoseWithCovarianceStamped>,
        _: &Output<Paths>,
    ) -> Result<(), StageError> {
        if !self.drives.contains_key(pose.robot()) {
            self.drives.insert(pose.robot().to_owned(), Drive::default());
        }
        if self.pose_frames.get(pose.robot()) != Some(&pose.header.frame_id) {
            self.pose_frames.insert(pose.robot().to_owned(), pose.header.frame_id.clone());
        }
        if let Some(drive) = self.drives.get_mut(pose.robot()) {
            drive.add(pose.header.stamp, pose.pose.pose.planar(), self.parameters.spacing);
            self.has_new_poses = true;
        }
        Ok(())
    }

    fn receive_matched_pose(&mut self, pose: Received<'_, PoseStamped>, _: &Output<Paths>) -> Result<(), StageError> {
        let stamp = pose.header.stamp;
        let (drive, last) = self.matched.entry(pose.robot().to_owned()).or_insert_with(|| (Drive::default(), stamp));
        if stamp < *last {
            *drive = Drive::default();
        }
        *last = stamp;
        drive.add(stamp, pose.pose.planar(), self.parameters.spacing);
        self.has_new_poses = true;
        Ok(())
    }

    /// The drive of a robot: as it was matched, if it was.
    fn drive(&self, robot: &str) -> Option<&Drive> {
        self.matched.get(robot).map(|(drive, _)| drive).or_else(|| self.drives.get(robot))
    }

    /// A deformation waits for the frames that belong to it.
    fn receive_deformation(
        &mut self,
        deformation: Received<'_, MapDeformation>,
        output: &Output<Paths>,
    ) -> Result<(), StageError> {
        self.has_new_deformations |= self.placement.keep_deformation(&deformation, output);
        Ok(())
    }

    fn receive_frames(&mut self, frames: Received<'_, RobotFrames>, output: &Output<Paths>) -> Result<(), StageError> {
        let frames = frames.into_content();
        let is_same = frames.reference == self.placement.frames.reference
            && frames.frames == self.placement.frames.frames
            && !self.has_new_deformations;
        self.placement.frames = frames;
        if is_same { Ok(()) } else { self.send(output) }
    }

    fn finish(&mut self, output: &Output<Paths>) -> Result<(), StageError> {
        self.warn_of_other_frames(output);
        if self.has_new_deformations || self.has_new_poses {
            self.send(output)?;
        }
        if output.pose.is_read() { self.send_poses(output) } else { Ok(()) }
    }

    /// Warns of poses that name another frame than that of the map. A prefix may have been added to one of both only.
    fn warn_of_other_frames(&self, output: &Output<Paths>) {
        let last_part = |frame: &str| frame.rsplit('/').next().unwrap_or_default().to_owned();
        for RobotFrame { robot, frame_id, .. } in &self.placement.frames.frames {
            let named = self.pose_frames.get(robot).filter(|_| !self.matched.contains_key(robot));
            let names = |frame: &&String| !frame.is_empty() && !frame_id.is_empty();
            if let Some(named) = named.filter(names).filter(|named| last_part(named) != last_part(frame_id)) {
                output.warn(format!(
                    "the poses of {robot} name the frame `{named}`, and its map is in `{frame_id}`: they are taken for poses in the \
                     map. If these are two frames, the path is wrong: rename the topic of the poses, so that tf gives them"
                ));
            }
        }
    }

    fn send(&mut self, output: &Output<Paths>) -> Result<(), StageError> {
        (self.has_new_deformations, self.has_new_poses) = (false, false);
        let header = || Header::new(output.log_time(), RobotFrames::WORLD);
        let mut left = std::mem::take(&mut self.on_the_map);
        let mut on_the_map = BTreeSet::new();
        for (robot, placed) in self.placement.placed() {
            let Some(drive) = self.drive(robot) else { continue };
            output.path.send(robot, &Path { header: header(), poses: in_world(drive, &placed).collect() })?;
            left.remove(robot);
            on_the_map.insert(robot.to_owned());
        }
        self.on_the_map = on_the_map;
        // A viewer would keep the path of a robot that is placed no more.
        left.iter().try_for_each(|robot| output.path.send(robot, &Path { header: header(), poses: Vec::new() }))
    }

    fn send_poses(&self, output: &Output<Paths>) -> Result<(), StageError> {
        for (robot, placed) in self.placement.placed() {
            let Some(drive) = self.drive(robot) else { continue };
            in_world(drive, &placed).try_for_each(|pose| output.pose.send(robot, &pose))?;
        }
        Ok(())
    }
}

/// The poses of a drive in the frame `world`.
fn in_world(drive: &Drive, placed: &Placed<'_>) -> impl Iterator<Item = PoseStamped> {
    drive.poses().map(|(stamp, in_map)| PoseStamped {
        header: Header { stamp, frame_id: RobotFrames::WORLD.to_owned() },
        pose: placed.in_world(&in_map).into(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_runtime::message::LogTime;
    use gridweave_runtime::stage::StageHarness;

    fn frames(x: f64) -> RobotFrames {
        let frame = RobotFrame { robot: "robot1".into(), x, ..Default::default() };
        RobotFrames { reference: "robot1".into(), frames: vec![frame], ..Default::default() }
    }

    #[test]
    fn poses_that_name_another_frame_than_the_map_are_a_warning() {
        let warnings = |pose_frame: &str, map_frame: &str| {
            let mut stage = StageHarness::new(&kind(), "").unwrap();
            let header = Header { frame_id: pose_frame.to_owned(), ..Default::default() };
            let stamped = PoseWithCovarianceStamped::from(PoseStamped { header, ..Default::default() });
            stage.give::<PoseWithCovarianceStamped>("pose", "robot1", LogTime(1), &stamped).unwrap();
            let mut frames = frames(0.0);
            frames.frames[0].frame_id = map_frame.to_owned();
            stage.give::<RobotFrames>("frames", "", LogTime(2), &frames).unwrap();
            stage.finish(LogTime(3)).unwrap();
            stage.warnings()
        };
        let found = warnings("robot1/odom", "robot1/map");
        assert!(
            found.len() == 1 && found.keys().all(|text| text.contains("name the frame `robot1/odom`")),
            "{found:?}"
        );
        for pose_frame in ["robot1/map", "map", "/map", ""] {
            assert_eq!(warnings(pose_frame, "robot1/map").len(), 0, "{pose_frame}");
        }
    }

    #[test]
    fn a_robot_that_is_placed_no_more_has_an_empty_path() {
        let mut stage = StageHarness::new(&kind(), "").unwrap();
        let stamped = PoseWithCovarianceStamped::from(PoseStamped::default());
        for robot in ["robot1", "robot2"] {
            stage.give::<PoseWithCovarianceStamped>("pose", robot, LogTime(1), &stamped).unwrap();
        }
        let placed = |robots: &[&str]| RobotFrames {
            reference: robots[0].into(),
            frames: robots.iter().map(|robot| RobotFrame { robot: (*robot).into(), ..Default::default() }).collect(),
            ..Default::default()
        };
        let mut paths = |robots: &[&str]| {
            stage.give::<RobotFrames>("frames", "", LogTime(2), &placed(robots)).unwrap();
            let sent = stage.take_messages("path").into_iter();
            let count = |message: &gridweave_runtime::message::Message| message.decode::<Path>().unwrap().poses.len();
            sent.map(|message| (message.header().topic.as_str().to_owned(), count(&message))).collect::<Vec<_>>()
        };
        let path = |robot: &str, count: usize| (format!("/{robot}/merged_path"), count);
        assert_eq!(paths(&["robot2"]), [path("robot2", 1)], "the reference until two robots are merged");
        assert_eq!(paths(&["robot1"]), [path("robot1", 1), path("robot2", 0)]);
        assert_eq!(paths(&["robot1", "robot2"]), [path("robot1", 1), path("robot2", 1)]);
    }
}
