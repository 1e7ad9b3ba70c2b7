//! Robot poses from tf, the tree of frames that ROS programs publish edge by edge.

mod components;

use crate::robot_name::fits;
use crate::schemas::full_type_name;
use components::Components;
use gridweave_runtime::message::Channel;
use gridweave_runtime::ros::{Header, Point, Pose, PoseStamped, Quaternion, RosMessage, TFMessage, Time, Transform};
use gridweave_runtime::stage::{TfFrames, frame_of_robot, match_robot};
use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use std::collections::{BTreeMap, BTreeSet};

/// The prefix of the frames in a channel's transforms; `None` if it carries no transforms. On `/tf` and `/tf_static`
/// frames have full names; on `/robot1/tf` and `/robot1/tf_static` they lack the prefix `robot1/`.
pub fn tf_topic(channel: &Channel) -> Option<&str> {
    let is_tf = channel.message_encoding == "cdr" && full_type_name(&channel.schema_name) == TFMessage::NAME;
    let (namespace, last) = channel.topic.rsplit_once('/').filter(|_| is_tf)?;
    let robot = namespace.rsplit_once('/').map_or(namespace, |(_, robot)| robot);
    matches!(last, "tf" | "tf_static").then_some(robot)
}

/// Whether the transforms on a tf topic are static.
pub fn is_static(topic: &str) -> bool {
    topic.ends_with("tf_static")
}

/// The key in the metadata of an announced channel of transforms under which a source names the map frames of robots, a
/// line for each. A sink needs them before the first transform, and maps may come late.
pub(crate) const MAP_FRAMES: &str = "gridweave_map_frames";

/// The maximum number of transforms between two frames, as in tf2. More are no robot, and each message would follow all
/// of them.
const LONGEST_PATH: usize = 1000;

/// The latest transform of each frame to its parent.
#[derive(Clone, Debug, Default)]
pub struct FrameTree {
    /// By child frame.
    edges: BTreeMap<String, Edge>,
}

#[derive(Clone, Debug)]
struct Edge {
    parent: String,
    transform_parent_child: Isometry3<f64>,
    /// Whether the transform is static.
    is_static: bool,
}

/// The pose of one frame in another, and the edges between them.
struct Chain<'a> {
    transform_target_source: Isometry3<f64>,
    /// The child frames of the edges, from the source to the target.
    children: Vec<&'a str>,
}

impl FrameTree {
    /// Adds an edge, replacing that of the child frame. Returns `false` if it is invalid: a value is not finite, or
    /// parent and child are the same frame.
    pub fn insert(&mut self, parent: &str, child: &str, transform: &Transform, is_static: bool) -> bool {
        self.add(parent, child, transform, is_static).is_some()
    }

    /// The same. Returns whether the frames are connected otherwise than before; `None` if the edge is invalid.
    fn add(&mut self, parent: &str, child: &str, transform: &Transform, is_static: bool) -> Option<bool> {
        let transform_parent_child = isometry(transform).filter(|_| parent != child && !child.is_empty())?;
        Some(match self.edges.get_mut(child) {
            Some(edge) => {
                edge.transform_parent_child = transform_parent_child;
                edge.is_static = is_static;
                let has_moved = edge.parent != parent;
                if has_moved {
                    parent.clone_into(&mut edge.parent);
                }
                has_moved
            }
            None => {
                let edge = Edge { parent: parent.to_owned(), transform_parent_child, is_static };
                self.edges.insert(child.to_owned(), edge);
                true
            }
        })
    }

    /// The pose of the frame `source` in the frame `target`; `None` if they are not connected, or by more than 1000
    /// transforms.
    pub fn lookup(&self, target: &str, source: &str) -> Option<Isometry3<f64>> {
        self.chain(target, source).map(|chain| chain.transform_target_source)
    }

    fn chain<'a>(&'a self, target: &'a str, source: &'a str) -> Option<Chain<'a>> {
        let to_root: Vec<_> = self.ancestors(source).collect();
        // In a cycle a frame comes again; what counts is the first time.
        let mut places = BTreeMap::new();
        for (place, (frame, _)) in to_root.iter().enumerate() {
            places.entry(*frame).or_insert(place);
        }
        // The two paths meet at the first ancestor of the target that is also one of the source's.
        for (steps, (frame, transform_ancestor_target)) in self.ancestors(target).enumerate() {
            let Some(&meeting) = places.get(frame) else { continue };
            let mut to_target: Vec<&str> = self.ancestors(target).take(steps).map(|(frame, _)| frame).collect();
            to_target.reverse();
            let from_source = to_root[..meeting].iter().map(|(frame, _)| *frame);
            return Some(Chain {
                transform_target_source: transform_ancestor_target.inverse() * to_root[meeting].1,
                children: from_source.chain(to_target).collect(),
            });
        }
        None
    }

    /// The child frame of the edge that moves the source: the first that is not static.
    fn moving<'a>(&self, chain: &Chain<'a>) -> Option<&'a str> {
        let moves = |child: &&&str| self.edges.get(**child).is_some_and(|edge| !edge.is_static);
        chain.children.iter().find(moves).or(chain.children.first()).copied()
    }

    /// `frame` and its ancestors, each with the pose of `frame` in it, up to the maximum that is followed.
    fn ancestors<'a>(&'a self, frame: &'a str) -> impl Iterator<Item = (&'a str, Isometry3<f64>)> {
        let step = |(child, transform): &(&'a str, Isometry3<f64>)| {
            let edge = self.edges.get(*child)?;
            Some((edge.parent.as_str(), edge.transform_parent_child * transform))
        };
        // A path with more steps than there are edges is a cycle.
        std::iter::successors(Some((frame, Isometry3::identity())), step).take(self.edges.len().min(LONGEST_PATH) + 1)
    }
}

/// `None` if a value is not finite. A zero quaternion, which many programs write, is read as no rotation.
pub(crate) fn isometry(transform: &Transform) -> Option<Isometry3<f64>> {
    let (t, r) = (transform.translation, transform.rotation);
    let finite = [t.x, t.y, t.z, r.x, r.y, r.z, r.w].iter().all(|value| value.is_finite());
    let quaternion = nalgebra::Quaternion::new(r.w, r.x, r.y, r.z);
    let rotation = UnitQuaternion::try_new(quaternion, 1e-12).unwrap_or_default();
    finite.then(|| Isometry3::from_parts(Translation3::new(t.x, t.y, t.z), rotation))
}

/// An isometry as a pose.
pub(crate) fn pose(isometry: &Isometry3<f64>) -> Pose {
    let (t, r) = (&isometry.translation, &isometry.rotation);
    Pose { position: Point { x: t.x, y: t.y, z: t.z }, orientation: Quaternion { x: r.i, y: r.j, z: r.k, w: r.w } }
}

/// Derives the pose of each robot's base in its map whenever tf moves the base.
///
/// A base moves in the odometry frame, and a SLAM system corrects the pose of that frame in the map. A correction alone
/// gives no pose: combined with an earlier movement it would be a pose of no particular time, and many systems date
/// their corrections into the future.
#[derive(Clone, Debug, Default)]
pub struct TfPoses {
    /// The frame patterns of robots that are not known yet.
    frames: Option<TfFrames>,
    tree: FrameTree,
    components: Components,
    /// The known robots: with `frames`, those of which one of the two frames was seen.
    robots: BTreeMap<String, KnownRobot>,
}

/// A robot, with the numbers of its frames in the components.
#[derive(Clone, Debug)]
struct KnownRobot {
    frames: PoseFrames,
    map: usize,
    bases: Vec<usize>,
}

impl KnownRobot {
    fn new(frames: PoseFrames, components: &mut Components) -> Self {
        let map = components.number(&frames.map);
        let bases = frames.bases.iter().map(|base| components.number(base)).collect();
        Self { frames, map, bases }
    }

    /// Whether transforms in some sets of frames may have moved a base in the map, or have shown which base it is.
    fn may_have_moved(&self, components: &Components, changed: &BTreeSet<usize>) -> bool {
        let set = components.set_of(self.map);
        let is_connected = self.bases.iter().any(|base| components.set_of(*base) == set);
        is_connected && (self.bases.len() > 1 || changed.contains(&set))
    }
}

/// The frames between which a robot's pose is looked up.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PoseFrames {
    /// The map frame.
    pub map: String,
    /// Candidates for the base frame. The first that is connected to the map frame is used from then on.
    pub bases: Vec<String>,
}

impl TfPoses {
    /// Poses between the two frames, in which `{robot}` is the robot's name.
    pub fn new(frames: TfFrames) -> Self {
        Self { frames: Some(frames), ..Self::default() }
    }

    /// Sets the robots to derive poses of. Known base frames are kept.
    pub fn set_robots(&mut self, robots: BTreeMap<String, PoseFrames>) {
        let mut known = std::mem::take(&mut self.robots);
        let components = &mut self.components;
        let with_known = robots.into_iter().map(|(robot, pose_frames)| {
            let known = known.remove(&robot).unwrap_or_else(|| KnownRobot::new(pose_frames, components));
            (robot, known)
        });
        self.robots = with_known.collect();
    }

    /// Adds a tf message whose frames lack `prefix` (empty: none). Returns the derived poses, by robot, and the number
    /// of invalid transforms.
    pub fn update(
        &mut self,
        prefix: &str,
        is_static: bool,
        message: &TFMessage,
    ) -> (Vec<(String, PoseStamped)>, usize) {
        let mut changed: BTreeMap<String, Time> = BTreeMap::new();
        let mut unusable = 0;
        for edge in &message.transforms {
            let parent = frame_of_robot(prefix, &edge.header.frame_id);
            let child = frame_of_robot(prefix, &edge.child_frame_id);
            let Some(is_new) = self.tree.add(&parent, &child, &edge.transform, is_static) else {
                unusable += 1;
                continue;
            };
            if is_new {
                self.components.connect(&parent, &child);
            }
            self.recognise(&parent);
            self.recognise(&child);
            changed.insert(child.into_owned(), edge.header.stamp);
        }
        (self.poses(&changed), unusable)
    }

    fn recognise(&mut self, frame: &str) {
        let Some(frames) = &self.frames else { return };
        for pattern in [&frames.map_frame, &frames.base_frame] {
            if let Some(robot) = match_robot(pattern, frame)
                && fits(robot)
                && !self.robots.contains_key(robot)
            {
                let named = |pattern: &str| pattern.replace("{robot}", robot);
                let pose_frames = PoseFrames { map: named(&frames.map_frame), bases: vec![named(&frames.base_frame)] };
                let known = KnownRobot::new(pose_frames, &mut self.components);
                self.robots.insert(robot.to_owned(), known);
            }
        }
    }

    fn poses(&mut self, changed: &BTreeMap<String, Time>) -> Vec<(String, PoseStamped)> {
        let (tree, components) = (&self.tree, &mut self.components);
        let numbers: Vec<usize> = changed.keys().map(|frame| components.number(frame)).collect();
        let sets: BTreeSet<usize> = numbers.into_iter().map(|number| components.set_of(number)).collect();
        let pose_of = |(robot, known): (&String, &mut KnownRobot)| {
            if !known.may_have_moved(components, &sets) {
                return None;
            }
            let pose_frames = &mut known.frames;
            if pose_frames.bases.len() > 1 {
                let is_connected = |base: &String| tree.chain(&pose_frames.map, base).is_some();
                let connected = pose_frames.bases.iter().position(is_connected)?;
                pose_frames.bases = vec![pose_frames.bases.swap_remove(connected)];
                known.bases = vec![known.bases.swap_remove(connected)];
            }
            let chain = tree.chain(&pose_frames.map, pose_frames.bases.first()?)?;
            let stamp = changed.get(tree.moving(&chain)?)?;
            let header = Header { stamp: *stamp, frame_id: pose_frames.map.clone() };
            Some((robot.clone(), PoseStamped { header, pose: pose(&chain.transform_target_source) }))
        };
        self.robots.iter_mut().filter_map(pose_of).collect()
    }

    /// The known robots, by name.
    pub fn robots(&self) -> impl Iterator<Item = &str> {
        self.robots.keys().map(String::as_str)
    }

    /// Whether a robot is known.
    pub fn knows(&self, robot: &str) -> bool {
        self.robots.contains_key(robot)
    }

    /// The map frame of a robot.
    pub fn map_frame(&self, robot: &str) -> Option<&str> {
        self.robots.get(robot).map(|known| known.frames.map.as_str())
    }

    /// Sets the map frame of a robot.
    pub fn set_map_frame(&mut self, robot: &str, frame: &str) {
        if let Some(known) = self.robots.get_mut(robot) {
            frame.clone_into(&mut known.frames.map);
            known.map = self.components.number(frame);
        }
    }

    /// The base frame of a robot, once it is known which of several it is.
    pub fn base_of(&self, robot: &str) -> Option<&str> {
        match &self.robots.get(robot)?.frames.bases[..] {
            [base] => Some(base),
            _ => None,
        }
    }

    /// Whether any transform was added that ties the map frame of a robot to another frame.
    pub fn has_map_frame(&self, robot: &str) -> bool {
        self.robots.get(robot).is_some_and(|known| self.components.is_connected(known.map))
    }

    /// Whether any transform was added.
    pub fn has_frames(&self) -> bool {
        !self.tree.edges.is_empty()
    }

    /// The robots of which a frame was seen and whose base was never connected to their map.
    pub fn robots_without_pose(&self) -> BTreeSet<&str> {
        let unconnected = |(_, known): &(&String, &KnownRobot)| {
            let PoseFrames { map, bases } = &known.frames;
            bases.iter().all(|base| self.tree.chain(map, base).is_none())
        };
        self.robots.iter().filter(unconnected).map(|(robot, _)| robot.as_str()).collect()
    }
}

#[cfg(test)]
mod tests;
