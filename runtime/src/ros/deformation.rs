//! `gridweave_msgs`: how maps are bent. The `.msg` texts lie in `logs/msg/gridweave_msgs/`.

use super::{Header, ros_messages};
use serde::{Deserialize, Serialize};

/// A node of the lattice that says how a map is bent. What lies around it moves with it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DeformationNode {
    /// Where it stands in the map as it came, metres.
    pub x: f64,
    /// Metres.
    pub y: f64,
    /// By how much it is displaced, metres.
    pub dx: f64,
    /// Metres.
    pub dy: f64,
    /// By how much what lies around it is turned, radians.
    pub dyaw: f64,
    /// Covariance of (dx, dy, dyaw), 3 x 3.
    pub covariance: [f64; 9],
}

/// How one robot's map is bent: where each place of it belongs, before the map is placed in the world as a whole.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MapDeformation {
    /// Time, and the robot's map frame.
    pub header: Header,
    /// Whose map.
    pub robot: String,
    /// From node to node along x and along y, metres.
    pub spacing: f64,
    /// The nodes, on a lattice through the origin of the map frame, row by row. Between them the displacement is bilinear.
    pub nodes: Vec<DeformationNode>,
    /// The length of its walls that were laid on walls of others, metres.
    pub wall_matched: f64,
    /// How the walls that others show as well lie on theirs, as the rigid frames have them.
    pub sharpness_rigid: Sharpness,
    /// The same, as the maps are bent.
    pub sharpness: Sharpness,
    /// How it was found to bend: standard deviation of the displacement of two places against each other, metres for the root
    /// of each metre between them; 0 if that is not known.
    pub bend: f64,
    /// The same of the turn of two places against each other, radians for the root of each metre.
    pub turn: f64,
}

/// How well walls that several maps show come out as one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Sharpness {
    /// The mean distance of one drawing of a wall from the other, across the wall, metres.
    pub apart: f64,
    /// The share of the walls whose two drawings lie so far apart that they look like two walls, 0 to 1.
    pub doubled: f64,
}

ros_messages!("gridweave_msgs": MapDeformation);
