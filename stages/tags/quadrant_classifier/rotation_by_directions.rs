//! Rotation between two maps from their directions.

use super::direction::Direction;
use super::parameters::QuadrantClassifierParameters;
use super::quadrant::quadrant;
use super::tag_rotation::TagRotation;
use crate::shared::geometry::{turn_difference, wrap_angle};
use std::f64::consts::{FRAC_PI_2, TAU};

/// Why the directions of two maps determine no rotation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MissingDirection {
    /// A map is missing.
    #[error("a map is missing so far")]
    Map,
    /// A map has no direction.
    #[error("the walls of a map have no common direction")]
    Direction,
}

/// `d_theta + kappa * 90 degrees`, compared with the tags.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct RotationByDirections {
    /// The rotation of `T_a_b`, radians, and its standard deviation.
    pub(super) rotation: TagRotation,
    /// The tags' rotation less this one, radians.
    pub(super) off: f64,
    /// Largest difference allowed, radians.
    pub(super) limit: f64,
}

impl RotationByDirections {
    /// Whether the tags agree.
    pub(super) fn agrees(&self) -> bool {
        self.off.abs() <= self.limit
    }
}

/// The rotation by the directions that is nearest to that of the tags.
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

/// `d_theta`, the direction of map a less that of map b: the rotation of `T_a_b` up to quarter turns.
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
