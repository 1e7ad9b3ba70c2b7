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
        points.push(ScanPoint { place: *place, normal: normal(hits, index, lidar) });
    }
    points
}

/// The normal of the line through the hits around one of them: the direction in which they vary least.
fn normal(hits: &[Point2], index: usize, lidar: &Point2) -> Option<Vector2<f64>> {
    let at = hits[index];
    let beside = |other: Option<&Point2>| other.map_or(f64::INFINITY, |other| (other - at).norm());
    let nearest = beside(index.checked_sub(1).and_then(|before| hits.get(before))).min(beside(hits.get(index + 1)));
    let radius = (NORMAL_BEAMS * nearest).clamp(NORMAL_RADIUS, MAX_NORMAL_RADIUS);
    let is_near = |other: &&Point2| (*other - at).norm() <= radius;
    let before = hits[..index].iter().rev().take(MAX_NEIGHBOURS).take_while(is_near);
    let after = hits[index + 1..].iter().take(MAX_NEIGHBOURS).take_while(is_near);
    let (mut count, mut sum, mut squares) = (1.0, Vector2::zeros(), Matrix2::zeros());
    for other in before.chain(after) {
        let arm = other - at;
        count += 1.0;
        sum += arm;
        squares += arm * arm.transpose();
    }
    if count < 3.0 {
        return None;
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
        let far = [Point2::new(1e7, 0.0), Point2::new(f64::NAN, 0.0), Point2::new(0.0, 41.0), Point2::new(0.0, 39.0)];
        let points = scan_points(&far, &Point2::origin());
        assert_eq!(points.iter().map(|point| point.place).collect::<Vec<_>>(), [far[3]]);
        // Each hit is apart from the one before, and all are beside each other.
        let many: Vec<Point2> = (0..200_000).map(|hit| Point2::new(0.06 * f64::from(hit % 2), 1.0)).collect();
        assert_eq!(scan_points(&many, &Point2::origin()).len(), MAX_POINTS);
    }

    #[test]
    fn a_lone_hit_and_clutter_have_no_normal() {
        let lone = scan_points(&[Point2::new(1.0, 0.0), Point2::new(3.0, 2.0)], &Point2::origin());
        assert!(lone.iter().all(|point| point.normal.is_none()));
        let clutter = [(1.0, 0.0), (1.08, 0.05), (1.0, 0.1), (1.09, 0.12), (1.01, 0.16)];
        let clutter: Vec<Point2> = clutter.iter().map(|&(x, y)| Point2::new(x, y)).collect();
        assert!(scan_points(&clutter, &Point2::origin())[2].normal.is_none());
    }
}
