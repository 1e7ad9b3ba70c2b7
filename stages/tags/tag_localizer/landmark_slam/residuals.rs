//! The factors of the readings: residuals, and their derivatives.

use super::super::measured::Measured;
use super::keyframes::{KeyframeReading, yaw};
use crate::shared::geometry::{Point2, Pose2, quarter_turn, wrap_angle};
use nalgebra::{Vector2, Vector3};

/// Least distance from a sensor, metres: at less, a direction is undefined.
const NEAREST: f64 = 1e-2;

/// A residual in standard deviations, and its derivatives.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Residual {
    pub(super) residual: f64,
    /// By the pose of the keyframe: x, y in the frame of the map, yaw.
    pub(super) by_pose: Vector3<f64>,
    /// By the position of the tag.
    pub(super) by_tag: Vector2<f64>,
    /// By the offset and the scale of ranges.
    pub(super) by_calibration: Vector2<f64>,
}

/// The rows of a reading at a pose of its keyframe: two for a position, of which the weight is one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ReadingFactor {
    rows: [Residual; 2],
    count: usize,
    /// Standard deviation of the first, as it was claimed, in the unit of the measurement.
    pub(super) stddev: f64,
}

impl ReadingFactor {
    /// The rows.
    pub(super) fn iter(&self) -> impl Iterator<Item = &Residual> {
        self.rows.iter().take(self.count)
    }

    /// Number of rows.
    pub(super) fn count(&self) -> usize {
        self.count
    }

    /// Squared residual, in variances.
    pub(super) fn squared(&self) -> f64 {
        self.iter().map(|row| row.residual * row.residual).sum()
    }

    /// The rows of a reading whose noise is `factor` times as large as claimed. `pose_stddev` is the error of a pose of
    /// its own, metres.
    pub(super) fn new(
        reading: &KeyframeReading,
        keyframe: &Pose2,
        tag: &Point2,
        calibration: &Vector2<f64>,
        pose_stddev: f64,
        factor: f64,
    ) -> Self {
        let turned = |local: &Vector2<f64>| keyframe.rotation * local;
        let claimed = reading.stddev.hypot(pose_stddev);
        match reading.measured {
            Measured::Range(range) => {
                let arm = turned(&reading.offset.translation.vector);
                let apart = tag.coords - keyframe.translation.vector - arm;
                let distance = apart.norm().max(NEAREST);
                let stddev = claimed * factor;
                let stretch = 1.0 + calibration[1];
                let by_tag = -stretch * apart / (distance * stddev);
                let row = Residual {
                    residual: (range - stretch * distance - calibration[0]) / stddev,
                    by_pose: by_sensor(&-by_tag, &arm),
                    by_tag,
                    by_calibration: Vector2::new(-1.0, -distance) / stddev,
                };
                Self { rows: [row, Residual::default()], count: 1, stddev: claimed }
            }
            Measured::Place(place) => {
                let seen = (reading.offset * Point2::from(place)).coords;
                let apart = tag.coords - keyframe.translation.vector;
                let stddev = claimed * factor;
                let local = keyframe.rotation.inverse() * apart;
                let turn = -quarter_turn(&local) / stddev;
                let row = |axis: usize| {
                    let mut unit = Vector2::zeros();
                    unit[axis] = 1.0 / stddev;
                    let by_tag = turned(&unit);
                    Residual {
                        residual: (local[axis] - seen[axis]) / stddev,
                        by_pose: Vector3::new(-by_tag.x, -by_tag.y, turn[axis]),
                        by_tag,
                        by_calibration: Vector2::zeros(),
                    }
                };
                Self { rows: [row(0), row(1)], count: 2, stddev: claimed }
            }
            Measured::Bearing { sensor, bearing, stddev } => {
                let arm = turned(&(reading.offset * Point2::from(sensor)).coords);
                let apart = tag.coords - keyframe.translation.vector - arm;
                let distance = apart.norm().max(NEAREST);
                let claimed = stddev.hypot(pose_stddev / distance);
                let expected = apart.y.atan2(apart.x) - yaw(keyframe);
                let by_tag = quarter_turn(&apart) / (distance * distance * claimed * factor);
                let by_pose = by_sensor(&-by_tag, &arm) - Vector3::z() / (claimed * factor);
                let residual = wrap_angle(expected - reading.offset.rotation.angle() - bearing) / (claimed * factor);
                let row = Residual { residual, by_pose, by_tag, by_calibration: Vector2::zeros() };
                Self { rows: [row, Residual::default()], count: 1, stddev: claimed }
            }
        }
    }
}

/// Derivative by a pose, from that by the position of a sensor at `arm` from it.
fn by_sensor(by_place: &Vector2<f64>, arm: &Vector2<f64>) -> Vector3<f64> {
    Vector3::new(by_place.x, by_place.y, by_place.dot(&quarter_turn(arm)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::pose;

    #[test]
    fn derivatives_are_those_of_the_residuals() {
        let sensor = Vector2::new(0.2, -0.1);
        for measured in [
            Measured::Range(4.0),
            Measured::Place(Vector2::new(2.0, 1.0)),
            Measured::Bearing { sensor, bearing: 0.4, stddev: 0.05 },
        ] {
            let reading = KeyframeReading { keyframe: 0, tag: 0, offset: pose(0.3, 0.1, 0.2), measured, stddev: 0.1 };
            let at = |v: &[f64; 7]| {
                let (tag, calibration) = (Point2::new(v[3], v[4]), Vector2::new(v[5], v[6]));
                // The same error of a pose as for the derivatives, however far the tag is.
                ReadingFactor::new(&reading, &pose(v[0], v[1], v[2]), &tag, &calibration, 0.0, 1.0)
            };
            let here = [1.0, -2.0, 0.7, 4.0, 1.5, 0.3, 0.02];
            let rows = at(&here);
            for place in 0..7 {
                let (mut low, mut high) = (here, here);
                low[place] -= 1e-6;
                high[place] += 1e-6;
                let slopes: Vec<f64> =
                    at(&low).iter().zip(at(&high).iter()).map(|(l, h)| (h.residual - l.residual) / 2e-6).collect();
                for (row, slope) in rows.iter().zip(slopes) {
                    let found = match place {
                        0..3 => row.by_pose[place],
                        3 | 4 => row.by_tag[place - 3],
                        _ => row.by_calibration[place - 5],
                    };
                    assert!((found - slope).abs() < 1e-4, "{measured:?} {place}: {found} {slope}");
                }
            }
        }
    }
}
