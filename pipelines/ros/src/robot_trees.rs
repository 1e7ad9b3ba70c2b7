//! The tf trees of single robots: on `/robot1/tf`, with frames without the robot's name.

use super::discovery::node_identity::Owner;
use super::liveliness::{Entity, Kind};
use super::node::Node;
use gridweave_logs::tf::tf_topic;
use gridweave_runtime::message::Channel;
use gridweave_runtime::ros::TransformStamped;
use gridweave_runtime::stage::StageError;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

/// The discovered robots that have their own tf tree.
#[derive(Debug)]
pub(crate) struct RobotTrees {
    /// The namespace of the tree, by robot.
    seen: Arc<Mutex<BTreeMap<String, String>>>,
}

impl RobotTrees {
    /// Watches for robots with their own tf tree.
    ///
    /// # Errors
    /// The session has failed.
    pub(crate) fn watch(node: &Node) -> Result<Self, StageError> {
        let seen = Arc::<Mutex<BTreeMap<String, String>>>::default();
        let (to, own, name) = (Arc::clone(&seen), node.session_names(), node.name().clone());
        node.watch(move |_, entity, is_present| {
            // What another run publishes in the tree of a robot makes none.
            let is_other = is_present && !own.contains(&entity.session) && name.owner(&entity) == Owner::Other;
            if let Some((robot, namespace)) = robot_tree(&entity).filter(|_| is_other) {
                to.lock().unwrap_or_else(PoisonError::into_inner).insert(robot, namespace);
            }
        })?;
        Ok(Self { seen })
    }

    /// The discovered robots, each with the topic of static transforms of its tree.
    pub(crate) fn topics(&self) -> Vec<(String, String)> {
        let seen = self.seen.lock().unwrap_or_else(PoisonError::into_inner);
        seen.iter().map(|(robot, namespace)| (robot.clone(), format!("{namespace}/tf_static"))).collect()
    }
}

/// The robot that publishes its own tf tree, and its namespace.
fn robot_tree(entity: &Entity) -> Option<(String, String)> {
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

/// A transform to a frame of a robot, with the name of the frame in the robot's tree; `None` for the frame of another
/// robot.
pub(crate) fn in_robot_tree(robot: &str, transform: &TransformStamped) -> Option<TransformStamped> {
    let child_frame_id = transform.child_frame_id.strip_prefix(robot)?.strip_prefix('/')?.to_owned();
    Some(TransformStamped { child_frame_id, ..transform.clone() })
}
