//! `gridweave golden` reports differences from the expected messages, and blesses them.

use crate::support::golden_cases::{Cases, SOURCE, TAGS, estimates};
use crate::support::{LogBuilder, gridweave};
use std::fs;
use tempfile::TempDir;

#[test]
fn what_was_blessed_passes_and_is_not_written_again() {
    let cases = Cases::four_tags(TAGS);
    cases.assert_fails(&[
        "FAILED   tag_filter/four_tags",
        "there is no expected.mcap (--bless writes it); the stage sends 1 message on 1 topic",
        "1 case: 0 as expected, 1 failed",
    ]);
    fs::remove_dir_all(cases.differences()).unwrap();
    cases.bless().assert(0, &["blessed  tag_filter/four_tags: new, 1 message on 1 topic", "1 blessed"]);
    let expected = cases.expected("tag_filter/four_tags");
    let (bytes, written) = (fs::read(&expected).unwrap(), expected.metadata().unwrap().modified().unwrap());
    cases.golden(&["--partial"]).assert(0, &["ok       tag_filter/four_tags", "1 case: 1 as expected"]);
    cases.bless().assert(0, &["ok       tag_filter/four_tags"]);
    assert_eq!(fs::read(&expected).unwrap(), bytes);
    assert_eq!(expected.metadata().unwrap().modified().unwrap(), written);
    assert!(!cases.differences().exists(), "nothing differs");
    fs::remove_file(&expected).unwrap();
    cases.bless();
    assert_eq!(fs::read(&expected).unwrap(), bytes, "the same messages give the same bytes");
}

#[test]
fn a_field_that_differs_is_reported_with_topic_time_and_values() {
    let cases = Cases::four_tags(TAGS);
    cases.bless();
    cases.input("tag_filter/four_tags", |log| estimates(log, 3));
    cases.assert_fails(&[
        "1 message differs",
        "/tag_filter/common at 1700000002.000000000",
        "tags: expected 4 elements, got 3 elements",
        "reason: expected \"",
        "the messages of the stage: golden-differences/tag_filter/four_tags/got.mcap",
    ]);
    assert!(cases.differences().join("tag_filter/four_tags/got.mcap").exists());
    let ended = cases.golden(&["--partial", "--limit", "1", "--differences", "elsewhere"]);
    ended.assert(1, &["tags: expected 4", "more (--limit COUNT shows more of them)", "elsewhere/tag_filter"]);
    cases.bless().assert(0, &["blessed  tag_filter/four_tags: 1 message differs", "tags: expected 4 elements"]);
    cases.golden(&["--partial"]).assert(0, &["ok"]);
}

#[test]
fn numbers_may_differ_by_the_tolerance_that_is_given() {
    let cases = Cases::new();
    let stage = |tolerance: &str| {
        let text = format!("{SOURCE}[compare]\nfloat_tolerance = {tolerance}\n");
        cases.stage("mcap_source/pose", &text);
    };
    let pose = |x: f64| {
        cases.input("mcap_source/pose", |log| {
            log.pose(1.0, "robot1", x, 3.0);
        });
    };
    stage("1e-3");
    pose(2.0);
    cases.bless();
    pose(2.0019);
    cases.golden(&["--partial"]).assert(0, &["ok"]);
    stage("1e-4");
    cases.assert_fails(&["/robot1/pose at", "pose.position.x: expected 2.0, got 2.0019"]);
}

#[test]
fn missing_and_surplus_messages_are_reported() {
    let cases = Cases::new();
    cases.stage("mcap_source/poses", SOURCE);
    let poses = |seconds: &[f64]| {
        cases.input("mcap_source/poses", |log| {
            for at in seconds {
                log.pose(*at, "robot1", *at, 0.0);
            }
        });
    };
    // Each comes on `pose`, and as it was logged on `other`.
    poses(&[1.0, 2.0, 3.0]);
    cases.bless();
    poses(&[1.0, 3.0, 4.0, 5.0]);
    cases.assert_fails(&[
        "2 messages are missing, 4 messages are surplus",
        "/robot1/pose at 1700000002.000000000\n      expected a message, got none",
        "/robot1/pose at 1700000005.000000000\n      expected no message, got one",
    ]);
    let json: serde_json::Value = serde_json::from_str(&cases.golden(&["--partial", "--json"]).stdout).unwrap();
    assert_eq!((&json["cases"][0]["missing"], &json["cases"][0]["surplus"]), (&2.into(), &4.into()));
    assert_eq!(json["cases"][0]["differences"][0]["log_time"], 1_700_000_002_000_000_000u64);
}

#[test]
fn cells_that_differ_are_counted_and_drawn() {
    let cases = Cases::map(&[]);
    cases.bless();
    cases.put_map(&[7, 5050]);
    cases.assert_fails(&[
        "/robot1/map at 1700000001.000000000",
        "data[7]: expected 100, got 0",
        "data[5050]: expected 0, got 100",
        "2 of 32000 cells differ, shown in golden-differences/mcap_source/map/robot1_map-1.png",
    ]);
    let json: serde_json::Value = serde_json::from_str(&cases.golden(&["--partial", "--json"]).stdout).unwrap();
    let picture = json["cases"][0]["grids"][0]["picture"].as_str().unwrap();
    let bytes = fs::read(cases.0.path().join(picture)).unwrap();
    assert!(bytes.starts_with(b"\x89PNG"), "it is a picture");
    assert_eq!(json["cases"][0]["grids"][0]["cells"], 2);
    cases.put_map(&(0..32000).collect::<Vec<_>>());
    cases.assert_fails(&["data: expected 32000 elements, got 32000 that differ", "32000 of 32000 cells differ"]);
}

#[test]
fn a_warning_that_differs_is_reported() {
    let cases = Cases::four_tags(TAGS);
    cases.bless();
    cases.input("tag_filter/four_tags", |log| {
        estimates(log, 4);
        log.raw(3.0, "/robot1/tags", "gridweave_msgs/msg/TagEstimates", &[0, 1, 0, 0]);
    });
    cases.assert_fails(&["1 warning differs", "cannot be read are left out", "expected 0 times, got once"]);
    cases.bless().assert(0, &["blessed  tag_filter/four_tags: 1 warning differs"]);
    cases.golden(&["--partial"]).assert(0, &["ok"]);
}

#[test]
fn what_must_hold_is_checked_even_when_blessing() {
    let expect = |entry: &str| format!("{TAGS}[[expect]]\n{entry}\n");
    for holds in [
        "port = \"common\"\nmessages = 1",
        "port = \"common\"\nfield = \"tags[3].tag_id\"\nequals = \"tag3\"",
        "port = \"common\"\nmessage = -1\nfield = \"tags\"\nlength = 4",
        "port = \"common\"\nfield = \"accepted\"\nequals = true",
        "port = \"common\"\nfield = \"tags[1].a\"\nequals = [5, 1.2]\nwithin = 0.2",
        "port = \"common\"\nfield = \"tags[0].covariance_a\"\nvalue = 0\ncount = 2",
        "warning = \"nothing\"\ncount = 0",
    ] {
        Cases::four_tags(&expect(holds)).bless().assert(0, &["blessed"]);
    }
    for (wrong, says) in [
        ("port = \"common\"\nmessages = 2", "`common` must send 2 messages, and has sent 1"),
        (
            "port = \"common\"\nfield = \"tags[3].tag_id\"\nequals = \"9\"",
            "tags[3].tag_id of message 0 of `common` must be \"9\", and is \"tag3\"",
        ),
        ("port = \"common\"\nmessage = 5\nfield = \"tags\"\nlength = 4", "none has the number 5"),
        ("port = \"common\"\nfield = \"tags\"\nlength = 3", "must have 3 elements, and has 4"),
        ("port = \"common\"\nfield = \"tag\"\nlength = 3", "has no field `tag`; it has header"),
        ("port = \"common\"\nfield = \"tags[1].a\"\nequals = [5, 1.2]\nwithin = 0.1", "within 0.1, and is [5.0, 1.0]"),
        (
            "port = \"common\"\nfield = \"tags[0].covariance_a\"\nvalue = 0\ncount = 3",
            "must have 3 elements of the value 0, and has 2",
        ),
        ("warning = \"nothing\"\ncount = 1", "the warning \"nothing\" must be given 1 times, and was given 0 times"),
    ] {
        let cases = Cases::four_tags(&expect(wrong));
        cases.assert_fails(&[says]);
        cases.bless().assert(1, &[says, "not blessed, since a condition of [[expect]] does not hold"]);
        assert!(!cases.expected("tag_filter/four_tags").exists());
    }
}

#[test]
fn what_a_sink_writes_is_compared_by_topic() {
    let cases = Cases::new();
    let stage =
        "[stage]\nkind = \"mcap_sink\"\nfile = \"{output}\"\n[inputs]\nmessages = [\"/{robot}/pose\", \"/strange\"]\n";
    cases.stage("mcap_sink/poses", stage);
    let write = |last: u8| {
        cases.input("mcap_sink/poses", |log| {
            log.pose(1.0, "robot1", 1.0, 2.0).raw(2.0, "/strange", "my_msgs/msg/Strange", &[1, 2, 3, last]);
        });
    };
    write(4);
    cases.bless().assert(0, &["2 messages on 2 topics"]);
    write(5);
    cases.assert_fails(&["/strange at", "expected 4 bytes, got 4 bytes, which differ from byte 3 on", "no definition"]);
    cases.stage("mcap_sink/poses", &stage.replace("{output}", "unused.mcap"));
    cases.assert_fails(&["2 messages are missing"]);
}

#[test]
fn a_filter_chooses_cases_and_lets_kinds_be_without() {
    let cases = Cases::four_tags(TAGS);
    cases.stage("mcap_source/map", SOURCE);
    cases.put_map(&[]);
    cases.bless();
    let ended = cases.golden(&["filter/four"]);
    ended.assert(0, &["ok       tag_filter/four_tags", "1 case: 1 as expected"]);
    assert!(!ended.text().contains("mcap_source"), "{ended:#?}");
    cases.golden(&["four", "mcap_source"]).assert(0, &["2 cases: 2 as expected"]);
    cases.golden(&["nothing"]).assert(2, &["no case in cases has nothing in its name"]);
    gridweave(cases.0.path(), &["golden"]).assert(2, &["there is no folder tests/golden", "--cases FOLDER"]);
}

#[test]
fn a_stage_kind_without_a_case_fails() {
    let cases = Cases::four_tags(TAGS);
    cases.bless();
    cases.golden(&[]).assert(
        1,
        &[
            "ok       tag_filter/four_tags",
            "FAILED   grid_fuser: this stage kind has no case in cases",
            "stage kinds without a case",
        ],
    );
    let json: serde_json::Value = serde_json::from_str(&cases.golden(&["--json"]).stdout).unwrap();
    let without = json["kinds_without_a_case"].as_array().unwrap();
    assert!(without.contains(&"grid_fuser".into()) && !without.contains(&"tag_filter".into()), "{without:?}");
    assert_eq!((&json["failed"], &json["cases"][0]["status"]), (&true.into(), &"passed".into()));
}

#[test]
fn a_piece_of_a_log_can_be_cut_for_a_case() {
    let folder = TempDir::new().unwrap();
    let mut log = LogBuilder::new(&folder.path().join("whole.mcap"));
    for second in 0..10 {
        log.pose(f64::from(second), "robot1", 0.0, 0.0).reading(f64::from(second), "robot1", "a", 1.0);
    }
    log.finish();
    let args = ["run", "cut", "--input", "whole.mcap", "--output", "piece.mcap", "--set", "log.start=3"];
    let more = ["--set", "log.end=5", "--set", "out.only_topics=[\"/{robot}/tag_ranges\"]"];
    gridweave(folder.path(), &[&args[..], &more].concat()).assert(0, &[]);
    gridweave(folder.path(), &["info", "piece.mcap"]).assert(0, &["3 messages over 2.0 s", "/robot1/tag_ranges"]);
}
