//! Whole maps, assembled from maps and their updates.

use gridweave_runtime::ros::{GridPrefix, OccupancyGrid, OccupancyGridUpdate};
use std::collections::BTreeMap;
use std::fmt;

/// The latest maps of the robots whose maps are updated in parts.
///
/// An updated map is due once the updates since it was last sent contain as many cells as the map, and at the end. So
/// no more cells are sent than were read, however often a large map is updated in small parts, and the last state is
/// always sent.
#[derive(Debug, Default)]
pub(super) struct UpdatedMaps {
    maps: BTreeMap<String, UpdatedMap>,
}

/// A map with its updates applied.
#[derive(Debug)]
pub(super) struct UpdatedMap {
    pub(super) prefix: GridPrefix,
    pub(super) cells: Vec<u8>,
    /// The number of cells in the updates since the map was last sent.
    brought: usize,
}

/// The reason why an update is ignored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum UpdateProblem {
    BeforeMap,
    WrongSize,
    OutOfBounds,
    OtherFrame,
}

impl fmt::Display for UpdateProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::BeforeMap => "no whole map was received before them",
            Self::WrongSize => "their number of cells does not match their size",
            Self::OutOfBounds => "they reach beyond the latest map",
            Self::OtherFrame => "they are in another frame than the latest map",
        })
    }
}

impl UpdatedMaps {
    /// Stores a whole map, which replaces the robot's earlier one and its updates. A map whose number of cells does not
    /// match its size is ignored.
    pub(super) fn keep(&mut self, robot: &str, map: &OccupancyGrid<'_>) {
        let prefix = GridPrefix { header: map.header.clone(), info: map.info };
        if prefix.cell_count() != map.data.len() {
            self.maps.remove(robot);
            return;
        }
        match self.maps.get_mut(robot) {
            Some(kept) => {
                kept.prefix = prefix;
                kept.brought = 0;
                kept.cells.clear();
                kept.cells.extend_from_slice(map.data);
            }
            None => {
                let kept = UpdatedMap { prefix, cells: map.data.to_vec(), brought: 0 };
                self.maps.insert(robot.to_owned(), kept);
            }
        }
    }

    /// Applies an update to the robot's latest map. Returns whether the map is due.
    ///
    /// # Errors
    /// The update does not fit the map; nothing has changed.
    pub(super) fn update(&mut self, robot: &str, update: &OccupancyGridUpdate<'_>) -> Result<bool, UpdateProblem> {
        let map = self.maps.get_mut(robot).ok_or(UpdateProblem::BeforeMap)?;
        map.apply(update)?;
        Ok(map.brought > 0 && map.brought >= map.cells.len())
    }

    /// A robot's map if it was updated since it was last sent; from here on it counts as sent.
    pub(super) fn take(&mut self, robot: &str) -> Option<&UpdatedMap> {
        let map = self.maps.get_mut(robot)?;
        (std::mem::take(&mut map.brought) > 0).then_some(&*map)
    }

    /// All such maps, by robot.
    pub(super) fn take_all(&mut self) -> impl Iterator<Item = (&str, &UpdatedMap)> {
        self.maps.iter_mut().filter_map(|(robot, map)| {
            let is_updated = std::mem::take(&mut map.brought) > 0;
            is_updated.then_some((robot.as_str(), &*map))
        })
    }
}

impl UpdatedMap {
    fn apply(&mut self, update: &OccupancyGridUpdate<'_>) -> Result<(), UpdateProblem> {
        let frame = &update.header.frame_id;
        if !frame.is_empty() && *frame != self.prefix.header.frame_id {
            return Err(UpdateProblem::OtherFrame);
        }
        let (width, height) = (update.width as usize, update.height as usize);
        if width.checked_mul(height) != Some(update.data.len()) {
            return Err(UpdateProblem::WrongSize);
        }
        let (map_width, map_height) = (self.prefix.info.width as usize, self.prefix.info.height as usize);
        let fits = |start: i32, length: usize, end: usize| {
            usize::try_from(start).ok().filter(|start| start.checked_add(length).is_some_and(|last| last <= end))
        };
        let outside = UpdateProblem::OutOfBounds;
        let column = fits(update.x, width, map_width).ok_or(outside)?;
        let row = fits(update.y, height, map_height).ok_or(outside)?;
        self.prefix.header.stamp = update.header.stamp;
        if update.data.is_empty() {
            return Ok(());
        }
        let rows = self.cells.chunks_exact_mut(map_width).skip(row);
        for (cells, update) in rows.zip(update.data.chunks_exact(width)) {
            cells[column..column + width].copy_from_slice(update);
        }
        self.brought = self.brought.saturating_add(update.data.len());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_runtime::message::LogTime;
    use gridweave_runtime::ros::{Header, MapMetaData};

    fn header(second: u64) -> Header {
        Header::new(LogTime(second * 1_000_000_000), "map")
    }

    fn maps_with(width: u32, height: u32) -> UpdatedMaps {
        let mut maps = UpdatedMaps::default();
        let data = vec![0xff; (width * height) as usize];
        let info = MapMetaData { width, height, ..Default::default() };
        maps.keep("r", &OccupancyGrid { header: header(1), info, data: &data });
        maps
    }

    fn update<'a>(x: i32, y: i32, width: u32, height: u32, data: &'a [u8]) -> OccupancyGridUpdate<'a> {
        OccupancyGridUpdate { header: header(2), x, y, width, height, data }
    }

    #[test]
    fn an_update_changes_its_part_and_nothing_else() {
        let mut maps = maps_with(4, 3);
        assert!(!maps.update("r", &update(1, 1, 2, 2, &[1, 2, 3, 4])).unwrap(), "it is not due");
        let rest: Vec<_> = maps.take_all().map(|(robot, map)| (robot.to_owned(), map.cells.clone())).collect();
        let n = 0xff;
        assert_eq!(rest, [("r".to_owned(), vec![n, n, n, n, n, 1, 2, n, n, 3, 4, n])]);
        assert_eq!(maps.maps["r"].prefix.header, header(2), "it has the stamp of its last update");
        assert_eq!(maps.take_all().count(), 0);
    }

    #[test]
    fn a_map_is_due_when_updates_have_brought_as_many_cells_as_it_has() {
        let mut maps = maps_with(4, 2);
        let due = |maps: &mut UpdatedMaps| {
            maps.update("r", &update(0, 0, 3, 1, &[7; 3])).unwrap() && maps.take("r").is_some()
        };
        assert_eq!([(); 6].map(|()| due(&mut maps)), [false, false, true, false, false, true]);
        assert_eq!(maps.take_all().count(), 0);
        assert!(!due(&mut maps));
        // A whole map replaces the updated one, whatever its size.
        let info = MapMetaData { width: 1, height: 2, ..Default::default() };
        maps.keep("r", &OccupancyGrid { header: header(3), info, data: &[1, 2] });
        assert_eq!(maps.take_all().count(), 0);
        assert!(!maps.update("r", &update(0, 1, 1, 1, &[9])).unwrap());
        assert_eq!(maps.maps["r"].cells, [1, 9]);
    }

    #[test]
    fn invalid_updates_change_nothing() {
        let mut maps = maps_with(4, 3);
        let wrong = |maps: &mut UpdatedMaps, update: &OccupancyGridUpdate<'_>| maps.update("r", update).err().unwrap();
        for outside in [
            update(-1, 0, 1, 1, &[0]),
            update(0, -1, 1, 1, &[0]),
            update(4, 0, 1, 1, &[0]),
            update(0, 2, 1, 2, &[0; 2]),
            update(i32::MAX, i32::MIN, 1, 1, &[0]),
            update(5, 0, 0, 0, &[]),
        ] {
            assert_eq!(wrong(&mut maps, &outside), UpdateProblem::OutOfBounds);
        }
        assert_eq!(wrong(&mut maps, &update(0, 0, 2, 2, &[0; 3])), UpdateProblem::WrongSize);
        assert_eq!(wrong(&mut maps, &update(0, 0, u32::MAX, u32::MAX, &[0; 3])), UpdateProblem::WrongSize);
        let elsewhere = OccupancyGridUpdate { header: Header::new(LogTime(1), "odom"), ..update(0, 0, 1, 1, &[0]) };
        assert_eq!(wrong(&mut maps, &elsewhere), UpdateProblem::OtherFrame);
        assert_eq!(maps.update("other", &update(0, 0, 1, 1, &[0])).err(), Some(UpdateProblem::BeforeMap));
        assert!(!maps.update("r", &update(4, 3, 0, 0, &[])).unwrap(), "an empty update does not count");
        assert!(maps.maps["r"].cells.iter().all(|cell| *cell == 0xff));
        assert_eq!(maps.take_all().count(), 0);
        // After an invalid map there is nothing to update.
        let info = MapMetaData { width: 4, height: 3, ..Default::default() };
        maps.keep("r", &OccupancyGrid { header: header(3), info, data: &[0; 5] });
        assert_eq!(wrong(&mut maps, &update(0, 0, 1, 1, &[0])), UpdateProblem::BeforeMap);
    }

    #[test]
    fn a_map_without_cells_is_never_due() {
        let mut maps = maps_with(0, 0);
        assert!(!maps.update("r", &update(0, 0, 0, 0, &[])).unwrap());
        assert_eq!(maps.take_all().count(), 0);
    }
}
