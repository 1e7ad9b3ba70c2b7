//! Distance of the walls of two maps.

use super::one_alignment::PairMaps;
use gridweave_stages::shared::geometry::Pose2;
use gridweave_stages::shared::walls::WallMap;

/// Walls farther apart than this are not the same wall, metres.
const SAME_WALL: f64 = 0.1;
/// The direction of a wall is taken from its cells within this radius, metres.
const NORMAL_RADIUS: f64 = 0.2;

/// The root mean square of the distances from the wall cells of map b to the lines of the walls of map a, of those that
/// are nearer than [`SAME_WALL`], metres; no number if there are none.
pub(super) fn wall_distance(maps: &PairMaps<'_>, transform_a_b: &Pose2) -> f64 {
    let [a, b] = [&maps.a, &maps.b].map(|map| WallMap::new(map, NORMAL_RADIUS));
    let distances = b.walls.points().iter().filter_map(|point| {
        let point = transform_a_b * point;
        let partner = a.walls.nearest(&point, SAME_WALL)?.index;
        let normal = a.normals[partner];
        // Where its neighbours show no line a wall has no normal.
        (normal.norm() > 0.5).then(|| normal.dot(&(point - a.walls.points()[partner])))
    });
    let squares: Vec<f64> = distances.map(|distance| distance * distance).collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_stages::shared::geometry::{Grid, GridGeometry, pose};

    #[test]
    fn distances_of_walls_are_measured_and_others_left_out() {
        // A wall of twenty cells along x, and in map b another one that map a has not.
        let geometry = GridGeometry { width: 20, height: 30, resolution: 0.05, origin: pose(0.0, 0.0, 0.0) };
        let row = |cells: &mut [i8], row: usize| cells[row * 20..(row + 1) * 20].fill(100);
        let (mut a, mut b) = ([0; 600], [0; 600]);
        row(&mut a, 3);
        row(&mut b, 3);
        row(&mut b, 25);
        let maps = PairMaps { a: Grid::new(geometry, &a).unwrap(), b: Grid::new(geometry, &b).unwrap() };
        assert!(wall_distance(&maps, &Pose2::identity()) < 1e-9);
        assert!((wall_distance(&maps, &pose(0.0, 0.07, 0.0)) - 0.07).abs() < 1e-9);
        assert!(wall_distance(&maps, &pose(9.0, 9.0, 0.0)).is_nan());
    }
}
