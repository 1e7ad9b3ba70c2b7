//! The stage from outside.

mod messages;
mod solutions;
mod tree;

use super::kind;
use crate::shared::geometry::{Pose2, pose, wrap_angle};
use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::{
    Alignment, Header, MapMetaData, OccupancyGrid, RobotFrames, TFMessage, TagEstimates, UnmergedRobot, Verdict,
    Verdicts,
};
use gridweave_runtime::stage::{Context, InitialPose, InputWire, StageError, StageHarness};

struct Run {
    stage: StageHarness,
    /// The message sent last.
    latest: Option<RobotFrames>,
    verdicts: Option<Verdicts>,
}

impl Run {
    fn new(reference: Option<&str>) -> Self {
        Self::in_context(&Context { reference: reference.map(str::to_owned), ..Default::default() })
    }

    fn in_context(context: &Context) -> Self {
        let stage = StageHarness::with_context(&kind(), "", context).unwrap();
        Self { stage, latest: None, verdicts: None }
    }

    fn map(&mut self, robot: &str, frame_id: &str) {
        self.map_of_resolution(robot, frame_id, 0.05);
    }

    fn map_of_resolution(&mut self, robot: &str, frame_id: &str, resolution: f32) {
        let info = MapMetaData { resolution, ..Default::default() };
        let map = OccupancyGrid { header: Header::new(LogTime(5), frame_id), info, ..Default::default() };
        self.stage.give::<OccupancyGrid<'_>>("map", robot, LogTime(5), &map).unwrap();
    }

    fn tags(&mut self, robot: &str, frame_id: &str) {
        let header = Header::new(LogTime(5), frame_id);
        let tags = TagEstimates { header, robot: robot.to_owned(), ..Default::default() };
        self.stage.give::<TagEstimates>("tags", robot, LogTime(5), &tags).unwrap();
    }

    fn lost(&mut self, robot: &str, reason: &str) {
        let lost = UnmergedRobot { robot: robot.to_owned(), reason: reason.to_owned() };
        self.stage.give::<UnmergedRobot>("lost", robot, LogTime(5), &lost).unwrap();
    }

    fn align(&mut self, alignment: &Alignment) {
        self.stage.give::<Alignment>("alignment", "", LogTime(5), alignment).unwrap();
    }

    fn finish(&mut self) -> Result<(), StageError> {
        self.stage.finish(LogTime(6))
    }

    /// The frames sent since the last look.
    fn frames(&mut self) -> Vec<RobotFrames> {
        let frames: Vec<RobotFrames> = self.stage.take("frames").unwrap();
        self.latest = frames.last().cloned().or_else(|| self.latest.take());
        frames
    }

    /// The frames sent last.
    fn latest(&mut self) -> Option<RobotFrames> {
        self.frames();
        self.latest.clone()
    }

    /// The frames as they are solved: they are sent when the run ends.
    fn solved(&mut self) -> RobotFrames {
        self.finish().unwrap();
        self.latest().unwrap()
    }

    /// The verdicts when the run ends.
    fn verdicts(&mut self) -> Vec<Verdict> {
        self.finish().unwrap();
        self.verdicts = self.stage.take("verdicts").unwrap().pop().or_else(|| self.verdicts.take());
        self.verdicts.clone().unwrap_or_default().verdicts
    }

    fn pose_of(&mut self, robot: &str) -> Option<Pose2> {
        let solved = self.solved();
        let frame = solved.frames.iter().find(|frame| frame.robot == robot)?;
        Some(pose(frame.x, frame.y, frame.yaw))
    }

    fn reason(&mut self, robot: &str) -> String {
        let latest = self.latest().unwrap();
        latest.unmerged.into_iter().find(|unmerged| unmerged.robot == robot).unwrap_or_default().reason
    }
}

const COVARIANCE: [f64; 9] = [1e-4, 2e-5, 0.0, 2e-5, 2e-4, 1e-6, 0.0, 1e-6, 1e-6];

fn accepted(a: &str, b: &str, transform_a_b: Pose2) -> Alignment {
    let mut alignment = Alignment {
        a: a.into(),
        b: b.into(),
        covariance: COVARIANCE,
        score: 0.9,
        method: "icp".into(),
        accepted: true,
        reason: "3 tags agree".into(),
        ..Default::default()
    };
    alignment.set_transform_a_b(&transform_a_b);
    alignment
}

fn refused(a: &str, b: &str, score: f64, reason: &str) -> Alignment {
    Alignment { a: a.into(), b: b.into(), score, reason: reason.into(), ..Default::default() }
}

fn is_near(one: &Pose2, other: &Pose2, tolerance: f64) -> bool {
    (one.translation.vector - other.translation.vector).norm() < tolerance
        && wrap_angle(one.rotation.angle() - other.rotation.angle()).abs() < tolerance
}

/// The pose of robot `n` (from 1) in these tests.
fn place(robot: usize) -> Pose2 {
    let n = robot as f64 - 1.0;
    pose(4.0 * n, -3.0 * n * n % 11.0, 0.8 * n)
}

fn between(a: usize, b: usize) -> Alignment {
    accepted(&format!("robot{a}"), &format!("robot{b}"), place(a).inverse() * place(b))
}

fn near(a: usize, b: usize, metres: f64) -> Alignment {
    let mut alignment = between(a, b);
    alignment.x += metres;
    alignment
}
