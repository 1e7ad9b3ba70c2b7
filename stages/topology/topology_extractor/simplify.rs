//! A path by few points.

use crate::shared::geometry::Point2;

/// A subset of the points of a path, including the first and the last, whose straight connections are at most
/// `tolerance` away from the others (Douglas and Peucker 1973).
pub fn simplify(points: &[Point2], tolerance: f64) -> Vec<Point2> {
    let Some(last) = points.len().checked_sub(1) else { return Vec::new() };
    let mut kept = vec![points[0]];
    // The ends of stretches that are still to be looked at, the nearest on top.
    let mut ends = vec![last];
    let mut start = 0;
    while let Some(&end) = ends.last() {
        let between = start + 1..end.max(start + 1);
        let distance = |place: usize| distance_from_line(&points[place], &points[start], &points[end]);
        let farthest = between.max_by(|one, other| distance(*one).total_cmp(&distance(*other)));
        match farthest.filter(|place| distance(*place) > tolerance) {
            Some(place) => ends.push(place),
            None => {
                if end > start {
                    kept.push(points[end]);
                }
                start = end;
                ends.pop();
            }
        }
    }
    kept
}

/// The distance of a point from the straight connection of two others.
fn distance_from_line(point: &Point2, start: &Point2, end: &Point2) -> f64 {
    let (along, from_start) = (end - start, point - start);
    let share = (from_start.dot(&along) / along.norm_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    (from_start - along * share).norm()
}
