use super::*;
use serde_json::{Value, json};

fn run(summary: &Value, truth: &Value) -> Result<Evaluation> {
    let folder = tempfile::tempdir().unwrap();
    let (summary_path, truth_path) = (folder.path().join("summary.json"), folder.path().join("truth.json"));
    std::fs::write(&summary_path, summary.to_string()).unwrap();
    std::fs::write(&truth_path, truth.to_string()).unwrap();
    evaluate(&summary_path, &truth_path)
}

fn outcomes(evaluation: &Evaluation) -> Vec<(&str, RobotOutcome)> {
    evaluation.robots.iter().map(|robot| (robot.robot.as_str(), robot.outcome)).collect()
}

fn frame(x: f64, y: f64, yaw: f64) -> Value {
    json!({"x": x, "y": y, "yaw": yaw})
}

fn truth() -> Value {
    json!({
        "frames": {"robot1": frame(0.0, 0.0, 0.0), "robot2": frame(10.0, 5.0, 1.0), "robot3": frame(-4.0, 2.0, -2.0)},
        "centres": {"robot1": [0.0, 0.0], "robot2": [20.0, 0.0], "robot3": [0.0, 0.0]},
        "tags": {"tag1": [1.0, 2.0]},
    })
}

#[test]
fn errors_are_taken_at_the_middle_of_the_map() {
    let summary = json!({
        "reference": "robot1",
        "frames": {"robot1": frame(0.0, 0.0, 0.0), "robot2": frame(10.0, 5.0, 1.01), "robot3": frame(-4.0, 2.3, -2.0)},
        "unmerged": {}, "alignments": [], "stages": {},
    });
    let evaluation = run(&summary, &truth()).unwrap();
    assert_eq!(outcomes(&evaluation), [("robot2", RobotOutcome::Right), ("robot3", RobotOutcome::Right)]);
    let robot2 = &evaluation.robots[0];
    assert!((robot2.error_m.unwrap() - 0.2).abs() < 1e-3, "0.01 rad over 20 m");
    assert!((robot2.error_deg.unwrap() - 0.573).abs() < 1e-3);
    assert!((evaluation.robots[1].error_m.unwrap() - 0.3).abs() < 1e-9);
    assert_eq!((evaluation.right, evaluation.wrong, evaluation.refused), (2, 0, 0));
}

#[test]
fn errors_are_normalised_by_the_covariance_in_the_summary() {
    let with = |covariance: [f64; 9]| {
        let found = json!({"x": 10.2, "y": 5.0, "yaw": 1.0 + 0.02, "covariance": covariance});
        let frames = json!({"robot1": frame(0.0, 0.0, 0.0), "robot2": found});
        let evaluation = run(&json!({"reference": "robot1", "frames": frames}), &truth()).unwrap();
        evaluation.robots[0].normalised_error_squared
    };
    let normalised = with([0.01, 0.0, 0.0, 0.0, 0.01, 0.0, 0.0, 0.0, 0.0001]).unwrap();
    assert!((normalised - 8.0).abs() < 1e-9, "{normalised}");
    assert_eq!((with([0.0; 9]), with([-1.0; 9])), (None, None));
}

#[test]
fn a_large_error_is_wrong_and_an_unmerged_robot_is_refused() {
    for wrong in [frame(10.5, 5.0, 1.0), frame(10.0, 5.0, 1.02), frame(10.0, 5.0, -2.0)] {
        let summary = json!({
            "reference": "robot1",
            "frames": {"robot1": frame(0.0, 0.0, 0.0), "robot2": wrong},
            "unmerged": {"robot3": "no tags in common"},
        });
        let evaluation = run(&summary, &truth()).unwrap();
        assert_eq!(outcomes(&evaluation), [("robot2", RobotOutcome::Wrong), ("robot3", RobotOutcome::Refused)]);
        assert_eq!(evaluation.robots[1].reason.as_deref(), Some("no tags in common"));
        assert_eq!((evaluation.right, evaluation.wrong, evaluation.refused), (0, 1, 1));
    }
}

#[test]
fn the_truth_is_transformed_to_the_reference_of_the_run() {
    let place = |x, y, yaw| Isometry2::new(nalgebra::Vector2::new(x, y), yaw);
    let (robot2, robot3) = (place(10.0, 5.0, 1.0), place(-4.0, 2.0, -2.0));
    let seen = |pose: Isometry2<f64>| frame(pose.translation.x, pose.translation.y, pose.rotation.angle());
    let summary = json!({
        "reference": "robot2",
        "frames": {
            "robot1": seen(robot2.inverse()), "robot2": frame(0.0, 0.0, 0.0), "robot3": seen(robot2.inverse() * robot3),
        },
    });
    let evaluation = run(&summary, &truth()).unwrap();
    assert_eq!(outcomes(&evaluation), [("robot1", RobotOutcome::Right), ("robot3", RobotOutcome::Right)]);
    assert!(evaluation.robots.iter().all(|robot| robot.error_m.unwrap() < 1e-9));
}

#[test]
fn unrelated_robots_are_rightly_refused_and_wrongly_merged() {
    let refused = json!({
        "reference": "robot1", "frames": {"robot1": frame(0.0, 0.0, 0.0)}, "unmerged": {"robot2": "other tags"},
    });
    let merged = json!({
        "reference": "robot1", "frames": {"robot1": frame(0.0, 0.0, 0.0), "robot2": frame(1.0, 0.0, 0.0)},
    });
    let truth = json!({"frames": {}});
    let evaluation = run(&refused, &truth).unwrap();
    assert_eq!(outcomes(&evaluation), [("robot2", RobotOutcome::RightlyRefused)]);
    assert!(!evaluation.related);
    assert_eq!(outcomes(&run(&merged, &truth).unwrap()), [("robot2", RobotOutcome::Wrong)]);
}

#[test]
fn robots_that_are_in_only_one_of_the_files_are_listed() {
    let summary = json!({
        "reference": "robot1",
        "frames": {"robot1": frame(0.0, 0.0, 0.0), "robot7": frame(1.0, 0.0, 0.0)},
        "unmerged": {"robot8": "no tags"},
    });
    let evaluation = run(&summary, &truth()).unwrap();
    let expected = [
        ("robot2", RobotOutcome::Refused),
        ("robot3", RobotOutcome::Refused),
        ("robot7", RobotOutcome::NoTruth),
        ("robot8", RobotOutcome::NoTruth),
    ];
    assert_eq!(outcomes(&evaluation), expected);
    assert_eq!(evaluation.refused, 2);
}

#[test]
fn a_reference_that_is_not_in_the_truth_is_an_error() {
    let summary = json!({"reference": "robot9", "frames": {"robot9": frame(0.0, 0.0, 0.0)}});
    let error = format!("{:#}", run(&summary, &truth()).unwrap_err());
    assert!(error.contains("`robot9` is not in the truth, which has robot1, robot2 and robot3"), "{error}");
}

#[test]
fn wrong_files_are_errors_that_name_them() {
    let folder = tempfile::tempdir().unwrap();
    let (good, bad) = (folder.path().join("good.json"), folder.path().join("bad.json"));
    std::fs::write(&good, r#"{"reference": null, "frames": {}}"#).unwrap();
    for (text, part) in [
        ("{", "EOF"),
        ("[]", "invalid"),
        (r#"{"reference": "robot1"}"#, "missing field `frames`"),
        (r#"{"reference": "a", "frames": {"a": {"x": null, "y": 0, "yaw": 0}}}"#, "null"),
    ] {
        std::fs::write(&bad, text).unwrap();
        let error = format!("{:#}", evaluate(&bad, &good).unwrap_err());
        assert!(error.contains("bad.json is not the summary of a run") && error.contains(part), "{error}");
    }
    std::fs::write(&bad, r#"{"frames": 3}"#).unwrap();
    let error = format!("{:#}", evaluate(&good, &bad).unwrap_err());
    assert!(error.contains("bad.json is not a truth file"), "{error}");
    let none = folder.path().join("none.json");
    for (summary, truth) in [(&none, &good), (&good, &none)] {
        let error = format!("{:#}", evaluate(summary, truth).unwrap_err());
        assert!(error.contains("none.json"), "{error}");
    }
}

#[test]
fn the_table_has_a_line_for_every_robot() {
    let summary = json!({
        "reference": "robot1",
        "frames": {"robot1": frame(0.0, 0.0, 0.0), "robot2": frame(10.0, 5.0, 1.0)},
        "unmerged": {"robot3": "no tags in common"},
    });
    let text = run(&summary, &truth()).unwrap().to_text(None);
    let expected = "  robot   outcome  error m  error deg
  robot2  right      0.000      0.000
  robot3  refused        -          -  no tags in common
right 1, wrong 0, refused 1 (reference robot1)
";
    assert_eq!(text, expected);
}

#[test]
fn the_outcome_follows_from_the_merge_the_truth_and_the_error() {
    // Whether the robot is merged, whether it is in the truth, whether it is near, and the outcome among related robots
    // and among unrelated ones.
    use RobotOutcome::{NoTruth, Refused, Right, RightlyRefused, Wrong};
    for (is_merged, is_in_truth, is_near, among_related, among_unrelated) in [
        (true, true, Some(true), Right, Right),
        (true, true, Some(false), Wrong, Wrong),
        (true, false, None, NoTruth, Wrong),
        (false, true, None, Refused, Refused),
        (false, false, None, NoTruth, RightlyRefused),
    ] {
        let outcomes = [true, false].map(|related| RobotOutcome::of(is_merged, is_in_truth, is_near, related));
        assert_eq!(outcomes, [among_related, among_unrelated], "{is_merged} {is_in_truth} {is_near:?}");
    }
}
