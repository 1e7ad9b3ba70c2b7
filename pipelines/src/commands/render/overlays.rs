//! Marks of what was found in maps.

use super::Overlay;
use crate::merge_log::{MergeState, PlacedRobot, Placing, RobotState};
use gridweave_logs::drawing::{Colour, Paint};
use gridweave_logs::map_file::GridMap;
use gridweave_logs::picture::{Mark, Marks, Shape, robot_colour, ways};
use gridweave_runtime::ros::OccupancyGrid;
use nalgebra::{Matrix2, Point2, Vector2};

/// The colour of cells in conflict, which is not that of a robot.
pub(super) const CONFLICT: Colour = [240, 228, 66];
/// The colour of the legend for marks that have the colours of their robots.
const INK: Colour = [70, 70, 70];
/// A cell is in conflict from this share on, percent.
const CONFLICT_FROM: i8 = 50;
/// Length of the arrow of a map's direction, metres.
const DIRECTION: f64 = 3.0;
/// Size of the ellipses, standard deviations.
const DEVIATIONS: f64 = 2.0;

/// Makes a map with the cells in conflict as walls and all others unknown.
pub(super) fn conflicts(map: &OccupancyGrid<'_>) -> GridMap {
    let cells = map.cells().iter().map(|cell| if *cell >= CONFLICT_FROM { 100 } else { -1 }).collect();
    GridMap { info: map.info, cells }
}

/// Makes the marks of an overlay, for each robot.
pub(super) fn marks(overlay: Overlay, state: &MergeState, placing: &Placing) -> Vec<Marks> {
    let enlargement = enlargement(state, placing);
    let robots = placing.robots.iter().filter_map(|robot| Some((robot, state.robots.get(&robot.name)?)));
    let of_robot = |(robot, known): (&PlacedRobot, &RobotState)| {
        let on_map = OnMap { robot, known };
        let (name, marks) = match overlay {
            Overlay::Names => (String::new(), on_map.name()),
            Overlay::Segments => ("walls found".to_owned(), on_map.segments()),
            Overlay::Directions => ("directions of the walls".to_owned(), on_map.direction()),
            Overlay::Tags => ("tags, 2 sigma".to_owned(), on_map.tags()),
            Overlay::Trajectories => ("drives".to_owned(), on_map.trajectory()),
            Overlay::Deformations => (format!("deformation, {enlargement} x"), on_map.deformation(enlargement)),
            Overlay::Ways => return on_map.ways(),
            Overlay::Conflicts | Overlay::All => return None,
        };
        let legend = (!name.is_empty()).then_some(INK);
        (!marks.is_empty()).then_some(Marks { name, legend, marks })
    };
    robots.filter_map(of_robot).collect()
}

/// A robot's map and its state.
struct OnMap<'a> {
    robot: &'a PlacedRobot,
    known: &'a RobotState,
}

impl OnMap<'_> {
    fn paint(&self, opacity: f64) -> Paint {
        // Darker than the walls, so that marks are visible on them.
        let colour = robot_colour(self.robot.index).map(|channel| (f64::from(channel) * 0.75) as u8);
        Paint { colour, opacity: if opacity.is_finite() { opacity.clamp(0.0, 1.0) } else { 1.0 } }
    }

    fn place(&self, x: f64, y: f64) -> Point2<f64> {
        self.robot.place(&Point2::new(x, y))
    }

    /// A direction of the map in the picture, without the small rotations of its deformation.
    fn turn(&self, x: f64, y: f64) -> Vector2<f64> {
        self.robot.transform_world_map.rotation * Vector2::new(x, y)
    }

    fn name(&self) -> Vec<Mark> {
        let (at, paint) = (self.place(0.0, 0.0), self.paint(1.0));
        let dot = Mark { shape: Shape::Dot { at, width: 5.0 }, paint };
        vec![dot, Mark { shape: Shape::Label { at, words: self.robot.name.clone() }, paint }]
    }

    fn segments(&self) -> Vec<Mark> {
        let segments = self.known.segments.iter().flat_map(|found| &found.segments);
        let line = |segment: &gridweave_runtime::ros::Segment| {
            let places = vec![self.place(segment.x1, segment.y1), self.place(segment.x2, segment.y2)];
            let paint = self.paint(0.25 + 0.75 * segment.reliability);
            Mark { shape: Shape::Line { places, width: 2.0 }, paint }
        };
        segments.map(line).collect()
    }

    fn direction(&self) -> Vec<Mark> {
        let Some(direction) = self.known.direction.as_ref().filter(|found| found.valid) else { return Vec::new() };
        let from = self.place(0.0, 0.0);
        let along = |angle: f64| from + self.turn(angle.cos(), angle.sin()) * DIRECTION;
        let angles = [direction.direction, direction.direction + std::f64::consts::FRAC_PI_2];
        angles.map(|angle| Mark { shape: Shape::Arrow { from, to: along(angle) }, paint: self.paint(1.0) }).to_vec()
    }

    fn tags(&self) -> Vec<Mark> {
        let tags = self.known.tags.iter().flat_map(|found| &found.tags);
        let rotation = self.robot.transform_world_map.rotation.to_rotation_matrix();
        let marks = tags.map(|tag| {
            let (at, paint) = (self.place(tag.x, tag.y), self.paint(0.3 + 0.7 * tag.certainty));
            let covariance =
                rotation.matrix() * Matrix2::from_row_slice(&tag.covariance) * rotation.matrix().transpose();
            let words = format!("{} {:.0} %", tag.tag_id, 100.0 * tag.certainty);
            [
                Mark { shape: Shape::Ellipse { middle: at, covariance, deviations: DEVIATIONS }, paint },
                Mark { shape: Shape::Dot { at, width: 3.5 }, paint },
                Mark { shape: Shape::Label { at, words }, paint },
            ]
        });
        marks.flatten().collect()
    }

    /// The path in the merged frame, or else the logged one.
    fn trajectory(&self) -> Vec<Mark> {
        let merged = self.known.path.as_ref().filter(|_| self.robot.is_merged);
        let places: Vec<Point2<f64>> = match merged {
            Some(path) => path.poses.iter().map(|pose| pose.pose.planar().translation.vector.into()).collect(),
            None => self.known.trail.iter().map(|place| self.robot.place(place)).collect(),
        };
        let line = |places| Mark { shape: Shape::Line { places, width: 1.2 }, paint: self.paint(0.8) };
        if places.len() > 1 { vec![line(places)] } else { Vec::new() }
    }

    fn deformation(&self, enlargement: f64) -> Vec<Mark> {
        let deformation = self.robot.deformation.as_ref().and(self.known.deformation.as_ref());
        let nodes = deformation.iter().flat_map(|deformation| &deformation.nodes);
        let arrow = |node: &gridweave_runtime::ros::DeformationNode| {
            let from = self.robot.transform_world_map * Point2::new(node.x, node.y);
            let to = from + self.turn(node.dx, node.dy) * enlargement;
            Mark { shape: Shape::Arrow { from, to }, paint: self.paint(0.9) }
        };
        nodes.map(arrow).collect()
    }

    /// The topological map, which has no deformation.
    fn ways(&self) -> Option<Marks> {
        Some(ways(self.known.topology.as_ref()?, &self.robot.transform_world_map))
    }
}

/// Factor by which deformations are enlarged: a round number for which the longest arrow is no longer than the spacing
/// of the nodes.
fn enlargement(state: &MergeState, placing: &Placing) -> f64 {
    let deformations = placing.robots.iter().filter_map(|robot| state.robots.get(&robot.name)?.deformation.as_ref());
    let max_factor = |deformation: &gridweave_runtime::ros::MapDeformation| {
        let longest = deformation.nodes.iter().map(|node| node.dx.hypot(node.dy)).fold(0.0, f64::max);
        deformation.spacing / longest.max(1e-9)
    };
    let most = deformations.map(max_factor).fold(f64::INFINITY, f64::min);
    let round = [100.0, 50.0, 20.0, 10.0, 5.0, 2.0];
    round.into_iter().find(|round| *round <= most).unwrap_or(1.0)
}
