//! Map frames that the run places in the world: transforms of the input must not give them another parent.

use gridweave_runtime::ros::{RosMessage, TFMessage, decode, encode};
use gridweave_runtime::stage::{Context, match_robot};
use std::collections::BTreeSet;

/// Name of a robot's map frame, unless the pipeline or a transform sets another.
const MAP_FRAME: &str = "{robot}/map";

/// The map frames of robots that the transforms of a run place.
///
/// A frame has one parent: with a recorded `world -> robot1/map` beside that of the run, either would be used at
/// random. Recorded transforms are dropped even for robots that are not merged, since their `world` would be mistaken
/// for that of the run.
pub(crate) struct GivenFrames {
    /// Patterns of map frames, with `{robot}` for any name; empty if the run publishes no transforms.
    pattern: Option<String>,
    /// Frames that transforms of the run have placed.
    named: BTreeSet<String>,
}

impl GivenFrames {
    /// Creates the set for a sink with these inputs.
    pub(crate) fn new(context: &Context) -> Self {
        let gives = context.inputs.iter().any(|wire| !wire.topic.is_empty() && wire.ros_type == TFMessage::NAME);
        let named = context.robots.tf.as_ref().map(|tf| tf.map_frame.clone());
        Self { pattern: gives.then(|| named.unwrap_or_else(|| MAP_FRAME.to_owned())), named: BTreeSet::new() }
    }

    /// Learns the frames in a message of transforms from the run.
    pub(crate) fn learn(&mut self, transforms: &[u8]) {
        if let Ok(message) = decode::<TFMessage>(transforms) {
            self.named.extend(message.transforms.into_iter().map(|edge| edge.child_frame_id));
        }
    }

    /// A message of input transforms without those that place such a frame, and the number of those; `None` if there
    /// are none. The message is empty if no transform is left.
    pub(crate) fn without(&self, transforms: &[u8]) -> Option<(Vec<u8>, usize)> {
        let pattern = self.pattern.as_ref()?;
        let mut message = decode::<TFMessage>(transforms).ok()?;
        let is_given = |frame: &str| match_robot(pattern, frame).is_some() || self.named.contains(frame);
        let before = message.transforms.len();
        message.transforms.retain(|edge| !is_given(&edge.child_frame_id));
        let left_out = before - message.transforms.len();
        if left_out == 0 {
            return None;
        }
        let bytes = if message.transforms.is_empty() { Vec::new() } else { encode(&message).ok()? };
        Some((bytes, left_out))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_runtime::ros::{Header, TransformStamped};
    use gridweave_runtime::stage::InputWire;

    fn transforms(edges: &[(&str, &str)]) -> Vec<u8> {
        let edge = |(parent, child): &(&str, &str)| TransformStamped {
            header: Header { frame_id: (*parent).to_owned(), ..Default::default() },
            child_frame_id: (*child).to_owned(),
            ..Default::default()
        };
        encode(&TFMessage { transforms: edges.iter().map(edge).collect() }).unwrap()
    }

    fn frames(ros_type: &str) -> GivenFrames {
        let wire = InputWire { topic: "/tf_static".into(), ros_type: ros_type.into(), ..Default::default() };
        GivenFrames::new(&Context { inputs: vec![wire], ..Default::default() })
    }

    #[test]
    fn map_frames_lose_the_parents_of_the_input_and_all_else_stays() {
        let mut frames = frames(TFMessage::NAME);
        assert_eq!(
            frames.without(&transforms(&[("robot1/map", "robot1/odom"), ("robot1/odom", "robot1/base_link")])),
            None
        );
        let (rest, left_out) =
            frames.without(&transforms(&[("earth", "robot1/map"), ("robot1/map", "robot1/odom")])).unwrap();
        assert_eq!((rest, left_out), (transforms(&[("robot1/map", "robot1/odom")]), 1));
        assert_eq!(frames.without(&transforms(&[("world", "robot2/map")])).unwrap().0, b"");
        assert_eq!(frames.without(b"cut"), None);
        assert_eq!(frames.without(&transforms(&[("world", "grid_of_robot3")])), None);
        frames.learn(&transforms(&[("world", "grid_of_robot3")]));
        assert!(frames.without(&transforms(&[("earth", "grid_of_robot3")])).is_some());
    }

    #[test]
    fn a_run_without_frames_does_not_change_the_input() {
        assert_eq!(frames("nav_msgs/msg/OccupancyGrid").without(&transforms(&[("world", "robot1/map")])), None);
    }
}
