//! The subscriptions of the doctor: the sizes and frames of the robots' maps, and the roots of their tf trees.

use super::node_identity::Owner;
use super::publishers::{Published, Topics};
use crate::middleware::Middleware;
use crate::node::{Node, Subscriber};
use crate::qos::Qos;
use gridweave_runtime::pipeline::list_in_words;
use gridweave_runtime::ros::{OccupancyGrid, RosMessage, TFMessage, decode};
use gridweave_runtime::stage::{RobotTopics, StageError, match_robot};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The topics of transforms.
const TF: [&str; 2] = ["tf", "tf_static"];

/// Subscriptions to maps and transforms, and what they received.
#[derive(Default)]
pub(crate) struct DoctorSubscriptions {
    subscribers: BTreeMap<(String, Middleware), Subscriber>,
    received: Arc<Mutex<Received>>,
}

#[derive(Debug, Default)]
struct Received {
    /// The description of the map on each topic.
    maps: BTreeMap<String, String>,
    /// The frames that are parents, and those that are children, by the namespace of their topics.
    frames: BTreeMap<String, [BTreeSet<String>; 2]>,
}

impl DoctorSubscriptions {
    /// Subscribes to the maps and transforms that are published.
    ///
    /// # Errors
    /// The session has failed.
    pub(crate) fn subscribe(
        &mut self,
        node: &mut Node,
        topics: &Topics,
        robots: &RobotTopics,
    ) -> Result<(), StageError> {
        for (name, of_topic) in topics {
            let is_map = match_robot(&robots.map, name).is_some();
            if !is_map && tf_namespace(name).is_none() {
                continue;
            }
            let expected = if is_map { OccupancyGrid::NAME } else { TFMessage::NAME };
            let is_one = |of: &&Published| of.owner == Owner::Other && of.ros_type == expected;
            for published in of_topic.iter().filter(is_one) {
                let key = (name.clone(), published.middleware);
                if self.subscribers.contains_key(&key) {
                    continue;
                }
                let alike = || of_topic.iter().filter(is_one).filter(|of| of.middleware == published.middleware);
                let qos = Qos {
                    is_reliable: alike().all(|of| of.qos.is_reliable),
                    is_latched: alike().all(|of| of.qos.is_latched),
                    depth: published.qos.depth,
                };
                let (to, topic) = (Arc::clone(&self.received), name.clone());
                let call = move |message: crate::node::Received| lock(&to).note(&topic, is_map, &message.content());
                let subscriber = node.subscribe(published.middleware, published.topic(name), qos, call)?;
                self.subscribers.insert(key, subscriber);
            }
        }
        Ok(())
    }

    /// The description of the map on a topic.
    pub(crate) fn map(&self, topic: &str) -> String {
        lock(&self.received).maps.get(topic).cloned().unwrap_or_else(|| "which has not come yet".to_owned())
    }

    /// The roots of the tf tree of a robot, if it has one.
    pub(crate) fn tree(&self, robot: &str) -> String {
        let namespace = format!("/{robot}");
        lock(&self.received)
            .roots(&namespace)
            .map(|roots| format!(", and tf on {namespace}/tf from {roots} on"))
            .unwrap_or_default()
    }

    /// The roots of the frames on `/tf`.
    pub(crate) fn shared_tree(&self) -> Option<String> {
        lock(&self.received).roots("").map(|roots| format!("frames on /tf begin with {roots}"))
    }
}

impl Received {
    fn note(&mut self, topic: &str, is_map: bool, message: &[u8]) {
        if is_map {
            let text = match decode::<OccupancyGrid<'_>>(message) {
                Ok(map) => {
                    let (info, frame) = (&map.info, &map.header.frame_id);
                    format!("{} x {} cells of {} m in the frame `{frame}`", info.width, info.height, info.resolution)
                }
                Err(error) => format!("which cannot be read: {error}"),
            };
            self.maps.insert(topic.to_owned(), text);
        } else if let (Some(namespace), Ok(message)) = (tf_namespace(topic), decode::<TFMessage>(message)) {
            let [parents, children] = self.frames.entry(namespace.to_owned()).or_default();
            for transform in message.transforms {
                parents.insert(transform.header.frame_id);
                children.insert(transform.child_frame_id);
            }
        }
    }

    /// The frames of a namespace that have no parent.
    fn roots(&self, namespace: &str) -> Option<String> {
        let [parents, children] = self.frames.get(namespace)?;
        let roots = parents.difference(children).map(|frame| format!("`{frame}`"));
        Some(list_in_words(roots)).filter(|roots| !roots.is_empty())
    }
}

/// The namespace of a topic of transforms, nothing for the root.
fn tf_namespace(topic: &str) -> Option<&str> {
    topic.rsplit_once('/').filter(|(_, name)| TF.contains(name)).map(|(namespace, _)| namespace)
}

fn lock(received: &Mutex<Received>) -> MutexGuard<'_, Received> {
    received.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_runtime::message::LogTime;
    use gridweave_runtime::ros::{Header, MapMetaData, TransformStamped, encode};

    #[test]
    fn a_map_is_described_by_its_size_and_frame_and_a_tree_by_its_roots() {
        let subscriptions = DoctorSubscriptions::default();
        let info = MapMetaData { width: 3, height: 1, resolution: 0.5, ..Default::default() };
        let map = OccupancyGrid { header: Header::new(LogTime(1), "map"), info, data: &[0; 3] };
        let transform = |parent: &str, child: &str| TransformStamped {
            header: Header::new(LogTime(1), parent),
            child_frame_id: child.into(),
            ..Default::default()
        };
        let transforms = vec![transform("odom", "base_link"), transform("map", "odom")];
        lock(&subscriptions.received).note("/robot1/map", true, &encode(&map).unwrap());
        lock(&subscriptions.received).note("/robot1/tf", false, &encode(&TFMessage { transforms }).unwrap());
        assert_eq!(subscriptions.map("/robot1/map"), "3 x 1 cells of 0.5 m in the frame `map`");
        assert_eq!(subscriptions.tree("robot1"), ", and tf on /robot1/tf from `map` on");
        assert!(subscriptions.map("/robot2/map").contains("not come") && subscriptions.shared_tree().is_none());
    }
}
