//! The path placer as a stage.

use super::Drive;
use crate::shared::placement::Placement;
use gridweave_runtime::ros::{Header, MapDeformation, Path, PoseStamped, PoseWithCovarianceStamped, RobotFrames};
use gridweave_runtime::stage::{
    Context, Out, Output, OutputPorts, Outputs, Parameters, Received, StageError, StageKind,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

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
         deformations change, and at the end if any robot has moved since.",
        |parameters: PathPlacerParameters, _: &Context| Ok(PathPlacer { parameters, ..PathPlacer::default() }),
    )
    .inputs("pose", "the robots' poses in their maps", PathPlacer::receive_pose)
    .optional_input("deformation", "the deformations of the maps", PathPlacer::receive_deformation)
    .input("frames", "the poses of the maps", PathPlacer::receive_frames)
    .finish(PathPlacer::finish)
    .build()
}

struct Paths {
    path: Out<Path>,
}

impl Outputs for Paths {
    fn declare(ports: &mut OutputPorts) -> Self {
        let summary = "the path of the robot, in the frame `world`; each pose with its own time";
        Self { path: ports.output_on("/{robot}/merged_path", "path", summary) }
    }
}

#[derive(Default)]
struct PathPlacer {
    parameters: PathPlacerParameters,
    drives: BTreeMap<String, Drive>,
    placement: Placement,
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
        if let Some(drive) = self.drives.get_mut(pose.robot()) {
            drive.add(pose.header.stamp, pose.pose.pose.planar(), self.parameters.spacing);
            self.has_new_poses = true;
        }
        Ok(())
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
        if self.has_new_deformations || self.has_new_poses { self.send(output) } else { Ok(()) }
    }

    fn send(&mut self, output: &Output<Paths>) -> Result<(), StageError> {
        (self.has_new_deformations, self.has_new_poses) = (false, false);
        for (robot, placed) in self.placement.placed() {
            let Some(drive) = self.drives.get(robot) else { continue };
            let stamped = |(stamp, in_map)| PoseStamped {
                header: Header { stamp, frame_id: RobotFrames::WORLD.to_owned() },
                pose: placed.in_world(&in_map).into(),
            };
            let header = Header::new(output.log_time(), RobotFrames::WORLD);
            output.path.send(robot, &Path { header, poses: drive.poses().map(stamped).collect() })?;
        }
        Ok(())
    }
}
