//! The summary of a merge as a JSON file: the frames of the robots, the robots that could not be merged with the
//! reason, and the outcome of each pair.

mod stage;

pub use stage::kind;

use gridweave_runtime::ros::{
    self, DeformationNode, Evidence, MapAgreement, MapDeformation, RobotFrame, RobotFrames, RobotGroup, Verdict,
    Verdicts,
};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The result of a merge.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// The robot whose map frame is the reference; `None` if there is no robot.
    pub reference: Option<String>,
    /// The map frames of the merged robots in the reference frame, by robot.
    pub frames: BTreeMap<String, Frame>,
    /// The reasons why the other robots could not be merged, by robot.
    #[serde(default)]
    pub unmerged: BTreeMap<String, String>,
    /// Groups of robots that are merged with each other, but not with the reference.
    #[serde(default)]
    pub groups: Vec<Group>,
    /// The outcome of each pair of robots.
    #[serde(default)]
    pub alignments: Vec<Pair>,
    /// The deformations of the maps, by robot.
    #[serde(default, rename = "bends", skip_serializing_if = "BTreeMap::is_empty")]
    pub deformations: BTreeMap<String, DeformationSummary>,
    /// The agreement of the fused maps, by the stage that fused them.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub areas: BTreeMap<String, Areas>,
}

/// The pose of a robot's map frame: metres and radians.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Frame {
    /// Metres.
    pub x: f64,
    /// Metres.
    pub y: f64,
    /// Radians.
    pub yaw: f64,
    /// The covariance of (x, y, yaw), 3 x 3 row by row.
    #[serde(default)]
    pub covariance: [f64; 9],
}

/// The deformation of a map: a displacement field that is applied before the rigid frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DeformationSummary {
    /// The maximum displacement of a node, metres.
    pub largest_m: f64,
    /// The maximum rotation of a node, degrees.
    pub largest_deg: f64,
    /// The longer side of the bounding box of the nodes, metres.
    pub over_m: f64,
    /// The length of its walls that were matched with walls of other maps, metres.
    pub wall_matched_m: f64,
    /// The sharpness of the walls in common with other maps, by the rigid frames alone.
    #[serde(default)]
    pub sharpness_rigid: WallSharpness,
    /// The same, with the deformations.
    #[serde(default)]
    pub sharpness: WallSharpness,
    /// The estimated strength of the deformation: standard deviation of the relative displacement of two points, metres
    /// per square root of the distance between them in metres; `None` if unknown.
    #[serde(default)]
    pub bend_m_per_root_m: Option<f64>,
    /// The same for the relative rotation of two points, radians per square root of metres.
    #[serde(default)]
    pub turn_rad_per_root_m: Option<f64>,
    /// The spacing of the nodes along x and along y, metres.
    pub spacing: f64,
    /// The nodes: x, y, their displacements along x and y, metres, and their rotation, radians.
    pub nodes: Vec<[f64; 5]>,
}

impl From<&MapDeformation> for DeformationSummary {
    fn from(message: &MapDeformation) -> Self {
        let most = |part: &dyn Fn(&DeformationNode) -> f64| message.nodes.iter().map(part).fold(f64::MIN, f64::max);
        let side = |part: &dyn Fn(&DeformationNode) -> f64| most(part) + most(&|node| -part(node));
        Self {
            largest_m: most(&|node| node.dx.hypot(node.dy)),
            largest_deg: most(&|node| node.dyaw.abs()).to_degrees(),
            over_m: side(&|node| node.x).max(side(&|node| node.y)),
            wall_matched_m: message.wall_matched,
            sharpness_rigid: message.sharpness_rigid.into(),
            sharpness: message.sharpness.into(),
            bend_m_per_root_m: (message.bend > 0.0).then_some(message.bend),
            turn_rad_per_root_m: (message.turn > 0.0).then_some(message.turn),
            spacing: message.spacing,
            nodes: message.nodes.iter().map(|node| [node.x, node.y, node.dx, node.dy, node.dyaw]).collect(),
        }
    }
}

/// The sharpness of walls that several maps contain.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WallSharpness {
    /// The wall thickness spread: the mean distance between the copies of a wall, perpendicular to the wall, metres.
    pub apart_m: f64,
    /// The double-wall ratio: the share of the walls whose copies appear as two walls, 0 to 1.
    pub doubled: f64,
}

impl From<ros::Sharpness> for WallSharpness {
    fn from(message: ros::Sharpness) -> Self {
        Self { apart_m: message.apart, doubled: message.doubled }
    }
}

/// A group of robots that are merged with each other, but not with the reference.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Group {
    /// The robot whose map frame is the reference of the group.
    pub reference: String,
    /// The map frames, by robot.
    pub frames: BTreeMap<String, Frame>,
}

/// The outcome of a pair of robots: `T_a_b` transforms points of map b to map a.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pair {
    /// The robot of map a.
    pub a: String,
    /// The robot of map b.
    pub b: String,
    /// The method that found the alignment.
    pub method: String,
    /// Translation of `T_a_b`, metres.
    pub x: f64,
    /// Translation of `T_a_b`, metres.
    pub y: f64,
    /// Rotation of `T_a_b`, radians.
    pub yaw: f64,
    /// The probability that the alignment is correct, 0 to 1.
    pub score: f64,
    /// Whether it is used.
    pub accepted: bool,
    /// Whether alignments along a cycle confirm it.
    pub checked: bool,
    /// The reason why it is not used, or the evidence for it.
    pub reason: String,
    /// The agreement of the maps; `None` if they were not compared.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub evidence: Option<PairEvidence>,
}

/// The agreement of two maps at the alignment of the pair.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PairEvidence {
    /// The number of hypotheses that were judged.
    pub hypotheses: u32,
    /// The area that is known in both maps, square metres.
    pub overlap_m2: f64,
    /// The inlier length: walls of one map on walls of the other, metres.
    pub wall_on_wall_m: f64,
    /// The conflict length: walls of one map on free space of the other, metres.
    pub wall_on_free_m: f64,
    /// The evidence for the second-best hypothesis, as a share of that for this one.
    pub elsewhere: f64,
}

impl From<&Evidence> for PairEvidence {
    fn from(message: &Evidence) -> Self {
        let Evidence { hypotheses, overlap, wall_on_wall, wall_on_free, evidence_elsewhere, .. } = *message;
        Self {
            hypotheses,
            overlap_m2: overlap,
            wall_on_wall_m: wall_on_wall,
            wall_on_free_m: wall_on_free,
            elsewhere: evidence_elsewhere,
        }
    }
}

/// The agreement of the fused maps: areas in square metres.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Areas {
    /// Known to one map.
    pub known_to_one_m2: f64,
    /// Known to several maps.
    pub known_to_several_m2: f64,
    /// The part of it in which these contradict each other.
    pub in_conflict_m2: f64,
    /// The same as a share, 0 to 1.
    pub conflict_share: f64,
}

impl From<&MapAgreement> for Areas {
    fn from(message: &MapAgreement) -> Self {
        let MapAgreement { known_to_one, known_to_several, in_conflict, .. } = *message;
        let conflict_share = if known_to_several > 0.0 { in_conflict / known_to_several } else { 0.0 };
        let (known_to_one_m2, known_to_several_m2) = (known_to_one, known_to_several);
        Self { known_to_one_m2, known_to_several_m2, in_conflict_m2: in_conflict, conflict_share }
    }
}

impl Summary {
    /// Replaces the frames by those in a message.
    pub fn set_frames(&mut self, message: &RobotFrames) {
        self.reference = Some(message.reference.clone());
        self.frames = by_robot(&message.frames);
        self.unmerged = message.unmerged.iter().map(|robot| (robot.robot.clone(), robot.reason.clone())).collect();
        let group = |group: &RobotGroup| Group { reference: group.reference.clone(), frames: by_robot(&group.frames) };
        self.groups = message.groups.iter().map(group).collect();
    }

    /// Replaces the outcomes by the verdicts in a message.
    pub fn set_verdicts(&mut self, message: &Verdicts) {
        let pair = |Verdict { alignment, checked }: &Verdict| Pair {
            a: alignment.a.clone(),
            b: alignment.b.clone(),
            method: alignment.method.clone(),
            x: alignment.x,
            y: alignment.y,
            yaw: alignment.yaw,
            score: alignment.score,
            accepted: alignment.accepted,
            checked: *checked,
            reason: alignment.reason.clone(),
            evidence: None,
        };
        self.alignments = message.verdicts.iter().map(pair).collect();
    }
}

fn by_robot(frames: &[RobotFrame]) -> BTreeMap<String, Frame> {
    let frame = |RobotFrame { x, y, yaw, covariance, .. }: &RobotFrame| Frame {
        x: *x,
        y: *y,
        yaw: *yaw,
        covariance: *covariance,
    };
    frames.iter().map(|of_robot| (of_robot.robot.clone(), frame(of_robot))).collect()
}
