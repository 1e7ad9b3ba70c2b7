//! A level slice of the point cloud of a 3D lidar: what a 2D lidar at its place would measure.

use gridweave_runtime::ros::{PointCloud2, PointField};
use nalgebra::{UnitQuaternion, Vector3};
use std::f64::consts::{PI, TAU};
use std::fmt;
use std::ops::RangeInclusive;

/// The number of directions of a slice. Common 3D lidars measure 900 to 2048.
const DIRECTIONS: usize = 1080;
/// The points nearer than this are of the robot itself, metres.
pub(crate) const NEAREST: f32 = 0.5;
/// The heights of the slice above a lidar, metres. Walls are seen above it as well as beside it, but below it is the
/// floor, which comes nearer when the robot tilts.
const ABOVE_LIDAR: RangeInclusive<f64> = -0.2..=0.5;
/// The heights of the slice above the base, of points that their driver has transformed there: they do not show how
/// high the lidar is.
const ABOVE_BASE: RangeInclusive<f64> = 0.2..=0.9;

/// Why the points of a cloud cannot be read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum CloudFault {
    /// There is no such field of one floating-point number.
    Field(&'static str),
    /// The data are shorter than the rows that the cloud states.
    Short,
}

impl fmt::Display for CloudFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Field(name) => write!(f, "its points have no field `{name}` that is one floating-point number"),
            Self::Short => write!(f, "its data are shorter than its rows"),
        }
    }
}

impl std::error::Error for CloudFault {}

/// The ranges in [`DIRECTIONS`] directions, from behind over the right, ahead and the left, in a frame that is level
/// with the base and has its origin at the sensor: the nearest point of each, metres; not a number where there is none.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Slice {
    pub(crate) ranges: Vec<f32>,
}

impl Slice {
    /// The angle of the first direction, radians.
    pub(crate) const ANGLE_MIN: f64 = -PI + Self::ANGLE_INCREMENT / 2.0;
    /// The angle from one direction to the next, radians.
    pub(crate) const ANGLE_INCREMENT: f64 = TAU / DIRECTIONS as f64;

    /// Takes the slice of a cloud from a sensor that is turned by `rotation` against the base. `is_base` is whether the
    /// points are in the frame of the base.
    ///
    /// # Errors
    /// The points cannot be read.
    pub(crate) fn of(
        cloud: &PointCloud2<'_>,
        rotation: &UnitQuaternion<f64>,
        is_base: bool,
    ) -> Result<Self, CloudFault> {
        let heights = if is_base { ABOVE_BASE } else { ABOVE_LIDAR };
        let rotation = rotation.to_rotation_matrix();
        let nearest = f64::from(NEAREST) * f64::from(NEAREST);
        let mut squared = vec![f64::INFINITY; DIRECTIONS];
        for_each_point(cloud, |point| {
            let point = rotation * point;
            let distance = point.x * point.x + point.y * point.y;
            // A point that is not a number is in no slice.
            if !heights.contains(&point.z) || !(nearest..f64::INFINITY).contains(&distance) {
                return;
            }
            let direction = (point.y.atan2(point.x) + PI) / Self::ANGLE_INCREMENT;
            let least = &mut squared[(direction as usize).min(DIRECTIONS - 1)];
            *least = least.min(distance);
        })?;
        let range = |squared: f64| if squared.is_finite() { squared.sqrt() as f32 } else { f32::NAN };
        Ok(Self { ranges: squared.into_iter().map(range).collect() })
    }
}

/// Calls `each` with every point, in the order of the data.
fn for_each_point(cloud: &PointCloud2<'_>, mut each: impl FnMut(Vector3<f64>)) -> Result<(), CloudFault> {
    let [x, y, z] = ["x", "y", "z"].map(|name| number(cloud, name).ok_or(CloudFault::Field(name)));
    let (x, y, z) = (x?, y?, z?);
    let (step, columns) = (cloud.point_step as usize, cloud.width as usize);
    let length = step.checked_mul(columns).ok_or(CloudFault::Short)?;
    // A row may be longer than its points. Some drivers state no length of it.
    let row_step = (cloud.row_step as usize).max(length);
    let Some(last) = (cloud.height as usize).checked_sub(1).filter(|_| length > 0) else { return Ok(()) };
    let needed = row_step.checked_mul(last).and_then(|begin| begin.checked_add(length)).ok_or(CloudFault::Short)?;
    let data = cloud.data.get(..needed).ok_or(CloudFault::Short)?;
    for row in data.chunks(row_step) {
        for point in row[..length].chunks_exact(step) {
            each(Vector3::new(x.read(point), y.read(point), z.read(point)));
        }
    }
    Ok(())
}

/// Where a floating-point number is in a point.
struct Number {
    offset: usize,
    is_double: bool,
    is_big_endian: bool,
}

/// The field of a cloud with the given name; `None` if it is not one floating-point number, or ends outside the point.
fn number(cloud: &PointCloud2<'_>, name: &str) -> Option<Number> {
    let field = cloud.fields.iter().find(|field| field.name == name && field.count <= 1)?;
    let (is_double, size) = match field.datatype {
        PointField::FLOAT32 => (false, 4),
        PointField::FLOAT64 => (true, 8),
        _ => return None,
    };
    let end = field.offset.checked_add(size)?;
    let number = Number { offset: field.offset as usize, is_double, is_big_endian: cloud.is_bigendian };
    (end <= cloud.point_step).then_some(number)
}

impl Number {
    /// Reads the number from the bytes of a point; not a number if they end before it.
    fn read(&self, point: &[u8]) -> f64 {
        let bytes = point.get(self.offset..).unwrap_or_default();
        let single = || bytes.first_chunk().map(|bytes| self.ordered(*bytes)).map(f32::from_le_bytes).map(f64::from);
        let double = || bytes.first_chunk().map(|bytes| self.ordered(*bytes)).map(f64::from_le_bytes);
        if self.is_double { double() } else { single() }.unwrap_or(f64::NAN)
    }

    /// The bytes of a number, the least significant first.
    fn ordered<const N: usize>(&self, mut bytes: [u8; N]) -> [u8; N] {
        if self.is_big_endian {
            bytes.reverse();
        }
        bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let angle = |place: usize| Slice::ANGLE_MIN + place as f64 * Slice::ANGLE_INCREMENT;
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
            assert_eq!(found(&of(empty).unwrap()), []);
        }
    }
}
