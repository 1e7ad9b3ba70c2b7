//! What the command line sets.

use super::*;
use crate::pipeline::SettingError;
use crate::stage::InitialPose;

fn load(overrides: &Overrides) -> Result<Pipeline, PipelineErrors> {
    Pipeline::parse("walls.toml", VALID, &registry(), overrides)
}

fn with(settings: &[&str]) -> Overrides {
    let mut overrides = Overrides::default();
    settings.iter().for_each(|setting| overrides.set(setting).unwrap());
    overrides
}

fn parameter(pipeline: &Pipeline, stage: &str, name: &str) -> Option<toml::Value> {
    pipeline.stages.iter().find(|spec| spec.name == stage)?.parameters.get(name).cloned()
}

#[test]
fn settings_go_before_the_file_and_the_last_one_counts() {
    let mut overrides = with(&["lines.min_length=1", "lines.min_length = 2.5", "lines.mean=groups", "fuse.depth=9"]);
    overrides.seed = Some(u64::MAX);
    overrides.reference = Some("robot2".into());
    let pipeline = load(&overrides).unwrap();
    assert_eq!(parameter(&pipeline, "lines", "min_length"), Some(2.5.into()));
    assert_eq!(parameter(&pipeline, "lines", "mean"), Some("groups".into()));
    assert_eq!(pipeline.stages.iter().find(|stage| stage.name == "fuse").map(|stage| stage.depth), Some(9));
    assert_eq!((pipeline.seed, pipeline.reference.as_deref()), (u64::MAX, Some("robot2")));
}

#[test]
fn an_initial_pose_is_typed_in_numbers_and_the_reference_lies_at_the_origin() {
    let typed = |texts: &[&str]| {
        let mut overrides = Overrides::default();
        overrides.initial_poses = texts.iter().map(|text| (*text).to_owned()).collect();
        load(&overrides)
    };
    let pipeline = typed(&["robot2=1,-2.5, 0.5", "robot3=1,2,3,0.5,0.1"]).unwrap();
    let robot2 = InitialPose { x: 1.0, y: -2.5, yaw: 0.5, ..InitialPose::default() };
    let robot3 = InitialPose { x: 1.0, y: 2.0, yaw: 3.0, stddev: 0.5, yaw_stddev: 0.1 };
    let expected = [("robot1", InitialPose::ORIGIN), ("robot2", robot2), ("robot3", robot3)];
    assert_eq!(pipeline.initial_poses, expected.map(|(robot, pose)| (robot.to_owned(), pose)).into());
    for (text, underlined, says) in [
        ("robot2", "robot2", "expected ROBOT=X,Y,YAW"),
        ("=1,2,3", "=1,2,3", "expected ROBOT=X,Y,YAW"),
        ("robot2=1,2", "1,2", "expected 3 to 5 numbers, found 2"),
        ("robot2=1,2,3,4,5,6", "1,2,3,4,5,6", "found 6"),
        ("robot2=1,north,3", "north", "y: expected a finite number of metres"),
        ("robot2=1,2,3,-1", "-1", "stddev: expected metres"),
    ] {
        let errors = typed(&[text]).unwrap_err();
        let found = shown(&errors);
        assert_eq!((found.len(), found[0].underlined.as_str()), (1, underlined), "{errors}");
        assert!(errors.to_string().contains(says), "{errors}");
    }
}

#[test]
fn files_go_to_the_only_source_and_the_only_sink() {
    let mut overrides = Overrides::default();
    overrides.set_for_kind("mcap_source", "files", vec!["b \"c\".mcap", "d\\e.mcap"]);
    overrides.set_for_kind("mcap_sink", "file", "line\nbreak.mcap");
    let pipeline = load(&overrides).unwrap();
    assert_eq!(parameter(&pipeline, "log", "files"), Some(vec!["b \"c\".mcap", "d\\e.mcap"].into()));
    assert_eq!(parameter(&pipeline, "out", "file"), Some("line\nbreak.mcap".into()));
}

#[test]
fn a_kind_that_no_stage_or_more_than_one_has_cannot_be_set() {
    let mut overrides = Overrides::default();
    overrides.set_for_kind("mcap_source", "files", vec!["b.mcap"]);
    let two = VALID.replace("[stages.fuse]", "[stages.log2]\nkind = \"mcap_source\"\n[stages.fuse]");
    let two = two.replace("[\"log.*\"", "[\"log.*\", \"log2.*\"");
    let parse = |text: &str| Pipeline::parse("walls.toml", text, &registry(), &overrides);
    let errors = parse(&two).unwrap_err().to_string();
    assert!(errors.contains("it is ambiguous which `mcap_source` gets `files`"), "{errors}");
    assert!(
        errors.contains("stages of this kind: `log`, `log2`") && errors.contains("`--set log.files=...`"),
        "{errors}"
    );
    let errors = parse("[stages.out]\nkind = \"mcap_sink\"").unwrap_err().to_string();
    assert!(errors.contains("there is no stage of kind `mcap_source` to set `files` of"), "{errors}");
}

#[test]
fn a_wrong_setting_is_underlined_in_the_setting() {
    let settings =
        ["lines.min_length=-1", "lines.merge=maybe", "lines.min_lenght=1", "linse.merge=true", "log.files=[1]"];
    let errors = load(&with(&settings)).unwrap_err();
    let found: Vec<(String, String)> =
        shown(&errors).into_iter().map(|error| (error.place, error.underlined)).collect();
    let expected =
        [("1:20", "-1"), ("1:15", "\"maybe\""), ("1:7", "min_lenght"), ("1:1", "linse.merge = true"), ("1:14", "1")];
    assert_eq!(found, expected.map(|(place, text)| (place.to_owned(), text.to_owned())), "{errors}");
    assert!(errors.to_string().contains("--> command line:1:20"), "{errors}");
    let mut overrides = Overrides::default();
    overrides.reference = Some(String::new());
    assert!(load(&overrides).unwrap_err().to_string().contains("the reference robot is empty"));
}

#[test]
fn a_setting_has_a_stage_a_parameter_and_a_value() {
    for text in ["", "a", "a.b", "a=1", ".b=1", "a.=1", "a.b="] {
        assert_eq!(Overrides::default().set(text), Err(SettingError::Form(text.to_owned())));
    }
    for text in ["a.b=[1", "a.b=1.2.3", "a.b=\"x", "a.b=x y"] {
        assert!(matches!(Overrides::default().set(text), Err(SettingError::Value { .. })), "{text}");
    }
}
