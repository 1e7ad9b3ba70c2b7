//! The place to a part of a cell.

use super::climb::{Steps, climb};
use super::overlay::Overlay;
use crate::shared::geometry::{Point2, Pose2};

/// How often a cell is halved.
const HALVINGS: usize = 3;

/// The peak near a place, to an eighth of a cell of the overlay and of `radians`, about `centre`, the middle of the walls
/// in common, in frame a.
pub fn refine_peak(overlay: &Overlay<'_>, transform_a_b: &Pose2, centre: &Point2, radians: f64) -> Pose2 {
    let steps = Steps { metres: overlay.a.cell, radians, halvings: HALVINGS };
    climb(|place| overlay.smooth_score(place), transform_a_b, centre, steps).transform_a_b
}
