//! Registration of a scan on the map so far.

use super::{ScanBeams, ScanMap, ScanMapperParameters};
use crate::registration::icp::{FirstGuess, IcpParameters, refine};
use crate::shared::geometry::{Grid, Point2, Pose2};
use crate::shared::scan_grid::SnapshotMap;
use crate::shared::walls::WallMap;
use nalgebra::{Matrix3, Vector3};

/// Least number of hits of a scan that is matched.
const LEAST_HITS: usize = 30;
/// Least standard deviation of odometry, even for a robot that stands still, metres and radians.
const LEAST_DEVIATION: [f64; 2] = [0.02, 0.01];
/// Largest standard deviation of a match, metres and radians; else odometry is used.
const MOST_DEVIATION: f64 = 0.2;
const MOST_YAW_DEVIATION: f64 = 0.02;
/// Margin of the map around the hits of a scan, metres.
const MARGIN: f64 = 1.0;

/// Motion of a robot by odometry.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion {
    /// Distance, metres.
    pub way: f64,
    /// Radians, 0 or more.
    pub turn: f64,
}

/// Pose of a robot's base in its map at a scan, by registration from the odometry pose `guess` after a motion. `None`
/// if the walls do not constrain it: if the scan has too few hits, in a bare corridor, and if it fits only far away.
pub fn match_scan(
    map: &ScanMap,
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
    // The scan alone, as a map in the frame of the base.
    let mut alone = ScanMap::new(parameters);
    alone.draw(scan, |_| Some(Pose2::identity())).ok()?;
    let seen = walls(&alone.snapshot()?)?;
    let share = parameters.odometry_deviation;
    let place = share * motion.way + LEAST_DEVIATION[0];
    // An unnoticed turn of the wheels turns the robot along its path, too.
    let yaw = share * (motion.turn + motion.way) + LEAST_DEVIATION[1];
    let covariance = Matrix3::from_diagonal(&Vector3::new(place * place, place * place, yaw * yaw));
    let refinement = refine(&so_far, &seen, &FirstGuess::new(*guess, covariance, &icp), &icp);
    // A match that has not converged, or is turned by an uncertain angle, would corrupt the later poses.
    let registration = &refinement.registration;
    let is_sure = registration.converged && registration.centre_covariance.m33.sqrt() <= MOST_YAW_DEVIATION;
    (refinement.refusal.is_none() && is_sure).then_some(registration.transform_a_b)
}
