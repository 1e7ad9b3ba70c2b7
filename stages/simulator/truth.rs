//! What a merge is measured against.

use crate::geometry::{Point2, Pose2};
use serde_json::{Map, Value, json};

/// The truth of a simulation.
#[derive(Clone, Debug, PartialEq)]
pub struct Truth {
    /// Metres a cell of the first robot's map.
    pub resolution: f64,
    /// `T_robot1_robotN`: the pose of every robot's map frame in the first robot's map frame.
    pub frames: Vec<(String, Pose2)>,
    /// Where the tags are in the first robot's map frame, metres.
    pub tags: Vec<(String, Point2)>,
    /// The middle of each robot's last map, in its own map frame, metres.
    pub centres: Vec<(String, Point2)>,
}

impl Truth {
    /// The truth as a JSON object: `resolution`, `frames` (robot to x, y, yaw), `tags` (id to x, y), `note` and
    /// `centres` (robot to x, y).
    pub fn to_json(&self) -> Value {
        let frame =
            |pose: &Pose2| json!({ "x": pose.translation.x, "y": pose.translation.y, "yaw": pose.rotation.angle() });
        json!({
            "resolution": self.resolution,
            "frames": object(&self.frames, frame),
            "tags": object(&self.tags, |point| json!([point.x, point.y])),
            "note": "frames: pose of each robot's map frame in robot1's map frame, metres and radians; tags in robot1's \
                     map frame; centres: middle of each robot's last map, in its own map frame (errors are taken there)",
            "centres": object(&self.centres, |point| json!([point.x, point.y])),
        })
    }
}

fn object<T>(entries: &[(String, T)], value: impl Fn(&T) -> Value) -> Value {
    Value::Object(entries.iter().map(|(name, entry)| (name.clone(), value(entry))).collect::<Map<_, _>>())
}
