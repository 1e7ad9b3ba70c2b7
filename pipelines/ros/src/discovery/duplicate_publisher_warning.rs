//! The warning when several programs publish one topic of a robot.

use crate::liveliness::Entity;
use gridweave_runtime::pipeline::list_in_words;

/// The warning for the publishers of a topic of one robot.
pub(crate) fn warning(topic: &str, publishers: &[&Entity]) -> String {
    let named = |entity: &&Entity| match entity.node.is_empty() {
        true => format!("a program without a node, of the session {}", entity.session),
        false => entity.full_node_name(),
    };
    format!(
        "`{topic}` is published by {} programs at once, {}: are there two robots of one name, or is one of them a program that has ended \
         without notice, which counts until its lease ends? What they say of it is mixed up",
        publishers.len(),
        list_in_words(publishers.iter().map(named))
    )
}

#[cfg(test)]
mod tests {
    use super::super::publishers::tests::publisher;
    use super::*;

    #[test]
    fn programs_are_named_by_their_nodes_and_a_crashed_one_is_considered() {
        let known = publisher(["/robot1", "slam"], "/robot1/map", "nav_msgs/msg/OccupancyGrid", 1);
        let nameless = Entity { node: String::new(), session: "0f".into(), ..known.clone() };
        let text = warning("/robot1/map", &[&known, &nameless]);
        for words in ["2 programs at once, /robot1/slam and a program", "the session 0f", "until its lease ends"] {
            assert!(text.contains(words), "{text}");
        }
        assert!(!warning("/robot1/map", &[&known, &known]).contains("session"));
    }
}
