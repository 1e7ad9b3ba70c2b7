//! The assignment of outputs to inputs.

use super::*;

/// The inputs of a stage as `PORT<STAGE.PORT`.
fn inputs(pipeline: &Pipeline, stage: &str) -> Vec<String> {
    let spec = pipeline.stages.iter().find(|spec| spec.name == stage).unwrap();
    let name = |wire: &crate::pipeline::Wire| {
        let from = &pipeline.stages[wire.from_stage];
        let output = from.kind.outputs[wire.from_port].name;
        format!("{}<{}.{output}", spec.kind.inputs[wire.port].name, from.name)
    };
    spec.inputs.iter().map(name).collect()
}

#[test]
fn an_entry_of_a_list_feeds_the_first_free_port_of_its_type() {
    let pipeline = parse(&changed("[\"log.map\", \"lines\"]", "[\"lines\", \"log.map\"]")).unwrap();
    assert_eq!(inputs(&pipeline, "align"), ["map<log.map", "segments<lines.segments"]);
}

#[test]
fn wires_are_sorted_by_port_and_within_a_port_by_the_file() {
    let text = changed("[\"log.map\", \"lines\"]", "{ segments = \"lines\", map = \"log.map\" }");
    assert_eq!(inputs(&parse(&text).unwrap(), "align"), ["map<log.map", "segments<lines.segments"]);
    let text = changed("[\"log.*\", \"lines\", ", "[\"lines\", \"log.*\", ");
    let expected =
        ["in<lines.segments", "in<log.map", "in<log.pose", "in<log.other", "in<align.alignment", "in<fuse.map"];
    assert_eq!(inputs(&parse(&text).unwrap(), "out"), expected);
}

#[test]
fn one_output_may_feed_two_ports_that_are_named() {
    let text = changed(
        "inputs = [\"log.map\", \"lines\"]",
        "inputs = { map = \"log.map\", segments = \"lines\", guess = \"pre\" }",
    );
    let text = text
        .replace("[stages.out]", "[stages.pre]\nkind = \"aligner\"\ninputs = [\"log.map\", \"lines\"]\n[stages.out]");
    assert_eq!(
        inputs(&parse(&text).unwrap(), "align"),
        ["map<log.map", "segments<lines.segments", "guess<pre.alignment"]
    );
}

#[test]
fn topics_come_from_the_stage_then_from_the_port_then_from_the_names() {
    let topics = |text: &str, stage: &str| {
        let pipeline = parse(text).unwrap();
        pipeline.stages.iter().find(|spec| spec.name == stage).unwrap().topics.clone()
    };
    assert_eq!(topics(VALID, "lines"), ["/{robot}/lines/segments"]);
    assert_eq!(topics(VALID, "fuse"), ["/map"]);
    let text = changed("depth = 4", "topics = { map = \"/merged/{stage}\" }");
    assert_eq!(topics(&text, "fuse"), ["/merged/fuse"]);
}

#[test]
fn stages_have_a_process_of_their_own_unless_they_share_one() {
    let pipeline = parse(&changed("depth = 4", "process = \"lines\"")).unwrap();
    assert_eq!(pipeline.processes(), ["log", "lines", "align", "out"]);
    let names = |process| pipeline.stages_of(process).into_iter().map(|stage| pipeline.stages[stage].name.as_str());
    assert_eq!(names("lines").collect::<Vec<_>>(), ["lines", "fuse"]);
    assert_eq!(names("fuse").count(), 0);
}

#[test]
fn limits_of_processes_may_be_switched_off() {
    let limits = |text: &str| {
        let pipeline = parse(&changed("seed = 7", text)).unwrap();
        (pipeline.stall_timeout.map(|timeout| timeout.as_secs_f64()), pipeline.memory_limit)
    };
    assert_eq!(limits("seed = 7"), (Some(300.0), None));
    assert_eq!(limits("stall_timeout = 2\nmemory_limit = 1000"), (Some(2.0), Some(1000)));
    assert_eq!(limits("stall_timeout = 0.0\nmemory_limit = 0"), (None, None));
}

#[test]
fn the_memory_of_messages_of_one_time_is_limited_by_default() {
    let limit = |text: &str| parse(&changed("seed = 7", text)).unwrap().same_time_limit;
    assert_eq!(limit("seed = 7"), 2 << 30);
    assert_eq!(limit("same_time_limit = 1000"), 1000);
    for text in ["seed = 7", "same_time_limit = 1000"] {
        let pipeline = parse(&changed("seed = 7", text)).unwrap();
        assert_eq!(parse(&pipeline.to_toml()).unwrap().same_time_limit, limit(text));
    }
}

#[test]
fn depths_come_from_the_stage_then_from_the_pipeline() {
    let pipeline = parse(&changed("seed = 7", "depth = 32")).unwrap();
    let depths: Vec<(&str, usize)> = pipeline.stages.iter().map(|stage| (stage.name.as_str(), stage.depth)).collect();
    assert_eq!(depths, [("log", 32), ("lines", 32), ("align", 32), ("fuse", 4), ("out", 32)]);
}

#[test]
fn a_pipeline_written_out_is_the_same_when_read_again() {
    let mut overrides = Overrides::default();
    overrides.seed = Some(u64::MAX);
    overrides.set("lines.starts=[0.5, 1]").unwrap();
    overrides.initial_poses.push("robot2=1,-2.5,0.5".into());
    let frames = "[robots]\ntf = { map_frame = \"{robot}/map\", base_frame = \"{robot}/base_link\" }";
    let fields = "tags = { topic = \"/{robot}/uwb\", each = \"all\", id_field = \"a.id\", range_field = \"mm\", range_unit = 0.001, \
         rssi_field = \"dbm\", rssi_at_1m = -40, path_loss_exponent = 2.5, rssi_stddev = 3, stddev_field = \"s\", \
         stddev = 0.1, pose_field = \"pose\", bearing_field = \"b\", bearing_unit = -0.01, bearing_stddev_field = \"d\", \
         bearing_stddev = 0.2 }";
    let text = changed("[robots]", &format!("{frames}\n{fields}"));
    let first = Pipeline::parse("walls.toml", &text, &registry(), &overrides).unwrap();
    let second = Pipeline::parse("other.toml", &first.to_toml(), &registry(), &Overrides::default()).unwrap();
    assert_eq!(format!("{first:?}"), format!("{second:?}"));
    let read = second.robots.tag_fields.unwrap();
    assert_eq!(
        (read.range_unit, read.path_loss.unwrap().exponent, second.robots.tags.as_str()),
        (Some(0.001), 2.5, "/{robot}/uwb")
    );
}
