//! The method as a whole, on drawn maps, and the stage from outside.

use super::*;
use gridweave_runtime::stage::Context;
use gridweave_stages::registration::search::Raster;
use gridweave_stages::shared::geometry::{Grid, GridGeometry, pose};
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

fn named<'a>(robot: &'a str, map: &'a DrawnMap) -> NamedMap<'a> {
    NamedMap { robot, grid: grid(map) }
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
    let office = office(ALL, 0.4);
    let geometry = GridGeometry { width: 10, height: 10, resolution: 0.05, origin: pose(1e6, -1e6, 0.3) };
    let (empty, mut cells) = ([0; 100], [-1; 100]);
    cells[37] = 100;
    let [empty, one_cell] =
        [&empty, &cells].map(|cells| NamedMap { robot: "b", grid: Grid::new(geometry, cells).unwrap() });
    let office = named("a", &office);
    let refusal = align_by_walks(&office, &empty, &quick(), 1).unwrap_err();
    assert_eq!(refusal.to_string(), "the map of b has no walls");
    for (a, b) in [(&office, &one_cell), (&one_cell, &office), (&one_cell, &one_cell)] {
        let found = align_by_walks(a, b, &quick(), 1).unwrap();
        assert!(found.iter().all(|one| one.covariance.iter().all(|value| value.is_finite())), "{found:?}");
    }
    let small = RandomWalkParameters { max_extent: 15.0, ..quick() };
    let refusal = align_by_walks(&office, &one_cell, &small, 1).unwrap_err();
    assert!(refusal.to_string().contains("longer than 15 m"), "{refusal}");
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
