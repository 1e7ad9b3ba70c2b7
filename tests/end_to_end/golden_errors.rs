//! `gridweave golden` reports errors in a case that cannot be run, and never panics.

use crate::support::golden_cases::{Cases, TAGS, change, estimates};
use std::fs;

#[test]
fn an_error_in_stage_toml_is_shown_with_the_right_name() {
    for (from, to, says) in [
        ("tag_filter", "tag_filtre", "did you mean `tag_filter`?"),
        ("kind = \"tag_filter\"", "kind = \"grid_fuser\"", "in the folder of the kind `tag_filter`"),
        ("[inputs]", "certanty = 0.5\n[inputs]", "did you mean `certainty`?"),
        ("[inputs]", "certainty = 7.0\n[inputs]", "`certainty` is out of range"),
        ("[inputs]", "[input]", "did you mean `inputs`?"),
        ("estimates =", "estimate =", "has no input `estimate`; did you mean `estimates`?"),
        ("estimates = \"/{robot}/tags\"", "", "the input `estimates` of `tag_filter` has no topic"),
        ("/{robot}/tags", "{robot}/tags", "is not a topic pattern"),
        ("/{robot}/tags", "/{robot}/tag", "matches `/{robot}/tag` of the input `estimates`; it has `/robot1/tags`"),
        ("\"/{robot}/tags\"", "7", "expected a topic in quotes"),
        ("[inputs]", "[compare]\ntolerance = 1\n[inputs]", "expected `float_tolerance`"),
        ("[inputs]", "[compare]\nfloat_tolerance = -1\n[inputs]", "must be 0 or more"),
        ("[inputs]", "[[expect]]\nport = \"comon\"\nmessages = 1\n[inputs]", "did you mean `common`?"),
        ("[inputs]", "[[expect]]\nports = \"common\"\n[inputs]", "unknown field `ports`"),
        ("[inputs]", "[[expect]]\nport = \"common\"\n[inputs]", "neither `field` nor `messages`"),
        ("[inputs]", "[[expect]]\nport = \"common\"\nfield = \"a[\"\nlength = 1\n[inputs]", "is not a field path"),
        ("[inputs]", "[[expect]]\nport = \"common\"\nfield = \"a\"\n[inputs]", "`field` needs one of"),
        ("[inputs]", "[[expect]]\nwarning = \"a\"\n[inputs]", "`warning` needs `count`"),
        ("[inputs]", "[pipeline]\nseeds = 1\n[inputs]", "did you mean `seed`?"),
        ("[stage]", "[stage", "stage.toml"),
    ] {
        let cases = Cases::four_tags(&TAGS.replacen(from, to, 1));
        cases.assert_fails(&["FAILED   tag_filter/four_tags", says, "tag_filter/four_tags"]);
    }
}

#[test]
fn a_folder_without_cases_is_bad_use() {
    let cases = Cases::new();
    cases.folder("tag_filter");
    cases.golden(&["--partial"]).assert(2, &["there is no case in cases", "KIND/CASE with stage.toml"]);
    cases.stage("tag_filter", TAGS);
    cases.golden(&["--partial"]).assert(2, &["cases/tag_filter/stage.toml is not in the folder of a case"]);
    fs::remove_dir_all(cases.0.path().join("cases")).unwrap();
    cases.golden(&[]).assert(2, &["there is no folder cases", "--cases FOLDER"]);
}

#[test]
fn an_input_that_cannot_be_used_fails_its_case() {
    let cases = Cases::four_tags(TAGS);
    let input = cases.folder("tag_filter/four_tags").join("input.mcap");
    cases.input("tag_filter/four_tags", |log| {
        log.pose(1.0, "robot1", 0.0, 0.0).pose(1.0, "a", 0.0, 0.0);
    });
    cases.assert_fails(&["no topic of input.mcap matches `/{robot}/tags`", "it has `/robot1/pose`, `/a/pose`"]);
    cases.input("tag_filter/four_tags", |log| {
        log.raw(1.0, "/robot1/tags", "geometry_msgs/msg/PoseStamped", &[]);
    });
    cases.assert_fails(&[
        "has geometry_msgs/msg/PoseStamped on `/robot1/tags`",
        "takes gridweave_msgs/msg/TagEstimates",
    ]);
    cases.input("tag_filter/four_tags", |log| estimates(log, 4));
    change(&input, |bytes| bytes.truncate(bytes.len() / 2));
    cases.assert_fails(&["cannot read input.mcap: the file has no end"]);
    fs::write(&input, b"").unwrap();
    cases.assert_fails(&["input.mcap: the file is empty"]);
    fs::remove_file(&input).unwrap();
    cases.assert_fails(&["there is no cases/tag_filter/four_tags/input.mcap"]);
    cases.stage("simulator/one", "[stage]\nkind = \"simulator\"\nrobots = 1\nduration = 1\n");
    cases.input("simulator/one", |_| {});
    cases.assert_fails(&["input.mcap is not used"]);
}

#[test]
fn a_stage_that_fails_fails_its_case_with_the_reason() {
    let cases = Cases::new();
    cases.stage("mcap_source/missing", "[stage]\nkind = \"mcap_source\"\nfiles = [\"/no/such/log.mcap\"]\n");
    cases.assert_fails(&["stage `mcap_source` failed", "/no/such/log.mcap: no such file or folder"]);
    cases.bless().assert(1, &["stage `mcap_source` failed"]);
    let cases = Cases::new();
    cases.stage("line_extractor/empty", "");
    cases.folder("line_extractor/no_file");
    cases.assert_fails(&["there is no section `[stage]`", "cannot read cases/line_extractor/no_file/stage.toml"]);
}

#[test]
fn a_damaged_expected_log_is_reported_and_can_be_blessed() {
    let cases = Cases::four_tags(TAGS);
    cases.bless();
    change(&cases.expected("tag_filter/four_tags"), |bytes| bytes.truncate(bytes.len() - 20));
    cases.assert_fails(&["expected.mcap cannot be read"]);
    cases.bless().assert(0, &["blessed  tag_filter/four_tags: the old one could not be read"]);
    cases.golden(&["--partial"]).assert(0, &["ok"]);
}

#[test]
fn damaged_files_fail_their_cases_without_a_panic() {
    let cases = Cases::four_tags(TAGS);
    cases.bless();
    let whole = cases.folder("tag_filter/four_tags");
    for number in 0..60 {
        let name = format!("tag_filter/damaged_{number:02}");
        let folder = cases.folder(&name);
        for file in ["stage.toml", "input.mcap", "expected.mcap"] {
            fs::copy(whole.join(file), folder.join(file)).unwrap();
        }
        let file = ["stage.toml", "input.mcap", "expected.mcap"][number % 3];
        change(&folder.join(file), |bytes| {
            let at = number * 7919 % bytes.len();
            match number % 2 {
                0 => bytes[at] ^= 1 << (number % 8),
                _ => bytes.truncate(at),
            }
        });
    }
    let ended = cases.assert_fails(&["ok       tag_filter/four_tags", "61 cases"]);
    assert!(ended.stdout.matches("FAILED").count() > 40, "{ended:#?}");
}
