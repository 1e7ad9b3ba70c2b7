//! What `graph` and `kinds` show.

use super::*;
use crate::pipeline::{TEXT_WIDTH, kind_text, kinds_json, kinds_text};

#[test]
fn the_list_shows_stages_their_inputs_and_what_is_not_default() {
    let text = parse(&changed("min_length = 0.8", "min_length = 0.8\niterations = 200\nstarts = [1]"))
        .unwrap()
        .to_text(TEXT_WIDTH);
    let expected = "\
2. lines (line_extractor)
     map  <- log.map  nav_msgs/msg/OccupancyGrid
     min_length = 0.8
     starts = [1]
";
    assert!(text.starts_with("walls: 5 stages, seed 7, reference robot1\n"), "{text}");
    assert!(text.contains(expected), "{text}");
    let text = parse(&changed("[\"log.*\", ", "[")).unwrap().to_text(TEXT_WIDTH);
    assert!(text.contains("     not read: pose, other\n"), "{text}");
}

#[test]
fn diagrams_hold_every_stage_and_wire() {
    let pipeline = parse(&changed("\"walls\"", "'a \"b\"'")).unwrap();
    let (mermaid, dot) = (pipeline.to_mermaid(), pipeline.to_dot());
    assert!(mermaid.contains("    s1[\"<b>lines</b><br/>line_extractor\"]\n"), "{mermaid}");
    assert!(mermaid.contains("    s1 -->|\"segments<br/>gridweave_msgs/msg/Segments\"| s2\n"), "{mermaid}");
    assert_eq!(mermaid.matches("-->").count(), 11);
    assert!(dot.starts_with("digraph \"a \\\"b\\\"\" {\n"), "{dot}");
    assert!(dot.contains("    \"lines\" -> \"align\" [label=\"segments\\ngridweave_msgs/msg/Segments\"];\n"), "{dot}");
    assert_eq!(dot.matches("->").count(), 11);
}

#[test]
fn a_kind_is_shown_with_its_ports_and_parameters() {
    let registry = registry();
    let expected = "\
line_extractor
  Finds straight walls.

  inputs
    map  nav_msgs/msg/OccupancyGrid  Maps.

  outputs
    segments  gridweave_msgs/msg/Segments  Walls.

  parameters
    min_length = 0.6  (number above 0)
        Segments shorter than this are dropped, in metres. The paper: 30 px.
    iterations = 200  (whole number of at least 1)
        The number of iterations.
    mean = \"circular\"  (\"circular\" | \"groups\")
        How the segments' angles are averaged.
        \"circular\": Over four times the angle, which knows no wrap.
        \"groups\": Of two groups of segments.
    merge = true  (true or false)
        Whether to join segments.
    starts = []  (list of numbers)
        Starts that are tried, in radians.
";
    assert_eq!(kind_text(registry.get("line_extractor").unwrap(), TEXT_WIDTH), expected);
    let all = kinds_text(&registry, TEXT_WIDTH);
    assert!(
        all.contains("    start  (number, may be left out)\n        Seconds to leave out at the start.\n"),
        "{all}"
    );
    assert!(all.contains("    in  any type, any number of them  What to write.\n"), "{all}");
    assert!(all.contains("    map  nav_msgs/msg/OccupancyGrid  The merged map. (on /map)\n"), "{all}");
}

#[test]
fn programs_get_the_kinds_as_json() {
    let json = kinds_json(&registry());
    let lines = json.as_array().unwrap().iter().find(|kind| kind["name"] == "line_extractor").unwrap();
    assert_eq!(lines["inputs"][0]["type"], "nav_msgs/msg/OccupancyGrid");
    assert_eq!(lines["parameters"][0]["default"], 0.6);
    assert_eq!(lines["parameters"][2]["values"][1]["value"], "groups");
    assert_eq!(lines["schema"]["properties"]["merge"]["type"], "boolean");
}
