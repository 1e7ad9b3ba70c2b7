//! Topological maps in a picture.

use super::decoration::{draw_line, unit};
use super::view::View;
use gridweave_runtime::ros::TopologicalMap;
use image::{Rgb, RgbImage};
use nalgebra::{Isometry2, Point2};

const WAY: Rgb<u8> = Rgb([40, 40, 160]);
const DOOR: Rgb<u8> = Rgb([220, 120, 0]);
const JUNCTION: Rgb<u8> = Rgb([200, 30, 30]);
const PLACE: Rgb<u8> = Rgb([20, 20, 20]);

/// A topological map, and where it lies: ways blue, doors orange, junctions red and other places black.
#[derive(Clone, Copy, Debug)]
pub struct Ways<'a> {
    /// The places and the ways between them.
    pub map: &'a TopologicalMap,
    /// The pose of the map's frame in the world of the picture.
    pub transform_world_map: Isometry2<f64>,
}

impl Ways<'_> {
    pub(super) fn draw(&self, image: &mut RgbImage, view: &View) {
        let unit = unit(view);
        // What is no number, or lies far beyond the picture, is not drawn.
        let pixel = |x: f64, y: f64| {
            let pixel = view.pixel(self.transform_world_map * Point2::new(x, y));
            (pixel.x.abs() < 1e5 && pixel.y.abs() < 1e5).then_some(pixel)
        };
        for path in &self.map.paths {
            for pair in path.points.windows(2) {
                if let (Some(from), Some(to)) = (pixel(pair[0].x, pair[0].y), pixel(pair[1].x, pair[1].y)) {
                    draw_line(image, from, to, 1.2 * unit, WAY);
                }
            }
        }
        for node in &self.map.nodes {
            let colour = match node.kind.as_str() {
                "door" => DOOR,
                "junction" => JUNCTION,
                _ => PLACE,
            };
            if let Some(at) = pixel(node.x, node.y) {
                draw_line(image, at, at, 4.0 * unit, colour);
            }
        }
    }
}
