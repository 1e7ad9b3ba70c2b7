//! Map frames that the run places in the world: transforms of the input must not give them another parent, nor one to
//! the world.

use crate::tf::MAP_FRAMES;
use gridweave_runtime::message::Channel;
use gridweave_runtime::ros::{RobotFrames, RosMessage, TFMessage, decode, encode};
use gridweave_runtime::stage::{Context, match_robot};
use std::collections::{BTreeMap, BTreeSet};

/// Name of a robot's map frame, unless the pipeline, its map or a transform has another.
const MAP_FRAME: &str = "{robot}/map";

/// Why a transform of the input that places a map frame is left out.
const PLACES_MAP: &str = "input transforms that place a robot's map frame were dropped: this run places it";
/// Why one that places the world is left out: map frames in it would be above and below it.
const PLACES_WORLD: &str = "input transforms that place the frame `world` were dropped: this run places the robots' maps in a frame of that name";

/// The map frames of robots that the transforms of a run place.
///
/// A frame has one parent: with a recorded `world -> robot1/map` beside that of the run, either would be used at
/// random. Recorded transforms are dropped even for robots that are not merged, since their `world` would be mistaken
/// for that of the run.
pub(crate) struct GivenFrames {
    /// Patterns of map frames, with `{robot}` for any name; empty if the run publishes no transforms.
    patterns: Vec<String>,
    /// Frames of maps, as a source has announced them, and frames that transforms of the run have placed.
    named: BTreeSet<String>,
    /// The parents of the frames that the input has placed.
    placed_by_input: BTreeMap<String, String>,
}

impl GivenFrames {
    /// Creates the set for a sink with these inputs.
    pub(crate) fn new(context: &Context) -> Self {
        let gives = context.inputs.iter().any(|wire| !wire.topic.is_empty() && wire.ros_type == TFMessage::NAME);
        let named = context.robots.tf.as_ref().map(|tf| tf.map_frame.clone());
        let patterns = if gives { named.into_iter().chain([MAP_FRAME.to_owned()]).collect() } else { Vec::new() };
        Self { patterns, named: BTreeSet::new(), placed_by_input: BTreeMap::new() }
    }

    /// Learns the frames that an announced channel names, and returns the channel as it was logged.
    pub(crate) fn announce(&mut self, channel: &Channel) -> Channel {
        let mut logged = channel.clone();
        if let Some(frames) = logged.metadata.remove(MAP_FRAMES)
            && !self.patterns.is_empty()
        {
            self.named.extend(frames.lines().map(str::to_owned));
        }
        logged
    }

    /// Learns the frames in a message of transforms from the run. Returns those to which the input has given another
    /// parent, once, with both parents.
    pub(crate) fn learn(&mut self, transforms: &[u8]) -> Vec<TwoParents> {
        let Ok(message) = decode::<TFMessage>(transforms) else { return Vec::new() };
        let mut conflicts = Vec::new();
        for edge in message.transforms {
            let (frame, parent) = (edge.child_frame_id, edge.header.frame_id);
            let before = self.placed_by_input.remove(&frame);
            if let Some(of_input) = before.filter(|before| *before != parent) {
                conflicts.push(TwoParents { frame: frame.clone(), of_input, of_run: parent });
            }
            self.named.insert(frame);
        }
        conflicts
    }

    /// A message of input transforms without those that place such a frame or the world, and why each of those is left
    /// out; `None` if there are none. The message is empty if no transform is left.
    pub(crate) fn without(&mut self, transforms: &[u8]) -> Option<(Vec<u8>, Vec<&'static str>)> {
        if self.patterns.is_empty() {
            return None;
        }
        let mut message = decode::<TFMessage>(transforms).ok()?;
        let fits = |frame: &str| self.patterns.iter().any(|pattern| match_robot(pattern, frame).is_some());
        let mut left_out = Vec::new();
        message.transforms.retain(|edge| {
            let child = edge.child_frame_id.trim_start_matches('/');
            let reason = match child == RobotFrames::WORLD {
                true => Some(PLACES_WORLD),
                false => (fits(child) || self.named.contains(child)).then_some(PLACES_MAP),
            };
            left_out.extend(reason);
            reason.is_none()
        });
        for edge in &message.transforms {
            if !self.placed_by_input.contains_key(&edge.child_frame_id) {
                self.placed_by_input.insert(edge.child_frame_id.clone(), edge.header.frame_id.clone());
            }
        }
        if left_out.is_empty() {
            return None;
        }
        let bytes = if message.transforms.is_empty() { Vec::new() } else { encode(&message).ok()? };
        Some((bytes, left_out))
    }
}

/// A frame to which both the input and the run give a parent.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the frame `{frame}` has two parents in the output: `{of_input}` in transforms of the input, until this run placed it in \
     `{of_run}`; for one tree of frames, set `robots.tf` with its pattern as `map_frame`, or give --results-only"
)]
pub(crate) struct TwoParents {
    frame: String,
    of_input: String,
    of_run: String,
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_runtime::ros::{Header, TransformStamped};
    use gridweave_runtime::stage::{InputWire, TfFrames};

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
        assert_eq!((rest, left_out), (transforms(&[("robot1/map", "robot1/odom")]), vec![PLACES_MAP]));
        assert_eq!(frames.without(&transforms(&[("world", "robot2/map")])).unwrap().0, b"");
        assert_eq!(frames.without(b"cut"), None);
        assert_eq!(frames.learn(&transforms(&[("world", "grid_of_robot3")])), []);
        assert!(frames.without(&transforms(&[("earth", "grid_of_robot3")])).is_some());
    }

    #[test]
    fn a_frame_that_the_input_has_placed_before_is_reported_once() {
        let mut frames = frames(TFMessage::NAME);
        assert_eq!(frames.without(&transforms(&[("earth", "robot3/slam"), ("world", "robot4/slam")])), None);
        let placed = transforms(&[("world", "robot3/slam"), ("world", "robot4/slam")]);
        let conflicts: Vec<String> = frames.learn(&placed).iter().map(TwoParents::to_string).collect();
        assert_eq!(conflicts.len(), 1, "{conflicts:?}");
        assert!(conflicts[0].starts_with("the frame `robot3/slam` has two parents in the output: `earth` in"));
        assert_eq!(frames.learn(&placed), []);
        assert!(frames.without(&transforms(&[("earth", "robot3/slam")])).is_some());
    }

    #[test]
    fn a_frame_that_a_source_announces_is_given_from_the_beginning() {
        let logged = Channel { topic: "/tf_static".into(), ..Default::default() };
        let mut announced = logged.clone();
        announced.metadata.insert(MAP_FRAMES.into(), "robot1/slam\nrobot2/grid".into());
        let mut frames = frames(TFMessage::NAME);
        assert_eq!(frames.announce(&announced), logged);
        for frame in ["robot1/slam", "robot2/grid"] {
            assert_eq!(frames.without(&transforms(&[("earth", frame)])).unwrap().0, b"");
        }
    }

    #[test]
    fn the_usual_map_frames_are_given_beside_those_of_the_pipeline() {
        let wire = InputWire { topic: "/tf_static".into(), ros_type: TFMessage::NAME.into(), ..Default::default() };
        let mut context = Context { inputs: vec![wire], ..Default::default() };
        context.robots.tf = Some(TfFrames { map_frame: "{robot}/slam".into(), base_frame: "{robot}/base".into() });
        let mut frames = GivenFrames::new(&context);
        for frame in ["robot1/slam", "robot1/map"] {
            assert!(frames.without(&transforms(&[("earth", frame)])).is_some(), "{frame}");
        }
    }

    #[test]
    fn the_world_gets_no_parent_from_the_input() {
        let mut frames = frames(TFMessage::NAME);
        for child in ["world", "/world"] {
            let edges = transforms(&[("robot1/odom", child), ("robot1/map", "robot1/odom")]);
            let rest = transforms(&[("robot1/map", "robot1/odom")]);
            assert_eq!(frames.without(&edges), Some((rest, vec![PLACES_WORLD])), "{child}");
        }
        assert_eq!(frames.without(&transforms(&[("robot1/map", "worldly")])), None);
    }

    #[test]
    fn a_run_without_frames_does_not_change_the_input() {
        assert_eq!(frames("nav_msgs/msg/OccupancyGrid").without(&transforms(&[("world", "robot1/map")])), None);
    }
}
