//! The hits of a scan as points with normals.

use crate::shared::geometry::Point2;
use nalgebra::{Matrix2, Vector2};

/// Distance between points that are kept, metres: near the lidar beams lie closer than that, and would count as more
/// wall than there is.
pub(super) const SPACING: f64 = 0.05;
/// Distance from the base up to which hits are used, metres: farther beams are too far apart to be registered, and
/// bound what a search may cost.
const FARTHEST: f64 = 40.0;
/// Number of points of a scan, at most: more than the walls of a round room of that radius have.
const MAX_POINTS: usize = 10_000;
/// Number of hits on each side of one that its normal is estimated from, at most.
const MAX_NEIGHBOURS: usize = 64;
/// Least radius in which a normal is estimated, metres; beams that lie farther apart widen it.
const NORMAL_RADIUS: f64 = 0.15;
/// The radius in distances between neighbouring beams.
const NORMAL_BEAMS: f64 = 2.5;
/// Largest radius in which a normal is estimated, metres: walls of buildings are straight for longer.
const MAX_NORMAL_RADIUS: f64 = 0.6;
/// Largest standard deviation of points across a wall, as a share of that along it.
const MAX_THICKNESS: f64 = 0.25;
/// Largest distance of a hit from the line through those beside it, metres, for all three to be on a wall though they
/// lie far apart: ranges deviate by one or two centimetres, and most of that is along a wall that is grazed.
const MAX_BEND: f64 = 0.02;

/// A hit of a scan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScanPoint {
    /// Position, metres, frame of the base.
    pub place: Point2,
    /// Unit normal of the surface, towards the lidar; `None` where neighbouring hits are not on a line.
    pub normal: Option<Vector2<f64>>,
}

/// Computes the points of a scan from its hits in the order of the beams, given in the frame of the base, which were
/// seen from `lidar`. Hits closer than 5 cm to the one before are used for the normals only, and those farther than
/// 40 m from the base not at all.
pub fn scan_points(hits: &[Point2], lidar: &Point2) -> Vec<ScanPoint> {
    let mut kept: Option<Point2> = None;
    let mut points = Vec::with_capacity(hits.len().min(512));
    for (index, place) in hits.iter().enumerate() {
        let is_near = kept.is_some_and(|last| (place - last).norm() < SPACING);
        // Written so that a value that is not a number fails it.
        let is_within = place.coords.norm() <= FARTHEST;
        if is_near || !is_within {
            continue;
        }
        if points.len() == MAX_POINTS {
            break;
        }
        kept = Some(*place);
        let normal = match kind(hits, index, lidar) {
            HitKind::Wall(normal) => Some(normal),
            HitKind::Spot => None,
            HitKind::Grazed => continue,
        };
        points.push(ScanPoint { place: *place, normal });
    }
    points
}

/// What a hit lies on, as those beside it show.
enum HitKind {
    /// A wall with this normal.
    Wall(Vector2<f64>),
    /// A corner, clutter, or an object of the width of a beam.
    Spot,
    /// A place at which a beam happens to meet a wall that it grazes, or the edge of a shadow. It goes with the lidar.
    Grazed,
}

/// The kind of one of the hits.
fn kind(hits: &[Point2], index: usize, lidar: &Point2) -> HitKind {
    let at = hits[index];
    let [before, after] = [index.checked_sub(1).and_then(|before| hits.get(before)), hits.get(index + 1)];
    let beside = |other: Option<&Point2>| other.map_or(f64::INFINITY, |other| (other - at).norm());
    let radius = (NORMAL_BEAMS * beside(before).min(beside(after))).clamp(NORMAL_RADIUS, MAX_NORMAL_RADIUS);
    let is_near = |other: &&Point2| (*other - at).norm() <= radius;
    let near_before = hits[..index].iter().rev().take(MAX_NEIGHBOURS).take_while(is_near);
    let near_after = hits[index + 1..].iter().take(MAX_NEIGHBOURS).take_while(is_near);
    let near = near_before.chain(near_after);
    if near.clone().nth(1).is_some() {
        return match normal(&at, near, lidar) {
            Some(normal) => HitKind::Wall(normal),
            None => HitKind::Spot,
        };
    }
    let (Some(before), Some(after)) = (before, after) else { return HitKind::Grazed };
    // Asked first, as the hit of a straight wall that is nearest to the lidar has both others behind it, as a pole has.
    if is_between(&at, before, after) {
        return normal(&at, [before, after].into_iter(), lidar).map_or(HitKind::Grazed, HitKind::Wall);
    }
    let range = (at - lidar).norm();
    if [before, after].iter().all(|other| (*other - lidar).norm() > range) { HitKind::Spot } else { HitKind::Grazed }
}

/// Whether a point lies on the line between two others.
fn is_between(at: &Point2, before: &Point2, after: &Point2) -> bool {
    let (along, arm) = (after - before, at - before);
    along.perp(&arm).abs() <= MAX_BEND * along.norm()
}

/// The normal of the line through a hit and others: the direction in which they vary least.
fn normal<'a>(at: &Point2, others: impl Iterator<Item = &'a Point2>, lidar: &Point2) -> Option<Vector2<f64>> {
    let (mut count, mut sum, mut squares) = (1.0, Vector2::zeros(), Matrix2::zeros());
    for other in others {
        let arm = other - at;
        count += 1.0;
        sum += arm;
        squares += arm * arm.transpose();
    }
    let mean = sum / count;
    let covariance = squares / count - mean * mean.transpose();
    let eigen = covariance.symmetric_eigen();
    let (across, along) = match eigen.eigenvalues.x < eigen.eigenvalues.y {
        true => (0, 1),
        false => (1, 0),
    };
    let [thin, long] = [across, along].map(|axis| eigen.eigenvalues[axis].max(0.0).sqrt());
    if thin > MAX_THICKNESS * long {
        return None;
    }
    let normal: Vector2<f64> = eigen.eigenvectors.column(across).into();
    Some(if normal.dot(&(lidar - at)) < 0.0 { -normal } else { normal })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_of_a_wall_have_its_normal_and_lie_apart() {
        let hits: Vec<Point2> = (0..200).map(|step| Point2::new(2.0, -1.0 + 0.01 * f64::from(step))).collect();
        let points = scan_points(&hits, &Point2::origin());
        assert!((38..=41).contains(&points.len()), "{}", points.len());
        let towards = |point: &ScanPoint| point.normal.is_some_and(|normal| (normal + Vector2::x()).norm() < 1e-6);
        assert!(points.iter().all(towards), "{points:?}");
    }

    #[test]
    fn hits_far_away_are_left_out_and_a_scan_has_a_limited_number_of_points() {
        let too_far = [Point2::new(1e7, 0.0), Point2::new(f64::NAN, 0.0), Point2::new(0.0, 41.0)];
        let wall = [0.0, 0.1, 0.2].map(|x| Point2::new(x, 39.0));
        let points = scan_points(&[too_far, wall].concat(), &Point2::origin());
        assert_eq!(points.iter().map(|point| point.place).collect::<Vec<_>>(), wall);
        // Each hit is apart from the one before, and all are beside each other.
        let many: Vec<Point2> = (0..200_000).map(|hit| Point2::new(0.06 * f64::from(hit % 2), 1.0)).collect();
        assert_eq!(scan_points(&many, &Point2::origin()).len(), MAX_POINTS);
    }

    #[test]
    fn hits_that_lie_far_apart_are_on_a_wall_or_in_front_of_one_or_say_nothing() {
        let hits = |places: &[(f64, f64)]| {
            let hits: Vec<Point2> = places.iter().map(|&(x, y)| Point2::new(x, y)).collect();
            scan_points(&hits, &Point2::origin())
        };
        // Along a wall of a corridor, whose first and last hit have one neighbour only.
        let wall = hits(&[(6.0, 1.0), (7.0, 1.01), (8.5, 1.0), (11.0, 1.0)]);
        assert!(wall.iter().all(|point| point.normal.is_some_and(|normal| normal.y < -0.99)), "{wall:?}");
        assert_eq!(wall.iter().map(|point| point.place.x).collect::<Vec<_>>(), [7.0, 8.5]);
        // The hit nearest to the lidar, before both others, is on the wall as well.
        let nearest = hits(&[(-1.0, 1.0), (0.0, 1.005), (1.0, 1.0)]);
        assert!(nearest.len() == 1 && nearest[0].normal.is_some_and(|normal| normal.y < -0.99), "{nearest:?}");
        // The leg of a table in front of it, and a hit in an open door, which goes along with the lidar.
        let leg = hits(&[(6.0, 1.0), (5.0, 0.7), (8.5, 1.0)]);
        assert_eq!((leg.len(), leg[0]), (1, ScanPoint { place: Point2::new(5.0, 0.7), normal: None }));
        let door = hits(&[(6.0, 1.0), (7.5, 1.3), (8.5, 1.0)]);
        assert!(door.is_empty(), "{door:?}");
    }

    #[test]
    fn clutter_has_no_normal() {
        let clutter = [(1.0, 0.0), (1.08, 0.05), (1.0, 0.1), (1.09, 0.12), (1.01, 0.16)];
        let clutter: Vec<Point2> = clutter.iter().map(|&(x, y)| Point2::new(x, y)).collect();
        assert!(scan_points(&clutter, &Point2::origin())[2].normal.is_none());
    }
}
