//! Registration of a scan on a local map, from the pose by odometry.

use super::correlative_search::{PosePrior, search};
use super::local_map::LocalMap;
use super::scan_points::ScanPoint;
use crate::shared::geometry::{Point2, Pose2};
use nalgebra::Matrix3;

/// Evidence of a point on a wall in the search: the logarithm of how much likelier it is there than elsewhere. Less
/// than that of one beam, as neighbouring beams hit the same wall.
pub(super) const GAIN: f64 = 0.3;
/// Number of points that the search looks at.
const SEARCHED_POINTS: usize = 180;
/// Half the window, in standard deviations of odometry.
const WINDOW: f64 = 3.0;
/// Least and largest half of the window, metres and radians.
const LEAST_WINDOW: [f64; 2] = [0.1, 0.05];
const LARGEST_WINDOW: [f64; 2] = [2.0, 1.0];
/// Share of the points on the map below which a wider window is tried: wheels may have slipped.
pub(super) const WELL_MATCHED: f64 = 0.6;
/// The wider window, at least, metres and radians.
const SLIP_WINDOW: [f64; 2] = [0.5, 0.7];
/// How much more of the points must match for a pose that odometry does not expect.
pub(super) const SLIP_GAIN: f64 = 0.2;

/// A scan on a map.
#[derive(Clone, Copy, Debug)]
pub(super) struct RegisteredScan {
    /// Pose of the base in the map's frame.
    pub(super) pose: Pose2,
    /// Inverse of its covariance (x, y, yaw) by the walls alone.
    pub(super) information: Matrix3<f64>,
    /// Share of its points that lie on the map.
    pub(super) matched: f64,
}

/// Registers a scan. `guess` is its pose by odometry, with the inverse of its covariance (x, y, yaw) in the map's
/// frame, and `deviations` the standard deviations of its position and yaw, metres and radians.
pub(super) fn register(
    map: &LocalMap,
    points: &[ScanPoint],
    guess: &Pose2,
    information: &Matrix3<f64>,
    deviations: [f64; 2],
) -> RegisteredScan {
    let bounded = |axis: usize| (WINDOW * deviations[axis]).clamp(LEAST_WINDOW[axis], LARGEST_WINDOW[axis]);
    let [place, yaw] = [bounded(0), bounded(1)];
    let found = register_within(map, points, guess, information, [place, place, yaw]);
    if found.matched >= WELL_MATCHED {
        return found;
    }
    let [place, yaw] = [place.max(SLIP_WINDOW[0]), yaw.max(SLIP_WINDOW[1])];
    // A slip is as uncertain as its window.
    let slip = Matrix3::from_diagonal(&[place, place, yaw].map(|half| (half / WINDOW).powi(-2)).into());
    let wide = register_within(map, points, guess, &slip, [place, place, yaw]);
    if wide.matched > found.matched + SLIP_GAIN { wide } else { found }
}

fn register_within(
    map: &LocalMap,
    points: &[ScanPoint],
    guess: &Pose2,
    information: &Matrix3<f64>,
    window: [f64; 3],
) -> RegisteredScan {
    let searched = thinned(points, SEARCHED_POINTS);
    let prior = PosePrior { mean: *guess, information: *information, window };
    let found = search(&map.field(&searched, &prior), &searched, &prior, GAIN, 0.0, None);
    let start = found.map_or(*guess, |found| found.pose);
    let fit = map.register(points, &start, (guess, information));
    RegisteredScan { pose: fit.pose, information: fit.information, matched: fit.matched }
}

/// Points spread evenly over the scan, at most `most`.
pub(super) fn thinned(points: &[ScanPoint], most: usize) -> Vec<Point2> {
    points.iter().step_by(points.len().div_ceil(most).max(1)).map(|point| point.place).collect()
}
