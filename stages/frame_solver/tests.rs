//! The stage from outside.

use super::solve::{Solution, by_name, solve};
use super::team::Team;
use super::uncertain::error_vector;
use super::{FrameSolverParameters, kind};
use crate::geometry::{Pose2, pose, wrap_angle};
use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::{Alignment, Header, OccupancyGrid, RobotFrame, RobotFrames, TFMessage, Verdict, Verdicts};
use gridweave_runtime::stage::{Context, LoneStage, StageError};
use proptest::prelude::*;

struct Run {
    stage: LoneStage,
    /// What was sent last.
    latest: Option<RobotFrames>,
    verdicts: Option<Verdicts>,
}

impl Run {
    fn new(reference: Option<&str>) -> Self {
        let context = Context { reference: reference.map(str::to_owned), ..Default::default() };
        let stage = LoneStage::with_context(&kind(), "", &context).unwrap();
        Self { stage, latest: None, verdicts: None }
    }

    fn map(&mut self, robot: &str, frame_id: &str) {
        let map = OccupancyGrid { header: Header::new(LogTime(5), frame_id), ..Default::default() };
        self.stage.give::<OccupancyGrid<'_>>("map", robot, LogTime(5), &map).unwrap();
    }

    fn align(&mut self, alignment: &Alignment) {
        self.stage.give::<Alignment>("alignment", "", LogTime(5), alignment).unwrap();
    }

    fn finish(&mut self) -> Result<(), StageError> {
        self.stage.finish(LogTime(6))
    }

    /// The frames sent since the last look.
    fn frames(&mut self) -> Vec<RobotFrames> {
        let frames: Vec<RobotFrames> = self.stage.take("frames").unwrap();
        self.latest = frames.last().cloned().or_else(|| self.latest.take());
        frames
    }

    /// The frames sent last.
    fn latest(&mut self) -> Option<RobotFrames> {
        self.frames();
        self.latest.clone()
    }

    /// The frames as they are solved: they are sent when the run ends.
    fn solved(&mut self) -> RobotFrames {
        self.finish().unwrap();
        self.latest().unwrap()
    }

    /// The verdicts when the run ends.
    fn verdicts(&mut self) -> Vec<Verdict> {
        self.finish().unwrap();
        self.verdicts = self.stage.take("verdicts").unwrap().pop().or_else(|| self.verdicts.take());
        self.verdicts.clone().unwrap_or_default().verdicts
    }

    fn pose_of(&mut self, robot: &str) -> Option<Pose2> {
        let solved = self.solved();
        let frame = solved.frames.iter().find(|frame| frame.robot == robot)?;
        Some(pose(frame.x, frame.y, frame.yaw))
    }

    fn reason(&mut self, robot: &str) -> String {
        let latest = self.latest().unwrap();
        latest.unmerged.into_iter().find(|unmerged| unmerged.robot == robot).unwrap_or_default().reason
    }
}

const COVARIANCE: [f64; 9] = [1e-4, 2e-5, 0.0, 2e-5, 2e-4, 1e-6, 0.0, 1e-6, 1e-6];

fn accepted(a: &str, b: &str, transform_a_b: Pose2) -> Alignment {
    let mut alignment = Alignment {
        a: a.into(),
        b: b.into(),
        covariance: COVARIANCE,
        score: 0.9,
        method: "icp".into(),
        accepted: true,
        reason: "3 tags agree".into(),
        ..Default::default()
    };
    alignment.set_transform_a_b(&transform_a_b);
    alignment
}

fn refused(a: &str, b: &str, score: f64, reason: &str) -> Alignment {
    Alignment { a: a.into(), b: b.into(), score, reason: reason.into(), ..Default::default() }
}

fn is_near(one: &Pose2, other: &Pose2, tolerance: f64) -> bool {
    (one.translation.vector - other.translation.vector).norm() < tolerance
        && wrap_angle(one.rotation.angle() - other.rotation.angle()).abs() < tolerance
}

/// Where robot `n` (from 1) is in these tests.
fn place(robot: usize) -> Pose2 {
    let n = robot as f64 - 1.0;
    pose(4.0 * n, -3.0 * n * n % 11.0, 0.8 * n)
}

fn between(a: usize, b: usize) -> Alignment {
    accepted(&format!("robot{a}"), &format!("robot{b}"), place(a).inverse() * place(b))
}

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
fn the_reference_is_exactly_at_the_origin() {
    let mut run = Run::new(None);
    run.map("robot1", "map");
    let robot1 = RobotFrame { robot: "robot1".into(), frame_id: "robot1/map".into(), ..Default::default() };
    let expected = RobotFrames {
        header: Header::new(LogTime(5), "world"),
        reference: "robot1".into(),
        frames: vec![robot1],
        ..Default::default()
    };
    assert_eq!(run.solved(), expected);
    assert!(run.stage.take_messages("verdicts").is_empty(), "there is no pair");
}

#[test]
fn another_reference_turns_the_frames_round() {
    let mut run = Run::new(Some("robot2"));
    run.map("robot1", "map");
    assert!(run.frames().is_empty(), "without the reference there is no world");
    run.map("robot2", "map");
    run.align(&between(1, 2));
    assert!(is_near(&run.pose_of("robot1").unwrap(), &(place(2).inverse() * place(1)), 1e-9));
    assert_eq!(run.latest().unwrap().reference, "robot2");
}

#[test]
fn a_reference_that_never_shows_up_is_an_error_that_names_the_robots() {
    let mut run = Run::new(Some("robot7"));
    run.map("robot1", "map");
    run.map("robot2", "map");
    let error = run.finish().unwrap_err().to_string();
    assert!(error.contains("robot7") && error.contains("robot1, robot2"), "{error}");
    assert_eq!(run.latest(), None);
}

#[test]
fn a_log_without_robots_has_no_frames() {
    let mut run = Run::new(None);
    run.finish().unwrap();
    assert!(run.frames().is_empty());
    assert!(run.stage.take_messages("verdicts").is_empty());
}

#[test]
fn frames_are_sent_when_something_changes_and_only_then() {
    let mut run = Run::new(None);
    run.map("robot1", "robot1/map");
    assert_eq!(run.frames().len(), 1);
    run.map("robot1", "robot1/map");
    assert_eq!(run.frames().len(), 0, "a later map of a known robot");
    run.map("robot2", "robot2/map");
    assert_eq!(run.frames().len(), 1, "another robot");
    run.align(&refused("robot1", "robot2", 0.1, "two tags in common"));
    assert_eq!(run.frames().len(), 1, "another reason");
    run.align(&between(1, 2));
    assert_eq!(run.frames().len(), 1, "a pose");
    let mut nearly = between(1, 2);
    run.align(&nearly);
    nearly.x += 0.01;
    run.align(&nearly);
    assert_eq!(run.frames().len(), 0, "a pose that the alignments hardly fit better");
    run.finish().unwrap();
    assert!((run.frames()[0].frames[1].x - nearly.x).abs() < 1e-9, "at the end it is as solved");
    run.finish().unwrap();
    assert!(run.frames().is_empty());
}

#[test]
fn transforms_lead_from_the_world_to_frames_with_the_robots_name() {
    let mut run = Run::new(None);
    run.map("robot1", "/robot1/map");
    run.map("robot2", "map");
    run.map("robot3", "");
    run.align(&between(1, 2));
    run.align(&between(2, 3));
    let last = run.stage.take_messages("tf").pop().unwrap();
    assert_eq!(last.header().topic.as_str(), "/tf_static");
    let transforms = last.decode::<TFMessage>().unwrap().transforms;
    let names: Vec<&str> = transforms.iter().map(|transform| transform.child_frame_id.as_str()).collect();
    assert_eq!(names, ["robot1/map", "robot2/map", "robot3/map"]);
    assert!(transforms.iter().all(|transform| transform.header.frame_id == "world"));
    assert!(is_near(&transforms[2].transform.planar(), &place(3), 1e-9));
}

#[test]
fn a_robot_without_alignments_says_so() {
    let mut run = Run::new(None);
    run.map("robot1", "map");
    run.map("robot2", "map");
    assert!(run.reason("robot2").starts_with("no alignment with any robot was found"), "{}", run.reason("robot2"));
}

#[test]
fn the_most_telling_refusal_is_the_reason() {
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
fn robots_tied_to_each_other_but_not_to_the_reference_say_so() {
    let mut run = Run::new(None);
    run.map("robot1", "map");
    run.align(&between(2, 3));
    run.align(&refused("robot1", "robot3", 0.2, "no tags in common"));
    let expected = "it is tied to robot3 only, not to the reference: no alignment with robot1: no tags in common";
    assert_eq!(run.reason("robot2"), expected);
}

#[test]
fn a_later_alignment_replaces_the_earlier_one() {
    let mut run = Run::new(None);
    run.align(&accepted("robot1", "robot2", pose(9.0, 9.0, 1.0)));
    run.align(&between(1, 2));
    assert!(is_near(&run.pose_of("robot2").unwrap(), &place(2), 1e-9));
    run.align(&refused("robot1", "robot2", 0.3, "the larger maps disagree"));
    assert_eq!(run.reason("robot2"), "no alignment with robot1: the larger maps disagree");
}

#[test]
fn a_contradiction_that_cannot_be_told_leaves_its_robots_out() {
    let mut run = Run::new(None);
    let mut wrong = between(2, 3);
    wrong.x += 3.0;
    [between(1, 2), between(1, 3), wrong, between(3, 4)].iter().for_each(|alignment| run.align(alignment));
    assert_eq!(run.latest().unwrap().frames.len(), 1);
    assert!(run.reason("robot2").contains("it cannot be told which is wrong"), "{}", run.reason("robot2"));
    assert!(run.reason("robot4").contains("it is tied to robot3 only"), "{}", run.reason("robot4"));
    let accepted: Vec<bool> = run.verdicts().iter().map(|verdict| verdict.alignment.accepted).collect();
    assert_eq!(accepted, [false, false, false, true]);
}

#[test]
fn a_wrong_alignment_is_left_out_when_the_others_agree() {
    let mut run = Run::new(None);
    for a in 1..=4 {
        (a + 1..=4).for_each(|b| run.align(&between(a, b)));
    }
    let mut wrong = between(1, 3);
    wrong.yaw += 1.5;
    run.align(&wrong);
    for robot in 2..=4 {
        assert!(is_near(&run.pose_of(&format!("robot{robot}")).unwrap(), &place(robot), 1e-6));
    }
    let (left_out, others): (Vec<Verdict>, Vec<Verdict>) =
        run.verdicts().into_iter().partition(|verdict| !verdict.alignment.accepted);
    assert_eq!((left_out.len(), others.len()), (1, 5));
    let left_out = &left_out[0].alignment;
    assert_eq!((left_out.a.as_str(), left_out.b.as_str(), left_out.yaw), ("robot1", "robot3", wrong.yaw));
    assert!(left_out.reason.contains("contradicts"), "{}", left_out.reason);
}

#[test]
fn a_verdict_says_what_the_alignment_said() {
    let mut run = Run::new(None);
    let refusal = refused("robot1", "robot3", 0.2, "no tags in common");
    [between(1, 2), refusal.clone()].iter().for_each(|alignment| run.align(alignment));
    run.align(&Alignment { header: Header::new(LogTime(5), "robot1/map"), ..between(1, 2) });
    let unchecked = |alignment| Verdict { alignment, checked: false };
    assert_eq!(run.verdicts(), [unchecked(between(1, 2)), unchecked(refusal)]);
    assert_eq!(run.verdicts.unwrap().header, Header::new(LogTime(5), "world"));
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
fn a_score_that_moves_no_robot_is_told_at_the_end() {
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
fn garbage_is_left_out_with_a_reason() {
    let mut run = Run::new(None);
    run.map("robot1", "map");
    for (x, variance) in [(f64::NAN, 1.0), (f64::INFINITY, 1.0), (1e300, 1.0), (0.0, f64::NAN), (0.0, -5.0)] {
        let mut alignment = between(1, 2);
        (alignment.x, alignment.covariance[0]) = (x, variance);
        run.align(&alignment);
        assert!(run.pose_of("robot2").is_none());
        assert!(run.reason("robot2").contains("its "), "{}", run.reason("robot2"));
    }
    run.align(&accepted("robot1", "robot1", pose(1.0, 0.0, 0.0)));
    run.map("", "map");
    assert_eq!(run.stage.warnings().values().sum::<u64>(), 2);
}

#[test]
fn a_certain_alignment_counts_for_more() {
    let mut run = Run::new(None);
    run.align(&between(1, 2));
    run.align(&between(2, 3));
    let mut vague = between(1, 3);
    vague.x += 0.5;
    vague.covariance = std::array::from_fn(|index| if index % 4 == 0 { 1.0 } else { 0.0 });
    run.align(&vague);
    assert!(is_near(&run.pose_of("robot3").unwrap(), &place(3), 0.02));
}

fn near(a: usize, b: usize, metres: f64) -> Alignment {
    let mut alignment = between(a, b);
    alignment.x += metres;
    alignment
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
fn robots_that_were_sent_stay_until_the_alignments_fit_much_better() {
    let mut run = Run::new(None);
    run.align(&between(1, 2));
    let sent = run.frames().pop().unwrap().frames[1].clone();
    run.align(&near(1, 2, 0.01));
    assert!(run.frames().is_empty());
    run.align(&between(2, 3));
    let with_another = run.frames().pop().unwrap();
    assert_eq!(
        (with_another.frames[1].x, with_another.frames[1].yaw),
        (sent.x, sent.yaw),
        "another robot is no reason"
    );
    assert_eq!(with_another.frames.len(), 3);
    run.align(&near(1, 2, 0.3));
    let moved = run.frames().pop().unwrap();
    assert!((moved.frames[1].x - sent.x - 0.3).abs() < 1e-9);
    run.align(&near(1, 2, 0.31));
    assert!(run.frames().is_empty());
    run.finish().unwrap();
    let last = run.frames().pop().unwrap();
    assert!((last.frames[1].x - sent.x - 0.31).abs() < 1e-9, "the best is sent at the end");
}

#[test]
fn robots_tied_to_each_other_only_are_placed_in_a_frame_of_their_own() {
    let mut run = Run::new(None);
    (1..=6).for_each(|robot| run.map(&format!("robot{robot}"), "map"));
    run.align(&between(4, 5));
    run.align(&between(3, 4));
    let message = run.frames().pop().unwrap();
    assert_eq!(message.frames.len(), 1);
    assert_eq!(message.unmerged.len(), 5);
    assert_eq!(message.groups.len(), 1);
    let group = &message.groups[0];
    assert_eq!(group.reference, "robot4", "the reference stays when another robot joins");
    let robots: Vec<&str> = group.frames.iter().map(|frame| frame.robot.as_str()).collect();
    assert_eq!((group.frame_id.as_str(), robots), ("world/robot4", vec!["robot3", "robot4", "robot5"]));
    for (frame, robot) in group.frames.iter().zip(3..) {
        assert!(is_near(&frame.transform_reference_robot(), &(place(4).inverse() * place(robot)), 1e-9));
    }
    let transforms = run.stage.take::<TFMessage>("tf").unwrap().pop().unwrap().transforms;
    let parents: Vec<&str> = transforms.iter().map(|transform| transform.header.frame_id.as_str()).collect();
    assert_eq!(parents, ["world", "world/robot4", "world/robot4", "world/robot4"]);
    run.align(&between(1, 5));
    assert!(run.latest().unwrap().groups.is_empty());
    assert!(is_near(&run.pose_of("robot3").unwrap(), &place(3), 1e-9));
}

#[test]
fn an_alignment_in_no_cycle_is_not_checked() {
    let mut run = Run::new(None);
    [between(1, 2), between(1, 3), between(2, 3), between(3, 4)].iter().for_each(|alignment| run.align(alignment));
    run.align(&refused("robot1", "robot4", 0.0, "no tags in common"));
    let checked: Vec<bool> = run.verdicts().iter().map(|verdict| verdict.checked).collect();
    assert_eq!(checked, [true, true, false, true, false]);
}

#[test]
fn robots_are_placed_right_in_spite_of_wrong_alignments() {
    let team = Team::new(16, 6, 7).with_mistakes(0.1);
    let mut run = Run::new(None);
    (0..team.edges.len()).for_each(|index| run.align(&team.alignment(index)));
    let placed: Vec<(usize, Pose2)> =
        (1..16).filter_map(|robot| Some((robot, run.pose_of(&Team::name(robot))?))).collect();
    assert!(placed.len() >= 14, "{}", placed.len());
    assert!(placed.iter().all(|(robot, pose)| !team.is_wrong(*robot, pose)));
}

#[test]
fn covariances_say_how_far_off_the_frames_are() {
    let parameters =
        FrameSolverParameters { position_floor: 1e-6, yaw_floor: 1e-6, ..FrameSolverParameters::default() };
    let robots = 12;
    let mut sum = 0.0;
    let mut count = 0.0;
    for seed in 0..60 {
        let team = Team::new(robots, 4, seed);
        let names = (0..robots).map(Team::name).collect();
        let alignments = (0..team.edges.len()).filter_map(|index| by_name(team.alignment(index))).collect();
        let solution = solve(&names, &alignments, &Team::name(0), &parameters, &Solution::default());
        for robot in 1..robots {
            let Some(frame) = solution.frames.get(&Team::name(robot)) else { continue };
            let truth = team.places[0].inverse() * team.places[robot];
            let mut error = error_vector(&frame.pose) - error_vector(&truth);
            error.z = wrap_angle(error.z);
            sum += error.dot(&(frame.covariance.try_inverse().unwrap() * error));
            count += 1.0;
        }
    }
    // The squared error in standard deviations is 3 in the mean if the covariances are right: one for each of x, y and
    // yaw. The robots of one team are off together, so the mean of 60 teams scatters by about 0.25.
    let mean = sum / count;
    assert!((2.3..3.7).contains(&mean), "{mean}");
}

proptest! {
    #[test]
    fn neither_the_order_nor_the_direction_of_alignments_matters(
        order in Just((0..10usize).collect::<Vec<_>>()).prop_shuffle(),
        turned in prop::collection::vec(any::<bool>(), 10),
        noise in prop::collection::vec(-0.02..0.02, 10),
    ) {
        let pairs: Vec<(usize, usize)> = (1..=5).flat_map(|a| (a + 1..=5).map(move |b| (a, b))).collect();
        let alignment = |index: usize, turned: bool| {
            let (a, b) = pairs[index];
            let mut alignment = between(a, b);
            alignment.x += noise[index];
            alignment.yaw += noise[(index + 3) % 10] / 10.0;
            if turned {
                let transform_b_a = super::UncertainPose {
                    pose: alignment.transform_a_b(),
                    covariance: nalgebra::Matrix3::from_row_slice(&alignment.covariance),
                }.inverse();
                std::mem::swap(&mut alignment.a, &mut alignment.b);
                alignment.set_transform_a_b(&transform_b_a.pose);
                alignment.covariance = crate::geometry::row_by_row(&transform_b_a.covariance);
            }
            alignment
        };
        let (mut plain, mut mixed) = (Run::new(Some("robot1")), Run::new(Some("robot1")));
        (0..10).for_each(|index| plain.align(&alignment(index, false)));
        order.iter().for_each(|&index| mixed.align(&alignment(index, turned[index])));
        for robot in ["robot1", "robot2", "robot3", "robot4", "robot5"] {
            let (one, other) = (plain.pose_of(robot).unwrap(), mixed.pose_of(robot).unwrap());
            prop_assert!(is_near(&one, &other, 1e-7), "{} {} {}", robot, one, other);
        }
        // In the same directions it is the same to the last bit.
        let mut shuffled = Run::new(Some("robot1"));
        order.iter().for_each(|&index| shuffled.align(&alignment(index, false)));
        prop_assert_eq!(shuffled.solved().frames, plain.solved().frames);
        prop_assert_eq!(shuffled.verdicts(), plain.verdicts());
    }

    #[test]
    fn a_chain_of_robots_is_recovered(
        steps in prop::collection::vec((-9.0..9.0, -9.0..9.0, -3.1..3.1), 1..20),
        reference in 0usize..20,
    ) {
        let mut places = vec![Pose2::identity()];
        for (x, y, yaw) in steps {
            places.push(places[places.len() - 1] * pose(x, y, yaw));
        }
        let name = |robot: usize| format!("robot{robot:02}");
        let reference = reference.min(places.len() - 1);
        let mut run = Run::new(Some(&name(reference)));
        for robot in 1..places.len() {
            run.align(&accepted(&name(robot - 1), &name(robot), places[robot - 1].inverse() * places[robot]));
        }
        for (robot, place) in places.iter().enumerate() {
            let solved = run.pose_of(&name(robot)).unwrap();
            prop_assert!(is_near(&solved, &(places[reference].inverse() * place), 1e-7));
        }
    }
}
