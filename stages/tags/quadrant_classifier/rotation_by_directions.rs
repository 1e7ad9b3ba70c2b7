//! The rotation between two maps that their directions tell.

use super::direction::Direction;
use super::parameters::QuadrantClassifierParameters;
use super::quadrant::quadrant;
use super::tag_rotation::TagRotation;
use crate::shared::geometry::{turn_difference, wrap_angle};
use std::f64::consts::{FRAC_PI_2, TAU};

/// Why the directions of two maps tell no rotation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MissingDirection {
    /// A map is not there.
    #[error("a map has not come yet")]
    Map,
    /// A map has no direction.
    #[error("the walls of a map have no common direction")]
    Direction,
}

/// `d_theta + kappa * 90 degrees`, beside what the tags say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct RotationByDirections {
    /// The rotation of `T_a_b`, radians, and its standard deviation.
    pub(super) rotation: TagRotation,
    /// The tags' rotation less this one, radians.
    pub(super) off: f64,
    /// How far the two may differ, radians.
    pub(super) limit: f64,
}

impl RotationByDirections {
    /// Whether the tags say the same.
    pub(super) fn agrees(&self) -> bool {
        self.off.abs() <= self.limit
    }
}

/// The rotation of the directions that is nearest to that of the tags.
pub(super) fn rotation_by_directions(
    by_tags: &TagRotation,
    a: Option<&Direction>,
    b: Option<&Direction>,
    parameters: &QuadrantClassifierParameters,
) -> Result<RotationByDirections, MissingDirection> {
    let TagRotation { angle: d_theta, deviation } = difference_of_directions(a, b)?;
    let angle = wrap_angle(d_theta + f64::from(quadrant(by_tags.angle, d_theta)) * FRAC_PI_2);
    let limit = 3.0 * deviation.hypot(by_tags.deviation) + parameters.contradiction_angle;
    Ok(RotationByDirections {
        rotation: TagRotation { angle, deviation },
        off: turn_difference(by_tags.angle, angle, TAU),
        limit: limit.min(parameters.max_contradiction),
    })
}

/// `d_theta`, the direction of map a less that of map b: the rotation of `T_a_b` but for quarter turns.
pub(super) fn difference_of_directions(
    a: Option<&Direction>,
    b: Option<&Direction>,
) -> Result<TagRotation, MissingDirection> {
    let (Some(a), Some(b)) = (a, b) else { return Err(MissingDirection::Map) };
    if !(a.valid && b.valid) {
        return Err(MissingDirection::Direction);
    }
    Ok(TagRotation { angle: a.angle - b.angle, deviation: a.deviation.hypot(b.deviation) })
}
