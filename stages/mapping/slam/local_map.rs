//! The map around a robot, on which its scans are registered.

use super::correlative_search::PosePrior;
use super::likelihood_field::LikelihoodField;
use super::scan_points::ScanPoint;
use crate::shared::geometry::{Point2, PointIndex, Pose2};
use nalgebra::Vector2;

/// Side of the cells in which points of one direction are averaged, metres.
const SURFACE_CELL: f64 = 0.1;
/// Distance of a point without a normal from a wall up to which it is part of it, metres.
const AT_WALL: f64 = 0.15;
/// Largest number of points without a normal within twice that distance of one of them, as a multiple of those within it, for a
/// corner: along a wall they are twice as many. And the least number of those within it.
const MOST_SPREAD: f64 = 1.25;
const LEAST_OF_CORNER: f64 = 5.0;

/// A piece of a wall: the mean of the points of several scans.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Surface {
    pub(super) place: Point2,
    pub(super) normal: Vector2<f64>,
}

/// The points of several scans in one frame.
#[derive(Clone, Debug)]
pub struct LocalMap {
    points: Vec<Point2>,
    /// Pieces of walls, in the order of `index`.
    pub(super) surfaces: Vec<Surface>,
    pub(super) index: PointIndex,
    /// Points without a normal that are not along walls: legs of tables, corners of door frames, and clutter.
    pub(super) spots: PointIndex,
}

impl LocalMap {
    /// Makes a map of scans at their poses.
    pub fn new<'a>(scans: impl Iterator<Item = (Pose2, &'a [ScanPoint])>) -> Self {
        let mut points = Vec::new();
        let mut pieces: Vec<Surface> = Vec::new();
        // For each piece its cell and sector, and its number.
        let mut keyed: Vec<(u64, u32)> = Vec::new();
        let mut spots: Vec<Point2> = Vec::new();
        for (pose, scan) in scans {
            for point in scan {
                let place = pose * point.place;
                points.push(place);
                let Some(normal) = point.normal else {
                    spots.push(place);
                    continue;
                };
                let normal = pose * normal;
                keyed.push((key(&place, &normal), pieces.len() as u32));
                pieces.push(Surface { place, normal });
            }
        }
        // The order of the sums is that of the scans, as the numbers are sorted, too.
        keyed.sort_unstable();
        let mean = |group: &[(u64, u32)]| {
            let share = 1.0 / group.len() as f64;
            let group = || group.iter().map(|(_, number)| &pieces[*number as usize]);
            let place = group().map(|surface| surface.place.coords * share).sum::<Vector2<f64>>();
            let normal = group().map(|surface| surface.normal).sum::<Vector2<f64>>();
            Surface { place: place.into(), normal: normal.normalize() }
        };
        let unsorted: Vec<Surface> = keyed.chunk_by(|(a, _), (b, _)| a == b).map(mean).collect();
        let places: Vec<Point2> = unsorted.iter().map(|surface| surface.place).collect();
        let (index, order) = PointIndex::new(&places, SURFACE_CELL);
        let surfaces = order.into_iter().map(|place| unsorted[place]).collect();
        // What lies at a wall is part of it, and where along it it was seen is noise, but for the corners of door frames, which
        // all scans see at the same place.
        let (all_spots, _) = PointIndex::new(&spots, SURFACE_CELL);
        spots.retain(|spot| index.nearest(spot, AT_WALL).is_none() || is_corner(&all_spots, spot));
        let (spots, _) = PointIndex::new(&spots, SURFACE_CELL);
        Self { points, surfaces, index, spots }
    }

    /// The likelihood field of the map for a search of points in a window about a pose.
    pub(super) fn field(&self, points: &[Point2], prior: &PosePrior) -> LikelihoodField {
        let [x, y, _] = prior.window;
        LikelihoodField::new(self.points.iter().copied(), &prior.reach(points), x.max(y))
    }
}

/// Whether the points without a normal about one of them lie at one place, and not along a wall.
fn is_corner(spots: &PointIndex, spot: &Point2) -> bool {
    let [near, wide] = [AT_WALL, 2.0 * AT_WALL].map(|radius| spots.within(spot, radius).count() as f64);
    wide < MOST_SPREAD * near && near >= LEAST_OF_CORNER
}

/// The cell of a place and the sector of a direction, as one number.
fn key(place: &Point2, normal: &Vector2<f64>) -> u64 {
    // Within half of what 30 bits hold, which is 50,000 km.
    const MIDDLE: f64 = (1_u64 << 29) as f64;
    let cell = |coordinate: f64| (coordinate / SURFACE_CELL + MIDDLE).clamp(0.0, 2.0 * MIDDLE - 1.0) as u64;
    (cell(place.x) << 34) | (cell(place.y) << 4) | sector(normal)
}

/// The sector of a direction, of twelve, from that of -x on.
fn sector(direction: &Vector2<f64>) -> u64 {
    const TAN_30: f64 = 0.577_350_269_189_625_8;
    const TAN_60: f64 = 1.732_050_807_568_877_2;
    let (x, y) = (direction.x.abs(), direction.y.abs());
    // From the x axis on.
    let of_quadrant = u64::from(y > TAN_30 * x) + u64::from(y > TAN_60 * x);
    match (direction.x < 0.0, direction.y < 0.0) {
        (true, true) => of_quadrant,
        (false, true) => 5 - of_quadrant,
        (false, false) => 6 + of_quadrant,
        (true, false) => 11 - of_quadrant,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sectors_follow_each_other_around_the_circle() {
        for degrees in 0..360 {
            let angle = f64::from(degrees) + 0.5;
            let direction = nalgebra::Rotation2::new(angle.to_radians()) * -Vector2::x();
            assert_eq!(sector(&direction), (angle / 30.0) as u64, "{angle}");
        }
    }
}
