//! Dissimilarity psi of two maps at a relative pose.

use super::DistanceMap;
use gridweave_stages::registration::search::{Content, Raster};
use gridweave_stages::shared::geometry::{Point2, Pose2};

/// The classes of cells that are compared.
const CLASSES: [Content; 2] = [Content::Free, Content::Wall];

/// A map as psi takes it.
#[derive(Clone, Debug)]
pub struct ClassifiedMap {
    raster: Raster,
    classes: Vec<Class>,
}

/// The cells of one class.
#[derive(Clone, Debug)]
struct Class {
    content: Content,
    /// Centres of cells, evenly chosen, map frame.
    points: Vec<Point2>,
    distances: DistanceMap,
}

impl ClassifiedMap {
    /// Of a raster, with at most so many cells of each class.
    pub fn new(raster: Raster, max_points: usize) -> Self {
        let class = |content| {
            let distances = DistanceMap::new(&raster, content)?;
            let all: Vec<usize> = (0..raster.cells.len()).filter(|index| raster.cells[*index] == content).collect();
            let count = all.len().min(max_points);
            let centre = |index: usize| raster.centre(index % raster.width, index / raster.width);
            let points = (0..count).map(|number| centre(all[number * all.len() / count])).collect();
            Some(Class { content, points, distances })
        };
        let classes = CLASSES.into_iter().filter_map(class).collect();
        Self { raster, classes }
    }

    /// The middle of the known rectangle, map frame.
    pub fn middle(&self) -> Point2 {
        let size = nalgebra::Vector2::new(self.raster.width as f64, self.raster.height as f64);
        Point2::from(self.raster.corner + 0.5 * self.raster.cell * size)
    }

    /// Half of its diagonal, metres.
    pub fn radius(&self) -> f64 {
        0.5 * self.raster.cell * (self.raster.width as f64).hypot(self.raster.height as f64)
    }

    /// The side of a cell, metres.
    pub fn cell(&self) -> f64 {
        self.raster.cell
    }

    fn class(&self, content: Content) -> Option<&Class> {
        self.classes.iter().find(|class| class.content == content)
    }

    /// The mean distance from points of another map to the nearest cell of a class, metres.
    fn mean_distance(&self, class: &Class, points: &[Point2], transform_self_other: &Pose2) -> f64 {
        let turn = transform_self_other.rotation.to_rotation_matrix().into_inner() / self.raster.cell;
        let shift = (transform_self_other.translation.vector - self.raster.corner) / self.raster.cell;
        let distances = points.iter().map(|point| class.distances.at(&(turn * point.coords + shift)));
        distances.sum::<f64>() / points.len() as f64 * self.raster.cell
    }
}

/// `psi` = sum over the classes c of `d(a, b, c) + d(b, a, c)`, metres, where `d(a, b, c)` is the mean Manhattan
/// distance from a cell of class c in map a to the nearest one of that class in map b: Carpin, Birk and Jucikas 2005,
/// and Birk and Carpin 2006.
///
/// Distances are along the axes of the map in which they are looked up. A class without a cell in a map is ignored.
pub fn dissimilarity(a: &ClassifiedMap, b: &ClassifiedMap, transform_a_b: &Pose2) -> f64 {
    let transform_b_a = transform_a_b.inverse();
    let of_class = |content| {
        let (of_a, of_b) = (a.class(content)?, b.class(content)?);
        let from_a = b.mean_distance(of_b, &of_a.points, &transform_b_a);
        let from_b = a.mean_distance(of_a, &of_b.points, transform_a_b);
        Some(from_a + from_b)
    };
    CLASSES.into_iter().filter_map(of_class).sum()
}
