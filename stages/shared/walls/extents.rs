//! How large the things are that the points of a map's walls belong to: walls of the building, or furniture, pillars
//! and the short stretches of wall between doors and in niches.

use crate::shared::geometry::PointIndex;
use nalgebra::Vector2;

/// Points at most this far apart are connected, metres, and in cells.
const LINK: f64 = 0.35;
/// Least and largest link in cells: diagonal neighbours are connected, and few points are near a point.
const LINK_IN_CELLS: (f64, f64) = (1.5, 7.0);
/// Least cosine of the angle between the normals of a straight segment (20 degrees).
const SAME_DIRECTION: f64 = 0.94;
/// Largest offset of neighbouring points across a straight segment, metres and cells.
const OFFSET: f64 = 0.15;
const OFFSET_IN_CELLS: f64 = 1.5;

/// How large the things are that a point of a wall belongs to, as diagonals of the rectangles around them, metres.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WallExtent {
    /// Of the connected component: everything that is connected with the point.
    pub component: f64,
    /// Of the straight segment: what is connected with the point and in line with it.
    pub segment: f64,
}

/// The extent at each of some points of walls with normals, `spacing` metres of wall each.
pub(super) fn extents(walls: &PointIndex, normals: &[Vector2<f64>], spacing: f64) -> Vec<WallExtent> {
    let link = LINK.clamp(LINK_IN_CELLS.0 * spacing, LINK_IN_CELLS.1 * spacing);
    let offset = OFFSET.max(OFFSET_IN_CELLS * spacing);
    let points = walls.points();
    let components = extents_of_groups(walls, link, |_, _, _| true);
    let segments = extents_of_groups(walls, link, |first, from, to| {
        let normal = normals[first];
        normal.dot(&normals[to]).abs() >= SAME_DIRECTION && normal.dot(&(points[to] - points[from])).abs() <= offset
    });
    components.into_iter().zip(segments).map(|(component, segment)| WallExtent { component, segment }).collect()
}

/// Groups neighbouring points, each group from its first point outwards, and gives for each point the extent of its
/// group. `is_joined(first, from, to)` says whether `to` belongs to the group of `first`, in which `from` is its
/// neighbour.
fn extents_of_groups(walls: &PointIndex, link: f64, is_joined: impl Fn(usize, usize, usize) -> bool) -> Vec<f64> {
    let points = walls.points();
    let mut is_left = vec![true; points.len()];
    let mut extents = vec![0.0; points.len()];
    let mut group = Vec::new();
    for first in 0..points.len() {
        if !std::mem::take(&mut is_left[first]) {
            continue;
        }
        group.clear();
        group.push(first);
        let (mut low, mut high) = (points[first], points[first]);
        let mut next = 0;
        while let Some(&from) = group.get(next) {
            next += 1;
            (low, high) = (low.inf(&points[from]), high.sup(&points[from]));
            for to in walls.within(&points[from], link) {
                if is_left[to] && is_joined(first, from, to) {
                    is_left[to] = false;
                    group.push(to);
                }
            }
        }
        let extent = (high - low).norm();
        group.iter().for_each(|&point| extents[point] = extent);
    }
    extents
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::{Grid, GridGeometry, pose};
    use crate::shared::walls::{NORMAL_RADIUS, WallMap};

    /// Extents of a room of 8 x 5 m with a pillar of 0.6 m in it, turned by `yaw`: on the walls, and on the pillar.
    fn room_and_pillar(resolution: f64, yaw: f64) -> (Vec<WallExtent>, Vec<WallExtent>) {
        let side = (10.0 / resolution).round() as usize;
        let geometry = GridGeometry { width: side, height: side, resolution, origin: pose(3.0, -1.0, yaw) };
        let value = |index: usize| {
            let (x, y) = ((index % side) as f64 * resolution, (index / side) as f64 * resolution);
            let on_edge = |at: f64, low: f64, high: f64| at < low + resolution || at >= high - resolution;
            let is_inside = (1.0..9.0).contains(&x) && (1.0..6.0).contains(&y);
            let is_wall = is_inside && (on_edge(x, 1.0, 9.0) || on_edge(y, 1.0, 6.0));
            let is_pillar = (4.0..4.6).contains(&x) && (3.0..3.6).contains(&y);
            if is_wall || is_pillar { 100 } else { 0 }
        };
        let cells: Vec<i8> = (0..side * side).map(value).collect();
        let map = WallMap::new(&Grid::new(geometry, &cells).unwrap(), NORMAL_RADIUS);
        let of_pillar = |point: &crate::shared::geometry::Point2| {
            let place = geometry.origin.inverse() * point;
            (place.x - 4.3).hypot(place.y - 3.3) < 0.7
        };
        let found = map.walls.points().iter().zip(&map.extents).map(|(point, extent)| (of_pillar(point), *extent));
        let (pillar, walls): (Vec<_>, Vec<_>) = found.partition(|(of_pillar, _)| *of_pillar);
        let extents = |of: Vec<(bool, WallExtent)>| of.into_iter().map(|(_, extent)| extent).collect();
        (extents(walls), extents(pillar))
    }

    #[test]
    fn a_pillar_is_small_and_a_room_is_large_at_any_resolution_and_angle() {
        for (resolution, yaw) in [(0.02, 0.0), (0.05, 0.3), (0.1, 1.0), (0.2, 0.0)] {
            let (walls, pillar) = room_and_pillar(resolution, yaw);
            assert!(
                !pillar.is_empty() && pillar.iter().all(|extent| extent.component < 1.2),
                "{resolution}: {pillar:?}"
            );
            assert!(walls.iter().all(|extent| extent.component > 8.0), "{resolution}");
            assert!(pillar.iter().all(|extent| extent.segment <= extent.component), "{resolution}");
        }
    }

    #[test]
    fn a_straight_segment_ends_at_a_corner() {
        for resolution in [0.02, 0.05, 0.1] {
            let (walls, _) = room_and_pillar(resolution, 0.3);
            let longest = walls.iter().map(|extent| extent.segment).fold(0.0, f64::max);
            assert!((7.0..8.5).contains(&longest), "{resolution}: {longest}");
            let long = walls.iter().filter(|extent| extent.segment > 4.0).count();
            assert!(long as f64 > 0.85 * walls.len() as f64, "{resolution}: {long} of {}", walls.len());
        }
    }
}
