//! `gridweave_msgs`: the messages of the map merging stages. Their `.msg` texts are in `logs/msg/gridweave_msgs/`.
//!
//! `T_a_b` transforms a point from frame b to frame a. Covariances are row by row.

use super::{Header, ros_messages};
use nalgebra::{Isometry2, Vector2};
use serde::{Deserialize, Serialize};

/// A scan of a lidar in the frame of its robot's base.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RangeScan {
    /// When the first beam was sent, and the frame of the robot's base.
    pub header: Header,
    /// The position of the lidar in that frame, forward, metres.
    pub x: f64,
    /// The position of the lidar in that frame, left, metres.
    pub y: f64,
    /// The direction of angle 0, radians.
    pub yaw: f64,
    /// The direction of the first beam, radians.
    pub angle_min: f64,
    /// The angle from one beam to the next, radians; negative for a lidar mounted upside down.
    pub angle_increment: f64,
    /// The time from one beam to the next, seconds; 0 if unknown.
    pub time_increment: f64,
    /// The minimum valid range, metres.
    pub range_min: f32,
    /// The maximum valid range, metres.
    pub range_max: f32,
    /// The measured ranges, metres.
    pub ranges: Vec<f32>,
}

/// A straight wall of a map.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Segment {
    /// One end, metres, map frame.
    pub x1: f64,
    /// One end, metres, map frame.
    pub y1: f64,
    /// The other end, metres, map frame.
    pub x2: f64,
    /// The other end, metres, map frame.
    pub y2: f64,
    /// Mean occupancy along the segment, 0 to 1.
    pub reliability: f64,
    /// The number of occupied cells that support it.
    pub inliers: u32,
}

/// The straight walls of a map.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Segments {
    /// Time, and the robot's map frame.
    pub header: Header,
    /// The robot of the map.
    pub robot: String,
    /// The walls in the order of detection: the best supported first.
    pub segments: Vec<Segment>,
}

/// The main direction of a map's walls.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MapDirection {
    /// Time, and the robot's map frame.
    pub header: Header,
    /// The robot of the map.
    pub robot: String,
    /// The direction of the map's walls, radians, modulo quarter turns.
    pub direction: f64,
    /// Standard deviation of the direction, radians.
    pub deviation: f64,
    /// Directions of the two groups of walls, radians.
    pub groups: [f64; 2],
    /// The share of the wall length that is parallel or perpendicular to the direction, 0 to 1.
    pub agreement: f64,
    /// Whether there are enough walls to estimate a direction.
    pub valid: bool,
}

/// An alignment hypothesis: the relative pose `T_a_b` of two maps.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Alignment {
    /// Time, and the frame of map a.
    pub header: Header,
    /// The robot of map a, the target.
    pub a: String,
    /// The robot of map b, which is moved.
    pub b: String,
    /// The source of the hypothesis, such as `tags` or `maps`. An alignment of a pair replaces the previous one of the
    /// same source; those of different sources compete.
    pub source: String,
    /// Whether there is a transform. If not, the transform and its covariance are meaningless.
    pub has_transform: bool,
    /// Translation of `T_a_b`, metres.
    pub x: f64,
    /// Translation of `T_a_b`, metres.
    pub y: f64,
    /// Rotation of `T_a_b`, radians.
    pub yaw: f64,
    /// Covariance of (x, y, yaw), 3 x 3, metres and radians.
    pub covariance: [f64; 9],
    /// The agreement of the maps, 0 to 1, as estimated by the sending stage. A stage that has searched all hypotheses
    /// gives the significance of this one: the probability that it is not the best by chance.
    pub score: f64,
    /// By how much the maps fit better here than by chance, as a share of how well they fit, 0 to 1. 0 if its stage
    /// does not know.
    pub margin: f64,
    /// The steps by which it was found, as in `tags+directions+icp`; for people.
    pub method: String,
    /// Whether it may be used to merge the maps.
    pub accepted: bool,
    /// Whether it may be used only after the walls of the maps have confirmed it, because its evidence is insufficient.
    /// The stage that confirms it sends it without this flag.
    pub provisional: bool,
    /// The rank among the hypotheses of its stage for the pair: 0 for the best.
    pub rank: u32,
    /// The number of hypotheses of its stage for the pair. All are sent one after the other, by rank, and replace those
    /// sent before. 0 if its stage does not search for others, 1 if it has searched and found no other.
    pub hypotheses: u32,
    /// Why it is rejected, or its evidence: a few short lines for everybody and, after an empty line, the details.
    pub reason: String,
}

impl Alignment {
    /// The transform `T_a_b` from map b to map a.
    pub fn transform_a_b(&self) -> Isometry2<f64> {
        Isometry2::new(Vector2::new(self.x, self.y), self.yaw)
    }

    /// Sets the transform `T_a_b` from map b to map a.
    pub fn set_transform_a_b(&mut self, transform_a_b: &Isometry2<f64>) {
        self.has_transform = true;
        self.x = transform_a_b.translation.x;
        self.y = transform_a_b.translation.y;
        self.yaw = transform_a_b.rotation.angle();
    }
}

/// The pose of one robot's map frame in the map frame of the reference robot, or of its group's reference.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RobotFrame {
    /// The robot of the map.
    pub robot: String,
    /// The name of the map's frame.
    pub frame_id: String,
    /// Metres in the reference robot's map frame.
    pub x: f64,
    /// Metres in the reference robot's map frame.
    pub y: f64,
    /// Radians.
    pub yaw: f64,
    /// Covariance of (x, y, yaw), 3 x 3, metres and radians.
    pub covariance: [f64; 9],
}

impl RobotFrame {
    /// Whether `other` is a frame of the same robot, at most `distance` metres and `angle` radians away.
    pub fn is_near(&self, other: &Self, distance: f64, angle: f64) -> bool {
        let change = self.transform_reference_robot().rotation.angle_to(&other.transform_reference_robot().rotation);
        self.robot == other.robot && (self.x - other.x).hypot(self.y - other.y) <= distance && change.abs() <= angle
    }

    /// The transform from this robot's map to the reference robot's.
    pub fn transform_reference_robot(&self) -> Isometry2<f64> {
        Isometry2::new(Vector2::new(self.x, self.y), self.yaw)
    }
}

/// A robot that is not connected to the reference.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct UnmergedRobot {
    /// The robot of the map.
    pub robot: String,
    /// The reason.
    pub reason: String,
}

/// The poses of all robots' maps.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RobotFrames {
    /// Time, and the frame `world`, which is the reference robot's map frame.
    pub header: Header,
    /// The robot whose map frame is the world.
    pub reference: String,
    /// The robots that are connected to the reference, including itself, by name.
    pub frames: Vec<RobotFrame>,
    /// The robots that are not connected to the reference, by name.
    pub unmerged: Vec<UnmergedRobot>,
    /// The connected components of unmerged robots, by the name of their references.
    pub groups: Vec<RobotGroup>,
}

/// A connected component of robots without the reference: their relative poses are known, but not those in the world.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RobotGroup {
    /// The robot of the group in whose map frame the others are placed.
    pub reference: String,
    /// The frame of the group: `world/REFERENCE`, the map frame of its reference. It is not connected to the frame
    /// `world`.
    pub frame_id: String,
    /// The robots of the group, including its reference, by name. Their poses are in the map frame of the group's
    /// reference.
    pub frames: Vec<RobotFrame>,
}

/// The outcome of one pair of robots.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// The relative pose of the maps, whether it is used, and why not.
    pub alignment: Alignment,
    /// Whether other alignments along a cycle confirm it.
    pub checked: bool,
}

/// The outcomes of all pairs of robots with an alignment.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Verdicts {
    /// Time, and the frame `world`.
    pub header: Header,
    /// The pairs, by the names of their robots.
    pub verdicts: Vec<Verdict>,
}

/// The evidence in the maps of two robots for the evaluated hypothesis.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Evidence {
    /// Time, and the frame of map a.
    pub header: Header,
    /// The robot of map a, the target.
    pub a: String,
    /// The robot of map b, which is moved.
    pub b: String,
    /// The number of hypotheses.
    pub hypotheses: u32,
    /// The area that is known in both maps, square metres.
    pub overlap: f64,
    /// The inlier length: walls of one map on walls of the other, metres.
    pub wall_on_wall: f64,
    /// The conflict length: walls of one map on free space of the other, metres.
    pub wall_on_free: f64,
    /// The evidence for the second-best hypothesis, as a share of that for this one.
    pub evidence_elsewhere: f64,
}

/// The agreement of the fused maps.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MapAgreement {
    /// Time, and the frame of the fused map.
    pub header: Header,
    /// The area that is known in exactly one map, square metres.
    pub known_to_one: f64,
    /// The area that is known in several maps, square metres.
    pub known_to_several: f64,
    /// The part of that area in which the maps are in conflict, square metres.
    pub in_conflict: f64,
}

impl RobotFrames {
    /// The name of the world frame: the reference robot's map frame.
    pub const WORLD: &'static str = "world";
}

ros_messages!("gridweave_msgs": RangeScan, Segments, MapDirection, Alignment, RobotFrames, Verdicts, Evidence, MapAgreement, UnmergedRobot);
