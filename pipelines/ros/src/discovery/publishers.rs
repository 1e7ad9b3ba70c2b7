//! The publishers of other nodes in a domain.

use super::node_identity::Owner;
use crate::key_expression::Topic;
use crate::liveliness::{Entity, Kind};
use crate::middleware::Middleware;
use crate::qos::Qos;
use std::collections::BTreeMap;

/// The topics that every node publishes.
const OF_EVERY_NODE: [&str; 2] = ["/rosout", "/parameter_events"];

/// The publishers of other nodes, except those that every node has.
#[derive(Debug, Default)]
pub(crate) struct DiscoveredPublishers(BTreeMap<(Middleware, Entity), Owner>);

/// A published topic.
#[derive(Clone, Debug)]
pub(crate) struct Published {
    pub(crate) ros_type: String,
    pub(crate) type_hash: String,
    pub(crate) middleware: Middleware,
    pub(crate) qos: Qos,
    pub(crate) owner: Owner,
    /// The full names of the nodes.
    pub(crate) nodes: Vec<String>,
}

/// The published topics by name; several for one topic where types, QoS or middlewares differ.
pub(crate) type Topics = BTreeMap<String, Vec<Published>>;

impl Published {
    /// The topic of this name.
    pub(crate) fn topic(&self, name: &str) -> Topic {
        Topic { name: name.to_owned(), ros_type: self.ros_type.clone(), type_hash: self.type_hash.clone() }
    }
}

impl DiscoveredPublishers {
    /// Records that an entity has appeared, or has gone.
    pub(crate) fn note(&mut self, middleware: Middleware, entity: Entity, owner: Owner, is_there: bool) {
        let Kind::Publisher(topic, _) = &entity.kind else { return };
        if OF_EVERY_NODE.contains(&topic.name.as_str()) {
            return;
        }
        match is_there {
            true => self.0.insert((middleware, entity), owner),
            false => self.0.remove(&(middleware, entity)),
        };
    }

    /// Whether no robot publishes anything.
    pub(crate) fn has_no_robots(&self) -> bool {
        self.0.values().all(|owner| *owner != Owner::Other)
    }

    /// The published topics.
    pub(crate) fn topics(&self) -> Topics {
        let mut topics = Topics::new();
        for ((middleware, entity), owner) in &self.0 {
            let Kind::Publisher(topic, qos) = &entity.kind else { continue };
            let of_topic = topics.entry(topic.name.clone()).or_default();
            let is_same = |known: &&mut Published| {
                (&known.ros_type, &known.type_hash, known.middleware)
                    == (&topic.ros_type, &topic.type_hash, *middleware)
                    && (known.qos.is_reliable, known.qos.is_latched) == (qos.is_reliable, qos.is_latched)
                    && known.owner == *owner
            };
            match of_topic.iter_mut().find(is_same) {
                Some(known) => known.nodes.push(entity.full_node_name()),
                None => of_topic.push(Published {
                    ros_type: topic.ros_type.clone(),
                    type_hash: topic.type_hash.clone(),
                    middleware: *middleware,
                    qos: *qos,
                    owner: *owner,
                    nodes: vec![entity.full_node_name()],
                }),
            }
        }
        topics
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// The publisher of a topic by a node in a namespace.
    pub(crate) fn publisher([namespace, node]: [&str; 2], topic: &str, ros_type: &str, number: u32) -> Entity {
        Entity {
            domain: 0,
            session: "a".into(),
            node_number: 0,
            number,
            enclave: "/".into(),
            namespace: namespace.into(),
            node: node.into(),
            kind: Kind::Publisher(Topic::known(topic, ros_type).unwrap(), Qos::latched(1)),
        }
    }

    #[test]
    fn nodes_with_equal_publishers_are_listed_together_and_topics_of_every_node_are_left_out() {
        let mut publishers = DiscoveredPublishers::default();
        let text = "std_msgs/msg/String";
        let rosout = publisher(["/", "a"], "/rosout", text, 1);
        publishers.note(Middleware::Dds, rosout, Owner::Other, true);
        let own = publisher(["/", "gridweave_ros"], "/a", text, 2);
        publishers.note(Middleware::Dds, own, Owner::OtherRun, true);
        assert!(publishers.has_no_robots());
        for (number, node) in [(3, "a"), (4, "b")] {
            publishers.note(Middleware::Dds, publisher(["/", node], "/a", text, number), Owner::Other, true);
        }
        publishers.note(Middleware::Zenoh, publisher(["/", "c"], "/a", text, 5), Owner::Other, true);
        publishers.note(Middleware::Zenoh, publisher(["/", "c"], "/b", text, 6), Owner::Other, true);
        publishers.note(Middleware::Zenoh, publisher(["/", "c"], "/b", text, 6), Owner::Other, false);
        let topics = publishers.topics();
        assert!(!publishers.has_no_robots() && topics.len() == 1, "{topics:?}");
        let nodes: Vec<Vec<String>> = topics["/a"].iter().map(|published| published.nodes.clone()).collect();
        assert_eq!(nodes, [vec!["/gridweave_ros"], vec!["/a", "/b"], vec!["/c"]]);
    }
}
