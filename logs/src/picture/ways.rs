//! Topological maps in a picture.

use super::marks::{Mark, Marks, Shape};
use crate::drawing::Colour;
use gridweave_runtime::ros::TopologicalMap;
use nalgebra::{Isometry2, Point2};

const WAY: Colour = [40, 40, 160];
const DOOR: Colour = [220, 120, 0];
const JUNCTION: Colour = [200, 30, 30];
const PLACE: Colour = [20, 20, 20];

/// A topological map at the pose of its frame in the world: paths blue, doors orange, junctions red and other nodes
/// black.
pub fn ways(map: &TopologicalMap, transform_world_map: &Isometry2<f64>) -> Marks {
    let world = |x: f64, y: f64| transform_world_map * Point2::new(x, y);
    let paths = map.paths.iter().map(|path| {
        let places = path.points.iter().map(|point| world(point.x, point.y)).collect();
        Mark { shape: Shape::Line { places, width: 1.2 }, paint: WAY.into() }
    });
    let nodes = map.nodes.iter().map(|node| {
        let colour = match node.kind.as_str() {
            "door" => DOOR,
            "junction" => JUNCTION,
            _ => PLACE,
        };
        Mark { shape: Shape::Dot { at: world(node.x, node.y), width: 4.0 }, paint: colour.into() }
    });
    Marks { name: "ways and places".into(), legend: Some(WAY), marks: paths.chain(nodes).collect() }
}
