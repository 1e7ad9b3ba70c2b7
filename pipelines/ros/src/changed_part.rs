//! The part of a map that has changed since the last whole map was sent.
//!
//! A subscriber with the last whole map has the current map after any later update, even if it missed the updates
//! between: an update covers all cells that differ from the whole map, and all cells of earlier updates. So the next
//! update applies to the whole map that is retained for late joiners.

use gridweave_runtime::ros::{GridPrefix, Header, OccupancyGrid, OccupancyGridUpdate};

/// The map has at least this many times the cells of an update, because it is sent again after the next whole map.
const MAX_SHARE_DIVISOR: usize = 4;

/// A rectangle of cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Rectangle {
    /// The first column and the first row.
    low: [usize; 2],
    /// The column and the row after the last ones.
    high: [usize; 2],
}

impl Rectangle {
    fn cell_count(&self) -> usize {
        (self.high[0] - self.low[0]) * (self.high[1] - self.low[1])
    }

    /// The smallest rectangle that contains both.
    fn with(self, other: Self) -> Self {
        let both = |a: [usize; 2], b: [usize; 2], of: fn(usize, usize) -> usize| [of(a[0], b[0]), of(a[1], b[1])];
        Self { low: both(self.low, other.low, usize::min), high: both(self.high, other.high, usize::max) }
    }
}

/// The sent state of a map: the last whole map, and the changes since.
#[derive(Debug)]
pub(crate) struct SentMap {
    prefix: GridPrefix,
    /// The cells of the last whole map.
    whole: Vec<u8>,
    /// The current cells.
    cells: Vec<u8>,
    /// The part covered by the last update; `None` if there was none after the whole map.
    covered: Option<Rectangle>,
    /// The number of cells in all updates after the whole map.
    updated_cells: usize,
    /// The part covered by updates before the whole map. Maps and updates have separate topics, so a subscriber may
    /// receive them in another order.
    outdated: Option<Rectangle>,
}

/// The part of a map that is to be sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Part {
    /// All of it.
    Whole,
    /// This part of it.
    Update(Rectangle),
    /// Nothing: no cell has changed.
    Nothing,
}

impl SentMap {
    /// The state for a first whole map; `None` if the number of cells does not match its size.
    pub(crate) fn new(map: &OccupancyGrid<'_>) -> Option<Self> {
        let prefix = GridPrefix { header: map.header.clone(), info: map.info };
        let is_whole = prefix.cell_count() == map.data.len();
        let cells = map.data.to_vec();
        is_whole.then(|| Self { prefix, whole: cells.clone(), cells, covered: None, updated_cells: 0, outdated: None })
    }

    /// Records the next map and returns the part to send: all of it if its origin, size or frame changed, if a large part
    /// changed, or if a subscriber gets no updates. It is also sent whole once updates would have as many cells as the
    /// map, so that at most twice the necessary cells are sent.
    pub(crate) fn take(&mut self, map: &OccupancyGrid<'_>, receives_updates: bool) -> Part {
        let (before, info) = (&self.prefix.info, &map.info);
        let has_same_geometry = self.prefix.header.frame_id == map.header.frame_id
            && (before.resolution, before.width, before.height, before.origin)
                == (info.resolution, info.width, info.height, info.origin)
            && self.cells.len() == map.data.len();
        if has_same_geometry && self.cells == map.data {
            return Part::Nothing;
        }
        self.prefix = GridPrefix { header: map.header.clone(), info: map.info };
        self.cells.clear();
        self.cells.extend_from_slice(map.data);
        let changed = difference(&self.whole, map.data, info.width as usize).filter(|_| has_same_geometry);
        let part = match (changed, self.covered) {
            (Some(changed), Some(covered)) => Some(changed.with(covered)),
            (changed, covered) => changed.or(covered),
        };
        let is_small = |part: &Rectangle| part.cell_count() <= self.cells.len() / MAX_SHARE_DIVISOR;
        let may_update = has_same_geometry && receives_updates && part.as_ref().is_some_and(is_small);
        match part.filter(|part| may_update && self.updated_cells.saturating_add(part.cell_count()) < self.cells.len())
        {
            Some(part) => {
                self.covered = Some(part);
                self.updated_cells += part.cell_count();
                Part::Update(part)
            }
            None => {
                self.set_whole();
                Part::Whole
            }
        }
    }

    /// Whether updates were sent after the last whole map.
    pub(crate) fn is_updated(&self) -> bool {
        self.covered.is_some()
    }

    /// The current whole map, which counts as sent.
    pub(crate) fn whole(&mut self) -> OccupancyGrid<'_> {
        self.set_whole();
        OccupancyGrid { header: self.prefix.header.clone(), info: self.prefix.info, data: &self.cells }
    }

    /// Makes the next change be sent as a whole map.
    pub(crate) fn request_whole(&mut self) {
        self.updated_cells = self.cells.len();
    }

    fn set_whole(&mut self) {
        self.whole.clone_from(&self.cells);
        (self.outdated, self.covered, self.updated_cells) = (self.covered.take().or(self.outdated), None, 0);
    }

    /// The part that must be sent again as an update after a whole map, because an earlier update may be applied to it.
    pub(crate) fn take_outdated(&mut self) -> Option<Rectangle> {
        let Rectangle { low, high } = self.outdated.take()?;
        let high = [high[0].min(self.prefix.info.width as usize), high[1].min(self.prefix.info.height as usize)];
        (low[0] < high[0] && low[1] < high[1]).then_some(Rectangle { low, high })
    }

    /// The update with a part of the map, whose cells are written to `cells`.
    pub(crate) fn update<'a>(&self, part: Rectangle, cells: &'a mut Vec<u8>) -> OccupancyGridUpdate<'a> {
        let Rectangle { low: [left, low], high: [right, high] } = part;
        cells.clear();
        for row in self.cells.chunks_exact(self.prefix.info.width.max(1) as usize).take(high).skip(low) {
            cells.extend_from_slice(row.get(left..right).unwrap_or_default());
        }
        let Header { stamp, frame_id } = self.prefix.header.clone();
        OccupancyGridUpdate {
            header: Header { stamp, frame_id },
            x: left as i32,
            y: low as i32,
            width: (right - left) as u32,
            height: (high - low) as u32,
            data: cells,
        }
    }
}

/// The smallest rectangle that holds all cells in which two maps of one size differ; `None` if they do not.
fn difference(before: &[u8], after: &[u8], width: usize) -> Option<Rectangle> {
    let rows = before.chunks_exact(width.max(1)).zip(after.chunks_exact(width.max(1))).enumerate();
    let changed = rows.filter_map(|(row, (before, after))| {
        if before == after {
            return None;
        }
        let differs = |(before, after): (&u8, &u8)| before != after;
        let first = before.iter().zip(after).position(differs)?;
        let last = before.iter().zip(after).rposition(differs)?;
        Some(Rectangle { low: [first, row], high: [last + 1, row + 1] })
    });
    changed.reduce(Rectangle::with)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_runtime::ros::MapMetaData;
    use proptest::prelude::*;

    fn map(width: u32, height: u32, data: &[u8]) -> OccupancyGrid<'_> {
        let info = MapMetaData { width, height, resolution: 0.05, ..Default::default() };
        OccupancyGrid { header: Header { frame_id: "world".into(), ..Default::default() }, info, data }
    }

    fn part(low: [usize; 2], high: [usize; 2]) -> Part {
        Part::Update(Rectangle { low, high })
    }

    #[test]
    fn an_update_holds_what_differs_from_the_whole_map_and_what_updates_have_changed_before() {
        let mut cells = vec![0; 40];
        let mut sent = SentMap::new(&map(8, 5, &cells)).unwrap();
        assert_eq!(sent.take(&map(8, 5, &cells), true), Part::Nothing);
        assert!(!sent.is_updated());
        (cells[9], cells[18]) = (1, 2);
        assert_eq!(sent.take(&map(8, 5, &cells), true), part([1, 1], [3, 3]));
        // Reverted cells must be sent too, to subscribers that applied the update.
        (cells[9], cells[18], cells[12]) = (0, 0, 7);
        assert_eq!(sent.take(&map(8, 5, &cells), true), part([1, 1], [5, 3]));
        assert_eq!(sent.take(&map(8, 5, &cells), true), Part::Nothing);
        assert!(sent.is_updated());
        let Part::Update(rectangle) = part([1, 1], [5, 3]) else { panic!() };
        let mut buffer = Vec::new();
        let update = sent.update(rectangle, &mut buffer);
        assert_eq!((update.x, update.y, update.width, update.height), (1, 1, 4, 2));
        assert_eq!((update.data, update.header.frame_id.as_str()), (&[0, 0, 0, 7, 0, 0, 0, 0][..], "world"));
        assert_eq!(sent.whole().data, cells);
        assert!(!sent.is_updated());
        assert_eq!(
            sent.take_outdated().map(Part::Update),
            Some(part([1, 1], [5, 3])),
            "the update may arrive after it"
        );
        assert_eq!(sent.take_outdated(), None);
        cells[0] = 1;
        assert_eq!(sent.take(&map(8, 5, &cells), false), Part::Whole, "a subscriber gets no updates");
        assert_eq!(sent.take_outdated(), None);
    }

    #[test]
    fn the_whole_map_is_sent_once_updates_would_have_brought_as_much() {
        let mut cells = vec![0; 40];
        let mut sent = SentMap::new(&map(8, 5, &cells)).unwrap();
        let mut parts = Vec::new();
        for value in 1..8 {
            cells[..8].fill(value);
            parts.push(sent.take(&map(8, 5, &cells), true));
        }
        let update = part([0, 0], [8, 1]);
        assert_eq!(parts, [update, update, update, update, Part::Whole, update, update]);
        cells.fill(9);
        assert_eq!(sent.take(&map(8, 5, &cells), true), Part::Whole);
        cells[0] = 1;
        sent.request_whole();
        assert_eq!(sent.take(&map(8, 5, &cells), true), Part::Whole);
        cells[0] = 2;
        assert_eq!(sent.take(&map(8, 5, &cells), true), part([0, 0], [1, 1]));
    }

    #[test]
    fn a_map_of_another_place_size_or_frame_is_sent_as_a_whole() {
        let mut cells = vec![0; 40];
        let mut sent = SentMap::new(&map(8, 5, &cells)).unwrap();
        cells[39] = 1;
        assert_eq!(sent.take(&map(8, 5, &cells), true), part([7, 4], [8, 5]));
        assert_eq!(sent.take(&map(5, 8, &cells), true), Part::Whole);
        assert_eq!(sent.take_outdated(), None, "it is outside of the other map, where it is refused");
        let mut moved = map(5, 8, &cells);
        moved.info.origin.position.x = 0.05;
        assert_eq!(sent.take(&moved, true), Part::Whole);
        moved.header.frame_id = "world/robot2".into();
        assert_eq!(sent.take(&moved, true), Part::Whole);
        moved.header.stamp.sec = 7;
        assert_eq!(sent.take(&moved, true), Part::Nothing, "a later stamp is no change");
        cells.truncate(35);
        assert_eq!(sent.take(&map(5, 7, &cells), true), Part::Whole);
        assert!(SentMap::new(&map(8, 5, &cells)).is_none() && SentMap::new(&map(0, 0, &[])).is_some());
    }

    /// Applies an update to a subscriber's map.
    fn apply(to: &mut [u8], width: usize, update: &OccupancyGridUpdate<'_>) {
        for (row, cells) in update.data.chunks_exact(update.width as usize).enumerate() {
            let start = (update.y as usize + row) * width + update.x as usize;
            to[start..start + cells.len()].copy_from_slice(cells);
        }
    }

    proptest! {
        #[test]
        fn a_subscriber_with_the_last_whole_map_has_the_map_after_any_updates(
            maps in prop::collection::vec(prop::collection::vec((0..30_usize, 0..3_u8), 0..4), 1..20),
            misses in prop::collection::vec(any::<bool>(), 20),
        ) {
            let (width, height) = (6, 5);
            let mut cells = vec![0; 30];
            let mut sent = SentMap::new(&map(width, height, &cells)).unwrap();
            // One subscriber receives everything; another misses updates, except the last.
            let (mut all, mut some) = (cells.clone(), cells.clone());
            for (changes, is_missed) in maps.iter().zip(misses) {
                for (cell, value) in changes {
                    cells[*cell] = *value;
                }
                let mut buffer = Vec::new();
                match sent.take(&map(width, height, &cells), true) {
                    Part::Nothing => {}
                    Part::Whole => (all, some) = (cells.clone(), cells.clone()),
                    Part::Update(part) => {
                        let update = sent.update(part, &mut buffer);
                        apply(&mut all, 6, &update);
                        if !is_missed {
                            apply(&mut some, 6, &update);
                            prop_assert_eq!(&some, &cells);
                        }
                    }
                }
                prop_assert_eq!(&all, &cells);
            }
        }
    }
}
