//! What was found in maps, as marks upon them.

use super::Overlay;
use crate::merge_log::{MergeState, PlacedRobot, Placing, RobotState};
use gridweave_logs::drawing::{Colour, Paint};
use gridweave_logs::map_file::GridMap;
use gridweave_logs::picture::{Mark, Marks, Shape, robot_colour, ways};
use gridweave_runtime::ros::OccupancyGrid;
use nalgebra::{Matrix2, Point2, Vector2};

/// The colour of what maps contradict each other in, which is no robot's.
pub(super) const CONFLICT: Colour = [240, 228, 66];
/// Of marks in the legend that have the colours of their robots.
const INK: Colour = [70, 70, 70];
/// From this share on a cell is in conflict, in hundredths.
const CONFLICT_FROM: i8 = 50;
/// How long the arrow of a map's direction is, metres.
const DIRECTION: f64 = 3.0;
const DEVIATIONS: f64 = 2.0;

/// The cells in conflict as the walls of a map of which nothing else is known.
pub(super) fn conflicts(map: &OccupancyGrid<'_>) -> GridMap {
    let cells = map.cells().iter().map(|cell| if *cell >= CONFLICT_FROM { 100 } else { -1 }).collect();
    GridMap { info: map.info, cells }
}

/// The marks of an overlay, robot by robot.
pub(super) fn marks(overlay: Overlay, state: &MergeState, placing: &Placing) -> Vec<Marks> {
    let longer = longer(state, placing);
    let robots = placing.robots.iter().filter_map(|robot| Some((robot, state.robots.get(&robot.name)?)));
    let of_robot = |(robot, known): (&PlacedRobot, &RobotState)| {
        let on_map = OnMap { robot, known };
        let (name, marks) = match overlay {
            Overlay::Names => (String::new(), on_map.name()),
            Overlay::Segments => ("walls found".to_owned(), on_map.segments()),
            Overlay::Directions => ("directions of the walls".to_owned(), on_map.direction()),
            Overlay::Tags => ("tags, 2 sigma".to_owned(), on_map.tags()),
            Overlay::Trajectories => ("drives".to_owned(), on_map.trajectory()),
            Overlay::Bends => (format!("bends, {longer} times as long"), on_map.bends(longer)),
            Overlay::Ways => return on_map.ways(),
            Overlay::Conflicts | Overlay::All => return None,
        };
        let legend = (!name.is_empty()).then_some(INK);
        (!marks.is_empty()).then_some(Marks { name, legend, marks })
    };
    robots.filter_map(of_robot).collect()
}

/// A robot's map, and what is known of it.
struct OnMap<'a> {
    robot: &'a PlacedRobot,
    known: &'a RobotState,
}

impl OnMap<'_> {
    fn paint(&self, opacity: f64) -> Paint {
        // Darker than the walls, so that marks stand out.
        let colour = robot_colour(self.robot.index).map(|channel| (f64::from(channel) * 0.75) as u8);
        Paint { colour, opacity: if opacity.is_finite() { opacity.clamp(0.0, 1.0) } else { 1.0 } }
    }

    fn place(&self, x: f64, y: f64) -> Point2<f64> {
        self.robot.place(&Point2::new(x, y))
    }

    /// A direction of the map in the picture, without the little by which bends turn it.
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

    /// The drive as the merge has carried it, or else as the robot has logged it.
    fn trajectory(&self) -> Vec<Mark> {
        let carried = self.known.path.as_ref().filter(|_| self.robot.is_merged);
        let places: Vec<Point2<f64>> = match carried {
            Some(path) => path.poses.iter().map(|pose| pose.pose.planar().translation.vector.into()).collect(),
            None => self.known.trail.iter().map(|place| self.robot.place(place)).collect(),
        };
        let line = |places| Mark { shape: Shape::Line { places, width: 1.2 }, paint: self.paint(0.8) };
        if places.len() > 1 { vec![line(places)] } else { Vec::new() }
    }

    fn bends(&self, longer: f64) -> Vec<Mark> {
        let bent = self.robot.bend.as_ref().and(self.known.bend.as_ref());
        let nodes = bent.iter().flat_map(|bend| &bend.nodes);
        let arrow = |node: &gridweave_runtime::ros::DeformationNode| {
            let from = self.robot.transform_world_map * Point2::new(node.x, node.y);
            let to = from + self.turn(node.dx, node.dy) * longer;
            Mark { shape: Shape::Arrow { from, to }, paint: self.paint(0.9) }
        };
        nodes.map(arrow).collect()
    }

    /// Topological maps are not bent.
    fn ways(&self) -> Option<Marks> {
        Some(ways(self.known.topology.as_ref()?, &self.robot.transform_world_map))
    }
}

/// How much longer than they are bends are drawn: the longest a little shorter than its nodes lie apart, by a round number.
fn longer(state: &MergeState, placing: &Placing) -> f64 {
    let bends = placing.robots.iter().filter_map(|robot| state.robots.get(&robot.name)?.bend.as_ref());
    let of_bend = |bend: &gridweave_runtime::ros::MapDeformation| {
        let longest = bend.nodes.iter().map(|node| node.dx.hypot(node.dy)).fold(0.0, f64::max);
        bend.spacing / longest.max(1e-9)
    };
    let most = bends.map(of_bend).fold(f64::INFINITY, f64::min);
    let round = [100.0, 50.0, 20.0, 10.0, 5.0, 2.0];
    round.into_iter().find(|round| *round <= most).unwrap_or(1.0)
}
