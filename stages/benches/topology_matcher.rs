//! Time of the matching of two topological maps, by the number of their nodes.
//!
//!     cargo bench -p gridweave-stages --bench topology_matcher

// An error in a bench ends it.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use gridweave_stages::shared::geometry::{Point2, pose};
use gridweave_stages::topology::topology_matcher::{Topology, TopologyMatcherParameters, exhaustive, icp_svd};
use std::time::Instant;

const RUNS: usize = 5;

fn main() {
    println!("| nodes | paths | trials | exhaustive, ms | least, ms | icp_svd, ms | least, ms |");
    println!("| --- | --- | --- | --- | --- | --- | --- |");
    for a in [corridors(2), corridors(5), corridors(10), corridors(20), lattice()] {
        let truth = pose(3.0, -2.0, 1.0);
        let b = Topology { nodes: a.nodes.iter().map(|node| truth.inverse() * node).collect(), ..a.clone() };
        let parameters = TopologyMatcherParameters::default();
        let found = exhaustive(&a, &b, &parameters).unwrap();
        assert!((found.poses[0].transform_a_b.inverse() * truth).translation.vector.norm() < 1e-6);
        let times = |run: &dyn Fn()| {
            let mut times: Vec<f64> = (0..RUNS)
                .map(|_| {
                    let start = Instant::now();
                    run();
                    1000.0 * start.elapsed().as_secs_f64()
                })
                .collect();
            times.sort_by(f64::total_cmp);
            format!("{:.1} | {:.1}", times[RUNS / 2], times[0])
        };
        let all = times(&|| drop(std::hint::black_box(exhaustive(&a, &b, &parameters))));
        let icp = times(&|| drop(std::hint::black_box(icp_svd(&a, &b, &parameters))));
        println!("| {0} and {0} | {1} and {1} | {2} | {all} | {icp} |", a.nodes.len(), a.paths.len(), found.trials);
    }
}

/// Paths of a warehouse: 20 rows of 20 nodes, 2 m apart, each off by up to 0.1 m, so that the map lies on itself nearly
/// as well a row farther on.
fn lattice() -> Topology {
    let mut topology = Topology::default();
    for node in 0..400 {
        let off = |step: usize| 0.1 * ((node * step % 201) as f64 / 100.0 - 1.0);
        let (column, row) = ((node % 20) as f64, (node / 20) as f64);
        topology.nodes.push(Point2::new(2.0 * column + off(61), 2.0 * row + off(83)));
        if node % 20 > 0 {
            topology.paths.push([node - 1, node]);
        }
        if node >= 20 {
            topology.paths.push([node - 20, node]);
        }
    }
    topology
}

/// Corridors of a building with eight nodes each, whose rooms have all widths.
fn corridors(rows: usize) -> Topology {
    let mut topology = Topology::default();
    for row in 0..rows {
        for column in 0..8 {
            let shift = ((row * 7 + column * 3) % 5) as f64;
            topology.nodes.push(Point2::new(5.0 * column as f64 + 0.6 * shift, 4.0 * row as f64 + 0.3 * shift));
            let node = row * 8 + column;
            if column > 0 {
                topology.paths.push([node - 1, node]);
            }
            if row > 0 && (row + column) % 3 != 0 {
                topology.paths.push([node - 8, node]);
            }
        }
    }
    topology
}
