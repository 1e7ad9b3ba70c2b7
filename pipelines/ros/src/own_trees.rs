//! Trees of frames that robots have for themselves: on `/robot1/tf`, with frames that do not bear the robot's name.

use super::liveliness::{Entity, Kind};
use super::node::Node;
use gridweave_logs::tf::tf_topic;
use gridweave_runtime::message::Channel;
use gridweave_runtime::ros::TransformStamped;
use gridweave_runtime::stage::StageError;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

/// The robots that have a tree of their own, as far as they were seen.
#[derive(Debug)]
pub(crate) struct OwnTrees {
    /// By robot, the namespace that its tree is in.
    seen: Arc<Mutex<BTreeMap<String, String>>>,
}

impl OwnTrees {
    /// Looks out for them.
    ///
    /// # Errors
    /// The session has failed.
    pub(crate) fn watch(node: &Node) -> Result<Self, StageError> {
        let seen = Arc::<Mutex<BTreeMap<String, String>>>::default();
        let (to, own) = (Arc::clone(&seen), node.session_name().to_owned());
        node.watch(move |entity, is_there| {
            if let Some((robot, namespace)) = own_tree(&entity).filter(|_| is_there && entity.session != own) {
                to.lock().unwrap_or_else(PoisonError::into_inner).insert(robot, namespace);
            }
        })?;
        Ok(Self { seen })
    }

    /// The robots that were seen so far, each with the topic of static transforms in its tree.
    pub(crate) fn topics(&self) -> Vec<(String, String)> {
        let seen = self.seen.lock().unwrap_or_else(PoisonError::into_inner);
        seen.iter().map(|(robot, namespace)| (robot.clone(), format!("{namespace}/tf_static"))).collect()
    }
}

/// The robot that publishes a tree of its own, and the namespace that it is in.
fn own_tree(entity: &Entity) -> Option<(String, String)> {
    let Kind::Publisher(topic, _) = &entity.kind else { return None };
    let channel = Channel {
        topic: topic.name.clone(),
        message_encoding: "cdr".to_owned(),
        schema_name: topic.ros_type.clone(),
        ..Default::default()
    };
    let robot = tf_topic(&channel).filter(|robot| !robot.is_empty())?.to_owned();
    let (namespace, _) = topic.name.rsplit_once('/')?;
    Some((robot, namespace.to_owned()))
}

/// A transform to a frame of a robot as that is called in the robot's own tree; `None` if it is the frame of another.
pub(crate) fn in_own_tree(robot: &str, transform: &TransformStamped) -> Option<TransformStamped> {
    let child_frame_id = transform.child_frame_id.strip_prefix(robot)?.strip_prefix('/')?.to_owned();
    Some(TransformStamped { child_frame_id, ..transform.clone() })
}
