//! Time of the non-rigid refinement of two maps, and of the maps of many robots, compared with the search of one
//! relative pose.
//!
//!     cargo bench -p gridweave-stages --bench elastic_refiner

// An error in a bench ends it.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use gridweave_stages::registration::non_rigid::{Body, DeformationParameters, refine, sharpness};
use gridweave_stages::registration::search::{MapAlignerParameters, NamedMap, align_maps};
use gridweave_stages::shared::geometry::{Grid, GridGeometry, Pose2, pose};
use gridweave_stages::shared::test_world::building::draw_deformed;
use gridweave_stages::shared::walls::{NORMAL_RADIUS, WallMap};
use std::time::Instant;

const RUNS: usize = 7;
/// Cells along a side, and metres of the building that a robot has seen.
const CELLS: usize = 800;
const KNOWN: f64 = 38.0;
/// Distance of neighbouring robots, metres: they share half of what they see.
const APART: f64 = 19.0;

/// A map with its pose and its walls.
struct Placed {
    map: (GridGeometry, Vec<i8>),
    walls: WallMap,
    transform_building_map: Pose2,
}

impl Placed {
    fn new(transform_building_map: Pose2, most: f64) -> Self {
        let map = draw_deformed(CELLS, KNOWN, &transform_building_map, most);
        let walls = WallMap::new(&Grid::new(map.0, &map.1).unwrap(), NORMAL_RADIUS);
        Self { map, walls, transform_building_map }
    }

    fn grid(&self) -> Grid<'_> {
        Grid::new(self.map.0, &self.map.1).unwrap()
    }
}

fn main() {
    let aligned = time(|| {
        let maps = [0.0, 0.35].map(|yaw| draw_deformed(CELLS, KNOWN, &pose(0.0, 0.0, yaw), 0.0));
        let [a, b] = ["a", "b"].map(str::to_owned);
        let grids = [Grid::new(maps[0].0, &maps[0].1).unwrap(), Grid::new(maps[1].0, &maps[1].1).unwrap()];
        let (a, b) = (NamedMap { robot: &a, grid: grids[0] }, NamedMap { robot: &b, grid: grids[1] });
        let start = Instant::now();
        align_maps(&a, &b, &MapAlignerParameters::default()).unwrap();
        start.elapsed().as_secs_f64()
    });
    println!(
        "The search of the relative pose of two maps of {CELLS} x {CELLS} cells takes {:.0} ms.\n",
        1000.0 * aligned
    );
    println!("| robots | deformation, m | nodes | median, ms | relative |\n| --- | --- | --- | --- | --- |");
    for (robots, displacement) in [(2, 0.0), (2, 0.2), (16, 0.0), (16, 0.2)] {
        let side = if robots > 2 { 4 } else { 1 };
        let placed: Vec<Placed> = (0..robots)
            .map(|robot| {
                let (column, row) = if robots > 2 { (robot % side, robot / side) } else { (0, 0) };
                let yaw = 0.35 * f64::from(robot);
                let most = if robot % 2 == 1 { displacement } else { 0.0 };
                Placed::new(pose(APART * f64::from(column), APART * f64::from(row), yaw), most)
            })
            .collect();
        let parameters = DeformationParameters::default();
        let mut nodes = 0;
        let seconds = time(|| {
            let start = Instant::now();
            let bodies: Vec<Body<'_>> = placed
                .iter()
                .map(|map| Body::new(&map.grid(), &map.walls, map.transform_building_map, parameters.spacing))
                .collect();
            let refined = refine(&bodies, &parameters).unwrap().if_supported();
            sharpness(&bodies, &refined, &parameters);
            let seconds = start.elapsed().as_secs_f64();
            nodes = refined.iter().map(|map| map.deformation.moves.len()).sum();
            seconds
        });
        println!("| {robots} | {displacement} | {nodes} | {:.0} | {:.2} |", 1000.0 * seconds, seconds / aligned);
    }
}

/// The median of some runs, seconds.
fn time(mut run: impl FnMut() -> f64) -> f64 {
    let mut times: Vec<f64> = (0..RUNS).map(|_| run()).collect();
    times.sort_by(f64::total_cmp);
    times[RUNS / 2]
}
