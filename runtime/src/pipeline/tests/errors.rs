//! Every error is shown at its location, with what was expected and the most similar valid name.

use super::*;
use crate::pipeline::diagnostic::MOST_SHOWN;
use std::path::Path;

#[test]
fn the_valid_pipeline_has_no_errors() {
    parse(VALID).unwrap();
}

#[test]
fn a_toml_syntax_error_is_underlined() {
    assert_error(("seed = 7", "seed = 7 8"), "5:8", "7 8", &["this is not TOML"]);
    let errors = parse("a = \nb = \"x\n[c]\nd = 1\nd = 2\n").unwrap_err();
    let places: Vec<String> = shown(&errors).into_iter().map(|error| error.place).collect();
    assert_eq!(places, ["1:5", "2:7", "5:1"]);
}

#[test]
fn for_an_unknown_section_or_key_the_most_similar_is_suggested() {
    assert_error(("[robots]", "[robot]"), "7:2", "robot", &["unknown section `robot`", "did you mean `robots`?"]);
    assert_error(("reference", "referense"), "4:1", "referense", &["`[pipeline]`", "did you mean `reference`?"]);
    assert_error(("\nmap = ", "\nmaps = "), "8:1", "maps", &["`[robots]`", "did you mean `map`?"]);
}

#[test]
fn of_very_many_errors_the_first_are_shown() {
    for wrong in ["\"log.map\", ", "\"nothing\", "] {
        let text = changed("inputs = [", &format!("inputs = [{}", wrong.repeat(2_000)));
        let errors = parse(&text).unwrap_err();
        assert_eq!(errors.count(), MOST_SHOWN, "{wrong}");
        let rendered = errors.render(false);
        assert!(rendered.contains("has more errors than these 100"), "{wrong}");
        assert!(rendered.len() < 500_000, "{wrong}: {} bytes", rendered.len());
    }
}

#[test]
fn limits_of_processes_are_numbers_that_are_not_negative() {
    for (line, column, underlined, says) in [
        ("stall_timeout = -1.0", "17", "-1.0", "expected seconds, 0 or more"),
        ("stall_timeout = \"long\"", "17", "\"long\"", "expected seconds, 0 or more, found text"),
        ("stall_timeout = nan", "17", "nan", "expected seconds, 0 or more"),
        ("memory_limit = -1", "16", "-1", "expected bytes, 0 or more, found `-1`"),
        ("same_time_limit = -1", "19", "-1", "expected bytes, 0 or more, found `-1`"),
        ("memory_limit = 1.5", "16", "1.5", "expected bytes, 0 or more, found a number"),
    ] {
        assert_error(("seed = 7", line), &format!("5:{column}"), underlined, &[says]);
    }
}

#[test]
fn for_an_unknown_kind_the_most_similar_is_suggested_without_further_errors() {
    let says = ["unknown kind of stage `line_extracter`", "did you mean `line_extractor`?"];
    assert_error(("\"line_extractor\"", "\"line_extracter\""), "15:8", "\"line_extracter\"", &says);
    let says = ["there are: `aligner`, `fuser`, `line_extractor`, `mcap_sink`, `mcap_source`"];
    assert_error(("\"aligner\"", "\"zzz\""), "20:8", "\"zzz\"", &says);
    assert_error(("kind = \"aligner\"\n", ""), "19:9", "align", &["has no kind", "did you mean `aligner`?"]);
}

#[test]
fn for_an_unknown_parameter_the_most_similar_is_suggested() {
    let says = ["`line_extractor` has no such parameter", "did you mean `min_length`?"];
    assert_error(("min_length", "min_lenght"), "17:1", "min_lenght", &says);
    assert_error(("min_length", "dept"), "17:1", "dept", &["did you mean `depth`?"]);
    let says = ["its parameters: `min_length`, `iterations`, `mean`, `merge`, `starts`"];
    assert_error(("min_length", "zzz"), "17:1", "zzz", &says);
}

#[test]
fn the_error_of_a_wrong_type_states_what_was_expected() {
    let cases = [
        ("min_length = \"long\"", "14", "\"long\"", "expected a number above 0, found text"),
        ("iterations = 1.5", "14", "1.5", "expected a whole number of at least 1, found a number"),
        ("iterations = -3", "14", "-3", "expected a whole number of at least 1, found `-3`"),
        ("iterations = 5000000000", "14", "5000000000", "u32"),
        ("merge = 1", "9", "1", "expected true or false, found `1`"),
        ("starts = 0.5", "10", "0.5", "expected a list of numbers, found a number"),
        ("starts = [0.5, \"a\"]", "16", "\"a\"", "expected a list of numbers, and this is text"),
        ("mean = 3", "8", "3", "expected \"circular\" or \"groups\", found `3`"),
        ("mean = \"circlar\"", "8", "\"circlar\"", "did you mean \"circular\"?"),
        ("depth = 1.5", "9", "1.5", "expected a whole number from 1 to 4096, found a number"),
        ("process = 3", "11", "3", "expected text in quotes, found `3`"),
    ];
    for (line, column, underlined, says) in cases {
        assert_error(("min_length = 0.8", line), &format!("17:{column}"), underlined, &[says, "wrong value of"]);
    }
    assert_error(("seed = 7", "seed = -7"), "5:8", "-7", &["expected a whole number of at least 0, found `-7`"]);
    assert_error(("\"walls\"", "[]"), "3:8", "[]", &["expected text in quotes, found a list"]);
}

#[test]
fn every_wrong_parameter_of_a_stage_is_shown() {
    let text = changed("min_length = 0.8", "min_length = \"a\"\niterations = 0\nmean = \"b\"\nmarge = true");
    let titles: Vec<String> = shown(&parse(&text).unwrap_err()).into_iter().map(|error| error.title).collect();
    let expected = [
        "wrong value of `min_length`",
        "`iterations` is out of range",
        "wrong value of `mean`",
        "unknown parameter `marge`",
    ];
    assert_eq!(titles, expected);
}

#[test]
fn a_value_out_of_range_is_underlined() {
    let says = ["`min_length` is out of range", "must be above 0, not"];
    assert_error(("min_length = 0.8", "min_length = -2"), "17:14", "-2", &says);
    assert_error(("min_length = 0.8", "min_length = nan"), "17:14", "nan", &says);
    assert_error(("depth = 4", "depth = 0"), "26:9", "0", &["expected a whole number from 1 to 4096, found `0`"]);
    let says = ["expected a whole number from 1 to 4096, found a number"];
    assert_error(("depth = 4", "depth = 99999999999999999999"), "26:9", "99999999999999999999", &says);
}

#[test]
fn for_an_unknown_stage_or_port_the_most_similar_is_suggested() {
    let says = ["unknown stage `lgo`", "did you mean `log.map`?"];
    assert_error(("[\"log.map\"]", "[\"lgo.map\"]"), "16:12", "lgo", &says);
    let says = ["`log` has no output `mop`", "did you mean `map`?"];
    assert_error(("[\"log.map\"]", "[\"log.mop\"]"), "16:16", "mop", &says);
    assert_error(("\"lines\"]", "\"line\"]"), "21:23", "line", &["unknown stage `line`", "did you mean `lines`?"]);
    let says = ["unknown input `maps`", "did you mean `map`?"];
    assert_error(("{ map = ", "{ maps = "), "25:12", "maps", &says);
}

#[test]
fn a_stage_with_several_outputs_needs_its_port_named() {
    let says = ["ambiguous which output of `log`", "name one: `log.map`, `log.pose`, `log.other`, or `log.*`"];
    assert_error(("[\"log.map\"]", "[\"log\"]"), "16:11", "\"log\"", &says);
    assert_error(
        ("\"fuse.map\"", "\"fuse.map\", \"fuse.map\""),
        "30:50",
        "\"fuse.map\"",
        &["`fuse.map` is given twice"],
    );
}

#[test]
fn a_wrong_type_is_shown_with_the_expected_one() {
    let says = [
        "`log.pose` does not fit the input `map` of `lines`",
        "expected nav_msgs/msg/OccupancyGrid, found geometry_msgs/msg/PoseStamped",
        "`map` could be fed by `fuse.map`, `log.map`",
    ];
    assert_error(("[\"log.map\"]", "[\"log.pose\"]"), "16:11", "\"log.pose\"", &says);
    let says = ["`lines.segments` does not fit the input `map` of `fuse`", "found gridweave_msgs/msg/Segments"];
    assert_error(("{ map = \"log.map\"", "{ map = \"lines\""), "25:18", "\"lines\"", &says);
    let says = ["`log.other` fits no input of `align`", "its type is any type", "`segments` takes gridweave_msgs"];
    assert_error(
        ("[\"log.map\", \"lines\"]", "[\"log.other\", \"lines\", \"log.map\"]"),
        "21:11",
        "\"log.other\"",
        &says,
    );
}

#[test]
fn two_outputs_for_a_port_that_takes_one_are_an_error() {
    let says = ["the input `map` of `align` takes one output", "`fuse.map` is one too many", "fed by `log.map`"];
    let text = changed("\"lines\"]", "\"lines\", \"fuse.map\"]").replace("\"align.alignment\"", "");
    let errors = parse(&text).unwrap_err().render(false);
    says.iter().for_each(|text| assert!(errors.contains(text), "{errors}"));
    let says = ["the input `map` of `fuse` takes one output", "fed by `log.map`"];
    let text = changed("{ map = \"log.map\"", "{ map = [\"log.map\", \"log2.map\"]");
    let text = text.replace("[stages.fuse]", "[stages.log2]\nkind = \"mcap_source\"\n[stages.fuse]");
    let error = only_error(&text);
    assert_eq!(error.underlined, "\"log2.map\"");
    says.iter().for_each(|text| assert!(error.text.contains(text), "{}", error.text));
    let says = ["`*` means all outputs of a stage"];
    assert_error(("{ map = \"log.map\"", "{ map = \"log.*\""), "25:18", "\"log.*\"", &says);
    assert_error(("[\"log.map\"]", "[\"log.*\"]"), "16:11", "\"log.*\"", &says);
}

#[test]
fn a_stage_cannot_be_wired_to_itself() {
    let says = ["the stage `lines` is wired to itself"];
    assert_error(("[\"log.map\"]", "[\"log.map\", \"lines\"]"), "16:22", "\"lines\"", &says);
}

#[test]
fn a_cycle_is_shown_with_its_whole_path() {
    let says = [
        "these stages feed each other in a cycle: align -> fuse -> lines -> align",
        "`fuse` reads `align`",
        "`lines` reads `fuse`",
        "`align` reads `lines`",
    ];
    assert_error(("[\"log.map\"]", "[\"fuse.map\"]"), "25:42", "\"align.alignment\"", &says);
}

#[test]
fn for_an_unwired_input_the_outputs_that_could_feed_it_are_listed() {
    let says = [
        "the input `segments` of `align` is not wired",
        "expected an output of type gridweave_msgs/msg/Segments",
        "`segments` could be fed by `lines.segments`",
    ];
    assert_error(("[\"log.map\", \"lines\"]", "[\"log.map\"]"), "21:10", "[\"log.map\"]", &says);
    assert_error(("inputs = [\"log.map\"]\n", ""), "14:9", "lines", &["the input `map` of `lines` is not wired"]);
    let error = only_error("[stages.out]\nkind = \"mcap_sink\"\n");
    assert!(error.text.contains("no stage here has such an output; add one of kind `mcap_source`"), "{}", error.text);
}

#[test]
fn a_source_takes_no_inputs() {
    let says = ["a source has no inputs", "`mcap_source` takes no inputs"];
    assert_error(("files = [\"a.mcap\"]", "inputs = [\"lines\"]"), "12:10", "[\"lines\"]", &says);
}

#[test]
fn inputs_are_a_list_or_a_table() {
    let says = ["expected a list of outputs or a table of ports, found text", "write `inputs = [\"log.map\"]`"];
    assert_error(("[\"log.map\"]", "\"log.map\""), "16:10", "\"log.map\"", &says);
    assert_error(("[\"log.map\"]", "[7]"), "16:11", "7", &["expected text in quotes, found `7`"]);
}

#[test]
fn a_stage_without_readers_is_an_error() {
    let spare = "[stages.spare]\nkind = \"line_extractor\"\ninputs = [\"log.map\"]\n\n[stages.out]";
    let says = ["the output of `spare` is not used", "add \"spare\" to the inputs of another stage"];
    assert_error(("[stages.out]", spare), "28:9", "spare", &says);
    let says = ["no output of `spare` is used", "add \"spare.map\""];
    assert_error(("[stages.out]", "[stages.spare]\nkind = \"mcap_source\"\n[stages.out]"), "28:9", "spare", &says);
}

#[test]
fn two_outputs_cannot_have_one_topic() {
    let says = [
        "`align.alignment` and `lines.segments` have the same topic",
        "`align.alignment` goes there too",
        "topics = { segments = \"/lines/segments\" }",
    ];
    let text = "[stages.lines]\ntopics.segments = \"/{robot}/align/alignment\"";
    assert_error(("[stages.lines]", text), "15:19", "\"/{robot}/align/alignment\"", &says);
}

#[test]
fn a_topic_is_a_path_of_bounded_length() {
    let long = format!("/{}", "a".repeat(128));
    let robot = format!("/{{robot}}/{}", "a".repeat(100));
    let cases = [
        ("walls", "a topic starts with `/`"),
        ("/walls/", "a part of this path is empty"),
        ("/r_{robot}/walls", "`{robot}` is a whole part of the path"),
        ("/{robot}/{name}", "the only placeholders are `{robot}` and `{stage}`"),
        ("/{robot}/a/{robot}", "at most once"),
        ("/{robot}", "and more than that"),
        (&long, "up to 129 bytes"),
        (&robot, "up to 166 bytes with the robot's name, and at most 128 fit"),
    ];
    for (topic, says) in cases {
        let line = format!("topics = {{ segments = \"{topic}\" }}\nmin_length");
        assert_error(("min_length", &line), "17:23", &format!("\"{topic}\""), &[says]);
    }
    let says = ["unknown output `segment`", "did you mean `segments`?"];
    assert_error(("min_length", "topics.segment = \"/a\"\nmin_length"), "17:8", "segment", &says);
}

#[test]
fn an_output_has_a_limited_number_of_readers() {
    let with = |readers: usize| {
        let reader = |number| format!("[stages.out{number}]\nkind = \"mcap_sink\"\ninputs = [\"log.map\"]\n");
        let stages: String = (0..readers).map(reader).collect();
        format!("[stages.log]\nkind = \"mcap_source\"\n{stages}")
    };
    parse(&with(64)).unwrap();
    let error = only_error(&with(65));
    assert_eq!(error.title, "`log.map` has 65 readers, and an output may have 64");
}

#[test]
fn a_stage_has_a_short_plain_name() {
    let says = ["expected lower-case letters a-z, digits, `_` and, but for the first, `-`"];
    assert_error(("[stages.out]", "[stages.Out]"), "28:9", "Out", &says);
    assert_error(("[stages.out]", "[stages.\"o u\"]"), "28:9", "\"o u\"", &says);
    assert_error(("[stages.out]", "[stages.\"-h\"]"), "28:9", "\"-h\"", &says);
    assert_error(("[stages.out]", "[stages.\"\"]"), "28:9", "\"\"", &says);
    let long = "a".repeat(65);
    let says = ["expected at most 64 characters, found 65"];
    assert_error(("[stages.out]", &format!("[stages.{long}]")), "28:9", &long, &says);
}

#[test]
fn a_pipeline_has_stages() {
    for text in ["", "[pipeline]\nname = \"a\"\n", "[stages]\n"] {
        let error = only_error(text);
        assert_eq!((error.title.as_str(), error.place.as_str()), ("this pipeline has no stages", ""));
    }
    let error = only_error("[stage.log]\nkind = \"mcap_source\"\n");
    assert_eq!((error.underlined.as_str(), error.title.as_str()), ("stage", "unknown section `stage`"));
    let error = only_error("stages = 3\n");
    assert_eq!(error.underlined, "3");
    let error = only_error("[stages]\nlog = \"mcap_source\"\n");
    assert!(error.text.contains("write a section `[stages.log]`"), "{}", error.text);
}

#[test]
fn the_reference_is_the_name_of_a_robot() {
    assert_error(("\"robot1\"", "\"\""), "4:13", "\"\"", &["the reference robot is empty", "leave `reference` out"]);
    assert_error(("\"robot1\"", "\"a/b\""), "4:13", "\"a/b\"", &["one part of a path"]);
    let long = format!("\"{}\"", "r".repeat(65));
    assert_error(("\"robot1\"", &long), "4:13", &long, &["at most 64 fit"]);
    assert_error(("\"walls\"", "\"\""), "3:8", "\"\"", &["the name of the pipeline is empty"]);
}

#[test]
fn an_initial_pose_has_a_position_and_a_yaw() {
    let with = |initial: &str| format!("[robots.robot2]\ninitial = {initial}\n\n[stages.log]");
    let errors = |initial: &str, place: &str, underlined: &str, says: &[&str]| {
        assert_error(("[stages.log]", &with(initial)), place, underlined, says);
    };
    errors("{ x = 1.0, y = 2 }", "11:11", "{ x = 1.0, y = 2 }", &["`initial` has no `yaw`", "in metres and radians"]);
    errors("{ x = 1.0, y = 2, yaw = 0, std = 1 }", "11:38", "std", &["unknown key `std`", "did you mean"]);
    errors("{ x = 1.0, y = 2, yaw = \"east\" }", "11:35", "\"east\"", &["radians from -6.2832 to 6.2832"]);
    errors("{ x = 1.0, y = 2, yaw = 90 }", "11:35", "90", &["90 degrees are 1.5708"]);
    errors("{ x = 1.0, y = nan, yaw = 0 }", "11:26", "nan", &["a finite number of metres"]);
    errors("{ x = 1.0, y = 2, yaw = 0, stddev = 0.0 }", "11:47", "0.0", &["metres from 0.01"]);
    let robot = "[robots.robot2]\ninital = { }\n\n[stages.log]";
    assert_error(("[stages.log]", robot), "11:1", "inital", &["`[robots.robot2]`", "did you mean `initial`?"]);
    let alone = with("{ x = 1.0, y = 2, yaw = 0 }");
    let text = VALID.replacen("[stages.log]", &alone, 1).replacen("reference = \"robot1\"\n", "", 1);
    let error = only_error(&text);
    assert!(error.title.contains("the initial pose of `robot2` alone"), "{}", error.text);
}

#[test]
fn a_pattern_has_one_placeholder_for_the_robot() {
    let topic = "\"/{robot}/map\"\n";
    assert_error((topic, "\"/map\"\n"), "8:7", "\"/map\"", &["expected `{robot}` once, found it nowhere"]);
    let twice = "\"/{robot}/{robot}\"";
    assert_error((topic, &format!("{twice}\n")), "8:7", twice, &["found it twice or more"]);
    let other = "\"/{robot}/{id}\"";
    assert_error((topic, &format!("{other}\n")), "8:7", other, &["the only placeholder is `{robot}`"]);
    assert_error((topic, "\"{robot}/map\"\n"), "8:7", "\"{robot}/map\"", &["a topic starts with `/`"]);
    let frames = format!("{topic}tf = {{ map_frame = \"{{robot}}/map\" }}\n");
    assert_error((topic, &frames), "9:1", "tf", &["`tf` has no `base_frame`", "base_frame = \"{robot}/base_link\""]);
    let frames =
        format!("{topic}tf = {{ map_frame = \"{{robot}}/map\", base = \"base_link\", base_frame = \"{{robot}}\" }}\n");
    assert_error((topic, &frames), "9:35", "base", &["unknown key `base` in `tf`", "did you mean `base_frame`?"]);
}

#[test]
fn the_fields_of_tag_readings_are_checked() {
    let topic = "\"/{robot}/map\"\n";
    let tags = |fields: &str| format!("{topic}tags = {{ {fields} }}\n");
    let whole = "topic = \"/{robot}/uwb\", id_field = \"id\"";
    assert_error(
        (topic, &tags("topic = \"/{robot}/uwb\", range_field = \"r\"")),
        "9:1",
        "tags",
        &["has no `id_field`"],
    );
    assert_error((topic, &tags("id_field = \"id\", range_field = \"r\"")), "9:1", "tags", &["has no `topic`"]);
    assert_error((topic, &tags(whole)), "9:1", "tags", &["has no `range_field`", "or a pose (`pose_field`)"]);
    let strength = format!("{whole}, rssi_field = \"dbm\"");
    assert_error((topic, &tags(&strength)), "9:1", "tags", &["has no `rssi_at_1m`"]);
    let unknown = format!("{whole}, range_feild = \"r\", range_field = \"r\"");
    assert_error((topic, &tags(&unknown)), "9:51", "range_feild", &["unknown key", "did you mean `range_field`?"]);
    let negative = format!("{whole}, range_field = \"r\", range_unit = -1");
    assert_error((topic, &tags(&negative)), "9:83", "-1", &["a number above 0"]);
    let pattern = "topic = \"/uwb\", id_field = \"id\", range_field = \"r\"";
    assert_error((topic, &tags(pattern)), "9:18", "\"/uwb\"", &["expected `{robot}` once"]);
}

#[test]
fn a_file_that_cannot_be_read_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let load = |path: &Path| Pipeline::load(path, &registry(), &Overrides::default());
    let missing = load(&folder.path().join("missing.toml")).unwrap_err().to_string();
    assert!(missing.contains("cannot read the pipeline") && missing.contains("missing.toml"), "{missing}");
    assert!(!missing.contains("has an error"), "{missing}");
    let binary = folder.path().join("binary.toml");
    std::fs::write(&binary, b"a = \"\xff\"").unwrap();
    assert!(load(&binary).unwrap_err().to_string().contains("byte 5 is not UTF-8"));
    let good = folder.path().join("good.toml");
    std::fs::write(&good, VALID.replace("name = \"walls\"\n", "")).unwrap();
    assert_eq!(load(&good).unwrap().name, "good");
}

#[test]
fn all_errors_of_a_file_are_shown_in_its_order() {
    let text = VALID
        .replace("seed = 7", "sead = 7")
        .replace("files = ", "file = ")
        .replace("inputs = [\"log.map\"]", "inputs = [\"log.mpa\"]")
        .replace("min_length = 0.8", "min_length = -1\nmean = \"x\"")
        .replace("\"lines\"]\n\n", "\"fuse\"]\n\n")
        .replace("depth = 4", "depth = -4")
        .replace("\"mcap_sink\"", "\"mcap_snk\"");
    let errors = parse(&text).unwrap_err();
    let lines: Vec<String> = shown(&errors).iter().map(|error| error.place.split(':').take(1).collect()).collect();
    assert_eq!(lines, ["5", "12", "16", "17", "18", "22", "26", "27", "30"], "{errors}");
    assert!(errors.to_string().ends_with("walls.toml has 9 errors"));
    assert!(errors.render(true).contains("\u{1b}["));
}
