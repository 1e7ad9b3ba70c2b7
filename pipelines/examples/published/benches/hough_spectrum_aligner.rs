//! Time of the Hough spectrum of a map, and of the alignment of two maps by it.
//!
//!     cargo bench -p gridweave-published --bench hough_spectrum_aligner

// An error in a bench ends it.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use gridweave_published::hough_spectrum_aligner::{HoughSpectrum, HoughSpectrumParameters, WallCells, align_spectra};
use gridweave_stages::registration::search::NamedMap;
use gridweave_stages::shared::geometry::Grid;
use gridweave_stages::shared::test_world::building::draw;
use std::hint::black_box;
use std::time::Instant;

const RUNS: usize = 21;
/// Directions at 0.25 degrees.
const DIRECTIONS: usize = 720;
/// The width of a line, metres.
const CELL: f64 = 0.05;

fn main() {
    println!(
        "| grid, cells | known, m | occupied cells | spectrum, ms | two maps, ms |\n| --- | --- | --- | --- | --- |"
    );
    for (cells, known) in [(800, 40.0), (2000, 100.0), (4000, 200.0)] {
        let (a, b) = (draw(cells, known, 0.0), draw(cells, known, 0.35));
        let (grid_a, grid_b) = (Grid::new(a.0, &a.1).unwrap(), Grid::new(b.0, &b.1).unwrap());
        let (a, b) = (NamedMap { robot: "a", grid: grid_a }, NamedMap { robot: "b", grid: grid_b });
        let walls = WallCells::new(&a, 400.0).unwrap();
        let spectrum = median(|| {
            black_box(HoughSpectrum::new(&walls, DIRECTIONS, CELL));
        });
        let both = median(|| {
            black_box(align_spectra(&a, &b, &HoughSpectrumParameters::default()).unwrap());
        });
        let occupied = walls.points.len();
        println!("| {cells} x {cells} | {known} x {known} | {occupied} | {spectrum:.1} | {both:.0} |");
    }
}

/// Milliseconds.
fn median(work: impl Fn()) -> f64 {
    let mut times: Vec<f64> = (0..RUNS)
        .map(|_| {
            let start = Instant::now();
            work();
            1000.0 * start.elapsed().as_secs_f64()
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[RUNS / 2]
}
