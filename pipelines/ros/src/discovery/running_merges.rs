//! The robots that runs of Gridweave read already, for the verb `doctor`.

use super::node_identity::Owner;
use crate::liveliness::{Entity, Kind};
use gridweave_runtime::pipeline::list_in_words;
use std::collections::BTreeSet;

/// The subscribers of other runs.
#[derive(Debug, Default)]
pub(crate) struct RunningMerges(BTreeSet<Entity>);

impl RunningMerges {
    /// Records that an entity has appeared, or has gone.
    pub(crate) fn note(&mut self, entity: &Entity, owner: Owner, is_there: bool) {
        if owner != Owner::OtherRun || !matches!(entity.kind, Kind::Subscriber(..)) {
            return;
        }
        match is_there {
            true => self.0.insert(entity.clone()),
            false => self.0.remove(entity),
        };
    }

    /// Says which nodes read robots, each given with the topic of its map or scans, if they read at least two of them.
    /// Nodes with the name `own` only look, too.
    pub(crate) fn text(&self, robots: &[(String, String)], own: &str) -> Option<String> {
        let mut nodes = BTreeSet::new();
        let (mut read, mut others) = (Vec::new(), Vec::new());
        for (robot, topic) in robots {
            let is_of = |entity: &&Entity| {
                entity.node != own && matches!(&entity.kind, Kind::Subscriber(of, _) if of.name == *topic)
            };
            let readers: BTreeSet<String> = self.0.iter().filter(is_of).map(Entity::full_node_name).collect();
            if readers.is_empty() { &mut others } else { &mut read }.push(robot);
            nodes.extend(readers);
        }
        if read.len() < 2 {
            return None;
        }
        let mut text = format!(
            "a run of Gridweave reads {} already, by {}: it merges them, and a second run would do it again",
            list_in_words(read),
            list_in_words(&nodes)
        );
        if !others.is_empty() {
            text.push_str(&format!("; it does not read {}", list_in_words(others)));
        }
        Some(text)
    }
}

#[cfg(test)]
mod tests {
    use super::super::publishers::tests::publisher;
    use super::*;

    /// A subscriber of a topic.
    fn subscriber(node: &str, topic: &str, number: u32) -> Entity {
        let mut entity = publisher(["/", node], topic, "nav_msgs/msg/OccupancyGrid", number);
        if let Kind::Publisher(topic, qos) = entity.kind {
            entity.kind = Kind::Subscriber(topic, qos);
        }
        entity
    }

    #[test]
    fn robots_that_a_run_reads_are_merged_and_those_that_a_viewer_or_another_doctor_reads_are_not() {
        let robots: Vec<(String, String)> =
            ["robot1", "robot2", "robot3"].map(|robot| (robot.to_owned(), format!("/{robot}/map"))).into();
        let text = |merges: &RunningMerges| merges.text(&robots, "gridweave_doctor");
        let mut merges = RunningMerges::default();
        for (number, (_, topic)) in (0..).zip(&robots) {
            merges.note(&subscriber("rviz", topic, number), Owner::Other, true);
            merges.note(&subscriber("gridweave_doctor", topic, 10 + number), Owner::OtherRun, true);
        }
        assert_eq!(text(&merges), None);
        merges.note(&subscriber("gridweave_robots", "/robot1/map", 20), Owner::OtherRun, true);
        assert_eq!(text(&merges), None, "one robot is not merged");
        let second = subscriber("gridweave_robots", "/robot2/map", 21);
        merges.note(&second, Owner::OtherRun, true);
        let said = text(&merges).unwrap();
        for words in ["reads robot1 and robot2 already, by /gridweave_robots:", "it does not read robot3"] {
            assert!(said.contains(words), "{said}");
        }
        merges.note(&second, Owner::OtherRun, false);
        assert_eq!(text(&merges), None);
    }
}
