//! Where a scan fits the map so far.

use super::{DrawnMap, ScanBeams, ScanMapperParameters};
use crate::registration::icp::{FirstGuess, IcpParameters, refine};
use crate::shared::geometry::{Grid, Point2, Pose2};
use crate::shared::scan_grid::SnapshotMap;
use crate::shared::walls::WallMap;
use nalgebra::{Matrix3, Vector3};

/// A scan with fewer hits tells no place.
const LEAST_HITS: usize = 30;
/// Even a robot that stands still is not known better than this by odometry, metres and radians.
const LEAST_DEVIATION: [f64; 2] = [0.02, 0.01];
/// A place that the walls leave open by more than this, metres and radians, is taken from odometry.
const MOST_DEVIATION: f64 = 0.2;
const MOST_YAW_DEVIATION: f64 = 0.02;
/// So much beyond the hits of a scan the map is looked at, metres.
const MARGIN: f64 = 1.0;

/// How far a robot has moved, by odometry.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion {
    /// Metres.
    pub way: f64,
    /// Radians, 0 or more.
    pub turn: f64,
}

/// Where the base of a robot was in its map when it made a scan, of which odometry says that it was at `guess` after a motion.
/// `None` if the walls do not tell: where the scan has met too little, in a bare corridor, and where it fits only far away.
pub fn match_scan(
    map: &DrawnMap,
    scan: &ScanBeams,
    guess: &Pose2,
    motion: Motion,
    parameters: &ScanMapperParameters,
) -> Option<Pose2> {
    if scan.hits() < LEAST_HITS {
        return None;
    }
    let reach = scan.beams.iter().filter(|beam| beam.is_hit).map(|beam| beam.range).fold(0.0, f64::max) + MARGIN;
    let icp = IcpParameters {
        max_deviation: MOST_DEVIATION,
        max_distance: 0.5,
        position_slack: 0.02,
        yaw_slack: 0.01,
        ..Default::default()
    };
    let walls = |map: &SnapshotMap| Some(WallMap::new(&Grid::new(map.geometry, &map.cells).ok()?, icp.normal_radius));
    let so_far = walls(&map.around(&Point2::from(guess.translation.vector), reach)?)?;
    // The scan alone, drawn as the map is, in the frame of the base.
    let mut alone = DrawnMap::new(parameters);
    alone.draw(scan, |_| Some(Pose2::identity())).ok()?;
    let seen = walls(&alone.snapshot()?)?;
    let share = parameters.odometry_deviation;
    let place = share * motion.way + LEAST_DEVIATION[0];
    // A turn of the wheels that nobody has seen turns the robot on its way, too.
    let yaw = share * (motion.turn + motion.way) + LEAST_DEVIATION[1];
    let covariance = Matrix3::from_diagonal(&Vector3::new(place * place, place * place, yaw * yaw));
    let refinement = refine(&so_far, &seen, &FirstGuess::new(*guess, covariance, &icp), &icp);
    // A match that still moves, or is turned by an unknown angle, would lead the poses that follow astray.
    let registration = &refinement.registration;
    let is_sure = registration.converged && registration.centre_covariance.m33.sqrt() <= MOST_YAW_DEVIATION;
    (refinement.refusal.is_none() && is_sure).then_some(registration.transform_a_b)
}
