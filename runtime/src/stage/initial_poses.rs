//! Where the user knows the maps of robots to lie.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Where the user knows the map frame of one robot to lie, in a frame that all initial poses have in common: for a
/// robot whose map begins where it stood, the place where it stood.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct InitialPose {
    /// Metres.
    pub x: f64,
    /// Metres.
    pub y: f64,
    /// Radians.
    pub yaw: f64,
    /// Standard deviation in x and in y, metres.
    pub stddev: f64,
    /// Standard deviation of the yaw, radians.
    pub yaw_stddev: f64,
}

impl Default for InitialPose {
    /// At the origin, known as well as a place that was paced out and a direction that was seen by eye.
    fn default() -> Self {
        Self { x: 0.0, y: 0.0, yaw: 0.0, stddev: 1.0, yaw_stddev: 0.2 }
    }
}

impl InitialPose {
    /// The origin of all initial poses, exactly.
    pub const ORIGIN: Self = Self { x: 0.0, y: 0.0, yaw: 0.0, stddev: 0.0, yaw_stddev: 0.0 };
    /// The greatest yaw, radians: a full turn, slightly enlarged for rounding; larger values are rejected as
    /// degrees.
    pub const FULL_TURN: f64 = 1.00001 * std::f64::consts::TAU;
    /// Its keys in a pipeline file, and its order on a command line.
    pub const FIELDS: [&str; 5] = ["x", "y", "yaw", "stddev", "yaw_stddev"];

    /// Sets one of [`FIELDS`](Self::FIELDS).
    ///
    /// # Errors
    /// What the field takes, if it does not take this value.
    pub fn set(&mut self, field: usize, value: f64) -> Result<(), &'static str> {
        let (place, expected, is_fit) = match field {
            0 => (&mut self.x, "a finite number of metres", value.is_finite()),
            1 => (&mut self.y, "a finite number of metres", value.is_finite()),
            2 => (
                &mut self.yaw,
                "radians from -6.2832 to 6.2832 (90 degrees are 1.5708)",
                value.abs() <= Self::FULL_TURN,
            ),
            3 => (&mut self.stddev, "metres from 0.01 to 10000", (0.01..=1e4).contains(&value)),
            _ => (&mut self.yaw_stddev, "radians from 0.001 to 10", (1e-3..=10.0).contains(&value)),
        };
        if is_fit {
            *place = value;
        }
        is_fit.then_some(()).ok_or(expected)
    }

    /// The numbers of all [`FIELDS`](Self::FIELDS).
    pub fn values(&self) -> [f64; 5] {
        [self.x, self.y, self.yaw, self.stddev, self.yaw_stddev]
    }
}

/// The initial poses that the user knows, by robot.
pub type InitialPoses = BTreeMap<String, InitialPose>;
