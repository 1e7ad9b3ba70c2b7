//! Time of the alignment of two maps without an initial guess, by their size.
//!
//!     cargo bench -p gridweave-stages --bench map_aligner

// An error in a bench ends it.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use gridweave_stages::registration::search::{MapAlignerParameters, NamedMap, align_maps};
use gridweave_stages::shared::geometry::Grid;
use gridweave_stages::shared::test_world::building::draw;
use std::time::Instant;

const RUNS: usize = 7;

fn main() {
    println!("| grid, cells | known, m | median, ms | least, ms |\n| --- | --- | --- | --- |");
    for (cells, known) in [(800, 40.0), (2000, 40.0), (4000, 200.0)] {
        let (a, b) = (draw(cells, known, 0.0), draw(cells, known, 0.35));
        let (grid_a, grid_b) = (Grid::new(a.0, &a.1).unwrap(), Grid::new(b.0, &b.1).unwrap());
        let (a, b) = (NamedMap { robot: "a", grid: grid_a }, NamedMap { robot: "b", grid: grid_b });
        let mut times: Vec<f64> = (0..RUNS)
            .map(|_| {
                let start = Instant::now();
                let found = align_maps(&a, &b, &MapAlignerParameters::default()).unwrap();
                let seconds = start.elapsed().as_secs_f64();
                let angle = found.hypotheses[0].transform_a_b.rotation.angle();
                assert!((angle - 0.35).abs() < 0.01, "turned by {angle}");
                1000.0 * seconds
            })
            .collect();
        times.sort_by(f64::total_cmp);
        println!("| {cells} x {cells} | {known} x {known} | {:.0} | {:.0} |", times[RUNS / 2], times[0]);
    }
}
