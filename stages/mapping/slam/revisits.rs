//! Scans registered on what the robot saw at their place at other times, once all poses are nearly known.
//!
//! A loop closure ties a submap to an earlier one by one measurement. With all poses near their places each scan is
//! registered by itself on the submaps around it, as in the network of Lu and Milios (1997, "Globally consistent range
//! scan alignment for environment mapping").

use super::local_map::LocalMap;
use super::loop_closure::{Revisit, middle};
use super::pose_graph::Constraint;
use rayon::prelude::*;

/// Distance of a submap from a scan up to which they may have much in common, metres.
const COMMON_DISTANCE: f64 = 14.0;
/// Number of submaps, the nearest ones, on which a scan is registered.
const MAX_SUBMAPS: usize = 12;
/// Least share of the points on walls of the submap.
const LEAST_MATCHED: f64 = 0.5;
/// How far a scan may move, metres and radians: what lies farther off is another wall.
const MAX_MOVE: [f64; 2] = [0.3, 0.1];
/// Share of the information of a registration that counts: the scans of a submap are registered on the same points.
const INFORMATION_SHARE: f64 = 0.3;

/// Poses of scans in submaps that are at least `apart` scans before or after them, by scan. The map of a submap is
/// built, used and dropped: those of all at once would take as much memory as the drive is long.
pub(super) fn register_on_revisited(revisit: &Revisit<'_>, apart: usize) -> Vec<Constraint> {
    // The scans near each submap, each with the place of that submap among its own.
    let mut near: Vec<Vec<(usize, usize)>> = vec![Vec::new(); revisit.submaps.len()];
    for scan in 0..revisit.scans.len() {
        for (place, submap) in near_submaps(revisit, scan, apart).into_iter().enumerate() {
            near[submap].push((scan, place));
        }
    }
    let on_submap = |(submap, scans): (usize, &Vec<(usize, usize)>)| -> Vec<((usize, usize), Constraint)> {
        if scans.is_empty() {
            return Vec::new();
        }
        let map = revisit.map_around(submap, revisit.scans.len());
        let on_it = |order: &(usize, usize)| Some((*order, register_on(revisit, order.0, submap, &map)?));
        scans.iter().filter_map(on_it).collect()
    };
    let mut found: Vec<((usize, usize), Constraint)> = near.par_iter().enumerate().flat_map_iter(on_submap).collect();
    found.sort_by_key(|(order, _)| *order);
    found.into_iter().map(|(_, constraint)| constraint).collect()
}

/// The nearest submaps of other times.
fn near_submaps(revisit: &Revisit<'_>, scan: usize, apart: usize) -> Vec<usize> {
    let poses = &revisit.graph.poses;
    let here = poses[scan].translation.vector;
    let distance = |submap: usize| (poses[middle(&revisit.submaps[submap])].translation.vector - here).norm();
    let is_of_other_time = |submap: &usize| {
        let scans = &revisit.submaps[*submap];
        scans.end + apart <= scan || scan + apart < scans.start
    };
    let of_other_time = (0..revisit.submaps.len()).filter(is_of_other_time).map(|submap| (distance(submap), submap));
    let mut near: Vec<(f64, usize)> = of_other_time.filter(|(distance, _)| *distance <= COMMON_DISTANCE).collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    near.into_iter().take(MAX_SUBMAPS).map(|(_, submap)| submap).collect()
}

/// The pose of a scan in a submap, from where it is known to be; `None` if it does not lie on it there.
fn register_on(revisit: &Revisit<'_>, scan: usize, submap: usize, map: &LocalMap) -> Option<Constraint> {
    let poses = &revisit.graph.poses;
    let from = middle(&revisit.submaps[submap]);
    let known = poses[from].inv_mul(&poses[scan]);
    let fit = map.register(&revisit.scans[scan], &known, None);
    let moved = known.inv_mul(&fit.pose);
    let is_near = moved.translation.vector.norm() <= MAX_MOVE[0] && moved.rotation.angle().abs() <= MAX_MOVE[1];
    (fit.matched >= LEAST_MATCHED && is_near).then(|| Constraint {
        from,
        to: scan,
        transform: fit.pose,
        information: INFORMATION_SHARE * fit.information,
        is_loop: true,
    })
}
