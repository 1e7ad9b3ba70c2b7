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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::pose;

    #[test]
    fn the_truth_has_the_form_of_a_truth_file() {
        let truth = Truth {
            resolution: 0.05,
            frames: vec![("robot1".into(), Pose2::identity()), ("robot2".into(), pose(1.0, 2.0, 0.5))],
            tags: vec![("tag00".into(), Point2::new(3.0, 4.0))],
            centres: vec![("robot1".into(), Point2::new(5.0, 6.0))],
        };
        let json = truth.to_json();
        assert_eq!(json["resolution"], 0.05);
        assert_eq!(json["frames"]["robot2"], json!({ "x": 1.0, "y": 2.0, "yaw": 0.5 }));
        assert_eq!(json["tags"]["tag00"], json!([3.0, 4.0]));
        assert_eq!(json["centres"]["robot1"], json!([5.0, 6.0]));
        assert!(json["note"].is_string());
    }
}
