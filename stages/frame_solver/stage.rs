//! The frame solver as a stage.

use super::solve::{Alignments, Solution, by_name, solve};
use super::{FrameSolverParameters, UncertainPose};
use crate::geometry::row_by_row;
use gridweave_runtime::message::Message;
use gridweave_runtime::ros::{
    Alignment, Header, OccupancyGrid, RobotFrame, RobotFrames, TFMessage, TransformStamped, UnmergedRobot,
};
use gridweave_runtime::stage::{Context, InputPort, Output, OutputPort, PortType, Stage, StageError, StageKind};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};

const MAP: usize = 0;
const FRAMES: usize = 0;
const TF: usize = 1;

/// The kind `frame_solver`.
pub fn kind() -> StageKind {
    StageKind::stage(
        "frame_solver",
        "Places every robot's map in the reference robot's map, from alignments of pairs. Alignments that contradict \
         others along a cycle are left out; robots that cannot be placed with confidence are not merged, and the reason \
         is given.",
        vec![
            InputPort::one(
                "map",
                PortType::of::<OccupancyGrid<'_>>(),
                "the robots' maps: says which robots there are, and how their map frames are called",
            ),
            InputPort::one("alignment", PortType::of::<Alignment>(), "alignments of pairs, accepted and refused ones"),
        ],
        vec![
            OutputPort::new(
                "frames",
                PortType::of::<RobotFrames>(),
                "the pose of every robot's map, and why the others have none; sent when something changes",
            )
            .on_topic("/robot_frames"),
            OutputPort::new("tf", PortType::of::<TFMessage>(), "the same poses as static transforms from `world`")
                .on_topic("/tf_static"),
        ],
        |parameters: FrameSolverParameters, context: &Context| Ok(FrameSolver::new(parameters, context)),
    )
}

struct FrameSolver {
    parameters: FrameSolverParameters,
    /// The reference that the pipeline names.
    wanted: Option<String>,
    /// All robots that were heard of, and the names of their map frames in the merged tree of frames.
    robots: BTreeSet<String>,
    frame_ids: BTreeMap<String, String>,
    alignments: Alignments,
    reference: Option<String>,
    solution: Solution,
    sent: Option<RobotFrames>,
    sent_tf: Vec<RobotFrame>,
}

impl Stage for FrameSolver {
    fn receive(&mut self, port: usize, message: &Message, output: &mut Output<'_>) -> Result<(), StageError> {
        let news = match port {
            MAP => self.receive_map(message, output),
            _ => self.receive_alignment(message, output),
        };
        if news {
            self.solve();
            self.send(output, false)?;
        }
        Ok(())
    }

    fn finish(&mut self, output: &mut Output<'_>) -> Result<(), StageError> {
        if let Some(wanted) = &self.wanted
            && !self.robots.contains(wanted)
        {
            let robots: Vec<String> = self.robots.iter().cloned().collect();
            let cause = match robots.is_empty() {
                true => "neither it nor any other robot sent a map".to_owned(),
                false => format!("it sent no map; the robots seen are {}", robots.join(", ")),
            };
            return Err(StageError::new(format!("place the maps in the frame of the reference `{wanted}`"), cause)
                .with_help("set `reference` in [pipeline] to one of the robots, or check the topics in [robots]"));
        }
        self.send(output, true)
    }

    fn report(&self) -> Option<Value> {
        let pose = |pose: &UncertainPose| {
            json!({
                "x": pose.pose.translation.x,
                "y": pose.pose.translation.y,
                "yaw": pose.pose.rotation.angle(),
                "covariance": row_by_row(&pose.covariance),
            })
        };
        let frames: BTreeMap<&str, Value> =
            self.solution.frames.iter().map(|(robot, frame)| (robot.as_str(), pose(frame))).collect();
        let alignment = |alignment: &Alignment, left_out: Option<&String>| {
            json!({
                "a": alignment.a,
                "b": alignment.b,
                "method": alignment.method,
                "x": alignment.x,
                "y": alignment.y,
                "yaw": alignment.yaw,
                "score": alignment.score,
                "accepted": alignment.accepted && left_out.is_none(),
                "reason": left_out.unwrap_or(&alignment.reason),
            })
        };
        let alignments: Vec<Value> =
            self.alignments.iter().map(|(pair, one)| alignment(one, self.solution.left_out.get(pair))).collect();
        Some(json!({
            "reference": self.reference,
            "frames": frames,
            "unmerged": self.solution.unmerged,
            "alignments": alignments,
        }))
    }
}

impl FrameSolver {
    fn new(parameters: FrameSolverParameters, context: &Context) -> Self {
        Self {
            parameters,
            wanted: context.reference.clone(),
            robots: BTreeSet::new(),
            frame_ids: BTreeMap::new(),
            alignments: BTreeMap::new(),
            reference: None,
            solution: Solution::default(),
            sent: None,
            sent_tf: Vec::new(),
        }
    }

    /// Whether the map tells something new: another robot, or another name of its frame.
    fn receive_map(&mut self, message: &Message, output: &mut Output<'_>) -> bool {
        let robot = message.robot();
        if robot.is_empty() {
            output.warn("a map that belongs to no robot was left out");
            return false;
        }
        let frame_id = match message.decode::<OccupancyGrid<'_>>() {
            Ok(grid) => prefixed(robot, &grid.header.frame_id),
            Err(error) => {
                output.warn(format!("a map of {robot} was left out: {error}"));
                return false;
            }
        };
        let is_new = self.robots.insert(robot.to_owned());
        let is_renamed = self.frame_ids.get(robot) != Some(&frame_id);
        self.frame_ids.insert(robot.to_owned(), frame_id);
        is_new || is_renamed
    }

    /// Whether the alignment differs from the last one of its pair.
    fn receive_alignment(&mut self, message: &Message, output: &mut Output<'_>) -> bool {
        let alignment = match message.decode::<Alignment>() {
            Ok(alignment) => alignment,
            Err(error) => {
                output.warn(format!("an alignment was left out: {error}"));
                return false;
            }
        };
        let Some((pair, mut alignment)) = by_name(alignment) else {
            output.warn("an alignment that is not of two robots was left out");
            return false;
        };
        alignment.header = Header::default();
        self.robots.insert(pair.0.clone());
        self.robots.insert(pair.1.clone());
        let before = self.alignments.insert(pair.clone(), alignment);
        before.as_ref() != self.alignments.get(&pair)
    }

    fn solve(&mut self) {
        self.reference = match &self.wanted {
            Some(wanted) => self.robots.get(wanted).cloned(),
            None => self.robots.first().cloned(),
        };
        if let Some(reference) = &self.reference {
            self.solution = solve(&self.robots, &self.alignments, reference, &self.parameters);
        }
    }

    /// Sends the frames and transforms if they differ from those sent last: at all if they are the `last` ones, else by
    /// more than the parameters allow. Without a reference there is nothing to send.
    fn send(&mut self, output: &mut Output<'_>, last: bool) -> Result<(), StageError> {
        let Some(reference) = self.reference.clone() else { return Ok(()) };
        let frames: Vec<RobotFrame> =
            self.solution.frames.iter().map(|(robot, pose)| self.frame(robot, pose)).collect();
        let unmerged = self.solution.unmerged.iter();
        let unmerged = unmerged.map(|(robot, reason)| UnmergedRobot { robot: robot.clone(), reason: reason.clone() });
        let header = Header::new(output.log_time(), RobotFrames::WORLD);
        let message = RobotFrames { header: header.clone(), reference, frames, unmerged: unmerged.collect() };
        if self.sent.as_ref().is_some_and(|sent| match last {
            true => RobotFrames { header: sent.header.clone(), ..message.clone() } == *sent,
            false => self.is_nearly(sent, &message),
        }) {
            return Ok(());
        }
        output.send(FRAMES, "", &message)?;
        if self.sent_tf != message.frames {
            output.send(TF, "", &transforms(&header, &message.frames))?;
            self.sent_tf.clone_from(&message.frames);
        }
        self.sent = Some(message);
        Ok(())
    }

    fn frame(&self, robot: &str, pose: &UncertainPose) -> RobotFrame {
        RobotFrame {
            robot: robot.to_owned(),
            frame_id: self.frame_ids.get(robot).cloned().unwrap_or_else(|| prefixed(robot, "")),
            x: pose.pose.translation.x,
            y: pose.pose.translation.y,
            yaw: pose.pose.rotation.angle(),
            covariance: row_by_row(&pose.covariance),
        }
    }

    fn is_nearly(&self, sent: &RobotFrames, message: &RobotFrames) -> bool {
        let FrameSolverParameters { min_move, min_turn, .. } = self.parameters;
        let near = |(one, next): (&RobotFrame, &RobotFrame)| {
            one.frame_id == next.frame_id && one.is_near(next, min_move, min_turn)
        };
        sent.reference == message.reference
            && sent.unmerged == message.unmerged
            && sent.frames.len() == message.frames.len()
            && sent.frames.iter().zip(&message.frames).all(near)
    }
}

/// The name of a robot's map frame in a tree of frames that holds all robots: `map` becomes `robot1/map`.
fn prefixed(robot: &str, frame_id: &str) -> String {
    let frame_id = frame_id.trim_start_matches('/');
    match frame_id.strip_prefix(robot) {
        Some(rest) if rest.starts_with(['/', '_']) => frame_id.to_owned(),
        _ if frame_id.is_empty() => format!("{robot}/map"),
        _ => format!("{robot}/{frame_id}"),
    }
}

fn transforms(header: &Header, frames: &[RobotFrame]) -> TFMessage {
    let transform = |frame: &RobotFrame| TransformStamped {
        header: header.clone(),
        child_frame_id: frame.frame_id.clone(),
        transform: frame.transform_reference_robot().into(),
    };
    TFMessage { transforms: frames.iter().map(transform).collect() }
}
