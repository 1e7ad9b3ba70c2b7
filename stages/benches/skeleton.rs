//! Time of the skeleton of a map's free space, by the size of the map.
//!
//!     cargo bench -p gridweave-stages --bench skeleton

// An error in a bench ends it.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use gridweave_stages::shared::geometry::Grid;
use gridweave_stages::shared::test_world::building;
use gridweave_stages::topology::skeleton::{DistanceMap, FreeSpace, Skeleton, SkeletonGraph, SkeletonParameters};
use std::time::Instant;

const RUNS: usize = 21;

fn main() {
    println!(
        "| grid, cells | known, m | free space, ms | distances, ms | thinning, ms | graph, ms | all, ms | least, ms |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- |");
    for (cells, known) in [(800, 40.0), (2000, 40.0), (2000, 100.0), (4000, 200.0)] {
        let (geometry, values) = building::draw(cells, known, 0.35);
        let grid = Grid::new(geometry, &values).unwrap();
        let times: Vec<[f64; 5]> = (0..RUNS).map(|_| steps(&grid)).collect();
        let sorted = |step: usize| {
            let mut times: Vec<f64> = times.iter().map(|times| times[step]).collect();
            times.sort_by(f64::total_cmp);
            times
        };
        let medians: Vec<String> = (0..5).map(|step| format!("{:.1}", sorted(step)[RUNS / 2])).collect();
        println!("| {cells} x {cells} | {known} x {known} | {} | {:.1} |", medians.join(" | "), sorted(4)[0]);
    }
}

/// Milliseconds of each step, and of all.
fn steps(grid: &Grid<'_>) -> [f64; 5] {
    let parameters = SkeletonParameters::default();
    let start = Instant::now();
    let since_start = || 1000.0 * start.elapsed().as_secs_f64();
    let space = FreeSpace::of(grid, parameters.max_hole).unwrap();
    let free_space = since_start();
    let distances = DistanceMap::of(space);
    let distance_map = since_start();
    let skeleton = Skeleton::of(&distances, parameters.min_clearance);
    let thinning = since_start();
    let mut graph = SkeletonGraph::of(&skeleton, &distances);
    graph.prune(parameters.min_spur);
    let all = since_start();
    assert!(graph.paths.len() > 10, "{} paths", graph.paths.len());
    [free_space, distance_map - free_space, thinning - distance_map, all - thinning, all]
}
