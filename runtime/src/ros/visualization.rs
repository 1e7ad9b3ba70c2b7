//! `visualization_msgs`: shapes that RViz and Foxglove draw. Unused fields are always empty.

use super::{Header, Point, Pose, Vector3, ros_messages};
use serde::{Deserialize, Serialize};

/// `std_msgs/msg/ColorRGBA`, each part 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct ColorRGBA {
    pub r: f32,
    pub g: f32,
    pub b: f32,
    pub a: f32,
}

/// `builtin_interfaces/msg/Duration`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct Duration {
    pub sec: i32,
    pub nanosec: u32,
}

/// `visualization_msgs/msg/Marker`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Marker {
    /// Time, and the frame that the shape is in.
    pub header: Header,
    /// The namespace of the shape; viewers can hide shapes by namespace.
    pub ns: String,
    /// The id of the shape in its namespace.
    pub id: i32,
    /// The type of the shape: see the constants.
    #[serde(rename = "type")]
    pub shape: i32,
    /// The action: [`ADD`](Self::ADD), [`DELETE`](Self::DELETE) or [`DELETE_ALL`](Self::DELETE_ALL).
    pub action: i32,
    /// The pose of the shape.
    pub pose: Pose,
    /// The side lengths; for lines, x is the width; for text, z is the height. Metres.
    pub scale: Vector3,
    /// The colour, if the points have no colours.
    pub color: ColorRGBA,
    /// How long it is shown; zero means forever.
    pub lifetime: Duration,
    /// Whether it moves with its frame.
    pub frame_locked: bool,
    /// The points of list types.
    pub points: Vec<Point>,
    /// The colours of the points; empty for the colour of the shape.
    pub colors: Vec<ColorRGBA>,
    /// Empty.
    pub texture_resource: String,
    /// Empty.
    pub texture: CompressedImage,
    /// Empty.
    pub uv_coordinates: Vec<UVCoordinate>,
    /// The text of a text shape.
    pub text: String,
    /// Empty.
    pub mesh_resource: String,
    /// Empty.
    pub mesh_file: MeshFile,
    /// False.
    pub mesh_use_embedded_materials: bool,
}

impl Marker {
    /// An arrow along x.
    pub const ARROW: i32 = 0;
    /// An ellipsoid.
    pub const SPHERE: i32 = 2;
    /// A line between each two points.
    pub const LINE_LIST: i32 = 5;
    /// A sphere at each point.
    pub const SPHERE_LIST: i32 = 7;
    /// Text that faces the viewer.
    pub const TEXT: i32 = 9;
    /// Adds the shape, or replaces the one with the same namespace and id.
    pub const ADD: i32 = 0;
    /// Deletes the shape with the same namespace and id.
    pub const DELETE: i32 = 2;
    /// Deletes all shapes of the topic.
    pub const DELETE_ALL: i32 = 3;
}

/// `sensor_msgs/msg/CompressedImage`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct CompressedImage {
    pub header: Header,
    pub format: String,
    pub data: Vec<u8>,
}

/// `visualization_msgs/msg/UVCoordinate`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct UVCoordinate {
    pub u: f32,
    pub v: f32,
}

/// `visualization_msgs/msg/MeshFile`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct MeshFile {
    pub filename: String,
    pub data: Vec<u8>,
}

/// `visualization_msgs/msg/MarkerArray`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MarkerArray {
    /// The shapes.
    pub markers: Vec<Marker>,
}

ros_messages!("visualization_msgs": MarkerArray);
