//! The points in the bytes of a point cloud.

use gridweave_runtime::ros::{PointCloud2, PointField};
use nalgebra::Vector3;
use std::fmt;
use std::ops::RangeInclusive;

/// Fields with the time of a point, as drivers name them: after the stamp, or since 1970.
const TIMES: [&str; 6] = ["t", "time", "timestamp", "time_stamp", "offset_time", "time_offset"];
/// Integer times are in this unit, seconds; others are in seconds.
const NANOSECOND: f64 = 1e-9;

/// Why a cloud gives no scan.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum CloudFault {
    /// There is no such field of one floating-point number.
    Field(&'static str),
    /// The data are shorter than the rows that the cloud states.
    Short,
    /// The points are in this frame, which does not move with the robot.
    Fixed(String),
    /// No point is at these heights (metres) above the lidar or above the base.
    NoWalls(RangeInclusive<f64>, &'static str),
}

impl fmt::Display for CloudFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Field(name) => write!(f, "its points have no field `{name}` that is one floating-point number"),
            Self::Short => write!(f, "its data are shorter than its rows"),
            Self::Fixed(frame) => write!(
                f,
                "its points are in `{frame}`, which does not move with the robot; give a topic with the points as the \
                 lidar measured them"
            ),
            Self::NoWalls(heights, of) => write!(
                f,
                "none of its points is from {} to {} m above the {of}, where walls are looked for; is its frame right?",
                heights.start(),
                heights.end()
            ),
        }
    }
}

impl std::error::Error for CloudFault {}

/// The points of a cloud. Each is where it was measured, and a way to its time.
pub(super) struct Points<'a> {
    position: [Number; 3],
    time: Option<Number>,
    rows: std::slice::Chunks<'a, u8>,
    /// The length of a row without what is behind its points, bytes.
    row_length: usize,
    point_length: usize,
}

impl<'a> Points<'a> {
    /// Finds the points of a cloud.
    pub(super) fn of(cloud: &PointCloud2<'a>) -> Result<Self, CloudFault> {
        let coordinate = |name| match Number::of(cloud, name) {
            Some(number) if number.kind != Kind::Nanoseconds => Ok(number),
            _ => Err(CloudFault::Field(name)),
        };
        let position = [coordinate("x")?, coordinate("y")?, coordinate("z")?];
        let time = TIMES.iter().find_map(|name| Number::of(cloud, name));
        let (point_length, columns) = (cloud.point_step as usize, cloud.width as usize);
        let row_length = point_length.checked_mul(columns).ok_or(CloudFault::Short)?;
        // A row may be longer than its points. Some drivers state no length of it.
        let row_step = (cloud.row_step as usize).max(row_length);
        let needed = match (cloud.height as usize).checked_sub(1).filter(|_| row_length > 0) {
            Some(last) => row_step.checked_mul(last).and_then(|begin| begin.checked_add(row_length)),
            None => Some(0),
        };
        let data = needed.and_then(|needed| cloud.data.get(..needed)).ok_or(CloudFault::Short)?;
        Ok(Self { position, time, rows: data.chunks(row_step.max(1)), row_length, point_length })
    }

    /// Calls `each` with every point, in the order of the data: its position, and a function that reads its time,
    /// seconds, if it has one.
    pub(super) fn for_each(self, mut each: impl FnMut(Vector3<f64>, &dyn Fn() -> Option<f64>)) {
        let [x, y, z] = &self.position;
        for row in self.rows {
            for point in row[..self.row_length].chunks_exact(self.point_length) {
                let time = || self.time.as_ref().map(|time| time.read(point));
                each(Vector3::new(x.read(point), y.read(point), z.read(point)), &time);
            }
        }
    }
}

/// Where a number is in a point.
struct Number {
    offset: usize,
    kind: Kind,
    is_big_endian: bool,
}

/// How a number is stored.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Single,
    Double,
    /// An unsigned integer of four bytes.
    Nanoseconds,
}

impl Number {
    /// The field of a cloud with the given name; `None` if it is not one number of a known kind, or ends outside the
    /// point.
    fn of(cloud: &PointCloud2<'_>, name: &str) -> Option<Self> {
        let field = cloud.fields.iter().find(|field| field.name == name && field.count <= 1)?;
        let (kind, size) = match field.datatype {
            PointField::UINT32 => (Kind::Nanoseconds, 4),
            PointField::FLOAT32 => (Kind::Single, 4),
            PointField::FLOAT64 => (Kind::Double, 8),
            _ => return None,
        };
        let end = field.offset.checked_add(size)?;
        let number = Self { offset: field.offset as usize, kind, is_big_endian: cloud.is_bigendian };
        (end <= cloud.point_step).then_some(number)
    }

    /// Reads the number from the bytes of a point; not a number if they end before it.
    fn read(&self, point: &[u8]) -> f64 {
        let bytes = point.get(self.offset..).unwrap_or_default();
        let read = match self.kind {
            Kind::Single => bytes.first_chunk().map(|bytes| f64::from(f32::from_le_bytes(self.ordered(*bytes)))),
            Kind::Double => bytes.first_chunk().map(|bytes| f64::from_le_bytes(self.ordered(*bytes))),
            Kind::Nanoseconds => {
                let integer = bytes.first_chunk().map(|bytes| u32::from_le_bytes(self.ordered(*bytes)));
                integer.map(|integer| f64::from(integer) * NANOSECOND)
            }
        };
        read.unwrap_or(f64::NAN)
    }

    /// The bytes of a number, the least significant first.
    fn ordered<const N: usize>(&self, mut bytes: [u8; N]) -> [u8; N] {
        if self.is_big_endian {
            bytes.reverse();
        }
        bytes
    }
}
