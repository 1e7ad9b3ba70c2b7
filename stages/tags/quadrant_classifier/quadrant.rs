//! Which of the four quarter turns aligns two maps (equation 7 of Tsardoulias et al.).

use std::f64::consts::FRAC_PI_2;

/// Number of quarter turns, 0 to 3, to add to the difference of two maps' directions, `d_theta`, to be nearest to the
/// rotation of the tags, `theta_hat`; both radians.
///
/// Equation 7 gives it from `theta_hat` alone, which holds only while `d_theta` is below 45 degrees. For a `d_theta`
/// of 0 this is its table, except for the printed borders of 215 and 305 degrees, which should be 225 and 315: a
/// quadrant is 90 degrees wide.
pub fn quadrant(theta_hat: f64, d_theta: f64) -> u8 {
    ((theta_hat - d_theta) / FRAC_PI_2).round().rem_euclid(4.0) as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::turn_difference;
    use proptest::prelude::*;
    use std::f64::consts::TAU;

    proptest! {
        #[test]
        fn the_rotation_is_recovered_for_any_directions(
            rotation in -TAU..TAU, direction_b in -TAU..TAU, turns_a in 0..4i32, turns_b in 0..4i32, noise in -0.7..0.7,
        ) {
            // Directions are known up to quarter turns, and the tags' rotation is off by up to 40 degrees.
            let direction_a = direction_b + rotation + f64::from(turns_a) * FRAC_PI_2;
            let d_theta = direction_a - (direction_b + f64::from(turns_b) * FRAC_PI_2);
            let found = d_theta + f64::from(quadrant(rotation + noise, d_theta)) * FRAC_PI_2;
            prop_assert!(turn_difference(found, rotation, TAU).abs() < 1e-9);
        }
    }
}
