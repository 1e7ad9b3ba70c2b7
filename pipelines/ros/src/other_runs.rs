//! Other runs of Gridweave that publish what this one publishes, too.

use super::discovery::node_identity::Owner;
use super::liveliness::{Entity, Kind};
use super::node::Node;
use gridweave_runtime::pipeline::list_in_words;
use gridweave_runtime::stage::StageError;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, PoisonError};

/// What other runs publish.
#[derive(Debug)]
pub(crate) struct OtherRuns {
    /// The topics that are theirs, each with the full names of its nodes.
    topics: Arc<Mutex<BTreeMap<String, BTreeSet<String>>>>,
    /// The nodes of which was warned.
    warned: BTreeSet<String>,
}

impl OtherRuns {
    /// Watches for other runs.
    ///
    /// # Errors
    /// The session has failed.
    pub(crate) fn watch(node: &Node) -> Result<Self, StageError> {
        let topics = Arc::<Mutex<BTreeMap<String, BTreeSet<String>>>>::default();
        let (to, name) = (Arc::clone(&topics), node.name().clone());
        node.watch(move |_, entity, is_there| {
            if name.owner(&entity) == Owner::OtherRun {
                note(&mut to.lock().unwrap_or_else(PoisonError::into_inner), &entity, is_there);
            }
        })?;
        Ok(Self { topics, warned: BTreeSet::new() })
    }

    /// What to warn of, once for each node, where one publishes what is published here.
    pub(crate) fn warnings(&mut self, is_published: impl Fn(&str) -> bool) -> Vec<String> {
        let topics = self.topics.lock().unwrap_or_else(PoisonError::into_inner);
        let mut both = BTreeMap::<&String, Vec<String>>::new();
        for (topic, nodes) in topics.iter().filter(|(topic, _)| is_published(topic)) {
            for node in nodes.iter().filter(|node| !self.warned.contains(*node)) {
                both.entry(node).or_default().push(format!("`{topic}`"));
            }
        }
        let text = |(node, topics): (&&String, &Vec<String>)| {
            format!(
                "{node} of another run of Gridweave publishes what this run publishes, at first {}, or it has ended without notice: who \
                 subscribes gets now the one, now the other. End one of the runs, or give one another `domain`, or other topics by \
                 `rename`",
                list_in_words(topics)
            )
        };
        let texts = both.iter().map(text).collect();
        let nodes: Vec<String> = both.into_keys().cloned().collect();
        self.warned.extend(nodes);
        texts
    }
}

fn note(topics: &mut BTreeMap<String, BTreeSet<String>>, entity: &Entity, is_there: bool) {
    let Kind::Publisher(topic, _) = &entity.kind else { return };
    let nodes = topics.entry(topic.name.clone()).or_default();
    match is_there {
        true => nodes.insert(entity.full_node_name()),
        false => nodes.remove(&entity.full_node_name()),
    };
}

#[cfg(test)]
mod tests {
    use super::super::discovery::publishers::tests::publisher;
    use super::*;

    #[test]
    fn a_node_of_another_run_is_reported_once_with_the_common_topics() {
        let mut others = OtherRuns { topics: Arc::default(), warned: BTreeSet::new() };
        let node = ["/", "gridweave_ros"];
        let of = |topic| publisher(node, topic, "nav_msgs/msg/OccupancyGrid", 1);
        for topic in ["/map", "/map_conflicts", "/other"] {
            note(&mut others.topics.lock().unwrap(), &of(topic), true);
        }
        note(&mut others.topics.lock().unwrap(), &of("/map_conflicts"), false);
        assert!(others.warnings(|topic| topic == "/map_conflicts").is_empty());
        let texts = others.warnings(|topic| topic.starts_with("/map"));
        assert!(
            texts.len() == 1 && texts[0].contains("/gridweave_ros of another") && texts[0].contains("at first `/map`"),
            "{texts:?}"
        );
        assert!(others.warnings(|_| true).is_empty());
    }
}
