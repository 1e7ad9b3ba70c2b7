//! The method as a whole, on drawn maps, and the stage from outside.

use super::*;
use crate::pair_aligner::test_maps::{check_extreme_maps, named};
use gridweave_runtime::stage::Context;
use gridweave_stages::registration::search::Raster;
use gridweave_stages::shared::geometry::{Grid, pose};
use gridweave_stages::shared::test_world::floor_plan::{DrawnMap, FloorPlan, apart, drawing, seen};
use gridweave_stages::shared::test_world::stage_bench::StageBench;

/// Few walks over wide cells, which is quick.
const QUICK: &str = "cell = 0.2\nmax_points = 300\nwalks = 8\nmax_trials = 1500\npatience = 300\nmin_omega = 0.9\n";

fn quick() -> RandomWalkParameters {
    toml::from_str(QUICK).unwrap()
}

fn office(part: [f64; 4], yaw: f64) -> DrawnMap {
    let [x1, y1, x2, y2] = part;
    let drawing =
        gridweave_stages::shared::test_world::floor_plan::Drawing { resolution: 0.1, ..drawing(12.0, 6.0, yaw) };
    FloorPlan::office().draw(seen(x1, y1, x2, y2), drawing)
}

const ALL: [f64; 4] = [-0.2, -0.2, 20.2, 12.2];

fn grid(map: &DrawnMap) -> Grid<'_> {
    Grid::new(map.geometry, &map.cells).unwrap()
}

fn classified(map: &DrawnMap) -> ClassifiedMap {
    ClassifiedMap::new(Raster::new(&grid(map), 0.2, 400.0).unwrap(), 500)
}

#[test]
fn a_map_is_not_dissimilar_to_itself_and_is_where_it_is_moved() {
    let map = classified(&office(ALL, 0.0));
    assert_eq!(dissimilarity(&map, &map, &pose(0.0, 0.0, 0.0)), 0.0);
    let moved = [0.4, 0.8, 1.6].map(|x| dissimilarity(&map, &map, &pose(x, 0.0, 0.0)));
    assert!(moved.is_sorted() && moved[0] > 0.1, "{moved:?}");
}

#[test]
fn dissimilarity_is_the_same_both_ways_round_where_axes_agree() {
    let (a, b) = (classified(&office(ALL, 0.0)), classified(&office([3.0, 1.0, 14.0, 9.0], 0.0)));
    for number in 0..50 {
        let transform = pose(0.7 * f64::from(number % 7) - 2.0, 0.9 * f64::from(number / 7) - 3.0, 0.0);
        let (forth, back) = (dissimilarity(&a, &b, &transform), dissimilarity(&b, &a, &transform.inverse()));
        assert!(forth >= 0.0 && (forth - back).abs() < 1e-9, "{forth} {back}");
    }
}

#[test]
fn maps_of_one_building_are_aligned_at_any_angle() {
    let a = office(ALL, 0.4);
    for yaw in [0.5, -2.9] {
        let b = office(ALL, yaw);
        let found = align_by_walks(&named("a", &a), &named("b", &b), &quick(), 5).unwrap();
        let (metres, radians) = apart(&found[0].transform_a_b, &a.transform_to(&b), &b);
        assert!(metres < 0.2 && radians < 0.02, "{metres} m, {radians} rad at {yaw}");
        assert!(found.iter().all(|one| one.covariance.cholesky().is_some()), "{found:?}");
    }
}

#[test]
fn maps_without_walls_and_too_large_ones_are_refused_and_a_single_cell_fits_anywhere() {
    check_extreme_maps(&office(ALL, 0.4), -1, |a, b, max_extent| {
        align_by_walks(a, b, &RandomWalkParameters { max_extent, ..quick() }, 1)
    });
}

#[test]
fn the_stage_walks_with_its_seed_and_every_pair_by_itself() {
    let (a, b, c) = (office(ALL, 0.0), office(ALL, 0.4), office([0.0, 0.0, 9.0, 9.0], 1.0));
    let sent = |seed, robots: &[(&str, &DrawnMap)]| {
        let context = Context { seed, ..Default::default() };
        let mut bench = StageBench::with_context(&kind(), QUICK, &context);
        for (robot, map) in robots {
            assert_eq!(bench.give_map(robot, map), []);
        }
        bench.finish()
    };
    let pair = [("robot1", &a), ("robot2", &b)];
    let one = sent(7, &pair);
    assert!(one[0].accepted && one[0].method == "random_walk" && one[0].score > 0.9, "{one:?}");
    assert_eq!(one, sent(7, &pair));
    assert_ne!(one[0].x, sent(8, &pair)[0].x);
    let more = sent(7, &[("robot1", &a), ("robot2", &b), ("robot0", &c)]);
    let (place, again) = (one[0].transform_a_b(), more[2].transform_a_b());
    assert_eq!((more.len(), more[2].a.as_str(), place), (3, "robot1", again), "others change nothing");
}
