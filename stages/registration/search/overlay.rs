//! How well one map lies on another at one place.

use super::raster::{Content, Raster};
use crate::shared::geometry::{Point2, Pose2};
use nalgebra::Vector2;
use std::f64::consts::FRAC_PI_4;

/// The length of wall in a cell of its outline, in sides of the cell: the mean over all directions in which a straight
/// wall may run (Cauchy and Crofton).
const WALL_PER_CELL: f64 = FRAC_PI_4;

/// So many cells round a wall show from which side it was seen.
const AROUND: i32 = 2;
/// So many cells before a wall is the space from which it was seen, beyond those that are wall by a shift of one cell.
const FRONT: f64 = 2.5;
/// About as wide as a corridor, metres.
const MOST_AHEAD: f64 = 1.0;

/// Points on the walls of a map, evenly chosen.
#[derive(Clone, Debug, PartialEq)]
pub struct Walls {
    points: Vec<Point2>,
    /// The direction to the space before each, if it was seen from one side.
    faces: Vec<Option<Vector2<f64>>>,
    /// The length of wall that a point stands for, metres.
    spacing: f64,
}

impl Walls {
    /// At most `most` for all walls of a raster.
    pub fn new(raster: &Raster, most: usize) -> Self {
        let all: Vec<Point2> = raster.wall_cells().collect();
        // Half of what lies beside walls lies on either side, however thick they are drawn.
        let beside = raster.cells.iter().filter(|content| **content == Content::BesideWall).count();
        let length = 0.5 * beside as f64 * raster.cell * WALL_PER_CELL;
        let count = all.len().min(most);
        let points: Vec<Point2> = (0..count).map(|number| all[number * all.len() / count]).collect();
        let faces = points.iter().map(|point| face(raster, point)).collect();
        Self { spacing: length / count.max(1) as f64, points, faces }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }
}

/// The direction to the space before a wall; none of a wall that is free on both sides or on neither.
fn face(raster: &Raster, wall: &Point2) -> Option<Vector2<f64>> {
    let around =
        (-AROUND..=AROUND).flat_map(|x| (-AROUND..=AROUND).map(move |y| Vector2::new(f64::from(x), f64::from(y))));
    let free = around.filter(|offset| raster.at(&(wall + offset * raster.cell)) == Content::Free);
    let direction = free.fold(Vector2::zeros(), |sum, offset| sum + offset);
    // What is free all around has no side.
    let is_one_sided = direction.norm() > f64::from(AROUND);
    is_one_sided.then(|| direction.normalize())
}

/// Whether a raster knows the space before a wall which another map has seen from one side, where the wall lies by `transform`.
fn is_faced(raster: &Raster, transform: &Pose2, wall: &Point2, face: Option<Vector2<f64>>) -> bool {
    let ahead = FRONT * raster.cell;
    // In wide cells the space before a wall may be narrower than that.
    let (Some(face), true) = (face, ahead <= MOST_AHEAD) else { return true };
    raster.at(&(transform * (wall + face * ahead))) != Content::Unknown
}

/// Two maps that are laid on each other.
#[derive(Clone, Copy, Debug)]
pub struct Overlay<'a> {
    /// The map that stays.
    pub a: &'a Raster,
    /// The map that is moved.
    pub b: &'a Raster,
    /// The walls of a.
    pub walls_a: &'a Walls,
    /// The walls of b.
    pub walls_b: &'a Walls,
    /// What a wall on free space counts against a place, where a wall on a wall counts 1 for it.
    pub penalty: f64,
}

/// The walls of map b that meet walls of map a, to within a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CommonWalls {
    /// Their middle, in frame a.
    pub centre: Point2,
    /// How far they lie from there, the root of the mean square, metres.
    pub radius: f64,
    /// About their length, metres.
    pub length: f64,
    /// The length of those of them that both maps have seen from the same side, metres.
    pub faced_length: f64,
    /// Their share in the walls of map b that meet anything known, 0 to 1.
    pub agreement: f64,
}

impl Overlay<'_> {
    /// The length of wall on wall, less `penalty` times that of wall on free space, metres: the mean of both maps.
    pub fn score(&self, transform_a_b: &Pose2) -> f64 {
        let values = self.values();
        self.sum(transform_a_b, |raster, place| values[raster.content(place.x, place.y) as usize])
    }

    /// The same, with the values between the centres of cells interpolated, so that it is smooth in the place.
    pub fn smooth_score(&self, transform_a_b: &Pose2) -> f64 {
        let values = self.values();
        self.sum(transform_a_b, |raster, place| {
            let within = |place: f64, count: usize| (place - 0.5).clamp(0.0, count as f64);
            let (x, y) = (within(place.x, raster.width), within(place.y, raster.height));
            let (right, up) = (x.fract(), y.fract());
            let value = |x: f64, y: f64| values[raster.content(x, y) as usize];
            let below = value(x, y) * (1.0 - right) + value(x + 1.0, y) * right;
            let above = value(x, y + 1.0) * (1.0 - right) + value(x + 1.0, y + 1.0) * right;
            below * (1.0 - up) + above * up
        })
    }

    /// The walls in common at a place, if there are any.
    pub fn common_walls(&self, transform_a_b: &Pose2) -> Option<CommonWalls> {
        let (mut sum, mut squares, mut on_wall, mut on_free, mut faced) = (Vector2::zeros(), 0.0, 0.0, 0.0, 0.0);
        let middle = transform_a_b * self.walls_b.points.first()?;
        for (point, face) in self.walls_b.points.iter().zip(&self.walls_b.faces) {
            let wall = transform_a_b * point;
            match self.a.at(&wall) {
                Content::Wall | Content::BesideWall => {
                    // Differences from a point nearby, so that frames far away cost no digits.
                    let offset = wall - middle;
                    sum += offset;
                    squares += offset.norm_squared();
                    on_wall += 1.0;
                    faced += f64::from(u8::from(is_faced(self.a, transform_a_b, point, *face)));
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

    /// The score, where walls that the two maps have not seen from the same side count nothing: those of two buildings back to back lie
    /// on each other, too.
    pub fn faced_score(&self, transform_a_b: &Pose2) -> f64 {
        let values = self.values();
        let of = |walls: &Walls, raster: &Raster, transform: &Pose2| {
            let values = walls.points.iter().zip(&walls.faces).map(|(wall, face)| {
                let content = raster.at(&(transform * wall));
                let counts = !content.is_near_wall() || is_faced(raster, transform, wall, *face);
                if counts { values[content as usize] } else { 0.0 }
            });
            values.sum::<f64>() * walls.spacing
        };
        0.5 * (of(self.walls_b, self.a, transform_a_b) + of(self.walls_a, self.b, &transform_a_b.inverse()))
    }

    fn sum(&self, transform_a_b: &Pose2, value: impl Fn(&Raster, Vector2<f64>) -> f64) -> f64 {
        let of = |walls: &Walls, raster: &Raster, transform: &Pose2| {
            // From the frame of the walls to cells of the raster.
            let turn = transform.rotation.to_rotation_matrix().into_inner() / raster.cell;
            let shift = (transform.translation.vector - raster.corner) / raster.cell;
            let values = walls.points.iter().map(|wall| value(raster, turn * wall.coords + shift));
            values.sum::<f64>() * walls.spacing
        };
        0.5 * (of(self.walls_b, self.a, transform_a_b) + of(self.walls_a, self.b, &transform_a_b.inverse()))
    }

    /// What a wall counts that meets each [`Content`].
    fn values(&self) -> [f64; 4] {
        let mut values = [0.0; 4];
        // Walls that meet are counted in both maps, and a wall on free space in its own only.
        values[Content::Free as usize] = -2.0 * self.penalty;
        values[Content::BesideWall as usize] = 0.5;
        values[Content::Wall as usize] = 1.0;
        values
    }
}
