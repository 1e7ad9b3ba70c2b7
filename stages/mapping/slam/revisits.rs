//! Scans registered on what a robot saw at their place at other times, once all poses are nearly known.
//!
//! A loop closure ties a submap to an earlier one by one measurement. With all poses near their places each scan is
//! registered by itself on the submaps around it, as in the network of Lu and Milios (1997, "Globally consistent range
//! scan alignment for environment mapping").

use super::local_map::LocalMap;
use super::loop_closure::{Drive, Revisit, middle};
use super::pose_graph::{Constraint, PoseGraph, Solver};
use super::scan_points::ScanPoint;
use crate::shared::geometry::Pose2;
use rayon::prelude::*;
use std::cell::LazyCell;
use std::collections::BTreeMap;
use std::ops::Range;

/// Distance of a submap from a scan up to which they may have much in common, metres.
const COMMON_DISTANCE: f64 = 14.0;
/// Number of submaps, the nearest ones, on which a scan is registered.
const MAX_SUBMAPS: usize = 12;
/// How far a scan may move, metres and radians: what lies farther off is another wall.
const MAX_MOVE: [f64; 2] = [0.3, 0.1];
/// Share of the information of a registration that counts: the scans of a submap are registered on the same points.
const INFORMATION_SHARE: f64 = 0.3;

/// How often the scans are registered, at most, and the move of a scan, metres, below which they are registered no more.
const ROUNDS: usize = 8;
const LEAST_MOVE: f64 = 0.005;

/// Move of a scan against a submap, or within one, metres and radians, up to which its registration is what it was: well
/// below the deviations of the walls.
const UNMOVED: [f64; 2] = [0.002, 5e-4];

/// The registrations of scans on a submap, as they were measured last.
#[derive(Clone, Default)]
struct SubmapMatches {
    /// Poses of the scans of its map in that of its middle scan.
    shape: Vec<Pose2>,
    /// For each scan the pose from which it was registered, and the constraint if it lies on the submap.
    matches: BTreeMap<usize, (Pose2, Option<Constraint>)>,
}

/// Registers each scan on what was seen at its place at other times, and moves all to the most likely poses, until they
/// stay. Scans of one drive see the same place at other times if they are at least `apart` scans from each other; those of
/// different drives always do. Returns whether any scan lies on others.
pub(super) fn refine(
    graph: &mut PoseGraph,
    scans: &[&[ScanPoint]],
    submaps: &[Range<usize>],
    drives: &[Drive],
    apart: usize,
) -> bool {
    let known = graph.constraints.len();
    let mut matches = vec![SubmapMatches::default(); submaps.len()];
    let mut has_moved = false;
    let mut solver = Solver::default();
    for _ in 0..ROUNDS {
        let revisit = Revisit { graph, scans, submaps, drives, recent: scans.len() };
        let found = register_on_revisited(&revisit, apart, &mut matches);
        if found.is_empty() {
            break;
        }
        graph.constraints.extend(found);
        let before = graph.poses.clone();
        // The first round has moved all near to where they belong.
        if has_moved {
            graph.settle(&mut solver);
        } else {
            graph.optimize_with(&mut solver);
        }
        // The next round measures them anew, where scans have moved.
        graph.constraints.truncate(known);
        has_moved = true;
        let moves = before.iter().zip(&graph.poses);
        let moved = moves.map(|(before, after)| (after.translation.vector - before.translation.vector).norm());
        if moved.fold(0.0, f64::max) < LEAST_MOVE {
            break;
        }
    }
    has_moved
}

/// Poses of scans in submaps that are at least `apart` scans before or after them, by scan. The map of a submap is
/// built, used and dropped: those of all at once would take as much memory as the drive is long.
fn register_on_revisited(revisit: &Revisit<'_>, apart: usize, matches: &mut [SubmapMatches]) -> Vec<Constraint> {
    // The scans near each submap, each with the place of that submap among its own.
    let mut near: Vec<Vec<(usize, usize)>> = vec![Vec::new(); revisit.submaps.len()];
    for scan in 0..revisit.scans.len() {
        for (place, submap) in near_submaps(revisit, scan, apart).into_iter().enumerate() {
            near[submap].push((scan, place));
        }
    }
    let of_submaps = near.par_iter().zip(matches).enumerate();
    let found = of_submaps.flat_map_iter(|(submap, (scans, matches))| {
        matches.update(revisit, submap, scans.iter().map(|(scan, _)| *scan));
        let on_it = |order: &(usize, usize)| Some((*order, matches.matches.get(&order.0)?.1?));
        scans.iter().filter_map(on_it).collect::<Vec<_>>()
    });
    let mut found: Vec<((usize, usize), Constraint)> = found.collect();
    found.sort_by_key(|(order, _)| *order);
    found.into_iter().map(|(_, constraint)| constraint).collect()
}

impl SubmapMatches {
    /// Registers those of the scans that have moved against the submap since they were registered, or all if its shape has
    /// changed.
    fn update(&mut self, revisit: &Revisit<'_>, submap: usize, scans: impl Iterator<Item = usize>) {
        let poses = &revisit.graph.poses;
        let from = middle(&revisit.submaps[submap]);
        let into = poses[from].inverse();
        let around = revisit.scans_around(submap, revisit.scans.len());
        let shape = around.iter().map(|scan| into * poses[*scan]);
        let is_same = self.shape.len() == around.len() && self.shape.iter().zip(shape.clone()).all(is_unmoved);
        if !is_same {
            *self = Self { shape: shape.collect(), matches: BTreeMap::new() };
        }
        let map = LazyCell::new(|| revisit.map_of(&around, from));
        for scan in scans {
            let known = into * poses[scan];
            if !self.matches.get(&scan).is_some_and(|(before, _)| is_unmoved((before, known))) {
                self.matches.insert(scan, (known, register_on(revisit.scans[scan], scan, from, &known, &map)));
            }
        }
    }
}

/// Whether a pose is nearly what it was.
fn is_unmoved((before, now): (&Pose2, Pose2)) -> bool {
    let moved = before.inv_mul(&now);
    moved.translation.vector.norm() <= UNMOVED[0] && moved.rotation.angle().abs() <= UNMOVED[1]
}

/// The nearest submaps of other times.
fn near_submaps(revisit: &Revisit<'_>, scan: usize, apart: usize) -> Vec<usize> {
    let poses = &revisit.graph.poses;
    let here = poses[scan].translation.vector;
    let drive = revisit.drive(scan);
    // Scans are registered on a recorded map, and it not on them.
    if drive.is_recorded {
        return Vec::new();
    }
    let distance = |submap: usize| (poses[middle(&revisit.submaps[submap])].translation.vector - here).norm();
    let is_of_other_time = |submap: &usize| {
        let scans = &revisit.submaps[*submap];
        !drive.scans.contains(&scans.start) || scans.end + apart <= scan || scan + apart < scans.start
    };
    let of_other_time = (0..revisit.submaps.len()).filter(is_of_other_time).map(|submap| (distance(submap), submap));
    let mut near: Vec<(f64, usize)> = of_other_time.filter(|(distance, _)| *distance <= COMMON_DISTANCE).collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    near.into_iter().take(MAX_SUBMAPS).map(|(_, submap)| submap).collect()
}

/// The pose of a scan in a submap, whose frame is that of the scan `from`, as registered from a known one; `None` if the
/// scan does not lie on it there.
fn register_on(points: &[ScanPoint], scan: usize, from: usize, known: &Pose2, map: &LocalMap) -> Option<Constraint> {
    let fit = map.find(points, known)?;
    let moved = known.inv_mul(&fit.pose);
    let is_near = moved.translation.vector.norm() <= MAX_MOVE[0] && moved.rotation.angle().abs() <= MAX_MOVE[1];
    is_near.then(|| Constraint {
        from,
        to: scan,
        transform: fit.pose,
        information: INFORMATION_SHARE * fit.information,
        is_loop: true,
    })
}
