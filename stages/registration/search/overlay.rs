//! Score of one map on another at one relative pose.

use super::lookup::CellTransform;
use super::raster::{Content, Raster};
use crate::shared::geometry::{Point2, Pose2};
use nalgebra::Vector2;
use std::f64::consts::FRAC_PI_4;

/// Length of wall per cell of its outline, in sides of the cell: the mean over all directions of a straight wall
/// (Cauchy and Crofton).
const WALL_PER_CELL: f64 = FRAC_PI_4;

/// Radius in cells in which the side is determined from which a wall was seen.
const AROUND: i32 = 2;
/// Distance in cells at which the space before a wall is looked up, beyond those that are wall by a shift of one
/// cell.
const FRONT: f64 = 2.5;
/// Bound of that distance, about the width of a corridor, metres.
const MOST_AHEAD: f64 = 1.0;

/// Bits of the count of the walls on one content: a quarter of a `u64`.
const COUNT_BITS: u32 = 16;

/// Evenly sampled points on the walls of a map.
#[derive(Clone, Debug, PartialEq)]
pub struct Walls {
    points: Vec<Point2>,
    /// Direction to the free space before each, if it was seen from one side only.
    faces: Vec<Option<Vector2<f64>>>,
    /// Length of wall per point, metres.
    spacing: f64,
}

impl Walls {
    /// Samples at most `most` points on the walls of a raster.
    pub fn new(raster: &Raster, most: u16) -> Self {
        let all: Vec<Point2> = raster.wall_cells().collect();
        // Cells beside walls are on both sides, however thick the walls are drawn, so they count one half.
        let beside = raster.cells.iter().filter(|content| **content == Content::BesideWall).count();
        let length = 0.5 * beside as f64 * raster.cell * WALL_PER_CELL;
        let count = all.len().min(usize::from(most));
        let points: Vec<Point2> = (0..count).map(|number| all[number * all.len() / count]).collect();
        let faces = points.iter().map(|point| face(raster, point)).collect();
        Self { spacing: length / count.max(1) as f64, points, faces }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }
}

/// Direction to the free space before a wall; none if both sides are free, or neither.
fn face(raster: &Raster, wall: &Point2) -> Option<Vector2<f64>> {
    let around =
        (-AROUND..=AROUND).flat_map(|x| (-AROUND..=AROUND).map(move |y| Vector2::new(f64::from(x), f64::from(y))));
    let free = around.filter(|offset| raster.at(&(wall + offset * raster.cell)) == Content::Free);
    let direction = free.fold(Vector2::zeros(), |sum, offset| sum + offset);
    // A wall that is free all around has no side.
    let is_one_sided = direction.norm() > f64::from(AROUND);
    is_one_sided.then(|| direction.normalize())
}

/// Whether a raster knows the space before a wall that another map has seen from one side.
fn is_faced(raster: &Raster, to_cells: &CellTransform, wall: &Point2, face: Option<Vector2<f64>>) -> bool {
    let ahead = FRONT * raster.cell;
    // In wide cells the space before a wall may be narrower than that.
    let (Some(face), true) = (face, ahead <= MOST_AHEAD) else { return true };
    raster.content(&to_cells.place(&(wall + face * ahead))) != Content::Unknown
}

/// Two maps, to be overlaid at any relative pose.
#[derive(Clone, Copy, Debug)]
pub struct Overlay<'a> {
    /// The fixed map.
    pub a: &'a Raster,
    /// The moved map.
    pub b: &'a Raster,
    /// The walls of a.
    pub walls_a: &'a Walls,
    /// The walls of b.
    pub walls_b: &'a Walls,
    /// Weight of a wall on free space, against the pose, where a wall on a wall has a weight of 1.
    pub penalty: f64,
}

/// Common walls: walls of map b within a cell of walls of map a.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CommonWalls {
    /// Centroid, in frame a.
    pub centre: Point2,
    /// Root mean square distance from the centroid, metres.
    pub radius: f64,
    /// Approximate length, metres.
    pub length: f64,
    /// Length of those that both maps have seen from the same side, metres.
    pub faced_length: f64,
    /// Their share of the walls of map b on known cells of map a, 0 to 1.
    pub agreement: f64,
}

impl Overlay<'_> {
    /// Length of wall on wall, less `penalty` times that of wall on free space, metres: the mean of both maps.
    pub fn score(&self, transform_a_b: &Pose2) -> f64 {
        let values = self.values();
        self.mean(transform_a_b, |walls, raster, to_cells| {
            // The walls on each content are counted in one number, which takes one addition a wall.
            let one_of_each: [u64; 4] = std::array::from_fn(|content| 1 << (content as u32 * COUNT_BITS));
            let contents = walls.points.iter().map(|wall| raster.content(&to_cells.place(wall)));
            let counts: u64 = contents.map(|content| one_of_each[content as usize]).sum();
            let value = |(content, value): (u32, &f64)| {
                (counts >> (content * COUNT_BITS) & ((1 << COUNT_BITS) - 1)) as f64 * value
            };
            (0..).zip(&values).map(value).sum()
        })
    }

    /// The same, interpolated between the centres of cells, so that it is smooth in the pose.
    pub fn smooth_score(&self, transform_a_b: &Pose2) -> f64 {
        let values = self.values();
        self.mean(transform_a_b, |walls, raster, to_cells| {
            walls.points.iter().map(|wall| raster.interpolated(&values, &to_cells.place(wall))).sum()
        })
    }

    /// The common walls at a relative pose, if there are any.
    pub fn common_walls(&self, transform_a_b: &Pose2) -> Option<CommonWalls> {
        let (mut sum, mut squares, mut on_wall, mut on_free, mut faced) = (Vector2::zeros(), 0.0, 0.0, 0.0, 0.0);
        let middle = transform_a_b * self.walls_b.points.first()?;
        let to_cells = self.a.cell_transform(transform_a_b);
        for (point, face) in self.walls_b.points.iter().zip(&self.walls_b.faces) {
            let wall = transform_a_b * point;
            match self.a.content(&to_cells.place(point)) {
                Content::Wall | Content::BesideWall => {
                    // Differences from a nearby point, so that frames far away lose no digits.
                    let offset = wall - middle;
                    sum += offset;
                    squares += offset.norm_squared();
                    on_wall += 1.0;
                    faced += f64::from(u8::from(is_faced(self.a, &to_cells, point, *face)));
                }
                Content::Free => on_free += 1.0,
                Content::Unknown => {}
            }
        }
        let mean = sum / on_wall;
        (on_wall > 0.0).then(|| CommonWalls {
            centre: middle + mean,
            radius: (squares / on_wall - mean.norm_squared()).max(0.0).sqrt(),
            length: on_wall * self.walls_b.spacing,
            faced_length: faced * self.walls_b.spacing,
            agreement: on_wall / (on_wall + on_free),
        })
    }

    /// The score without walls that the maps have not seen from the same side: the walls of two adjacent buildings
    /// coincide, too.
    pub fn faced_score(&self, transform_a_b: &Pose2) -> f64 {
        let values = self.values();
        self.mean(transform_a_b, |walls, raster, to_cells| {
            let value = |(wall, face): (&Point2, &Option<Vector2<f64>>)| {
                let content = raster.content(&to_cells.place(wall));
                let counts = !content.is_near_wall() || is_faced(raster, to_cells, wall, *face);
                if counts { values[content as usize] } else { 0.0 }
            };
            walls.points.iter().zip(&walls.faces).map(value).sum()
        })
    }

    /// Mean of the values of b's walls on a and of a's walls on b, metres, where `sum` adds the values of single walls.
    fn mean(&self, transform_a_b: &Pose2, sum: impl Fn(&Walls, &Raster, &CellTransform) -> f64) -> f64 {
        let of = |walls: &Walls, raster: &Raster, transform: &Pose2| {
            sum(walls, raster, &raster.cell_transform(transform)) * walls.spacing
        };
        0.5 * (of(self.walls_b, self.a, transform_a_b) + of(self.walls_a, self.b, &transform_a_b.inverse()))
    }

    /// Weight of a wall on each [`Content`].
    fn values(&self) -> [f64; 4] {
        let mut values = [0.0; 4];
        // Walls on walls are counted in both maps, and a wall on free space in its own map only.
        values[Content::Free as usize] = -2.0 * self.penalty;
        values[Content::BesideWall as usize] = 0.5;
        values[Content::Wall as usize] = 1.0;
        values
    }
}
