//! Scans that contradict the map of which they are part: their beams pass through walls that were seen at other times.
//!
//! A beam that ended somewhere has passed all that lies before. Where a map is doubled or bent, the beams of one visit
//! pass through the walls of another (Mazuran et al. 2014, "A statistical measure for map consistency in SLAM"). No
//! truth is needed to see that.

use super::scan_points::ScanPoint;
use crate::shared::geometry::{Point2, PointIndex, Pose2};
use nalgebra::Vector2;
use rayon::prelude::*;

/// Number of beams of a scan that are looked at: some in each direction are enough.
const BEAMS: usize = 60;
/// Part of a beam at its start and before its end that is not looked at, metres: walls are drawn to some centimetres.
const MARGIN: f64 = 0.3;
/// Step in which beams are followed, and the distance up to which a point of a wall is on a beam, metres.
const STEP: f64 = 0.1;
const REACH: f64 = 0.07;
/// Distance of the end of a beam from a wall on which it lies, metres.
const END_REACH: f64 = 0.15;
/// Least cosine between a beam and the normal of a wall that it passes through, and does not graze.
const LEAST_COSINE: f64 = 0.5;
/// Least number of beams of a scan that meet walls of other times, for the scan to say anything.
const LEAST_BEAMS: usize = 8;
/// Share of these beams that pass through such walls, above which a scan contradicts the map. Doors that were closed
/// and things that were moved are some of them, a wall that is drawn twice is most.
const MAX_PASSING: f64 = 1.0 / 3.0;

/// How often scans contradict walls that were seen at other times.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Contradictions {
    /// Number of scans whose beams meet walls of other times.
    pub revisiting: usize,
    /// Those of them that contradict these walls, in their order.
    pub contradicting: Vec<usize>,
}

/// A scan at its place in the map.
pub(super) struct PlacedScan<'a> {
    /// Points in the frame of the base.
    pub(super) points: &'a [ScanPoint],
    /// Pose of the base.
    pub(super) pose: Pose2,
    /// Position of the lidar in the frame of the base; none of what is part of a recorded map.
    pub(super) lidar: Option<Point2>,
    /// Number of the drive of which it is part.
    pub(super) drive: usize,
}

/// The walls of all scans.
struct Walls<'a> {
    scans: &'a [PlacedScan<'a>],
    /// Least number of scans of one drive between those of other times.
    apart: usize,
    index: PointIndex,
    /// For each point of the index its scan and its normal.
    seen: Vec<(usize, Vector2<f64>)>,
}

/// Compares each scan with the walls of those that are of other drives, or more than `apart` scans before or after it.
pub(super) fn find_contradictions(scans: &[PlacedScan<'_>], apart: usize) -> Contradictions {
    let walls = Walls::of(scans, apart);
    let judge = |scan: usize| walls.is_contradicted(scan);
    let judged: Vec<Option<bool>> = (0..scans.len()).into_par_iter().map(judge).collect();
    let contradicting = (0..scans.len()).filter(|scan| judged[*scan] == Some(true)).collect();
    Contradictions { revisiting: judged.iter().flatten().count(), contradicting }
}

impl<'a> Walls<'a> {
    fn of(scans: &'a [PlacedScan<'a>], apart: usize) -> Self {
        let (mut places, mut unsorted) = (Vec::new(), Vec::new());
        for (number, scan) in scans.iter().enumerate() {
            for point in scan.points {
                if let Some(normal) = point.normal {
                    places.push(scan.pose * point.place);
                    unsorted.push((number, scan.pose * normal));
                }
            }
        }
        let (index, order) = PointIndex::new(&places, STEP);
        Self { scans, apart, index, seen: order.into_iter().map(|place| unsorted[place]).collect() }
    }

    /// Whether two scans were made at different times.
    fn are_apart(&self, one: usize, other: usize) -> bool {
        one.abs_diff(other) > self.apart || self.scans[one].drive != self.scans[other].drive
    }

    /// Whether the beams of a scan pass through walls of other times; `None` if too few meet any.
    fn is_contradicted(&self, number: usize) -> Option<bool> {
        let scan = &self.scans[number];
        let lidar = scan.pose * scan.lidar?;
        let (mut passing, mut meeting) = (0, 0);
        for point in scan.points.iter().step_by(scan.points.len().div_ceil(BEAMS).max(1)) {
            let end = scan.pose * point.place;
            let passes = self.is_passed(number, &lidar, &end);
            let is_of_other_time = |index: usize| self.are_apart(self.seen[index].0, number);
            passing += usize::from(passes);
            meeting += usize::from(passes || self.index.within(&end, END_REACH).any(is_of_other_time));
        }
        (meeting >= LEAST_BEAMS).then_some(passing as f64 > MAX_PASSING * meeting as f64)
    }

    /// Whether a beam passes through a wall of other times that is recorded, or that two scans have seen: what only one has
    /// seen may have been a person.
    fn is_passed(&self, number: usize, lidar: &Point2, end: &Point2) -> bool {
        let way = end - lidar;
        let range = way.norm();
        let along = way / range;
        let steps = ((range - 2.0 * MARGIN) / STEP).max(0.0) as usize;
        let mut witness = None;
        for step in 0..steps {
            let at = lidar + along * (MARGIN + STEP * step as f64);
            for index in self.index.within(&at, REACH) {
                let (scan, normal) = &self.seen[index];
                if !self.are_apart(*scan, number) || normal.dot(&along).abs() < LEAST_COSINE {
                    continue;
                }
                let is_recorded = self.scans[*scan].lidar.is_none();
                if is_recorded || witness.is_some_and(|witness| witness != *scan) {
                    return true;
                }
                witness = Some(*scan);
            }
        }
        false
    }
}
