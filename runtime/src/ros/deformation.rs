//! `gridweave_msgs`: deformations of maps. The `.msg` texts are in `logs/msg/gridweave_msgs/`.

use super::{Header, ros_messages};
use serde::{Deserialize, Serialize};

/// A node of the deformation lattice of a map. The map around it moves with it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DeformationNode {
    /// Its position in the undeformed map, x, metres.
    pub x: f64,
    /// Its position in the undeformed map, y, metres.
    pub y: f64,
    /// Its displacement along x, metres.
    pub dx: f64,
    /// Its displacement along y, metres.
    pub dy: f64,
    /// The local rotation, radians.
    pub dyaw: f64,
    /// Covariance of (dx, dy, dyaw), 3 x 3.
    pub covariance: [f64; 9],
}

/// The deformation field of one robot's map, applied before the rigid transform to the world.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MapDeformation {
    /// Time, and the robot's map frame.
    pub header: Header,
    /// The robot of the map.
    pub robot: String,
    /// The distance between nodes along x and along y, metres.
    pub spacing: f64,
    /// The nodes, on a lattice through the origin of the map frame, row by row. The displacement is interpolated
    /// bilinearly.
    pub nodes: Vec<DeformationNode>,
    /// The length of its walls that were matched with walls of other maps, metres.
    pub wall_matched: f64,
    /// The sharpness of the matched walls with the rigid transforms.
    pub sharpness_rigid: Sharpness,
    /// The sharpness of the matched walls with the deformations.
    pub sharpness: Sharpness,
    /// The estimated deformation: standard deviation of the relative displacement of two points, metres per square root
    /// of the distance in metres; 0 if unknown.
    pub bend: f64,
    /// The standard deviation of the relative rotation of two points, radians per square root of the distance in
    /// metres.
    pub turn: f64,
}

/// The sharpness of walls that several maps show.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Sharpness {
    /// The mean distance between the two images of a wall, perpendicular to it, metres.
    pub apart: f64,
    /// The double-wall ratio: the share of the walls whose two images look like two walls, 0 to 1.
    pub doubled: f64,
}

ros_messages!("gridweave_msgs": MapDeformation);
