//! Which messages are sent, and when.

use super::*;

#[test]
fn a_provisional_alignment_is_left_out() {
    let mut run = Run::new(None);
    run.map("robot1", "map");
    run.map("robot2", "map");
    run.align(&Alignment { provisional: true, reason: "2 tags only".into(), ..between(1, 2) });
    assert_eq!(run.pose_of("robot2"), None);
    let reason = run.reason("robot2");
    assert!(reason.contains("provisional") && reason.contains("2 tags only"), "{reason}");
    run.align(&between(1, 2));
    assert!(run.pose_of("robot2").is_some());
}

#[test]
fn a_robot_without_a_map_is_in_the_frame_of_its_tags() {
    let mut run = Run::new(None);
    run.tags("robot1", "robot1/odom");
    run.map("robot2", "map");
    run.tags("robot2", "odom");
    assert_eq!(run.frames().len(), 1, "tags alone make no robot known");
    run.align(&between(1, 2));
    let frame_ids = |frames: RobotFrames| frames.frames.into_iter().map(|frame| frame.frame_id).collect::<Vec<_>>();
    assert_eq!(frame_ids(run.solved()), ["robot1/odom", "robot2/map"]);
    run.tags("robot1", "odom_combined");
    assert_eq!(frame_ids(run.solved()), ["robot1/odom_combined", "robot2/map"]);
}

#[test]
fn a_reference_that_never_shows_up_is_an_error_that_names_the_robots() {
    let mut run = Run::new(Some("robot7"));
    run.map("robot1", "map");
    run.map("robot2", "map");
    let error = run.finish().unwrap_err().to_string();
    assert!(error.contains("robot7") && error.contains("robot1 and robot2"), "{error}");
    assert_eq!(run.latest(), None);
}

#[test]
fn a_robot_without_a_map_beside_those_with_maps_is_said_to_have_none() {
    let mut run = Run::new(None);
    run.map("robot1", "map");
    run.align(&refused("robot1", "robot2", 0.1, "no tag in common"));
    assert!(
        run.reason("robot2").starts_with("it has sent no map, and by its tags alone: "),
        "{}",
        run.reason("robot2")
    );
    run.map("robot2", "map");
    assert!(!run.reason("robot2").contains("no map"), "{}", run.reason("robot2"));
}

#[test]
fn that_a_robot_has_no_map_is_said_once_however_many_alignments_are_refused() {
    let mut run = Run::new(None);
    run.map("robot1", "map");
    run.map("robot3", "map");
    run.align(&refused("robot1", "robot2", 0.1, "no tag in common"));
    run.align(&refused("robot1", "robot3", 0.1, "no tag in common"));
    run.align(&refused("robot1", "robot3", 0.2, "one tag in common"));
    let reason = run.reason("robot2");
    assert_eq!(reason.matches("it has sent no map").count(), 1, "{reason}");
}

#[test]
fn an_initial_pose_of_a_robot_that_never_shows_up_is_a_warning() {
    let initial_poses = ["robot1", "robt2"].map(|robot| (robot.to_owned(), InitialPose::ORIGIN)).into();
    let mut run = Run::in_context(&Context { initial_poses, ..Default::default() });
    run.map("robot1", "map");
    run.map("robot2", "map");
    run.finish().unwrap();
    let warnings: Vec<String> = run.stage.warnings().into_keys().collect();
    let warning =
        "the initial pose of `robt2` is not used, as there is no such robot; the robots seen are robot1 and robot2";
    assert_eq!(warnings, [warning]);
}

#[test]
fn a_log_without_robots_has_no_frames() {
    let mut run = Run::new(None);
    run.finish().unwrap();
    assert!(run.frames().is_empty());
    assert!(run.stage.take_messages("verdicts").is_empty());
}

#[test]
fn a_robot_whose_map_cannot_be_used_is_no_reference_and_has_that_as_reason() {
    let mut run = Run::new(None);
    run.map_of_resolution("robot1", "map", 0.0);
    assert_eq!(run.latest().unwrap().reference, "robot1", "there is no other");
    run.map("robot2", "map");
    run.map("robot3", "map");
    run.align(&between(2, 3));
    assert_eq!(run.latest().unwrap().reference, "robot2");
    assert!(run.pose_of("robot3").is_some());
    let reason = run.reason("robot1");
    assert_eq!(reason, "its map cannot be used: its resolution is 0 m per cell, which is not positive");
    // A later map of it can be used.
    run.map("robot1", "map");
    assert!(!run.reason("robot1").contains("cannot be used"));
    run.map_of_resolution("robot1", "map", f32::NAN);
    assert!(!run.reason("robot1").contains("cannot be used"), "one that can be used has come before");
    // A robot that is known by an alignment before its map.
    run.align(&refused("robot2", "robot4", 0.1, "two tags in common"));
    run.map_of_resolution("robot4", "map", 0.0);
    assert!(run.reason("robot4").contains("cannot be used"));
}

#[test]
fn a_robot_that_has_lost_its_way_is_not_merged_and_is_no_reference() {
    let mut run = Run::new(None);
    run.lost("robot1", "it has no map: its scans do not fit");
    assert!(run.latest().is_none(), "nobody has a map");
    run.map("robot2", "map");
    assert_eq!(run.latest().unwrap().reference, "robot2");
    assert_eq!(run.reason("robot1"), "it has no map: its scans do not fit");
    // One that had a map before keeps its place.
    run.map("robot3", "map");
    run.align(&between(2, 3));
    run.lost("robot3", "it has no map: its scans do not fit");
    assert!(run.pose_of("robot3").is_some() && run.pose_of("robot1").is_none());
}

#[test]
fn robots_of_which_it_is_known_why_they_have_no_map_are_no_reference_and_no_pair() {
    let mut run = Run::new(None);
    run.align(&refused("robot1", "robot2", 0.0, "no tag in common"));
    run.lost("robot1", "nothing to merge");
    run.lost("robot2", "nothing to merge");
    run.align(&refused("robot2", "robot3", 0.0, "no tag in common"));
    run.map("robot3", "map");
    run.map("robot4", "map");
    run.align(&between(3, 4));
    assert_eq!(run.solved().reference, "robot3");
    assert_eq!([run.reason("robot1"), run.reason("robot2")], ["nothing to merge"; 2].map(str::to_owned));
    let verdicts: Vec<Verdicts> = run.stage.take("verdicts").unwrap();
    let last = &verdicts.last().unwrap().verdicts;
    let pairs: Vec<_> = last.iter().map(|verdict| (&*verdict.alignment.a, &*verdict.alignment.b)).collect();
    assert_eq!(pairs, [("robot2", "robot3"), ("robot3", "robot4")]);
    // An alignment by tags merges a robot all the same.
    run.align(&between(2, 3));
    assert!(run.pose_of("robot2").is_some());
}

#[test]
fn where_maps_are_expected_and_there_are_none_the_reasons_say_so() {
    let wire = |port| InputWire { port, ..Default::default() };
    let reasons = |inputs: Vec<InputWire>| {
        let mut run = Run::in_context(&Context { inputs, ..Default::default() });
        run.align(&refused("robot1", "robot2", 0.0, "no tag in common"));
        assert_eq!(run.reason("robot2"), "no alignment with robot1: no tag in common", "maps may come");
        run.finish().unwrap();
        let reason = run.reason("robot2");
        let verdicts: Vec<Verdicts> = run.stage.take("verdicts").unwrap();
        (reason, verdicts.last().unwrap().verdicts[0].alignment.reason.clone())
    };
    let (robot, pair) = reasons(vec![wire("map")]);
    assert_eq!(robot, "it has sent no map, and by its tags alone: no alignment with robot1: no tag in common");
    assert_eq!(pair, "robot1 and robot2 have sent no map, and by tags alone: no tag in common");
    let (robot, pair) = reasons(vec![wire("map"), wire("tags")]);
    assert_eq!((&*robot, &*pair), ("no alignment with robot1: no tag in common", "no tag in common"));
}

#[test]
fn the_most_informative_refusal_is_the_reason() {
    let mut run = Run::new(None);
    run.align(&between(1, 2));
    run.align(&refused("robot1", "robot3", 0.0, "no tags in common"));
    run.align(&refused("robot2", "robot3", 0.0, "no tags in common"));
    run.align(&refused("robot3", "robot4", 0.9, "not merged either"));
    assert_eq!(run.reason("robot3"), "no alignment with robot1 and robot2: no tags in common");
    run.align(&refused("robot2", "robot3", 0.4, "walls agree to 40 % only"));
    assert_eq!(run.reason("robot3"), "no alignment with robot2: walls agree to 40 % only");
    assert_eq!(run.reason("robot4"), "no alignment with robot3: not merged either");
}

#[test]
fn the_verdicts_on_many_pairs_are_not_sent_for_each_robot() {
    let mut run = Run::new(Some("robot1"));
    let (robots, mut sent) = (100, 0);
    for b in 1..=robots {
        run.map(&format!("robot{b}"), "map");
        for a in 1..b {
            run.align(&refused(&format!("robot{a}"), &format!("robot{b}"), 0.1, &format!("{a} and {b}")));
        }
        let messages: Vec<Verdicts> = run.stage.take("verdicts").unwrap();
        sent += messages.iter().map(|message| message.verdicts.len()).sum::<usize>();
    }
    let pairs = robots * (robots - 1) / 2;
    assert_eq!(run.verdicts().len(), pairs);
    assert!(sent < 15 * pairs, "{sent} verdicts on {pairs} pairs");
}

#[test]
fn verdicts_are_sent_after_frames_and_at_the_end_if_they_have_changed() {
    let mut run = Run::new(None);
    run.map("robot1", "map");
    run.map("robot2", "map");
    run.align(&between(1, 2));
    assert_eq!(run.stage.take_messages("verdicts").len(), 1);
    run.map("robot3", "map");
    assert_eq!(run.frames().len(), 4);
    assert!(run.stage.take_messages("verdicts").is_empty(), "another robot is no alignment");
    let nearly = near(1, 2, 0.01);
    run.align(&nearly);
    assert!(run.stage.take_messages("verdicts").is_empty(), "no frames were sent");
    run.finish().unwrap();
    assert_eq!(run.verdicts(), [Verdict { alignment: nearly, checked: false }]);
    run.finish().unwrap();
    assert!(run.stage.take_messages("verdicts").is_empty());
}

#[test]
fn a_score_that_moves_no_robot_is_sent_at_the_end() {
    let mut run = Run::new(None);
    run.align(&between(1, 2));
    let scored = Alignment { score: 0.95, ..between(1, 2) };
    run.align(&scored);
    run.frames();
    run.finish().unwrap();
    assert!(run.frames().is_empty());
    assert_eq!(run.verdicts(), [Verdict { alignment: scored, checked: false }]);
}

#[test]
fn covariances_are_sent_as_solved_at_the_end() {
    let mut run = Run::new(None);
    run.align(&between(1, 2));
    let before = run.frames().pop().unwrap();
    run.align(&Alignment { covariance: COVARIANCE.map(|variance| 4.0 * variance), ..between(1, 2) });
    assert!(run.frames().is_empty(), "the poses are the same");
    run.finish().unwrap();
    let last = run.frames().pop().unwrap();
    assert!(last.frames[1].covariance[0] > before.frames[1].covariance[0]);
}

#[test]
fn a_reference_stays_when_an_earlier_name_appears_after_a_merge() {
    let mut run = Run::new(None);
    run.map("robot3", "map");
    run.map("robot2", "map");
    assert_eq!(run.latest().unwrap().reference, "robot2", "nothing is merged so far");
    run.align(&between(2, 3));
    run.map("robot1", "map");
    assert_eq!(run.latest().unwrap().reference, "robot2");
    assert!(is_near(&run.pose_of("robot3").unwrap(), &(place(2).inverse() * place(3)), 1e-9));
    run.align(&between(1, 2));
    assert!(is_near(&run.pose_of("robot1").unwrap(), &(place(2).inverse() * place(1)), 1e-9));
    run.align(&refused("robot2", "robot3", 0.1, "the larger maps disagree"));
    run.align(&refused("robot1", "robot2", 0.1, "the larger maps disagree"));
    assert_eq!(run.latest().unwrap().reference, "robot2");
}

#[test]
fn reasons_are_the_same_whether_robots_are_solved_before_or_after_refusals() {
    let connected = [between(1, 2), between(3, 4)];
    let refusals = [
        refused("robot1", "robot3", 0.3, "too few tags"),
        refused("robot4", "robot2", 0.5, "walls do not fit"),
        refused("robot5", "robot1", 0.1, "nothing in common"),
        refused("robot3", "robot5", 0.9, "walls do not fit"),
        refused("robot6", "robot1", 0.2, "no walls"),
        // The last one of a pair counts.
        refused("robot4", "robot2", 0.2, "nothing in common"),
        refused("robot5", "robot2", 0.1, "nothing in common"),
    ];
    let solve = |alignments: [&[Alignment]; 2]| {
        let mut run = Run::new(None);
        (1..=5).for_each(|robot| run.map(&format!("robot{robot}"), "map"));
        run.map_of_resolution("robot6", "map", 0.0);
        alignments.into_iter().flatten().for_each(|alignment| run.align(alignment));
        run.solved()
    };
    let (before, after) = (solve([&connected, &refusals]), solve([&refusals, &connected]));
    assert_eq!(before.unmerged, after.unmerged);
    let reason = |robot: &str| before.unmerged.iter().find(|unmerged| unmerged.robot == robot).unwrap().reason.clone();
    assert!(reason("robot3").contains("robot4 only") && reason("robot3").contains("too few tags"), "{before:#?}");
    assert!(reason("robot5").contains("robot1 and robot2: nothing in common"), "{before:#?}");
    assert!(reason("robot6").contains("cannot be used"), "{before:#?}");
}
