//! Refinement of drawn maps.

use super::anchor::anchor;
use super::{Body, ElasticRefinerParameters, RefinedMap, Refinement, kind, refine};
use crate::shared::deformation::Deformation;
use crate::shared::geometry::{Grid, Point2, Pose2, UNKNOWN, pose};
use crate::shared::test_world::floor_plan::{DrawnMap, FloorPlan, deformation_at, drawing, seen};
use crate::shared::walls::{NORMAL_RADIUS, WallMap};
use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::{Header, MapDeformation, OccupancyGrid, RobotFrame, RobotFrames};
use gridweave_runtime::stage::{Parameters, StageHarness};

const PARAMETERS: fn() -> ElasticRefinerParameters = ElasticRefinerParameters::default;

fn body(map: &DrawnMap, transform_world_map: Pose2) -> Body<'_> {
    Body::new(&map.view().grid, &map.walls, transform_world_map, PARAMETERS().spacing)
}

/// Distance between two maps of one building, metres: the mean and the largest over points known to both.
fn apart(maps: &[RefinedMap], bodies: &[Body<'_>], most: f64, places: &[Point2]) -> (f64, f64) {
    let distances = places.iter().map(|place| {
        let in_a = bodies[0].transform_world_map * maps[0].deformation.apply(place);
        let in_b = bodies[1].transform_world_map * maps[1].deformation.apply(&(place + deformation_at(most, place)));
        (in_a - in_b).norm()
    });
    let distances: Vec<f64> = distances.collect();
    (distances.iter().sum::<f64>() / distances.len() as f64, distances.iter().copied().fold(0.0, f64::max))
}

fn places() -> Vec<Point2> {
    (1..19).flat_map(|x| (1..12).map(move |y| Point2::new(f64::from(x), f64::from(y)))).collect()
}

#[test]
fn the_mean_displacement_of_the_reference_is_zero() {
    let map = FloorPlan::office().draw(seen(-1.0, -1.0, 21.0, 13.0), drawing(0.0, 0.0, 0.0));
    let deformed = map.deformed(0.4);
    let bodies = [body(&map, pose(3.0, -2.0, 0.7)), body(&deformed, pose(3.0, -2.0, 0.7))];
    let before = refine(&bodies, &PARAMETERS()).unwrap().maps;
    for reference in [0, 1] {
        let mut deformations = before.clone();
        anchor(&mut deformations, &bodies, reference);
        let moves = &deformations[reference].deformation.moves;
        let mean = moves.iter().sum::<nalgebra::Vector3<f64>>() / moves.len() as f64;
        assert!(mean.xy().norm() < 1e-9, "{mean}");
        let [apart_before, apart_after] =
            [&before, &deformations].map(|deformations| apart(deformations, &bodies, 0.4, &places()).0);
        assert!((apart_before - apart_after).abs() < 1e-3, "{apart_before} {apart_after}");
    }
}

#[test]
fn a_deformed_map_is_aligned_with_a_straight_one() {
    let map = FloorPlan::office().draw(seen(-1.0, -1.0, 21.0, 13.0), drawing(0.0, 0.0, 0.0));
    let mut drifts = Vec::new();
    for most in [0.1, 0.4] {
        let deformed = map.deformed(most);
        let bodies = [body(&map, Pose2::identity()), body(&deformed, Pose2::identity())];
        let rigid: Vec<RefinedMap> = bodies
            .iter()
            .map(|body| RefinedMap {
                deformation: Deformation::none(body.shape.lattice.clone()),
                covariances: Vec::new(),
                wall_matched: 0.0,
                cost: 0.0,
                drift: None,
            })
            .collect();
        let Refinement { maps: refined, gain, .. } = refine(&bodies, &PARAMETERS()).unwrap();
        assert!(gain > 10.0, "{most}: {gain}");
        let (before, after) = (apart(&rigid, &bodies, most, &places()), apart(&refined, &bodies, most, &places()));
        assert!(before.1 > 0.9 * most, "{before:?}");
        assert!(after.0 < 0.02 && after.1 < 0.06, "{most}: {before:?} before, {after:?} after");
        assert!(
            refined.iter().all(|map| map.wall_matched > 80.0 && map.cost > 0.0 && map.cost < 200.0 * most),
            "{}",
            refined[1].cost
        );
        let [rigid, deformed] = super::sharpness(&bodies, &refined, &PARAMETERS())[1];
        assert!(rigid.apart > 0.2 * most && rigid.doubled > most, "{most}: {rigid:?}");
        assert!(deformed.apart < 0.03 && deformed.doubled < 0.03, "{most}: {deformed:?}");
        drifts.push(refined[1].drift.unwrap());
    }
    // A larger deformation gives a larger estimate, though small deformations are hardly seen.
    let [little, much] = drifts[..] else { panic!() };
    assert!(much.displacement > 2.0 * little.displacement && much.turn > 1.5 * little.turn, "{little:?}, {much:?}");
    assert!((0.005..0.05).contains(&much.displacement) && (0.001..0.01).contains(&much.turn), "{much:?}");
}

#[test]
fn a_map_that_is_kept_stays_and_the_other_does_all() {
    let map = FloorPlan::office().draw(seen(-1.0, -1.0, 21.0, 13.0), drawing(0.0, 0.0, 0.0));
    let deformed = map.deformed(0.2);
    let bodies = [body(&map, Pose2::identity()).kept(), body(&deformed, Pose2::identity())];
    let deformations = refine(&bodies, &PARAMETERS()).unwrap().maps;
    assert!(deformations[0].deformation.largest_move() < 1e-3);
    assert!(apart(&deformations, &bodies, 0.2, &places()).1 < 0.06);
}

#[test]
fn maps_that_are_not_bent_stay_as_they_are() {
    let office = FloorPlan::office();
    let a = office.draw(seen(-1.0, -1.0, 15.0, 13.0), drawing(0.0, 0.0, 0.0));
    let b = office.draw(seen(4.0, -1.0, 21.0, 13.0), drawing(3.0, 1.0, 0.7));
    let bodies = [body(&a, a.transform_world_map), body(&b, b.transform_world_map)];
    let refinement = refine(&bodies, &PARAMETERS()).unwrap();
    for map in &refinement.maps {
        assert!(map.deformation.moves.iter().all(|by| by.xy().norm() < 0.02 && by.z.abs() < 0.005), "{map:?}");
    }
    assert!(refinement.gain < 0.0, "{}", refinement.gain);
    for map in refinement.if_supported() {
        assert!(map.deformation.largest_move() == 0.0 && map.cost == 0.0 && map.drift.is_none(), "{map:?}");
        assert!(map.wall_matched > 50.0 && map.covariances.iter().all(|covariance| covariance[(0, 0)] > 0.0));
    }
}

#[test]
fn the_order_of_the_maps_does_not_matter() {
    let map = FloorPlan::office().draw(seen(-1.0, -1.0, 21.0, 13.0), drawing(0.0, 0.0, 0.0));
    let deformed = map.deformed(0.2);
    let (a, b) = (body(&map, Pose2::identity()), body(&deformed, Pose2::identity()));
    let one = refine(&[a.clone(), b.clone()], &PARAMETERS()).unwrap().maps;
    let other = refine(&[b, a], &PARAMETERS()).unwrap().maps;
    for (one, other) in one.iter().zip(other.iter().rev()) {
        let pairs = one.deformation.moves.iter().zip(&other.deformation.moves);
        assert!(pairs.into_iter().all(|(one, other)| (one - other).norm() < 1e-9));
    }
}

#[test]
fn where_nobody_else_knows_the_place_the_map_is_rigid_and_less_is_known_of_it() {
    let office = FloorPlan::office();
    // The other robot knows the left third, which is drawn 0.1 m to the right.
    let part = office.draw(seen(-1.0, -1.0, 6.0, 13.0), drawing(0.0, 0.0, 0.0));
    let whole = office.draw(seen(-1.0, -1.0, 21.0, 13.0), drawing(0.0, 0.0, 0.0));
    let bodies = [body(&part, Pose2::identity()), body(&whole, pose(0.1, 0.0, 0.0))];
    let refined = refine(&bodies, &PARAMETERS()).unwrap().maps.remove(1);
    let move_at = |x: f64, y: f64| refined.deformation.apply(&Point2::new(x, y)) - Point2::new(x, y);
    assert!((move_at(19.0, 6.0) - move_at(9.0, 6.0)).norm() < 0.02, "{} {}", move_at(19.0, 6.0), move_at(9.0, 6.0));
    let deviation = |x: f64| {
        let near = (0..refined.covariances.len())
            .min_by(|&one, &other| {
                let at = |node| (refined.deformation.lattice.position(node) - Point2::new(x, 6.0)).norm();
                at(one).total_cmp(&at(other))
            })
            .unwrap();
        refined.covariances[near].diagonal().map(f64::sqrt)
    };
    assert!(deviation(18.0).y > 1.1 * deviation(3.0).y, "{} {}", deviation(18.0), deviation(3.0));
}

#[test]
fn numbers_without_bounds_are_refused_or_bounded() {
    let map = FloorPlan::office().draw(seen(-1.0, -1.0, 9.0, 13.0), drawing(0.0, 0.0, 0.0));
    let cells = vec![UNKNOWN; map.cells.len()];
    let walls = WallMap::new(&Grid::new(map.geometry, &cells).unwrap(), NORMAL_RADIUS);
    let unknown = DrawnMap { cells, walls, ..map };
    assert!(refine(&[], &PARAMETERS()).is_some_and(|refinement| refinement.maps.is_empty()));
    for transform in [pose(f64::NAN, 0.0, 0.0), pose(f64::INFINITY, 0.0, 0.0), pose(1e300, 0.0, 0.0)] {
        let bodies = [body(&map, Pose2::identity()), body(&map, transform), body(&unknown, transform)];
        let refinement = refine(&bodies, &PARAMETERS());
        assert!(refinement.is_none_or(|refinement| {
            refinement.maps.iter().flat_map(|deformation| &deformation.deformation.moves).all(|by| by.norm() < 0.1)
        }));
    }
    for (field, value) in [("spacing", "0.0"), ("bend", "nan"), ("turn", "-1.0"), ("reach", "inf")] {
        let parameters: ElasticRefinerParameters = toml::from_str(&format!("{field} = {value}")).unwrap();
        assert_eq!(parameters.check().len(), 1, "{field} = {value}");
    }
}

/// A stage that has received two maps and their frames.
fn stage(parameters: &str, map_b: &[i8]) -> (StageHarness, DrawnMap, RobotFrames) {
    let map = FloorPlan::office().draw(seen(-1.0, -1.0, 21.0, 13.0), drawing(0.0, 0.0, 0.0));
    let mut stage = StageHarness::new(&kind(), parameters).unwrap();
    for (robot, cells) in [("robot1", &map.cells[..]), ("robot2", map_b)] {
        let data: Vec<u8> = cells.iter().map(|cell| *cell as u8).collect();
        let header = Header { frame_id: format!("{robot}/map"), ..Default::default() };
        let message = OccupancyGrid { header, info: map.info(), data: &data };
        stage.give::<OccupancyGrid<'_>>("map", robot, LogTime(1), &message).unwrap();
    }
    let frame = |robot: &str| RobotFrame { robot: robot.into(), ..Default::default() };
    let frames = RobotFrames {
        reference: "robot1".into(),
        frames: vec![frame("robot1"), frame("robot2")],
        ..Default::default()
    };
    stage.give::<RobotFrames>("frames", "", LogTime(2), &frames).unwrap();
    (stage, map, frames)
}

#[test]
fn bends_are_sent_before_the_frames_that_they_belong_to_and_again_when_a_map_has_grown() {
    let map = FloorPlan::office().draw(seen(-1.0, -1.0, 21.0, 13.0), drawing(0.0, 0.0, 0.0));
    let (mut stage, map, frames) = stage("", &map.deformed(0.2).cells);
    let deformations: Vec<MapDeformation> = stage.take("deformation").unwrap();
    assert_eq!(
        deformations.iter().map(|deformation| deformation.robot.as_str()).collect::<Vec<_>>(),
        ["robot1", "robot2"]
    );
    assert_eq!(deformations[1].header.frame_id, "robot2/map");
    assert!(
        deformations[1].nodes.iter().any(|node| node.dx.hypot(node.dy) > 0.05)
            && deformations[1].nodes[0].covariance[0] > 0.0
    );
    assert_eq!(stage.take::<RobotFrames>("frames").unwrap(), std::slice::from_ref(&frames));

    let data: Vec<u8> = map.cells.iter().map(|cell| *cell as u8).collect();
    let message = OccupancyGrid { info: map.info(), data: &data, ..Default::default() };
    stage.give::<OccupancyGrid<'_>>("map", "robot2", LogTime(3), &message).unwrap();
    assert!(stage.take::<MapDeformation>("deformation").unwrap().is_empty());
    stage.finish(LogTime(3)).unwrap();
    let deformations: Vec<MapDeformation> = stage.take("deformation").unwrap();
    assert!(
        deformations.iter().flat_map(|deformation| &deformation.nodes).all(|node| node.dx.hypot(node.dy) < 0.01),
        "it is straight by then"
    );
}

#[test]
fn a_map_that_comes_last_is_aligned_as_if_all_had_come_at_once() {
    let map = FloorPlan::office().draw(seen(-1.0, -1.0, 21.0, 13.0), drawing(0.0, 0.0, 0.0));
    let deformed = |most: f64| map.deformed(most).cells;
    let maps = [map.cells.clone(), deformed(0.2), deformed(-0.25), deformed(0.3)];
    let names = ["robot1", "robot2", "robot3", "robot4"];
    let frame = |robot: &&str| RobotFrame { robot: (*robot).to_owned(), ..Default::default() };
    let frames_of = |count: usize| RobotFrames {
        reference: "robot1".into(),
        frames: names[..count].iter().map(frame).collect(),
        ..Default::default()
    };
    // One stage gets the last robot after it has deformed the others, one gets all at once.
    let [late, at_once] = [[3, 4], [4, 4]].map(|counts| {
        let mut stage = StageHarness::new(&kind(), "").unwrap();
        for (name, cells) in names.iter().zip(&maps) {
            let data: Vec<u8> = cells.iter().map(|cell| *cell as u8).collect();
            let header = Header { frame_id: format!("{name}/map"), ..Default::default() };
            let message = OccupancyGrid { header, info: map.info(), data: &data };
            stage.give::<OccupancyGrid<'_>>("map", name, LogTime(1), &message).unwrap();
        }
        for count in counts {
            stage.take::<MapDeformation>("deformation").unwrap();
            stage.give::<RobotFrames>("frames", "", LogTime(2), &frames_of(count)).unwrap();
        }
        let while_it_runs: Vec<MapDeformation> = stage.take("deformation").unwrap();
        stage.finish(LogTime(3)).unwrap();
        (while_it_runs, stage.take::<MapDeformation>("deformation").unwrap())
    });
    let (from_known, at_the_end) = late;
    assert_eq!((from_known.len(), at_the_end.len()), (4, 4), "it starts again at the end");
    assert!(at_once.0.is_empty() && at_once.1.is_empty(), "nothing has changed since");
    for (one, other) in from_known.iter().zip(&at_the_end) {
        assert!(one.sharpness.apart < 0.03 && one.sharpness.doubled < 0.03, "{:?}", one.sharpness);
        let pairs = one.nodes.iter().zip(&other.nodes);
        let apart = pairs.map(|(one, other)| (one.dx - other.dx).hypot(one.dy - other.dy)).fold(0.0, f64::max);
        assert!(apart > 0.0 && apart < 0.05, "{}: {apart}", one.robot);
    }
}

#[test]
fn frames_that_change_little_go_through_and_are_bent_anew_at_the_end() {
    let map = FloorPlan::office().draw(seen(-1.0, -1.0, 21.0, 13.0), drawing(0.0, 0.0, 0.0));
    let (mut stage, _, mut frames) = stage("", &map.deformed(0.2).cells);
    stage.take::<MapDeformation>("deformation").unwrap();
    stage.take::<RobotFrames>("frames").unwrap();
    for (x, count) in [(0.05, 0), (0.3, 2), (0.33, 0)] {
        frames.frames[1].x = x;
        stage.give::<RobotFrames>("frames", "", LogTime(3), &frames).unwrap();
        assert_eq!(stage.take::<MapDeformation>("deformation").unwrap().len(), count, "{x}");
        assert_eq!(stage.take::<RobotFrames>("frames").unwrap(), [frames.clone()]);
    }
    stage.finish(LogTime(4)).unwrap();
    assert_eq!(stage.take::<MapDeformation>("deformation").unwrap().len(), 2);
}

#[test]
fn maps_that_have_grown_are_bent_anew_when_frames_come() {
    let map = FloorPlan::office().draw(seen(-1.0, -1.0, 21.0, 13.0), drawing(0.0, 0.0, 0.0));
    let width = map.info().width as usize;
    let of_half = |(index, cell): (usize, &i8)| if index % width < width / 2 { *cell } else { UNKNOWN };
    let half: Vec<i8> = map.cells.iter().enumerate().map(of_half).collect();
    for (parameters, count) in [("", 2), ("min_growth = 10.0", 0)] {
        let (mut stage, map, frames) = stage(parameters, &half);
        stage.take::<MapDeformation>("deformation").unwrap();
        let data: Vec<u8> = map.cells.iter().map(|cell| *cell as u8).collect();
        let message = OccupancyGrid { info: map.info(), data: &data, ..Default::default() };
        stage.give::<OccupancyGrid<'_>>("map", "robot2", LogTime(3), &message).unwrap();
        stage.give::<RobotFrames>("frames", "", LogTime(4), &frames).unwrap();
        assert_eq!(stage.take::<MapDeformation>("deformation").unwrap().len(), count, "{parameters}");
    }
}

#[test]
fn a_stage_that_is_not_enabled_passes_the_frames_on_and_nothing_else() {
    let (mut stage, map, frames) = stage("enabled = false", &[UNKNOWN; 0]);
    drop(map);
    assert_eq!(stage.take::<RobotFrames>("frames").unwrap(), [frames]);
    stage.finish(LogTime(3)).unwrap();
    assert!(stage.take::<MapDeformation>("deformation").unwrap().is_empty());
}
