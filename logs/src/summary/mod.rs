//! The summary of a merge as a JSON file: where every robot's map lies, what could not be merged and why, and what became of
//! each pair.

mod stage;

pub use stage::kind;

use gridweave_runtime::ros::{
    self, DeformationNode, MapAgreement, MapDeformation, RobotFrame, RobotFrames, RobotGroup, Verdict, Verdicts,
};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What a merge has found.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// The robot whose map frame the others are placed in; none if there is no robot.
    pub reference: Option<String>,
    /// The merged robots' map frames in the reference robot's map frame, by robot.
    pub frames: BTreeMap<String, Frame>,
    /// Why the other robots could not be merged, by robot.
    #[serde(default)]
    pub unmerged: BTreeMap<String, String>,
    /// Robots that are merged with each other, but not with the reference.
    #[serde(default)]
    pub groups: Vec<Group>,
    /// What became of each pair of robots.
    #[serde(default)]
    pub alignments: Vec<Pair>,
    /// How the maps are bent, by robot.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub bends: BTreeMap<String, Bend>,
    /// How far the maps agree that were fused, by the stage that fused them.
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
    /// Of (x, y, yaw), 3 x 3 row by row.
    #[serde(default)]
    pub covariance: [f64; 9],
}

/// How a map is bent: where its places belong before the map is placed as a whole.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Bend {
    /// The largest displacement of a node, metres.
    pub largest_m: f64,
    /// The largest turn of a node, degrees.
    pub largest_deg: f64,
    /// The longer side of the rectangle that the nodes fill, metres.
    pub over_m: f64,
    /// The length of its walls that were laid on walls of others, metres.
    pub wall_matched_m: f64,
    /// How the walls that others show as well lie on theirs, as the rigid frames have them.
    #[serde(default)]
    pub sharpness_rigid: Sharpness,
    /// The same, as the maps are bent.
    #[serde(default)]
    pub sharpness: Sharpness,
    /// How it was found to bend: standard deviation of the displacement of two places against each other, metres for the root
    /// of each metre between them; none if that is not known.
    #[serde(default)]
    pub bend_m_per_root_m: Option<f64>,
    /// The same of the turn of two places, radians for the root of each metre.
    #[serde(default)]
    pub turn_rad_per_root_m: Option<f64>,
    /// From node to node along x and along y, metres.
    pub spacing: f64,
    /// The nodes: x, y, and by how much they are displaced along x and y, metres, and turned, radians.
    pub nodes: Vec<[f64; 5]>,
}

impl From<&MapDeformation> for Bend {
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

/// How well walls that several maps show come out as one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Sharpness {
    /// The mean distance of one drawing of a wall from the other, across the wall, metres.
    pub apart_m: f64,
    /// The share of the walls whose two drawings look like two walls, 0 to 1.
    pub doubled: f64,
}

impl From<ros::Sharpness> for Sharpness {
    fn from(message: ros::Sharpness) -> Self {
        Self { apart_m: message.apart, doubled: message.doubled }
    }
}

/// Robots that are merged with each other, but not with the reference.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Group {
    /// The robot in whose map frame the others are placed.
    pub reference: String,
    /// Their map frames, by robot.
    pub frames: BTreeMap<String, Frame>,
}

/// What became of a pair of robots: `T_a_b` takes a point of map b to map a.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pair {
    /// The robot whose map stays.
    pub a: String,
    /// The robot whose map is moved.
    pub b: String,
    /// How the alignment was found.
    pub method: String,
    /// Translation of `T_a_b`, metres.
    pub x: f64,
    /// Translation of `T_a_b`, metres.
    pub y: f64,
    /// Rotation of `T_a_b`, radians.
    pub yaw: f64,
    /// How probable it is that it is right, 0 to 1.
    pub score: f64,
    /// Whether it is used.
    pub accepted: bool,
    /// Whether others along a cycle confirm it.
    pub checked: bool,
    /// Why it is not used, or what speaks for it.
    pub reason: String,
}

/// How far the maps agree that were fused: areas in square metres.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Areas {
    /// What one map knows.
    pub known_to_one_m2: f64,
    /// What several maps know.
    pub known_to_several_m2: f64,
    /// The part of that on which they contradict each other.
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
    /// Takes over the frames of a message.
    pub fn set_frames(&mut self, message: &RobotFrames) {
        self.reference = Some(message.reference.clone());
        self.frames = by_robot(&message.frames);
        self.unmerged = message.unmerged.iter().map(|robot| (robot.robot.clone(), robot.reason.clone())).collect();
        let group = |group: &RobotGroup| Group { reference: group.reference.clone(), frames: by_robot(&group.frames) };
        self.groups = message.groups.iter().map(group).collect();
    }

    /// Takes over the verdicts of a message.
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
