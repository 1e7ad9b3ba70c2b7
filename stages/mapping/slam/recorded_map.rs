//! A recorded map as a trajectory that cannot bend, so that the scans of robots are registered on it as on those of
//! others.

use super::pose_graph::{Constraint, PoseGraph};
use super::scan_points::ScanPoint;
use super::trajectory::Trajectory;
use crate::shared::geometry::Pose2;
use nalgebra::Matrix3;
use std::collections::BTreeMap;

/// Side of the squares of a map that each count as a scan, metres: about as far apart as submaps are.
const SQUARE: f64 = 4.0;
/// Information that holds the squares together, in square metres and radians: a map is rigid to a tenth of a millimetre.
const RIGID: f64 = 1e8;

/// A trajectory with a scan for each square of a map, at the middle of the square, from walls in the map's frame.
pub fn recorded_map(walls: impl Iterator<Item = ScanPoint>) -> Trajectory {
    let mut squares: BTreeMap<[i64; 2], Vec<ScanPoint>> = BTreeMap::new();
    for wall in walls {
        let square = [wall.place.x, wall.place.y].map(|coordinate| (coordinate / SQUARE).floor() as i64);
        squares.entry(square).or_default().push(wall);
    }
    let (mut graph, mut scans) = (PoseGraph::default(), Vec::with_capacity(squares.len()));
    for ([column, row], mut walls) in squares {
        let [x, y] = [column, row].map(|number| SQUARE * (number as f64 + 0.5));
        let at = Pose2::translation(x, y);
        walls.iter_mut().for_each(|wall| wall.place = at.inverse() * wall.place);
        if let Some(first) = graph.poses.first() {
            graph.constraints.push(Constraint {
                from: 0,
                to: graph.poses.len(),
                transform: first.inv_mul(&at),
                information: Matrix3::identity() * RIGID,
                is_loop: false,
            });
        }
        graph.poses.push(at);
        scans.push(walls);
    }
    Trajectory::of_recorded_map(graph, scans)
}
