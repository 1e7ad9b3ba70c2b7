//! Poses of the robots' maps in a picture: merged maps by their frames, and the others beside them.

use super::MergeState;
use gridweave_logs::map_file::GridMap;
use gridweave_runtime::ros::{OccupancyGrid, RobotFrame, Time};
use gridweave_stages::merge::grid_fuser::KnownArea;
use gridweave_stages::merge::map_placer::PlacedMap;
use gridweave_stages::shared::deformation::Deformation;
use gridweave_stages::shared::geometry::{Grid, Point2, Pose2};
use gridweave_stages::shared::placement::Placed;
use std::collections::BTreeSet;

/// Gap between maps that are drawn beside each other, metres.
const GAP: f64 = 2.0;

/// Poses of the maps in a picture.
pub(crate) struct Placing {
    /// The robots, by name.
    pub(crate) robots: Vec<PlacedRobot>,
}

/// A robot and the pose of its map.
pub(crate) struct PlacedRobot {
    pub(crate) name: String,
    /// Its index among all robots by name, which decides its colour.
    pub(crate) index: usize,
    /// The pose of its map frame in the picture.
    pub(crate) transform_world_map: Pose2,
    /// The deformation of its map.
    pub(crate) deformation: Option<Deformation>,
    /// Whether its pose is in the frame of the merged map.
    pub(crate) is_merged: bool,
    /// The transformed map; `None` if it is too far away for a grid.
    pub(crate) map: Option<GridMap>,
}

impl PlacedRobot {
    /// Transforms a point of its map to the picture.
    pub(crate) fn place(&self, in_map: &Point2) -> Point2 {
        let deformed = self.deformation.as_ref().map_or(*in_map, |deformation| deformation.apply(in_map));
        self.transform_world_map * deformed
    }

    /// Transforms its map, shifted to the right and up.
    fn transform(&mut self, grid: &Grid<'_>, shift: (f64, f64)) {
        self.transform_world_map.translation.vector += nalgebra::Vector2::new(shift.0, shift.1);
        let placed = Placed { transform_world_map: self.transform_world_map, deformation: self.deformation.as_ref() };
        let area = KnownArea::of(grid);
        self.map = PlacedMap::new(*grid, &area, &placed).map(|placed| {
            let mut cells = vec![0; placed.geometry().cell_count()];
            placed.draw(&mut cells);
            GridMap { info: placed.geometry().meta_data(Time::default()), cells }
        });
    }

    /// Left, bottom and right border of its map.
    fn bounds(&self) -> Option<(f64, f64, f64)> {
        let info = &self.map.as_ref()?.info;
        let corner = info.origin.planar().translation;
        Some((corner.x, corner.y, corner.x + f64::from(info.width) * f64::from(info.resolution)))
    }
}

impl Placing {
    /// Arranges the maps of some robots, or of all: merged maps by their frames, beside them each group that is merged
    /// only with each other, and then the others. With `is_apart` all maps are beside each other.
    pub(crate) fn of(state: &MergeState, wanted: &BTreeSet<&str>, is_apart: bool) -> Self {
        let is_wanted = |robot: &str| wanted.is_empty() || wanted.contains(robot);
        let frames = state.frames.as_ref().filter(|_| !is_apart);
        let merged = frames.map(|frames| frames.frames.as_slice()).unwrap_or_default();
        let groups = frames.map(|frames| frames.groups.as_slice()).unwrap_or_default();
        let mut components: Vec<Vec<(&str, Pose2)>> = std::iter::once(merged)
            .chain(groups.iter().map(|group| group.frames.as_slice()))
            .map(|frames| frames.iter().map(pose_of).filter(|(robot, _)| is_wanted(robot)).collect())
            .collect();
        for (robot, _) in state.robots_with_maps().filter(|(robot, _)| is_wanted(robot)) {
            if !components.iter().flatten().any(|(placed, _)| *placed == robot) {
                components.push(vec![(robot, Pose2::identity())]);
            }
        }

        let mut robots: Vec<PlacedRobot> = Vec::new();
        for (number, component) in components.iter().enumerate() {
            let mut placed: Vec<(PlacedRobot, OccupancyGrid<'_>)> = Vec::new();
            for (robot, pose) in component {
                let known = state.robots_with_maps().enumerate().find(|(_, (name, _))| name == robot);
                let Some((index, (name, map))) = known else { continue };
                let deformation = state.robots[name].deformation.as_ref().filter(|_| !is_apart);
                placed.push((
                    PlacedRobot {
                        name: name.to_owned(),
                        index,
                        transform_world_map: *pose,
                        deformation: deformation.and_then(Deformation::from_message),
                        is_merged: number == 0 && !merged.is_empty(),
                        map: None,
                    },
                    map,
                ));
            }
            place_component(&mut placed, &robots);
            robots.extend(placed.into_iter().map(|(robot, _)| robot));
        }
        robots.sort_by_key(|robot| robot.index);
        Self { robots }
    }
}

/// Places the maps of a connected component, to the right of all maps before.
fn place_component(component: &mut [(PlacedRobot, OccupancyGrid<'_>)], before: &[PlacedRobot]) {
    let transform = |component: &mut [(PlacedRobot, OccupancyGrid<'_>)], shift| {
        for (robot, map) in component {
            if let Ok(grid) = Grid::from_message(map) {
                robot.transform(&grid, shift);
            }
        }
    };
    transform(component, (0.0, 0.0));
    let others: Vec<_> = before.iter().filter_map(PlacedRobot::bounds).collect();
    let own: Vec<_> = component.iter().filter_map(|(robot, _)| robot.bounds()).collect();
    if others.is_empty() || own.is_empty() {
        return;
    }
    let least = |values: &[(f64, f64, f64)], part: fn(&(f64, f64, f64)) -> f64| {
        values.iter().map(part).fold(f64::INFINITY, f64::min)
    };
    let right = others.iter().map(|bounds| bounds.2).fold(f64::NEG_INFINITY, f64::max);
    let shift = (
        right + GAP - least(&own, |bounds| bounds.0),
        least(&others, |bounds| bounds.1) - least(&own, |bounds| bounds.1),
    );
    transform(component, shift);
}

fn pose_of(frame: &RobotFrame) -> (&str, Pose2) {
    (frame.robot.as_str(), frame.transform_reference_robot())
}
