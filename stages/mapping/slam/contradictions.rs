//! Scans that contradict the map of which they are part: their beams pass through walls that were seen at other times.
//!
//! A beam that ended somewhere has passed all that lies before. Where a map is doubled or bent, the beams of one visit
//! pass through the walls of another (Mazuran et al. 2014, "A statistical measure for map consistency in SLAM"). No
//! truth is needed to see that.
//!
//! Some beams pass through railings, hedges and table legs whenever they are looked at, and through where a person was.
//! Their own time shows it: what scans of the time at which it was seen look through contradicts nothing.

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

/// Largest share of the scans that see walls again, and contradict them, of a map that is right. The benchmark
/// `scan_contradictions.py` fits it to simulated drives.
pub const MAX_CONTRADICTING: f64 = 0.06;

/// How often scans contradict walls that were seen at other times.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Contradictions {
    /// Number of scans whose beams meet walls of other times.
    pub revisiting: usize,
    /// Those of them that contradict these walls, in their order.
    pub contradicting: Vec<usize>,
}

impl Contradictions {
    /// Whether more than a share of the scans that see walls again contradict them.
    pub fn are_more_than(&self, share: f64) -> bool {
        self.contradicting.len() as f64 > share * self.revisiting as f64
    }
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

/// A point of a wall.
struct WallPoint {
    /// The scan that has seen it.
    scan: usize,
    normal: Vector2<f64>,
    /// How many other scans of its time look through it.
    passed_in_its_time: u32,
}

/// The walls of all scans.
struct Walls<'a> {
    scans: &'a [PlacedScan<'a>],
    /// Least number of scans of one drive between those of other times.
    apart: usize,
    index: PointIndex,
    /// For each point of the index what it is.
    points: Vec<WallPoint>,
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
        let point = |place: usize| {
            let (scan, normal) = unsorted[place];
            WallPoint { scan, normal, passed_in_its_time: 0 }
        };
        let mut walls = Self { scans, apart, index, points: order.into_iter().map(point).collect() };
        let passed: Vec<Vec<usize>> =
            (0..scans.len()).into_par_iter().map(|scan| walls.passed_in_its_time(scan)).collect();
        for point in passed.into_iter().flatten() {
            walls.points[point].passed_in_its_time += 1;
        }
        walls
    }

    /// Whether two scans were made at different times.
    fn are_apart(&self, one: usize, other: usize) -> bool {
        one.abs_diff(other) > self.apart || self.scans[one].drive != self.scans[other].drive
    }

    /// The beams of a scan that are looked at, from the lidar to their ends.
    fn beams(&self, number: usize) -> impl Iterator<Item = [Point2; 2]> {
        let scan = &self.scans[number];
        let lidar = scan.lidar.map(|lidar| scan.pose * lidar);
        let points = scan.points.iter().step_by(scan.points.len().div_ceil(BEAMS).max(1));
        points.filter_map(move |point| Some([lidar?, scan.pose * point.place]))
    }

    /// The points of walls that a beam passes through, in the order of the beam.
    fn passed(&self, [lidar, end]: [Point2; 2]) -> impl Iterator<Item = usize> {
        let way = end - lidar;
        let range = way.norm();
        let along = way / range;
        let steps = ((range - 2.0 * MARGIN) / STEP).max(0.0) as usize;
        let places = (0..steps).map(move |step| lidar + along * (MARGIN + STEP * step as f64));
        let points = places.flat_map(|at| self.index.within(&at, REACH));
        points.filter(move |index| self.points[*index].normal.dot(&along).abs() >= LEAST_COSINE)
    }

    /// The points of walls that other scans of the time of a scan have seen, and that it looks through.
    fn passed_in_its_time(&self, number: usize) -> Vec<usize> {
        let is_of_its_time = |index: &usize| {
            let scan = self.points[*index].scan;
            scan != number && !self.are_apart(scan, number)
        };
        let mut passed: Vec<usize> =
            self.beams(number).flat_map(|beam| self.passed(beam)).filter(is_of_its_time).collect();
        passed.sort_unstable();
        passed.dedup();
        passed
    }

    /// Whether the beams of a scan pass through walls of other times; `None` if too few meet any.
    fn is_contradicted(&self, number: usize) -> Option<bool> {
        let (mut passing, mut meeting) = (0, 0);
        for beam in self.beams(number) {
            let passes = self.contradicts(number, beam);
            let is_of_other_time = |index: usize| self.are_apart(self.points[index].scan, number);
            passing += usize::from(passes);
            meeting += usize::from(passes || self.index.within(&beam[1], END_REACH).any(is_of_other_time));
        }
        (meeting >= LEAST_BEAMS).then_some(passing as f64 > MAX_PASSING * meeting as f64)
    }

    /// Whether a beam passes through a wall of other times that is recorded, or that two scans have seen and two did not
    /// look through: what only one has seen may have been a person.
    fn contradicts(&self, number: usize, beam: [Point2; 2]) -> bool {
        let mut witness = None;
        for index in self.passed(beam) {
            let WallPoint { scan, passed_in_its_time, .. } = self.points[index];
            if !self.are_apart(scan, number) || passed_in_its_time >= 2 {
                continue;
            }
            let is_recorded = self.scans[scan].lidar.is_none();
            if is_recorded || witness.is_some_and(|witness| witness != scan) {
                return true;
            }
            witness = Some(scan);
        }
        false
    }
}
