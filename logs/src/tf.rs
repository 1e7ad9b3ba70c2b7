//! Robot poses from tf, the tree of frames that ROS programs publish one edge at a time.

use crate::schemas::full_type_name;
use gridweave_runtime::message::Channel;
use gridweave_runtime::ros::{Header, Point, Pose, PoseStamped, Quaternion, RosMessage, TFMessage, Time, Transform};
use gridweave_runtime::stage::{TfFrames, frame_of_robot, match_robot};
use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use std::collections::{BTreeMap, BTreeSet};

/// Whether transforms come on a channel, and the prefix of the frames in them: `/tf` and `/tf_static` have frames with
/// their full names, `/robot1/tf` and `/robot1/tf_static` frames that lack the `robot1/` before them.
pub fn tf_topic(channel: &Channel) -> Option<&str> {
    let is_tf = channel.message_encoding == "cdr" && full_type_name(&channel.schema_name) == TFMessage::NAME;
    let (namespace, last) = channel.topic.rsplit_once('/').filter(|_| is_tf)?;
    let robot = namespace.rsplit_once('/').map_or(namespace, |(_, robot)| robot);
    matches!(last, "tf" | "tf_static").then_some(robot)
}

/// Whether the transforms on a topic of tf hold for good, as those of sensors on a robot do.
pub fn is_static(topic: &str) -> bool {
    topic.ends_with("tf_static")
}

/// The latest transform of every frame to its parent.
#[derive(Clone, Debug, Default)]
pub struct FrameTree {
    /// By child.
    edges: BTreeMap<String, Edge>,
}

#[derive(Clone, Debug)]
struct Edge {
    parent: String,
    transform_parent_child: Isometry3<f64>,
    /// Whether it holds for good.
    is_static: bool,
}

/// How one frame lies in another, and the edges that say so.
struct Chain<'a> {
    transform_target_source: Isometry3<f64>,
    /// The child frames of the edges between the two, from the source to the target.
    children: Vec<&'a str>,
}

impl FrameTree {
    /// Puts in an edge, in place of the one that the child had; it may hold for good. `false` if it cannot be used: it
    /// has values that are not finite, or ties a frame to itself.
    pub fn insert(&mut self, parent: &str, child: &str, transform: &Transform, is_static: bool) -> bool {
        let Some(transform_parent_child) = isometry(transform).filter(|_| parent != child && !child.is_empty()) else {
            return false;
        };
        match self.edges.get_mut(child) {
            Some(edge) => {
                edge.transform_parent_child = transform_parent_child;
                edge.is_static = is_static;
                if edge.parent != parent {
                    parent.clone_into(&mut edge.parent);
                }
            }
            None => {
                let edge = Edge { parent: parent.to_owned(), transform_parent_child, is_static };
                self.edges.insert(child.to_owned(), edge);
            }
        }
        true
    }

    /// The pose of the frame `source` in the frame `target`; `None` if nothing ties them together.
    pub fn lookup(&self, target: &str, source: &str) -> Option<Isometry3<f64>> {
        self.chain(target, source).map(|chain| chain.transform_target_source)
    }

    fn chain<'a>(&'a self, target: &'a str, source: &'a str) -> Option<Chain<'a>> {
        let to_root: Vec<_> = self.ancestors(source).collect();
        // The first ancestor of the target that is also one of the source's is where the two meet.
        for (steps, (frame, transform_ancestor_target)) in self.ancestors(target).enumerate() {
            let Some(meeting) = to_root.iter().position(|(other, _)| *other == frame) else { continue };
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

    /// The child frame of the edge of a chain that moves the source: the first that does not hold for good.
    fn moving<'a>(&self, chain: &Chain<'a>) -> Option<&'a str> {
        let moves = |child: &&&str| self.edges.get(**child).is_some_and(|edge| !edge.is_static);
        chain.children.iter().find(moves).or(chain.children.first()).copied()
    }

    /// `frame` and then its ancestors, each with the pose of `frame` in it.
    fn ancestors<'a>(&'a self, frame: &'a str) -> impl Iterator<Item = (&'a str, Isometry3<f64>)> {
        let step = |(child, transform): &(&'a str, Isometry3<f64>)| {
            let edge = self.edges.get(*child)?;
            Some((edge.parent.as_str(), edge.transform_parent_child * transform))
        };
        // A path that is longer than there are edges goes round in a circle.
        std::iter::successors(Some((frame, Isometry3::identity())), step).take(self.edges.len() + 1)
    }
}

/// `None` if a value is not finite. A rotation of four zeros, which many programs write, is no rotation.
fn isometry(transform: &Transform) -> Option<Isometry3<f64>> {
    let (t, r) = (transform.translation, transform.rotation);
    let finite = [t.x, t.y, t.z, r.x, r.y, r.z, r.w].iter().all(|value| value.is_finite());
    let quaternion = nalgebra::Quaternion::new(r.w, r.x, r.y, r.z);
    let rotation = UnitQuaternion::try_new(quaternion, 1e-12).unwrap_or_default();
    finite.then(|| Isometry3::from_parts(Translation3::new(t.x, t.y, t.z), rotation))
}

fn pose(isometry: &Isometry3<f64>) -> Pose {
    let (t, r) = (&isometry.translation, &isometry.rotation);
    Pose { position: Point { x: t.x, y: t.y, z: t.z }, orientation: Quaternion { x: r.i, y: r.j, z: r.k, w: r.w } }
}

/// Gives the pose of each robot's base in its map whenever tf says how the base has moved.
///
/// A base moves in a frame of odometry, and a SLAM system corrects how that lies in the map. A correction by itself gives
/// no pose: joined to a movement of before it would be a pose of no time, and many systems date their corrections into
/// the future.
#[derive(Clone, Debug, Default)]
pub struct TfPoses {
    /// What the frames of robots are called that are not known yet.
    frames: Option<TfFrames>,
    tree: FrameTree,
    /// The robots that are known: with `frames`, those of which one of the two was seen.
    robots: BTreeMap<String, Ends>,
}

/// The frames of one robot between which its pose is looked for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Ends {
    /// The frame of its map.
    pub map: String,
    /// The frames that may be that of its base. The first that is tied to the map is, from then on.
    pub bases: Vec<String>,
}

impl TfPoses {
    /// Poses between the two frames, in which `{robot}` stands for the robot's name.
    pub fn new(frames: TfFrames) -> Self {
        Self { frames: Some(frames), ..Self::default() }
    }

    /// Gives poses of these robots. What was learnt of the frames of those that were known stays.
    pub fn set_robots(&mut self, robots: BTreeMap<String, Ends>) {
        let mut known = std::mem::take(&mut self.robots);
        let with_known = robots.into_iter().map(|(robot, ends)| {
            let ends = known.remove(&robot).unwrap_or(ends);
            (robot, ends)
        });
        self.robots = with_known.collect();
    }

    /// Takes up a tf message in which the frames lack the given prefix (empty: none), and which may hold for good. Gives
    /// the poses that it tells, by robot, and how many of its transforms could not be used.
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
            if !self.tree.insert(&parent, &child, &edge.transform, is_static) {
                unusable += 1;
                continue;
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
                && !self.robots.contains_key(robot)
            {
                let named = |pattern: &str| pattern.replace("{robot}", robot);
                let ends = Ends { map: named(&frames.map_frame), bases: vec![named(&frames.base_frame)] };
                self.robots.insert(robot.to_owned(), ends);
            }
        }
    }

    fn poses(&mut self, changed: &BTreeMap<String, Time>) -> Vec<(String, PoseStamped)> {
        let tree = &self.tree;
        let pose_of = |(robot, ends): (&String, &mut Ends)| {
            if ends.bases.len() > 1 {
                let tied = ends.bases.iter().find(|base| tree.chain(&ends.map, base).is_some())?;
                ends.bases = vec![tied.clone()];
            }
            let chain = tree.chain(&ends.map, ends.bases.first()?)?;
            let stamp = changed.get(tree.moving(&chain)?)?;
            let header = Header { stamp: *stamp, frame_id: ends.map.clone() };
            Some((robot.clone(), PoseStamped { header, pose: pose(&chain.transform_target_source) }))
        };
        self.robots.iter_mut().filter_map(pose_of).collect()
    }

    /// The robots that are known, by name.
    pub fn robots(&self) -> impl Iterator<Item = &str> {
        self.robots.keys().map(String::as_str)
    }

    /// Whether a robot is known.
    pub fn knows(&self, robot: &str) -> bool {
        self.robots.contains_key(robot)
    }

    /// The frame of a robot's map.
    pub fn map_frame(&self, robot: &str) -> Option<&str> {
        self.robots.get(robot).map(|ends| ends.map.as_str())
    }

    /// Says what the frame of a robot's map is called.
    pub fn set_map_frame(&mut self, robot: &str, frame: &str) {
        if let Some(ends) = self.robots.get_mut(robot) {
            frame.clone_into(&mut ends.map);
        }
    }

    /// The frame of a robot's base, once it is known which of several it is.
    pub fn base_of(&self, robot: &str) -> Option<&str> {
        match &self.robots.get(robot)?.bases[..] {
            [base] => Some(base),
            _ => None,
        }
    }

    /// Whether any transform has come.
    pub fn has_frames(&self) -> bool {
        !self.tree.edges.is_empty()
    }

    /// The robots of which a frame was seen and whose base was never tied to their map.
    pub fn robots_without_pose(&self) -> BTreeSet<&str> {
        let untied =
            |(_, ends): &(&String, &Ends)| ends.bases.iter().all(|base| self.tree.chain(&ends.map, base).is_none());
        self.robots.iter().filter(untied).map(|(robot, _)| robot.as_str()).collect()
    }
}

#[cfg(test)]
mod tests;
