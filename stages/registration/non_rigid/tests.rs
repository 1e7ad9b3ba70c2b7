//! Deformation of drawn maps.

use super::{Body, DeformationParameters, RefinedMap, Refinement, anchor, refine};
use crate::shared::deformation::Deformation;
use crate::shared::geometry::{Grid, Point2, Pose2, UNKNOWN, pose};
use crate::shared::test_world::floor_plan::{DrawnMap, FloorPlan, deformation_at, drawing, seen};
use crate::shared::walls::{NORMAL_RADIUS, WallMap};

const PARAMETERS: fn() -> DeformationParameters = DeformationParameters::default;

fn body(map: &DrawnMap, transform_world_map: Pose2) -> Body<'_> {
    Body::new(&map.grid(), &map.walls, transform_world_map, PARAMETERS().spacing)
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
                is_held: false,
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
fn deformations_of_maps_that_are_too_far_away_are_bounded() {
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
}
