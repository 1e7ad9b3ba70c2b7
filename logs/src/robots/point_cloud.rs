//! A level slice of the point cloud of a 3D lidar: what a 2D lidar at its place would measure.

mod points;
mod sweep;

use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::PointCloud2;
use nalgebra::UnitQuaternion;
use points::Points;
use std::f64::consts::{PI, TAU};
use std::ops::RangeInclusive;
use sweep::Sweep;

pub(crate) use points::CloudFault;

/// The number of directions of a slice. Common 3D lidars measure 900 to 2048.
const DIRECTIONS: usize = 1080;
/// The angle from one direction to the next, radians.
const STEP: f64 = TAU / DIRECTIONS as f64;
/// The points nearer than this are of the robot itself, metres.
pub(crate) const NEAREST: f32 = 0.5;
/// The heights of the slice above a lidar, metres. Walls are seen above it as well as beside it, but below it is the
/// floor, which comes nearer when the robot tilts.
const ABOVE_LIDAR: RangeInclusive<f64> = -0.2..=0.5;
/// The heights of the slice above the base, of points that their driver has transformed there: they do not show how
/// high the lidar is.
const ABOVE_BASE: RangeInclusive<f64> = 0.2..=0.9;
/// The greatest time between the stamp of a cloud and its first point, seconds.
const LONGEST_BEFORE: f64 = 1.0;

/// The nearest point in each of [`DIRECTIONS`] directions, in a frame that is level with the base and has its origin at
/// the sensor.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Slice {
    /// The distances, metres; not a number where there is no point. In the order in which they were measured, where the
    /// times of the points show it.
    pub(crate) ranges: Vec<f32>,
    /// The first direction, radians.
    pub(crate) angle_min: f64,
    /// The angle from one direction to the next, radians.
    pub(crate) angle_increment: f64,
    /// The time from one direction to the next, seconds; 0 if it is unknown.
    pub(crate) time_increment: f64,
    /// The time of the first direction after the stamp of the cloud, seconds.
    pub(crate) begin: f64,
}

/// The nearest point in a direction: the square of its distance (metres), and its time (seconds).
#[derive(Clone, Copy)]
struct Nearest {
    squared: f64,
    time: Option<f64>,
}

impl Slice {
    /// Takes the slice of a cloud from a sensor that is turned by `rotation` against the base. `is_base` is whether the
    /// points are in the frame of the base.
    ///
    /// # Errors
    /// The points cannot be read, or none is in the slice.
    pub(crate) fn of(
        cloud: &PointCloud2<'_>,
        rotation: &UnitQuaternion<f64>,
        is_base: bool,
    ) -> Result<Self, CloudFault> {
        let heights = if is_base { ABOVE_BASE } else { ABOVE_LIDAR };
        let rotation = rotation.to_rotation_matrix();
        let least = f64::from(NEAREST) * f64::from(NEAREST);
        let mut nearest = vec![Nearest { squared: f64::INFINITY, time: None }; DIRECTIONS];
        Points::of(cloud)?.for_each(|point, time| {
            let point = rotation * point;
            let squared = point.x * point.x + point.y * point.y;
            // A point that is not a number is in no slice.
            if !heights.contains(&point.z) || !(least..f64::INFINITY).contains(&squared) {
                return;
            }
            let of_direction = &mut nearest[place(point.y.atan2(point.x))];
            if squared < of_direction.squared {
                *of_direction = Nearest { squared, time: time() };
            }
        });
        if nearest.iter().all(|point| point.squared.is_infinite()) {
            return Err(CloudFault::NoWalls(heights, if is_base { "base" } else { "lidar" }));
        }
        let measured = nearest.iter().enumerate().filter_map(|(place, point)| Some((point.time?, angle(place))));
        Ok(match Sweep::of(measured.collect()) {
            Some(sweep) => Self::in_order(&nearest, &sweep, LogTime::from(cloud.header.stamp).seconds()),
            None => Self {
                ranges: nearest.iter().map(Nearest::range).collect(),
                angle_min: angle(0),
                angle_increment: STEP,
                time_increment: 0.0,
                begin: 0.0,
            },
        })
    }

    /// The directions from the first that was measured on.
    fn in_order(nearest: &[Nearest], sweep: &Sweep, stamp: f64) -> Self {
        let first = place(sweep.first);
        let ranges = nearest[first..].iter().chain(&nearest[..first]);
        let mut ranges: Vec<f32> = ranges.map(Nearest::range).collect();
        if sweep.rate < 0.0 {
            // The first direction stays in front.
            ranges[1..].reverse();
        }
        // Times are after the stamp, or since 1970.
        let begins = [sweep.begin, sweep.begin - stamp];
        let begin = begins.into_iter().find(|begin| begin.abs() <= LONGEST_BEFORE).unwrap_or(0.0);
        let time_increment = STEP / sweep.rate.abs();
        Self { ranges, angle_min: angle(first), angle_increment: STEP.copysign(sweep.rate), time_increment, begin }
    }
}

impl Nearest {
    fn range(&self) -> f32 {
        if self.squared.is_finite() { self.squared.sqrt() as f32 } else { f32::NAN }
    }
}

/// The place of a direction (radians) among all, from behind over the right, ahead and the left.
fn place(angle: f64) -> usize {
    ((angle + PI).rem_euclid(TAU) / STEP).min((DIRECTIONS - 1) as f64) as usize
}

/// The direction in the middle of a place, radians.
fn angle(place: usize) -> f64 {
    (place as f64 + 0.5) * STEP - PI
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_runtime::ros::{Header, PointField};

    fn field(name: &str, offset: u32) -> PointField {
        PointField { name: name.into(), offset, datatype: PointField::FLOAT32, count: 1 }
    }

    fn bytes(points: &[[f32; 3]]) -> Vec<u8> {
        points.iter().flatten().flat_map(|number| number.to_le_bytes()).collect()
    }

    fn cloud(points: usize, data: &[u8]) -> PointCloud2<'_> {
        let fields = vec![field("x", 0), field("y", 4), field("z", 8)];
        let (width, row_step) = (points as u32, data.len() as u32);
        PointCloud2 { height: 1, width, fields, point_step: 12, row_step, data, ..Default::default() }
    }

    /// The measured ranges, in whole centimetres by direction in whole degrees.
    fn found(slice: &Slice) -> Vec<(i64, i64)> {
        let angle = |place: usize| slice.angle_min + place as f64 * slice.angle_increment;
        let measured = slice.ranges.iter().enumerate().filter(|(_, range)| !range.is_nan());
        measured
            .map(|(place, range)| (angle(place).to_degrees().round() as i64, (100.0 * range).round() as i64))
            .collect()
    }

    #[test]
    fn the_nearest_point_near_the_height_of_the_lidar_counts_in_each_direction() {
        let points = [
            [3.0, 0.001, 0.4],
            [2.0, 0.001, 0.0],
            [1.0, 0.001, -0.5],
            [1.5, 0.001, 1.9],
            [0.001, 4.0, -0.1],
            [0.3, 0.3, 0.0],
            [f32::NAN, 1.0, 0.0],
            [f32::INFINITY, -5.0, 0.0],
            [-2.0, -0.001, 0.0],
        ];
        let data = bytes(&points);
        let slice = Slice::of(&cloud(points.len(), &data), &UnitQuaternion::identity(), false).unwrap();
        assert_eq!(found(&slice), [(-180, 200), (0, 200), (90, 400)]);
        // Over the base, the same heights are those of the floor.
        let slice = Slice::of(&cloud(points.len(), &data), &UnitQuaternion::identity(), true).unwrap();
        assert_eq!(found(&slice), [(0, 300)]);
    }

    #[test]
    fn a_lidar_that_is_mounted_turned_measures_a_level_slice() {
        // Its axis points ahead: what is left of the robot at its height is where the lidar's y points.
        let data = bytes(&[[0.0, 2.0, 0.001], [-3.0, 0.0, 1.0], [0.001, 0.0, 5.0]]);
        let rotation = UnitQuaternion::from_euler_angles(0.0, PI / 2.0, 0.0);
        let slice = Slice::of(&cloud(3, &data), &rotation, false).unwrap();
        assert_eq!(found(&slice), [(0, 500), (90, 200)]);
        let upside_down = UnitQuaternion::from_euler_angles(PI, 0.0, 0.0);
        let data = bytes(&[[0.001, 2.0, 0.1]]);
        assert_eq!(found(&Slice::of(&cloud(1, &data), &upside_down, false).unwrap()), [(-90, 200)]);
    }

    #[test]
    fn rows_with_a_remainder_and_numbers_of_either_size_and_order_are_read() {
        let mut data = Vec::new();
        for y in [2.0_f64, 3.0] {
            data.extend([y.to_be_bytes(), 0.001_f64.to_be_bytes(), 0.1_f64.to_be_bytes()].concat());
            data.extend([0xff; 7]);
        }
        let double = |name: &str, offset| PointField { datatype: PointField::FLOAT64, ..field(name, offset) };
        let rows = PointCloud2 {
            height: 2,
            width: 1,
            fields: vec![double("y", 0), double("x", 8), double("z", 16)],
            is_bigendian: true,
            point_step: 24,
            row_step: 31,
            data: &data,
            ..Default::default()
        };
        let slice = Slice::of(&rows, &UnitQuaternion::identity(), false).unwrap();
        assert_eq!(found(&slice), [(90, 200)]);
    }

    #[test]
    fn a_cloud_that_cannot_be_read_is_a_fault() {
        let data = bytes(&[[1.0, 2.0, 0.0]]);
        let good = cloud(1, &data);
        let level = UnitQuaternion::identity();
        let of = |cloud: PointCloud2<'_>| Slice::of(&cloud, &level, false);
        assert_eq!(of(PointCloud2 { fields: Vec::new(), ..good.clone() }), Err(CloudFault::Field("x")));
        assert_eq!(of(PointCloud2 { point_step: 11, ..good.clone() }), Err(CloudFault::Field("z")));
        let integer = vec![field("x", 0), PointField { datatype: 5, ..field("y", 4) }, field("z", 8)];
        assert_eq!(of(PointCloud2 { fields: integer, ..good.clone() }), Err(CloudFault::Field("y")));
        assert_eq!(of(PointCloud2 { width: 2, ..good.clone() }), Err(CloudFault::Short));
        let huge = PointCloud2 { height: u32::MAX, row_step: u32::MAX, ..good.clone() };
        assert_eq!(of(huge), Err(CloudFault::Short));
        for empty in [
            PointCloud2 { width: 0, ..good.clone() },
            PointCloud2 { height: 0, ..good.clone() },
            PointCloud2 { height: u32::MAX, width: 0, row_step: 0, data: &[], ..good },
        ] {
            assert_eq!(of(empty), Err(CloudFault::NoWalls(ABOVE_LIDAR, "lidar")));
        }
    }

    /// A wall around a lidar that turns clockwise from `first`, and begins `begin` seconds after zero.
    fn turning(first: f64, begin: f64) -> Vec<u8> {
        let point = |number: u32| {
            let part = f64::from(number) / 1000.0;
            let angle = first - TAU * part;
            let position = [3.0 * angle.cos(), 3.0 * angle.sin(), 0.0].map(|number| (number as f32).to_le_bytes());
            [position.concat(), (begin + 0.1 * part).to_le_bytes().to_vec()].concat()
        };
        (0..1000).flat_map(point).collect()
    }

    #[test]
    fn the_times_of_points_show_how_the_lidar_turned() {
        for (stamp, begin) in [(0, -0.1), (1_700_000_000, 1_700_000_000.02)] {
            let data = turning(1.0, begin);
            let time = PointField { datatype: PointField::FLOAT64, ..field("timestamp", 12) };
            let mut turned = cloud(1000, &data);
            (turned.point_step, turned.row_step) = (20, 20_000);
            turned.fields.push(time);
            turned.header = Header { stamp: LogTime(stamp * 1_000_000_000).into(), ..Default::default() };
            let slice = Slice::of(&turned, &UnitQuaternion::identity(), false).unwrap();
            assert!((slice.angle_min - 1.0).abs() < 0.02 && slice.angle_increment == -STEP, "{}", slice.angle_min);
            assert!((slice.time_increment * DIRECTIONS as f64 - 0.1).abs() < 0.001, "{}", slice.time_increment);
            assert!((slice.begin - if stamp == 0 { -0.1 } else { 0.02 }).abs() < 1e-3, "{}", slice.begin);
            assert!(slice.ranges.iter().all(|range| range.is_nan() || (range - 3.0).abs() < 0.001));
            // Upside down it turns the other way.
            let upside_down = UnitQuaternion::from_euler_angles(PI, 0.0, 0.0);
            let slice = Slice::of(&turned, &upside_down, false).unwrap();
            assert!((slice.angle_min + 1.0).abs() < 0.02 && slice.angle_increment == STEP, "{}", slice.angle_min);
            turned.fields.pop();
            assert_eq!(Slice::of(&turned, &upside_down, false).unwrap().time_increment, 0.0);
        }
    }
}
