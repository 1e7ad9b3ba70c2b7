//! Where the readings of tags are in messages of any type.

use serde::{Deserialize, Serialize};

/// Where the id, the range and the rest of a reading are in messages of any type. Fields are written as paths, such as
/// `header.frame_id`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TagFields {
    /// An array each of whose elements is a reading, in which the other fields are looked for; without it the message
    /// is one.
    pub each: Option<String>,
    /// Which tag: a text or a whole number.
    pub id_field: String,
    /// The distance to the tag.
    pub range_field: Option<String>,
    /// What one unit of the distance is in metres: 0.001 for millimetres.
    pub range_unit: Option<f64>,
    /// The signal strength, dBm: the distance where there is no range.
    pub rssi_field: Option<String>,
    /// The model of signal strength over distance; present where `rssi_field` replaces the range.
    pub path_loss: Option<PathLoss>,
    /// The standard deviation of the distance, in its unit.
    pub stddev_field: Option<String>,
    /// The standard deviation of the distance where no field holds it, metres.
    pub stddev: Option<f64>,
    /// The pose or the point at which the tag is in the frame of the message's header, metres.
    pub pose_field: Option<String>,
    /// The direction in which the tag is: the angle about the z axis of the frame of the message's header, from its x
    /// axis on and counterclockwise.
    pub bearing_field: Option<String>,
    /// What one unit of the bearing is in radians: 0.01745 for degrees. Below 0 where it counts clockwise.
    pub bearing_unit: Option<f64>,
    /// The standard deviation of the bearing, in its unit.
    pub bearing_stddev_field: Option<String>,
    /// The standard deviation of the bearing where no field holds it, radians.
    pub bearing_stddev: Option<f64>,
}

/// The log-distance model of how a radio signal gets weaker (Rappaport, "Wireless Communications", section 4.9):
/// `rssi = rssi_at_1m - 10 exponent log10(distance / 1 m)`, with normal noise of `stddev` dB.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PathLoss {
    /// Signal strength at one metre, dBm.
    pub rssi_at_1m: f64,
    /// How fast it falls: 2 in the open, 1.6 to 1.8 along corridors, 3 and more through walls.
    pub exponent: f64,
    /// Standard deviation of the signal strength, dB.
    pub stddev: f64,
}

impl PathLoss {
    /// The distance at which a signal has a strength, metres, and its standard deviation to first order.
    pub fn distance(&self, rssi: f64) -> (f64, f64) {
        let distance = 10f64.powf((self.rssi_at_1m - rssi) / (10.0 * self.exponent));
        (distance, distance * std::f64::consts::LN_10 / (10.0 * self.exponent) * self.stddev)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_signal_that_is_20_db_weaker_in_the_open_comes_from_ten_times_as_far() {
        let open = PathLoss { rssi_at_1m: -40.0, exponent: 2.0, stddev: 4.0 };
        assert_eq!(open.distance(-40.0).0, 1.0);
        let (far, stddev) = open.distance(-60.0);
        assert!((far - 10.0).abs() < 1e-9);
        // As far off as a signal of one standard deviation more or less says, to first order.
        let (nearer, farther) = (open.distance(-56.0).0, open.distance(-64.0).0);
        assert!((stddev - 4.605).abs() < 1e-3 && nearer > far - stddev && farther > far + stddev, "{stddev}");
    }
}
