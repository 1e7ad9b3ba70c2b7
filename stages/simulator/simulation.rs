//! A whole simulation: a building, its tags, the robots in it, and the truth.

use super::floor_plan::FloorPlan;
use super::parameters::SimulatorParameters;
use super::robot::{RobotLog, simulate_robot};
use super::route::share_rooms;
use super::tags::Tag;
use super::world::{SimulationError, World};
use crate::shared::geometry::{Point2, PointIndex, Pose2};
use gridweave_runtime::ros::{CommonPlace, Header, SimulationTruth, TrueFrame, TrueTag};
use gridweave_runtime::stage::Parameters as _;
use rayon::prelude::*;

/// Distance between points that two robots both have driven through, and the largest distance of their paths there,
/// metres.
const COMMON_SPACING: f64 = 0.5;

/// A simulation.
#[derive(Clone, Debug, PartialEq)]
pub struct Simulation {
    /// The building.
    pub plan: FloorPlan,
    /// Its tags.
    pub tags: Vec<Tag>,
    /// Log of each robot.
    pub robots: Vec<RobotLog>,
    /// Truth for the evaluation of a merge, without a time.
    pub truth: SimulationTruth,
}

/// Creates a building, simulates the robots in it, and computes the truth. The same parameters and seed give the same
/// simulation on any number of threads.
///
/// # Errors
/// A parameter is out of its range, or the robots have no path or see nothing.
pub fn simulate(parameters: &SimulatorParameters, seed: u64) -> Result<Simulation, SimulationError> {
    if let Some(error) = parameters.check().into_iter().next() {
        return Err(error.into());
    }
    let world = World::new(parameters, seed);
    let rooms = share_rooms(world.plan.rooms.len(), parameters.robots as usize, parameters.overlap);
    let robots = rooms
        .into_par_iter()
        .enumerate()
        .map(|(robot, rooms)| simulate_robot(&world, robot, rooms, parameters))
        .collect::<Vec<_>>();
    // The first error by robot, whichever thread was first.
    let robots = robots.into_iter().collect::<Result<Vec<_>, _>>()?;
    let truth = truth_of(&world.tags, &robots);
    Ok(Simulation { plan: world.plan, tags: world.tags, robots, truth })
}

fn truth_of(tags: &[Tag], robots: &[RobotLog]) -> SimulationTruth {
    let transform_building_first = robots.first().map(|robot| robot.transform_building_map).unwrap_or_default();
    let last_map = |robot: &RobotLog| Some(robot.maps.last()?.1.geometry);
    let frame = |robot: &RobotLog| {
        let pose = transform_building_first.inv_mul(&robot.transform_building_map);
        let centre = last_map(robot).map_or(Point2::origin(), |geometry| {
            let size = Point2::new(geometry.width as f64, geometry.height as f64);
            geometry.origin * (size * geometry.resolution / 2.0)
        });
        let (x, y) = (pose.translation.x, pose.translation.y);
        TrueFrame { robot: robot.name.clone(), x, y, yaw: pose.rotation.angle(), centre: centre.coords.into() }
    };
    let tag = |tag: &Tag| {
        let place = transform_building_first.inverse_transform_point(&tag.place);
        TrueTag { tag_id: tag.id.clone(), x: place.x, y: place.y }
    };
    let first = robots.first();
    SimulationTruth {
        header: Header { frame_id: format!("{}/map", first.map_or("", |robot| &robot.name)), ..Default::default() },
        resolution: first.and_then(last_map).map_or(0.0, |geometry| geometry.resolution),
        frames: robots.iter().map(frame).collect(),
        tags: tags.iter().map(tag).collect(),
        common: first_two_by_name(robots).map_or_else(Vec::new, |[first, second]| common_places(first, second)),
    }
}

/// The two robots whose common places are in the truth: `robot10` comes before `robot2`.
fn first_two_by_name(robots: &[RobotLog]) -> Option<[&RobotLog; 2]> {
    let mut by_name: Vec<&RobotLog> = robots.iter().collect();
    by_name.sort_by(|one, other| one.name.cmp(&other.name));
    by_name.first_chunk().copied()
}

/// Points that two robots both have driven through, in the map of the first and in that of the second: a robot's map
/// is displaced by the error of its pose.
fn common_places(first: &RobotLog, second: &RobotLog) -> Vec<CommonPlace> {
    let place = |pose: &Pose2| Point2::from(pose.translation.vector);
    let driven: Vec<Point2> = first.true_poses.iter().map(place).collect();
    let (index, order) = PointIndex::new(&driven, COMMON_SPACING);
    let mut common = Vec::new();
    let mut last: Option<Point2> = None;
    for (true_pose, pose) in second.true_poses.iter().zip(&second.poses) {
        let at = place(true_pose);
        if last.is_some_and(|last| (at - last).norm() < COMMON_SPACING) {
            continue;
        }
        let Some(near) = index.nearest(&at, COMMON_SPACING) else { continue };
        let tick = order[near.index];
        let in_first = first.poses[tick] * first.true_poses[tick].inverse_transform_point(&at);
        common.push(CommonPlace { first: in_first.coords.into(), second: place(pose).coords.into() });
        last = Some(at);
    }
    common
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::{Cell, Grid, is_occupied, pose};
    use gridweave_runtime::stage::ParameterError;

    /// A small building with two robots, exact poses and an exact lidar.
    fn small() -> SimulatorParameters {
        SimulatorParameters {
            robots: 2,
            width: 12.0,
            height: 10.0,
            overlap: 0.8,
            beams: 180,
            drift: 0.0,
            lidar_noise: 0.0,
            tags: 12,
            ..SimulatorParameters::default()
        }
    }

    fn transform(frame: &TrueFrame) -> Pose2 {
        pose(frame.x, frame.y, frame.yaw)
    }

    fn last_grid(robot: &RobotLog) -> Grid<'_> {
        let map = &robot.maps.last().unwrap().1;
        Grid::new(map.geometry, &map.cells).unwrap()
    }

    #[test]
    fn a_seed_gives_the_same_world_on_any_number_of_threads_and_another_seed_another() {
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| simulate(&SimulatorParameters { drift: 0.005, lidar_noise: 0.02, ..small() }, 4).unwrap())
        };
        let one = on(1);
        assert!(one == on(3));
        let other = simulate(&small(), 5).unwrap();
        assert!(one.plan != other.plan && one.robots[0].maps != other.robots[0].maps);
    }

    #[test]
    fn walls_that_two_robots_have_seen_coincide_under_the_true_transform() {
        for seed in 0..4 {
            let simulation = simulate(&small(), seed).unwrap();
            let [first, second] = [&simulation.robots[0], &simulation.robots[1]].map(last_grid);
            let transform_first_second = transform(&simulation.truth.frames[1]);
            let (mut on_first, mut near_wall) = (0, 0);
            for cell in second.occupied() {
                let point = transform_first_second * second.geometry.centre(cell);
                let Some(at) = first.geometry.cell(&point).filter(|at| first.value(*at) >= 0) else { continue };
                on_first += 1;
                let around = (0..3).flat_map(|row| (0..3).map(move |column| (column, row)));
                near_wall += usize::from(around.into_iter().any(|(column, row)| {
                    let column = (at.column + column).wrapping_sub(1);
                    let row = (at.row + row).wrapping_sub(1);
                    is_occupied(first.value(Cell { column, row }))
                }));
            }
            assert!(on_first > 300, "seed {seed}: the maps have only {on_first} wall cells in common");
            let share = f64::from(near_wall as u32) / f64::from(on_first);
            assert!(share > 0.97, "seed {seed}: {share}");
        }
    }

    #[test]
    fn common_places_coincide_with_exact_poses_and_differ_with_drift() {
        let apart = |drift: f64| {
            let truth = simulate(&SimulatorParameters { drift, ..small() }, 3).unwrap().truth;
            assert!(truth.common.len() > 10, "{}", truth.common.len());
            let transform_first_second = transform(&truth.frames[1]);
            let distance = |CommonPlace { first, second }: &CommonPlace| {
                (Point2::from(*first) - transform_first_second * Point2::from(*second)).norm()
            };
            truth.common.iter().map(distance).fold(0.0, f64::max)
        };
        assert!(apart(0.0) < 1e-9);
        let drifted = apart(0.01);
        assert!(drifted > 0.02 && drifted < 1.0, "{drifted}");
    }

    #[test]
    fn common_places_are_those_of_the_first_two_robots_by_name() {
        let of = |robots: u32| {
            let logs = simulate(&SimulatorParameters { robots, beams: 8, ..small() }, 3).unwrap().robots;
            first_two_by_name(&logs).map(|pair| pair.map(|robot| robot.name.clone()))
        };
        assert_eq!(of(1), None);
        assert_eq!(of(2), Some(["robot1".to_owned(), "robot2".to_owned()]));
        assert_eq!(of(10), Some(["robot1".to_owned(), "robot10".to_owned()]));
    }

    #[test]
    fn the_truth_contains_tags_frames_and_centres() {
        let simulation = simulate(&small(), 2).unwrap();
        let truth = &simulation.truth;
        assert_eq!(transform(&truth.frames[0]), Pose2::identity());
        for (robot, frame) in simulation.robots.iter().zip(&truth.frames) {
            assert_eq!(robot.name, frame.robot);
            let offs = robot.readings.iter().map(|(tick, reading)| {
                let antenna = transform(frame) * Point2::from(robot.poses[*tick].translation.vector);
                let tag = &truth.tags[reading.tag];
                (reading.range - (Point2::new(tag.x, tag.y) - antenna).norm()).abs()
            });
            let offs: Vec<f64> = offs.collect();
            assert!(offs.len() > 100 && offs.iter().all(|off| *off < 5.5 * 0.05));
            let grid = last_grid(robot);
            let middle = Cell { column: grid.geometry.width / 2, row: grid.geometry.height / 2 };
            let centre = Point2::from(frame.centre);
            assert!((grid.geometry.centre(middle) - centre).norm() < grid.geometry.resolution);
        }
    }

    #[test]
    fn maps_grow_and_have_the_resolutions_asked_for() {
        let parameters = SimulatorParameters { resolution: vec![0.05, 0.1], snapshots: 4, ..small() };
        let simulation = simulate(&parameters, 1).unwrap();
        for (robot, resolution) in simulation.robots.iter().zip([0.05, 0.1]) {
            assert_eq!(robot.maps.len(), 4);
            assert_eq!(robot.maps[3].0, robot.poses.len() - 1, "the last map holds the last scan");
            let known = |map: &[i8]| map.iter().filter(|value| **value >= 0).count();
            for pair in robot.maps.windows(2) {
                assert!(pair[0].0 < pair[1].0 && known(&pair[0].1.cells) <= known(&pair[1].1.cells));
            }
            for (_, map) in &robot.maps {
                assert_eq!(map.geometry.resolution, resolution);
                assert_eq!(map.cells.len(), map.geometry.cell_count());
                assert!(map.cells.iter().all(|value| (-1..=100).contains(value)));
            }
        }
    }

    #[test]
    fn robots_stay_clear_of_everything_and_see_all_their_rooms() {
        let simulation = simulate(&SimulatorParameters { clutter: 0.3, ..small() }, 3).unwrap();
        let visited = |area: &crate::simulator::Rectangle| {
            let robots = simulation.robots.iter().flat_map(|robot| &robot.true_poses);
            robots.into_iter().any(|pose| area.contains(&Point2::from(pose.translation.vector)))
        };
        assert!(simulation.plan.rooms.iter().all(|room| visited(&room.bounds)));
        for pose in simulation.robots.iter().flat_map(|robot| &robot.true_poses) {
            let place = Point2::from(pose.translation.vector);
            assert!(simulation.plan.solids.iter().all(|solid| solid.distance(&place) > 0.15));
        }
    }

    #[test]
    fn one_robot_no_tags_and_an_empty_building_are_worlds_too() {
        let bare = SimulatorParameters { robots: 1, tags: 0, clutter: 0.0, map_yaw: 0.0, map_offset: 0.0, ..small() };
        assert!(bare.check().is_empty());
        let simulation = simulate(&bare, 1).unwrap();
        assert_eq!((simulation.robots.len(), simulation.tags.len()), (1, 0));
        assert!(simulation.robots[0].readings.is_empty());
        assert_eq!(simulation.robots[0].transform_building_map.rotation.angle(), 0.0);
    }

    #[test]
    fn a_parameter_out_of_range_is_an_error() {
        let error = simulate(&SimulatorParameters { width: f64::NAN, ..small() }, 1).unwrap_err();
        assert!(matches!(error, SimulationError::Parameter(ParameterError { field, .. }) if field == "width"));
    }

    #[test]
    fn a_lidar_that_meets_nothing_is_an_error_that_says_what_to_change() {
        let blind = SimulatorParameters { beams: 1, lidar_range: 0.5, duration: 1.0, dropped_beams: 0.99, ..small() };
        let error = simulate(&blind, 1).unwrap_err();
        assert!(error.to_string().contains("lidar_range"), "{error}");
    }
}
