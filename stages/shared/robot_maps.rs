//! The last map of each robot.

use crate::shared::geometry::{Grid, GridGeometry};
use crate::shared::robot_pair::RobotPair;
use gridweave_runtime::message::Message;
use gridweave_runtime::ros::OccupancyGrid;
use gridweave_runtime::stage::{Output, Received};
use std::collections::BTreeMap;
use std::ops::Range;

/// The last usable map of each robot, by name, each with data of the stage.
#[derive(Debug)]
pub struct RobotMaps<T> {
    maps: BTreeMap<String, RobotMap<T>>,
}

/// A robot's last map. Its cells stay in the message.
#[derive(Debug)]
pub struct RobotMap<T> {
    /// Data of the stage for this map.
    pub own: T,
    /// Number of earlier usable maps of the robot.
    pub number: u64,
    /// Frame of the map.
    pub frame_id: String,
    geometry: GridGeometry,
    message: Message,
    /// Range of the cells in the message.
    cells: Range<usize>,
}

impl<T> Default for RobotMaps<T> {
    fn default() -> Self {
        Self { maps: BTreeMap::new() }
    }
}

impl<T> RobotMaps<T> {
    /// Stores a map in place of the robot's last, with the result of `own`. Returns `false`, with a warning, if it
    /// cannot be used.
    pub fn keep<O>(
        &mut self,
        map: &Received<'_, OccupancyGrid<'_>>,
        output: &Output<O>,
        own: impl FnOnce(&Grid<'_>) -> T,
    ) -> bool {
        let robot = map.robot();
        let grid = match Grid::from_message(map) {
            Ok(grid) => grid,
            Err(problem) => {
                output.warn(format!("a map of {robot} was left out: {problem}"));
                return false;
            }
        };
        let start = map.data.as_ptr().addr() - map.message().bytes().as_ptr().addr();
        let kept = RobotMap {
            own: own(&grid),
            number: self.maps.get(robot).map_or(0, |before| before.number + 1),
            frame_id: map.header.frame_id.clone(),
            geometry: grid.geometry,
            message: map.message().clone(),
            cells: start..start + map.data.len(),
        };
        self.maps.insert(robot.to_owned(), kept);
        true
    }

    /// The last map of a robot.
    pub fn get(&self, robot: &str) -> Option<&RobotMap<T>> {
        self.maps.get(robot)
    }

    /// The last maps of two robots, if both exist.
    pub fn pair(&self, pair: &RobotPair) -> Option<(&RobotMap<T>, &RobotMap<T>)> {
        self.get(&pair.a).zip(self.get(&pair.b))
    }

    /// The robots of a pair without a usable map, as in "no usable map of robot1 and robot2 has come".
    pub fn missing(&self, pair: &RobotPair) -> Option<String> {
        let missing: Vec<&str> = pair.robots().into_iter().filter(|robot| self.get(robot).is_none()).collect();
        (!missing.is_empty()).then(|| format!("no usable map of {} has come", missing.join(" and ")))
    }

    /// The last maps of all robots, by name.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &RobotMap<T>)> {
        self.maps.iter().map(|(robot, map)| (robot.as_str(), map))
    }
}

impl<T> RobotMap<T> {
    /// The map.
    pub fn grid(&self) -> Grid<'_> {
        let data = &self.message.bytes()[self.cells.clone()];
        Grid { geometry: self.geometry, cells: OccupancyGrid { data, ..Default::default() }.cells() }
    }

    /// The encoded message of the map.
    pub fn bytes(&self) -> &[u8] {
        self.message.bytes()
    }

    /// Whether another map has the same cells at the same pose.
    pub fn is_same(&self, other: &OccupancyGrid<'_>) -> bool {
        self.geometry == GridGeometry::from(&other.info) && self.grid().cells == other.cells()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_runtime::message::LogTime;
    use gridweave_runtime::ros::MapMetaData;
    use gridweave_runtime::stage::{StageError, StageHarness, StageKind};
    use std::cell::RefCell;
    use std::rc::Rc;

    /// The maps that a stage stores.
    fn kept(given: &[(&str, OccupancyGrid<'_>)]) -> (RobotMaps<usize>, usize) {
        type Shared = Rc<RefCell<RobotMaps<usize>>>;
        struct Keeper(Shared);
        impl Keeper {
            fn receive(&mut self, map: Received<'_, OccupancyGrid<'_>>, output: &Output<()>) -> Result<(), StageError> {
                self.0.borrow_mut().keep(&map, output, |grid| grid.cells.len());
                Ok(())
            }
        }
        thread_local!(static MAPS: Shared = Rc::default());
        let make = |(): (), _: &_| Ok(Keeper(MAPS.with(Rc::clone)));
        let kind = StageKind::stage("keeper", "", make).input("map", "", Keeper::receive).build();
        let mut stage = StageHarness::new(&kind, "").unwrap();
        for (robot, map) in given {
            stage.give::<OccupancyGrid<'_>>("map", robot, LogTime(1), map).unwrap();
        }
        (MAPS.with(|maps| maps.take()), stage.warnings().len())
    }

    fn map(cells: &[u8]) -> OccupancyGrid<'_> {
        let info = MapMetaData { resolution: 0.05, width: 2, height: 1, ..Default::default() };
        OccupancyGrid { info, data: cells, ..Default::default() }
    }

    #[test]
    fn the_last_usable_map_of_each_robot_is_kept() {
        let wrong = OccupancyGrid { data: &[0], ..map(&[]) };
        let given = [("b", map(&[0, 100])), ("a", map(&[1, 2])), ("b", map(&[3, 255])), ("b", wrong)];
        let (maps, warnings) = kept(&given);
        assert_eq!(maps.iter().map(|(robot, map)| (robot, map.number)).collect::<Vec<_>>(), [("a", 0), ("b", 1)]);
        let last = maps.get("b").unwrap();
        assert_eq!((last.grid().cells, last.own, warnings), (&[3, -1][..], 2, 1));
        assert!(last.is_same(&map(&[3, 255])) && !last.is_same(&map(&[3, 0])));
        assert!(!last.is_same(&OccupancyGrid { info: MapMetaData::default(), ..map(&[3, 255]) }));
    }

    #[test]
    fn the_missing_robots_of_a_pair_are_named() {
        let (maps, _) = kept(&[("a", map(&[0, 0]))]);
        assert!(maps.pair(&RobotPair::new("a", "a")).is_some() && maps.pair(&RobotPair::new("a", "b")).is_none());
        assert_eq!(maps.missing(&RobotPair::new("a", "a")), None);
        assert_eq!(maps.missing(&RobotPair::new("c", "b")).unwrap(), "no usable map of c and b has come");
    }
}
