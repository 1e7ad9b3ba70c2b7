//! Times of the stages of group mapping: the energy of the Radon transform, a whole Radon alignment, algorithm 1, the
//! probabilistic Voronoi diagram, and the matching of two of them.
//!
//!     cargo bench -p gridweave-published --bench group_mapping

// An error in a bench ends it.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use gridweave_published::edge_matcher::{EdgeMatcherParameters, edges, match_edges};
use gridweave_published::entropy_fuser::{common_grid, fuse};
use gridweave_published::log_odds::LogOdds;
use gridweave_published::pgvd_extractor::{PgvdExtractorParameters, topological_map};
use gridweave_published::radon_aligner::{NamedMap, PreparedMap, RadonAlignerParameters, WallPoints, align, energy};
use gridweave_published::uncertain_transform::{UncertainTransformParameters, transform};
use gridweave_stages::merge::grid_fuser::layout::CellLattice;
use gridweave_stages::merge::grid_fuser::{KnownArea, PlacedGrid};
use gridweave_stages::shared::geometry::{Grid, Point2, Pose2};
use gridweave_stages::shared::test_world::building;
use nalgebra::{Matrix3, UnitComplex, Vector3};
use std::time::Instant;

const RUNS: usize = 15;

fn main() {
    println!("| what | grid, cells | known, m | median, ms | least, ms |\n| --- | --- | --- | --- | --- |");
    for (cells, known) in [(800, 40.0), (2000, 100.0)] {
        let report = |what: &str, (median, least): (f64, f64)| {
            println!("| {what} | {cells} x {cells} | {known} x {known} | {median:.1} | {least:.1} |");
        };
        let [a, b] = [0.0, 0.35].map(|yaw| building::draw(cells, known, yaw));
        let [a, b] = [&a, &b].map(|(geometry, values)| Grid::new(*geometry, values).unwrap());
        let parameters = RadonAlignerParameters::default();
        report("Radon energy, 0.25 degrees", time(|| energy(&WallPoints::of(&b), parameters.steps())));
        let prepared = [a, b].map(|grid| PreparedMap::new(&grid, parameters.steps()));
        let named = |robot, grid, prepared| NamedMap { robot, grid, prepared };
        let (named_a, named_b) = (named("a", a, &prepared[0]), named("b", b, &prepared[1]));
        report("Radon alignment of two prepared maps", time(|| align(&named_a, &named_b, &parameters).unwrap()));

        let frame = Pose2::rotation(0.35);
        let area = KnownArea::of(&b);
        let anchor = Point2::from(a.geometry.origin.translation.vector);
        let lattice = CellLattice { anchor, resolution: 0.05, max_extent: 1000.0, max_cells: 100_000_000 };
        let carry = |[x, yaw]: [f64; 2]| {
            let covariance = Matrix3::from_diagonal(&Vector3::new(x * x, x * x, yaw * yaw));
            let placed = PlacedGrid::rigid(b, frame);
            transform(&placed, &area, &covariance, &lattice, &UncertainTransformParameters::default()).unwrap().unwrap()
        };
        for (what, deviations) in [
            ("algorithm 1, 0.05 m and 0.5 degrees", [0.05, 0.0087]),
            ("algorithm 1, 0.1 m and 1 degree", [0.1, 0.0175]),
            ("algorithm 1, 0.5 m and 3 degrees", [0.5, 0.0524]),
        ] {
            report(what, time(|| carry(deviations)));
        }
        let (sure, unsure) = (carry([0.0, 0.0]), carry([0.05, 0.0087]));
        let maps = [sure.grid(), unsure.grid()];
        let table = LogOdds::new(0.1192, 0.971);
        report(
            "entropy filter of two maps",
            time(|| {
                let over = common_grid(&maps, lattice.max_cells).0.unwrap();
                let mut fused = vec![0; over.cell_count()];
                fuse(&maps, &over, &table, &mut fused);
                fused
            }),
        );

        let diagram = |grid: &Grid<'_>| topological_map(grid, &PgvdExtractorParameters::default());
        report("probabilistic Voronoi diagram", time(|| diagram(&b)));
        let matching = EdgeMatcherParameters::default();
        let [edges_a, edges_b] = [a, b].map(|grid| edges(&diagram(&grid), matching.min_length));
        let what = format!("edge matching, {} and {} edges", edges_a.len(), edges_b.len());
        let rotation = UnitComplex::new(0.35);
        report(&what, time(|| match_edges(&edges_a, &edges_b, &rotation, 1e-4, &matching)));
    }
}

/// The median and the least of several runs, milliseconds.
fn time<T>(run: impl Fn() -> T) -> (f64, f64) {
    let mut times: Vec<f64> = (0..RUNS)
        .map(|_| {
            let start = Instant::now();
            std::hint::black_box(run());
            1000.0 * start.elapsed().as_secs_f64()
        })
        .collect();
    times.sort_by(f64::total_cmp);
    (times[RUNS / 2], times[0])
}
