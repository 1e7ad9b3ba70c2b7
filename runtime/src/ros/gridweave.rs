//! `gridweave_msgs`: the messages of the map merging stages. Their `.msg` texts lie in `logs/msg/gridweave_msgs/`.
//!
//! `T_a_b` takes a point in frame b to frame a. Covariances are row by row.

use super::{Header, ros_messages};
use nalgebra::{Isometry2, Vector2};
use serde::{Deserialize, Serialize};

/// A scan of a lidar, seen from the base of its robot.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RangeScan {
    /// When the first beam was sent, and the frame of the robot's base.
    pub header: Header,
    /// Where the lidar is in that frame, metres ahead of the base.
    pub x: f64,
    /// Metres to its left.
    pub y: f64,
    /// The direction from which its angles are counted, radians.
    pub yaw: f64,
    /// The direction of the first beam, radians.
    pub angle_min: f64,
    /// From a beam to the next, radians; negative for a lidar that hangs upside down.
    pub angle_increment: f64,
    /// From a beam to the next, seconds; 0 if it is not known.
    pub time_increment: f64,
    /// What is nearer is no measurement, metres.
    pub range_min: f32,
    /// What is farther is no measurement, metres.
    pub range_max: f32,
    /// What the beams have measured, metres.
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
    /// The number of occupied cells that it rests on.
    pub inliers: u32,
}

/// The straight walls of a map.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Segments {
    /// Time, and the robot's map frame.
    pub header: Header,
    /// Whose map.
    pub robot: String,
    /// The walls, in the order they were found: the best supported first.
    pub segments: Vec<Segment>,
}

/// The main direction of a map's walls.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MapDirection {
    /// Time, and the robot's map frame.
    pub header: Header,
    /// Whose map.
    pub robot: String,
    /// Direction of the map's walls, radians, known up to quarter turns.
    pub direction: f64,
    /// Standard deviation of the direction, radians.
    pub deviation: f64,
    /// Directions of the two groups of walls, radians.
    pub groups: [f64; 2],
    /// Share of the wall length that follows the direction or stands across it, 0 to 1.
    pub agreement: f64,
    /// Whether there are walls enough to tell a direction.
    pub valid: bool,
}

/// How two maps lie to each other: `T_a_b`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Alignment {
    /// Time, and the frame of map a.
    pub header: Header,
    /// The robot whose map stays.
    pub a: String,
    /// The robot whose map is moved.
    pub b: String,
    /// What it was found from, such as `tags` or `maps`. Alignments of a pair from one source take each other's place;
    /// those from several compete.
    pub source: String,
    /// Whether it says where map b lies. If not, the transform and its covariance mean nothing.
    pub has_transform: bool,
    /// Translation of `T_a_b`, metres.
    pub x: f64,
    /// Translation of `T_a_b`, metres.
    pub y: f64,
    /// Rotation of `T_a_b`, radians.
    pub yaw: f64,
    /// Covariance of (x, y, yaw), 3 x 3, metres and radians.
    pub covariance: [f64; 9],
    /// How well the maps agree, 0 to 1, as far as the stage that sends it can tell. One that has looked for all other places
    /// gives the probability that this one does not lead them by chance.
    pub score: f64,
    /// How it was found, step by step, as in `tags+directions+icp`. For people to read.
    pub method: String,
    /// Whether it may be used to merge the maps.
    pub accepted: bool,
    /// Whether it may be used only once the walls of the maps have confirmed it: it was found from too little to be
    /// believed by itself. What confirms it sends it without this mark.
    pub provisional: bool,
    /// Its place among the hypotheses that its stage has for the pair: 0 for the best.
    pub rank: u32,
    /// How many hypotheses its stage has for the pair. All are sent one after the other, by rank, and take the place of
    /// those sent before. 0 if its stage does not look for others, 1 if it has looked and there is no other.
    pub hypotheses: u32,
    /// Why it is refused, or what speaks for it: short lines that everybody is shown and, behind an empty line, the whole.
    pub reason: String,
}

impl Alignment {
    /// The transform that takes a point in map b to map a.
    pub fn transform_a_b(&self) -> Isometry2<f64> {
        Isometry2::new(Vector2::new(self.x, self.y), self.yaw)
    }

    /// Sets the transform that takes a point in map b to map a.
    pub fn set_transform_a_b(&mut self, transform_a_b: &Isometry2<f64>) {
        self.has_transform = true;
        self.x = transform_a_b.translation.x;
        self.y = transform_a_b.translation.y;
        self.yaw = transform_a_b.rotation.angle();
    }
}

/// The pose of one robot's map frame in the map frame of the reference robot, or of its group's.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RobotFrame {
    /// Whose map.
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
    /// Whether this is a frame of the same robot that has moved by `distance` metres and turned by `angle` radians at
    /// most.
    pub fn is_near(&self, other: &Self, distance: f64, angle: f64) -> bool {
        let change = self.transform_reference_robot().rotation.angle_to(&other.transform_reference_robot().rotation);
        self.robot == other.robot && (self.x - other.x).hypot(self.y - other.y) <= distance && change.abs() <= angle
    }

    /// The transform that takes a point in this robot's map to the reference robot's.
    pub fn transform_reference_robot(&self) -> Isometry2<f64> {
        Isometry2::new(Vector2::new(self.x, self.y), self.yaw)
    }
}

/// A robot that could not be tied to the reference.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct UnmergedRobot {
    /// Whose map.
    pub robot: String,
    /// Why.
    pub reason: String,
}

/// Where every robot's map lies.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RobotFrames {
    /// Time, and the frame `world`, which is the reference robot's map frame.
    pub header: Header,
    /// The robot whose map frame is the world.
    pub reference: String,
    /// The robots that are tied to the reference, itself among them, by name.
    pub frames: Vec<RobotFrame>,
    /// The robots that are not, by name.
    pub unmerged: Vec<UnmergedRobot>,
    /// Those of them that are tied to each other, by the name of the group's reference.
    pub groups: Vec<RobotGroup>,
}

/// Robots that are tied to each other, but not to the reference: how they lie to each other is known, where they all
/// lie is not.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RobotGroup {
    /// The robot of the group in whose map frame the others are placed.
    pub reference: String,
    /// The name of the frame that the group is shown in: `world/REFERENCE`, the reference's map frame. Nothing ties it
    /// to the frame `world`.
    pub frame_id: String,
    /// The robots of the group, its reference among them, by name. Their poses are in the map frame of the group's
    /// reference.
    pub frames: Vec<RobotFrame>,
}

/// What became of one pair of robots.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// How the maps lie to each other, whether that is used, and why not.
    pub alignment: Alignment,
    /// Whether others along a cycle confirm it.
    pub checked: bool,
}

/// What became of all pairs of robots of which an alignment has come.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Verdicts {
    /// Time, and the frame `world`.
    pub header: Header,
    /// The pairs, by the names of their robots.
    pub verdicts: Vec<Verdict>,
}

/// What the maps of two robots say of the place that was judged for them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Evidence {
    /// Time, and the frame of map a.
    pub header: Header,
    /// The robot whose map stays.
    pub a: String,
    /// The robot whose map is moved.
    pub b: String,
    /// How many places were proposed.
    pub hypotheses: u32,
    /// The area that both maps know, square metres.
    pub overlap: f64,
    /// The length of walls of one map that lie on walls of the other, metres.
    pub wall_on_wall: f64,
    /// The length of walls of one map that lie on free space of the other, metres.
    pub wall_on_free: f64,
    /// The evidence for the other place that is most like it, as a share of that for this one.
    pub evidence_elsewhere: f64,
}

/// How far the maps that were fused agree.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MapAgreement {
    /// Time, and the frame of the fused map.
    pub header: Header,
    /// The area that one map knows, square metres.
    pub known_to_one: f64,
    /// The area that several maps know, square metres.
    pub known_to_several: f64,
    /// The part of that on which they contradict each other, square metres.
    pub in_conflict: f64,
}

impl RobotFrames {
    /// The name of the frame that all maps are placed in: the reference robot's map frame.
    pub const WORLD: &'static str = "world";
}

ros_messages!("gridweave_msgs": RangeScan, Segments, MapDirection, Alignment, RobotFrames, Verdicts, Evidence, MapAgreement);
