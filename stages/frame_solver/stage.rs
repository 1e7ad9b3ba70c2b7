//! The frame solver as a stage.

use super::solve::{Alignments, Group, Pair, Solution, by_name, solve};
use super::{FrameSolverParameters, UncertainPose};
use crate::geometry::row_by_row;
use gridweave_runtime::message::Message;
use gridweave_runtime::ros::{
    Alignment, Header, OccupancyGrid, RobotFrame, RobotFrames, RobotGroup, TFMessage, TransformStamped, UnmergedRobot,
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
         is given. Where the pipeline names no reference, it is the first robot by name of those heard of when the \
         first two are merged, and stays so.",
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
                "the pose of every robot's map, why the others have none, and how those of them that are tied to each \
                 other lie; sent when something changes. Robots are moved only if that improves the fit by more than \
                 `min_improvement`, and at the end",
            )
            .on_topic("/robot_frames"),
            OutputPort::new(
                "tf",
                PortType::of::<TFMessage>(),
                "the same poses as static transforms from `world`, and of robots tied to each other only from a frame of \
                 their own, `world/ROBOT`, with the name of the robot in whose map frame they are placed",
            )
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
    /// Whether robots have been placed in the reference's frame.
    is_settled: bool,
    solution: Solution,
    sent: Option<RobotFrames>,
    sent_tf: TFMessage,
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
        let frames = |frames: &BTreeMap<String, UncertainPose>| -> BTreeMap<String, Value> {
            frames.iter().map(|(robot, frame)| (robot.clone(), pose(frame))).collect()
        };
        let group = |group: &Group| json!({ "reference": group.reference, "frames": frames(&group.frames) });
        let unchecked = self.solution.unchecked();
        let alignment = |(pair, alignment): (&Pair, &Alignment)| {
            let left_out = self.solution.left_out.get(pair);
            json!({
                "a": alignment.a,
                "b": alignment.b,
                "method": alignment.method,
                "x": alignment.x,
                "y": alignment.y,
                "yaw": alignment.yaw,
                "score": alignment.score,
                "accepted": alignment.accepted && left_out.is_none(),
                "checked": self.solution.used.contains_key(pair) && !unchecked.contains(pair),
                "reason": left_out.unwrap_or(&alignment.reason),
            })
        };
        let alignments: Vec<Value> = self.alignments.iter().map(alignment).collect();
        Some(json!({
            "reference": self.reference,
            "frames": frames(&self.solution.frames),
            "unmerged": self.solution.unmerged,
            "groups": self.solution.groups.iter().map(group).collect::<Vec<Value>>(),
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
            is_settled: false,
            solution: Solution::default(),
            sent: None,
            sent_tf: TFMessage::default(),
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
        // Once robots are placed in its frame, a reference stays: an earlier name is no reason to move them all.
        let is_settled = self.solution.frames.len() > 1;
        self.reference = match &self.wanted {
            Some(wanted) => self.robots.get(wanted).cloned(),
            None if is_settled || self.is_settled => self.reference.take(),
            None => self.robots.first().cloned(),
        };
        self.is_settled |= is_settled;
        if let Some(reference) = &self.reference {
            self.solution = solve(&self.robots, &self.alignments, reference, &self.parameters, &self.solution);
        }
    }

    /// Sends the frames and transforms if they differ from those sent last: the `last` ones as they are solved, others
    /// with the robots that were sent left in place as long as the parameters allow. Without a reference there is
    /// nothing to send.
    fn send(&mut self, output: &mut Output<'_>, last: bool) -> Result<(), StageError> {
        let Some(reference) = self.reference.clone() else { return Ok(()) };
        let header = Header::new(output.log_time(), RobotFrames::WORLD);
        let solved = self.message(header, reference);
        let message = match &self.sent {
            Some(sent) if !last => self.held(sent, solved),
            _ => solved,
        };
        if self.sent.as_ref().is_some_and(|sent| match last {
            true => RobotFrames { header: sent.header.clone(), ..message.clone() } == *sent,
            false => says_the_same(sent, &message),
        }) {
            return Ok(());
        }
        output.send(FRAMES, "", &message)?;
        let tf = transforms(&message);
        let place = |one: &TransformStamped| (one.header.frame_id.clone(), one.child_frame_id.clone(), one.transform);
        if !tf.transforms.iter().map(place).eq(self.sent_tf.transforms.iter().map(place)) {
            output.send(TF, "", &tf)?;
            self.sent_tf = tf;
        }
        self.sent = Some(message);
        Ok(())
    }

    /// The solution as a message.
    fn message(&self, header: Header, reference: String) -> RobotFrames {
        let frames = |frames: &BTreeMap<String, UncertainPose>| -> Vec<RobotFrame> {
            frames.iter().map(|(robot, pose)| self.frame(robot, pose)).collect()
        };
        let group = |group: &Group| RobotGroup {
            reference: group.reference.clone(),
            frame_id: format!("{}/{}", RobotFrames::WORLD, group.reference),
            frames: frames(&group.frames),
        };
        let unmerged = self.solution.unmerged.iter();
        let unmerged = unmerged.map(|(robot, reason)| UnmergedRobot { robot: robot.clone(), reason: reason.clone() });
        RobotFrames {
            header,
            reference,
            frames: frames(&self.solution.frames),
            unmerged: unmerged.collect(),
            groups: self.solution.groups.iter().map(group).collect(),
        }
    }

    /// What was solved, with the robots that were `sent` in the same frame left in their places; or as it is, if the
    /// alignments fit it better by more than `min_improvement`.
    fn held(&self, sent: &RobotFrames, solved: RobotFrames) -> RobotFrames {
        let mut held = solved.clone();
        if held.reference == sent.reference {
            hold(&mut held.frames, &sent.frames);
        }
        for group in &mut held.groups {
            if let Some(sent) = sent.groups.iter().find(|sent| sent.reference == group.reference) {
                hold(&mut group.frames, &sent.frames);
            }
        }
        let cost = |message: &RobotFrames| {
            let grouped = message.groups.iter().flat_map(|group| &group.frames);
            let frames = message.frames.iter().chain(grouped);
            let poses = frames.map(|frame| (frame.robot.as_str(), frame.transform_reference_robot())).collect();
            self.solution.squared_deviations(&poses)
        };
        let improvement = cost(&held) - cost(&solved);
        if improvement <= self.parameters.min_improvement { held } else { solved }
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
}

/// Leaves the robots that were `sent` in their places. Both by name.
fn hold(frames: &mut [RobotFrame], sent: &[RobotFrame]) {
    for frame in frames {
        if let Ok(place) = sent.binary_search_by(|sent| sent.robot.cmp(&frame.robot)) {
            let RobotFrame { x, y, yaw, .. } = sent[place];
            (frame.x, frame.y, frame.yaw) = (x, y, yaw);
        }
    }
}

/// Whether two messages differ by nothing but their times and covariances.
fn says_the_same(one: &RobotFrames, other: &RobotFrames) -> bool {
    let place = |frame: &RobotFrame| RobotFrame { covariance: [0.0; 9], ..frame.clone() };
    let same = |one: &[RobotFrame], other: &[RobotFrame]| one.iter().map(place).eq(other.iter().map(place));
    let same_group =
        |(one, other): (&RobotGroup, &RobotGroup)| one.reference == other.reference && same(&one.frames, &other.frames);
    one.reference == other.reference
        && one.unmerged == other.unmerged
        && same(&one.frames, &other.frames)
        && one.groups.len() == other.groups.len()
        && one.groups.iter().zip(&other.groups).all(same_group)
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

/// The frames of the message as transforms from `world`, and those of groups from the groups' own frames.
fn transforms(message: &RobotFrames) -> TFMessage {
    let main = (&message.header.frame_id, &message.frames);
    let all = std::iter::once(main).chain(message.groups.iter().map(|group| (&group.frame_id, &group.frames)));
    let transform = |parent: &str, frame: &RobotFrame| TransformStamped {
        header: Header { stamp: message.header.stamp, frame_id: parent.to_owned() },
        child_frame_id: frame.frame_id.clone(),
        transform: frame.transform_reference_robot().into(),
    };
    let transforms = all.flat_map(|(parent, frames)| frames.iter().map(move |frame| transform(parent, frame)));
    TFMessage { transforms: transforms.collect() }
}
