//! Comparison and judgement on drawn floor plans.

use super::{Decision, JudgementParameters, Refusal, UserKnowledge, judge};
use crate::registration::comparison::compare;
use crate::registration::pose_window::PoseWindow;
use crate::registration::{Basis, Hypothesis};
use crate::shared::geometry::{Point2, Pose2, point_jacobian, pose};
use crate::shared::test_world::floor_plan::{DrawnMap, FloorPlan, deformation_at, drawing, seen};
use gridweave_runtime::stage::InitialPose;
use nalgebra::{Matrix3, Vector2};
use std::f64::consts::{FRAC_PI_2, PI};

/// A hypothesis from enough tags.
fn by_tags(transform_a_b: &Pose2) -> Hypothesis {
    Hypothesis {
        transform_a_b: *transform_a_b,
        covariance: Matrix3::identity() * 1e-4,
        basis: Basis::Tags,
        source: "tags".into(),
        reason: "four tags".into(),
        is_refused: false,
        is_alternative_only: false,
    }
}

/// Hypotheses from the maps only, of which the first has a significant peak.
fn by_maps(poses: &[Pose2]) -> Vec<Hypothesis> {
    let hypothesis = |(rank, place): (usize, &Pose2)| Hypothesis {
        basis: Basis::Search {
            significance: if rank == 0 { 7.0 } else { 0.0 },
            margin: if rank == 0 { 0.6 } else { 0.0 },
        },
        source: "maps".into(),
        reason: "the maps alone".into(),
        ..by_tags(place)
    };
    poses.iter().enumerate().map(hypothesis).collect()
}

/// Hypotheses from the maps only, which fit better than by chance, and none much better than the others.
fn by_maps_alike(poses: &[Pose2]) -> Vec<Hypothesis> {
    let alike = |(rank, hypothesis)| Hypothesis {
        basis: Basis::Search { significance: if rank == 0 { 0.2 } else { 0.0 }, margin: 0.3 },
        ..hypothesis
    };
    by_maps(poses).into_iter().enumerate().map(alike).collect()
}

fn judged(a: &DrawnMap, b: &DrawnMap, hypotheses: &[Hypothesis]) -> Decision {
    judged_knowing(a, b, hypotheses, &UserKnowledge::default())
}

fn judged_knowing(a: &DrawnMap, b: &DrawnMap, hypotheses: &[Hypothesis], known: &UserKnowledge) -> Decision {
    judge(&a.view(), &b.view(), hypotheses, known, &JudgementParameters::default()).unwrap()
}

fn reason(decision: &Decision) -> String {
    decision.reason(JudgementParameters::default().accept, "verifier", "robot1", "robot2")
}

#[test]
fn a_deformed_map_is_compared_with_its_deformation_and_its_pose_is_the_nearest_rigid_one() {
    const MOST: f64 = 1.0;
    let a = FloorPlan::office().draw(seen(-1.0, -1.0, 21.0, 13.0), drawing(0.0, 0.0, 0.0));
    let b = a.deformed(MOST);
    // Where one part of it fits, and where another does.
    let maps = by_maps(&[pose(-0.65, -0.9, 0.0), pose(-0.75, 0.0, -0.04)]);
    let rigid = JudgementParameters { bend: 0.0, ..Default::default() };
    let decision = judge(&a.view(), &b.view(), &maps, &UserKnowledge::default(), &rigid).unwrap();
    assert!(decision.refusal.is_some(), "{}", reason(&decision));
    let decision = judged(&a, &b, &maps);
    assert_eq!(decision.refusal, None, "{}", reason(&decision));
    assert!(reason(&decision).contains("with a deformation of 0.4"), "{}", reason(&decision));
    let deformed = decision.candidate.deformed.unwrap();
    assert!(deformed.agreement.inlier_ratio() > 0.95 && deformed.cost > 1.0, "{deformed:?}");
    for (allowed, is_refused) in [(deformed.rms - 0.006, true), (deformed.rms - 0.004, false)] {
        let parameters = JudgementParameters { max_bend: allowed, ..Default::default() };
        let decision = judge(&a.view(), &b.view(), &maps, &UserKnowledge::default(), &parameters).unwrap();
        assert_eq!(decision.refusal.is_some(), is_refused, "{allowed}: {}", reason(&decision));
    }
    let poses: Vec<Point2> =
        (1..20).flat_map(|x| (1..12).map(move |y| Point2::new(f64::from(x), f64::from(y)))).collect();
    let off = poses.iter().map(|place| deformed.transform_a_b * (place + deformation_at(MOST, place)) - place);
    let off: Vec<Vector2<f64>> = off.collect();
    let mean = off.iter().sum::<Vector2<f64>>() / off.len() as f64;
    let variance = off.iter().map(|off| off.norm_squared()).sum::<f64>() / off.len() as f64;
    assert!(mean.norm() < 0.1, "{mean}");
    assert!((deformed.rms / variance.sqrt() - 1.0).abs() < 0.2, "{} {}", deformed.rms, variance.sqrt());
    let about_middle = point_jacobian(&deformed.transform_a_b, &Point2::new(10.0, 6.0));
    let covariance = about_middle * deformed.covariance * about_middle.transpose();
    assert!((covariance.trace() / variance - 1.0).abs() < 0.5, "{covariance} {variance}");
}

#[test]
fn the_map_of_another_building_is_not_deformed_to_fit() {
    let part = seen(-0.2, -0.2, 20.2, 12.2);
    let a = FloorPlan::office().draw(part, drawing(0.0, 0.0, 0.0));
    let b = FloorPlan::another_office().draw(part, drawing(0.0, 0.0, 0.0));
    for place in [pose(1.5, 0.0, 0.0), pose(-3.0, 1.0, 0.1), pose(12.0, 0.0, PI / 2.0)] {
        let maps = by_maps(&[place]);
        let decision = judged(&a, &b, &maps);
        assert!(decision.refusal.is_some(), "{}", reason(&decision));
    }
}

/// Furniture was moved all over the building, so that the maps contradict each other in much at their right place.
#[test]
fn maps_with_many_conflicts_are_merged_where_tags_and_a_search_agree() {
    let poses = (0..10).flat_map(|x| [1.1, 2.6, 3.9, 8.2, 9.6, 11.0].map(|y| (0.9 + 1.9 * f64::from(x), y)));
    let turned = |(x, y): (f64, f64)| ([x - 0.6, y, x + 0.6, y], [x, y - 0.6, x, y + 0.6]);
    let (before, after): (Vec<_>, Vec<_>) = poses.map(turned).unzip();
    let a = FloorPlan::office().with(&before).draw(seen(-1.0, -1.0, 21.0, 13.0), drawing(3.0, 2.0, 0.4));
    let b = FloorPlan::office().with(&after).draw(seen(-1.0, -1.0, 21.0, 13.0), drawing(12.0, 6.0, -2.1));
    let truth = a.transform_to(&b);
    let tags = by_tags(&truth);
    let decision = judged(&a, &b, std::slice::from_ref(&tags));
    assert!(matches!(decision.refusal, Some(Refusal::Contradiction { .. })), "{}", reason(&decision));
    let maps = by_maps(&[truth, pose(4.0, 0.0, 0.0) * truth]);
    let together = [std::slice::from_ref(&tags), &maps].concat();
    assert_eq!(judged(&a, &b, &together).refusal, None);
    let second = [std::slice::from_ref(&tags), &by_maps(&[pose(4.0, 0.0, 0.0) * truth, truth])].concat();
    assert!(judged(&a, &b, &second).refusal.is_some(), "the best peak of the search is elsewhere");
}

#[test]
fn a_refused_hypothesis_is_not_accepted_but_competes() {
    let plan = FloorPlan::nearly_symmetric();
    let part = seen(-0.2, -0.2, 20.2, 12.2);
    let (a, b) = (plan.draw(part, drawing(10.0, 6.0, 0.0)), plan.draw(part, drawing(10.0, 6.0, 0.7)));
    let truth = a.transform_to(&b);
    let mut maps = by_maps_alike(&[truth, pose(0.0, 0.0, PI) * truth]);
    maps[0].is_refused = true;
    maps[0].reason = "ICP has not settled".into();
    let decision = judged(&a, &b, &maps);
    assert_eq!(reason(&decision), "ICP has not settled");
    let (known, parameters) = (UserKnowledge::default(), JudgementParameters::default());
    assert!(judge(&a.view(), &b.view(), &[], &known, &parameters).is_none());
}

#[test]
fn walls_on_free_space_are_refused() {
    let (a, b) = FloorPlan::west_and_east_of_the_office();
    let truth = a.transform_to(&b);
    for (x, y, yaw) in [(1.5, 0.0, 0.0), (0.0, 2.0, 0.0), (-1.2, 1.2, 0.0)] {
        let wrong = pose(x, y, 0.0) * truth;
        let agreement = compare(&a.view(), &b.view(), &wrong, &JudgementParameters::default().comparison());
        assert!(agreement.inlier_ratio() < 0.7 && agreement.evidence < 10.0, "{x} {y} {yaw}: {agreement:?}");
        let hypotheses = [by_tags(&wrong)];
        assert!(judged(&a, &b, &hypotheses).refusal.is_some(), "{x} {y} {yaw}");
    }
}

#[test]
fn walls_that_are_seen_from_opposite_sides_are_no_evidence() {
    // Two rooms on either side of one wall, each map of one of them.
    let plan = FloorPlan::new(&[
        [0.0, 0.0, 6.0, 0.0],
        [6.0, 0.0, 6.0, 10.0],
        [6.0, 10.0, 0.0, 10.0],
        [0.0, 10.0, 0.0, 0.0],
        [0.0, 5.0, 6.0, 5.0],
    ]);
    let south = plan.draw(seen(-0.2, -0.2, 6.2, 5.0), drawing(3.0, 2.0, 0.4));
    let north = plan.draw(seen(-0.2, 5.0, 6.2, 10.2), drawing(3.0, 7.0, -2.1));
    let truth = south.transform_to(&north);
    let beside = compare(&south.view(), &north.view(), &truth, &JudgementParameters::default().comparison());
    let same = compare(&south.view(), &south.view(), &Pose2::identity(), &JudgementParameters::default().comparison());
    assert!(beside.inlier_length < 1.0 && same.inlier_length > 15.0, "{beside:?} {same:?}");
}

#[test]
fn a_region_may_be_shifted_a_little_and_not_far() {
    let (a, b) = FloorPlan::west_and_east_of_the_office();
    let truth = a.transform_to(&b);
    let evidence = |shift: f64| {
        let moved = pose(shift, 0.0, 0.0) * truth;
        compare(&a.view(), &b.view(), &moved, &JudgementParameters::default().comparison()).evidence
    };
    assert!(evidence(0.12) > 0.8 * evidence(0.0), "{} {}", evidence(0.12), evidence(0.0));
    assert!(evidence(0.6) < 0.3 * evidence(0.0), "{} {}", evidence(0.6), evidence(0.0));
}

#[test]
fn acceptance_follows_from_the_required_probability() {
    let (a, b) = FloorPlan::west_and_east_of_the_office();
    let hypotheses = by_maps(&[a.transform_to(&b)]);
    for (accept, is_accepted) in [(0.0, true), (0.98, true), (1.0, false)] {
        let parameters = JudgementParameters { accept, ..Default::default() };
        let decision = judge(&a.view(), &b.view(), &hypotheses, &UserKnowledge::default(), &parameters).unwrap();
        assert_eq!(decision.refusal.is_none(), is_accepted, "{accept}: {}", reason(&decision));
    }
}

#[test]
fn the_wrong_quarter_is_refused() {
    let office = FloorPlan::office();
    let a = office.draw(seen(-0.2, -0.2, 20.2, 12.2), drawing(10.0, 6.0, 0.0));
    let b = office.draw(seen(-0.2, -0.2, 20.2, 12.2), drawing(10.0, 6.0, 0.3));
    for turn in [FRAC_PI_2, PI, -FRAC_PI_2] {
        // The peaks of a search compete with the tags.
        let found =
            by_maps(&[a.transform_to(&b)]).into_iter().map(|one| Hypothesis { is_alternative_only: true, ..one });
        let wrong = by_tags(&(pose(0.0, 0.0, turn) * a.transform_to(&b)));
        let hypotheses: Vec<Hypothesis> = std::iter::once(wrong).chain(found).collect();
        let decision = judged(&a, &b, &hypotheses);
        assert!(decision.refusal.is_some(), "{turn}: {}", reason(&decision));
    }
}

/// A symmetric building, twice, and a pose in each of its halves.
fn ambiguous() -> (DrawnMap, DrawnMap, [Pose2; 2]) {
    let building = FloorPlan::symmetric();
    let part = seen(-0.2, -0.2, 20.2, 12.2);
    let (a, b) = (building.draw(part, drawing(3.0, 2.0, 0.4)), building.draw(part, drawing(12.0, 6.0, -2.1)));
    let truth = a.transform_to(&b);
    let world_a = a.transform_world_map;
    let half_turn = world_a.inverse() * pose(20.0, 12.0, PI) * world_a * truth;
    (a, b, [truth, half_turn])
}

/// An initial pose of map b that is known to half a metre, with map a at the origin.
fn window_at(place: &Pose2) -> UserKnowledge {
    let known = InitialPose {
        x: place.translation.x + 0.4,
        y: place.translation.y - 0.3,
        yaw: place.rotation.angle() + 0.1,
        stddev: 0.5,
        yaw_stddev: 0.1,
    };
    UserKnowledge { window: Some(PoseWindow::between(&InitialPose::ORIGIN, &known)), hypothesis: None }
}

#[test]
fn an_initial_pose_decides_between_poses_that_fit_equally_well() {
    let (a, b, poses) = ambiguous();
    let hypotheses = by_maps_alike(&poses);
    assert!(matches!(judged(&a, &b, &hypotheses).refusal, Some(Refusal::Ambiguous { .. })));
    for (rank, place) in (0..).zip(&poses) {
        let decision = judged_knowing(&a, &b, &hypotheses, &window_at(place));
        assert_eq!((decision.refusal.clone(), decision.candidate.number), (None, rank), "{}", reason(&decision));
    }
    let elsewhere = window_at(&(pose(5.0, 0.0, 0.0) * poses[0]));
    let decision = judged_knowing(&a, &b, &hypotheses[..1], &elsewhere);
    assert!(matches!(decision.refusal, Some(Refusal::OutsideWindow { shift, .. }) if (shift - 5.0).abs() < 1.0));
    assert!(reason(&decision).contains("from the initial poses only\ntry: "), "{}", reason(&decision));
}

#[test]
fn a_hypothesis_that_was_listed_can_be_chosen() {
    let (a, b, poses) = ambiguous();
    let hypotheses = by_maps_alike(&poses);
    let refused = judged(&a, &b, &hypotheses);
    let listed = &refused.listed.0;
    assert_eq!(listed.len(), 2);
    for (number, place) in (1..).zip(listed) {
        let known = UserKnowledge { hypothesis: Some(number), ..UserKnowledge::default() };
        let decision = judged_knowing(&a, &b, &hypotheses, &known);
        assert_eq!(decision.refusal, None);
        let translation = decision.candidate.hypothesis.transform_a_b.translation;
        assert_eq!((place.x, place.y), (translation.x, translation.y));
        assert!(reason(&decision).starts_with(&format!("hypothesis {number} of 2, chosen by the user")));
    }
    let known = UserKnowledge { hypothesis: Some(3), ..UserKnowledge::default() };
    let refusal = judged_knowing(&a, &b, &hypotheses, &known).refusal;
    assert_eq!(refusal, Some(Refusal::NoSuchHypothesis { asked: 3, count: 2 }));
}

#[test]
fn hypotheses_are_listed_by_their_probability() {
    let (a, b, [one, other]) = ambiguous();
    for (probable, less) in [(one, other), (other, one)] {
        let decision = judged(&a, &b, &by_maps_alike(&[probable, less]));
        let first = decision.listed.0[0];
        assert_eq!((first.x, first.y), (probable.translation.x, probable.translation.y));
    }
}

#[test]
fn hypotheses_at_one_pose_are_listed_once() {
    let (a, b, [first, second]) = ambiguous();
    let beside = pose(0.04, -0.03, 0.005) * second;
    let refused = judged(&a, &b, &by_maps_alike(&[first, second, beside]));
    assert!(matches!(&refused.refusal, Some(Refusal::Ambiguous { listed, .. }) if listed.0.len() == 2));
    let known = UserKnowledge { hypothesis: Some(2), ..UserKnowledge::default() };
    let chosen = judged_knowing(&a, &b, &by_maps_alike(&[first, second, beside]), &known);
    assert_eq!((chosen.refusal, chosen.chosen), (None, Some((2, 2))));
}

#[test]
fn the_short_text_of_a_refusal_fits_in_eighty_columns() {
    let (a, b, poses) = ambiguous();
    let reason = reason(&judged(&a, &b, &by_maps_alike(&poses)));
    let (shown, whole) = reason.split_once("\n\n").unwrap();
    let lines: Vec<&str> = shown.lines().collect();
    assert!(lines.iter().all(|line| line.len() <= 78), "{shown}");
    assert_eq!(lines[0], "the maps fit at 2 poses, and the evidence does not decide which is right");
    assert!(lines[1].starts_with("missing: a probability of 0.98 (--set verifier.accept); this is 0."), "{shown}");
    assert!(lines[2].starts_with("try: --accept robot2=N") && lines[4].starts_with("  2: x "), "{shown}");
    assert!(whole.starts_with("the maps alone; the maps do not confirm it"), "{whole}");
}
