//! What to say where several programs publish what belongs to one robot.

use super::liveliness::Entity;
use gridweave_runtime::pipeline::list_in_words;

/// What to warn of where these programs publish a topic of one robot.
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
    use super::super::census::tests::publisher;
    use super::*;

    #[test]
    fn programs_are_named_by_their_nodes_and_one_that_has_crashed_is_thought_of() {
        let known = publisher(["/robot1", "slam"], "/robot1/map", "nav_msgs/msg/OccupancyGrid", 1);
        let nameless = Entity { node: String::new(), session: "0f".into(), ..known.clone() };
        let text = warning("/robot1/map", &[&known, &nameless]);
        for words in ["2 programs at once, /robot1/slam and a program", "the session 0f", "until its lease ends"] {
            assert!(text.contains(words), "{text}");
        }
        assert!(!warning("/robot1/map", &[&known, &known]).contains("session"));
    }
}
