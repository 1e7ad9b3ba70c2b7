//! Connected objects of the occupied cells of a map.
//!
//! Cells are linked along rows first, to segments, so that memory goes with the outlines of objects and not with their
//! area.

use super::MapCleanerParameters;
use crate::shared::geometry::{Cell, Grid};
use std::ops::{Range, RangeInclusive};

/// Occupied cells of a row that are linked to each other. Sides of grids, and so the numbers of cells, are less than
/// 2^32.
#[derive(Clone, Copy, Debug)]
struct Segment {
    row: u32,
    first: u32,
    last: u32,
    cells: u32,
}

impl Segment {
    fn new(cell: Cell) -> Self {
        let column = cell.column as u32;
        Self { row: cell.row as u32, first: column, last: column, cells: 1 }
    }

    /// Adds the next occupied cell. Returns whether it is linked.
    fn add(&mut self, cell: Cell, reach: u32) -> bool {
        let column = cell.column as u32;
        let is_linked = cell.row as u32 == self.row && column - self.last <= reach;
        if is_linked {
            self.last = column;
            self.cells += 1;
        }
        is_linked
    }
}

/// Bounding box and size of connected occupied cells.
#[derive(Clone, Copy, Debug)]
struct Object {
    cells: u64,
    columns: (u32, u32),
    rows: (u32, u32),
}

impl Object {
    fn new(segment: &Segment) -> Self {
        Self { cells: 0, columns: (segment.first, segment.last), rows: (segment.row, segment.row) }
    }

    /// Adds a segment that is in no row before those of the object.
    fn add(&mut self, segment: &Segment) {
        self.cells += u64::from(segment.cells);
        self.columns = (self.columns.0.min(segment.first), self.columns.1.max(segment.last));
        self.rows.1 = segment.row;
    }

    /// Whether it is a wall, in cells of `resolution` metres.
    fn is_wall(&self, resolution: f64, parameters: &MapCleanerParameters) -> bool {
        let extent = |(low, high): (u32, u32)| f64::from(high - low) + 1.0;
        let (width, height) = (extent(self.columns), extent(self.rows));
        // A slanted line of cells has as many as it is long along its longer axis.
        let filled = self.cells as f64 >= parameters.min_fill * width.max(height);
        filled && width.hypot(height) * resolution >= parameters.min_wall_length
    }
}

/// Calls `remove` with the row and the columns of each segment that belongs to no wall, row by row.
pub(super) fn each_loose_segment(
    grid: &Grid<'_>,
    parameters: &MapCleanerParameters,
    mut remove: impl FnMut(usize, RangeInclusive<usize>),
) {
    let reach = ((parameters.link / grid.geometry.resolution).round() as u32).max(2);
    let segments = segments(grid, reach);
    let object_of = linked(&segments, reach);
    // The segments of an object are in order, and the first one of the next object has the next number.
    let mut objects: Vec<Object> = Vec::new();
    for (segment, object) in segments.iter().zip(&object_of) {
        let object = *object as usize;
        if object == objects.len() {
            objects.push(Object::new(segment));
        }
        objects[object].add(segment);
    }
    for (segment, object) in segments.iter().zip(&object_of) {
        if !objects[*object as usize].is_wall(grid.geometry.resolution, parameters) {
            remove(segment.row as usize, segment.first as usize..=segment.last as usize);
        }
    }
}

/// The occupied cells, row by row, where cells of a row are linked over up to `reach` columns.
fn segments(grid: &Grid<'_>, reach: u32) -> Vec<Segment> {
    let mut segments: Vec<Segment> = Vec::new();
    for cell in grid.occupied() {
        if !segments.last_mut().is_some_and(|last| last.add(cell, reach)) {
            segments.push(Segment::new(cell));
        }
    }
    segments
}

/// The number of each segment's object, where cells are linked over up to `reach` rows and columns. Objects are
/// numbered in the order of their first segments.
fn linked(segments: &[Segment], reach: u32) -> Vec<u32> {
    let mut sets = DisjointSets::new(segments.len());
    let mut rest = 0;
    while let Some(segment) = segments.get(rest) {
        let of_row = rest..rest + segments[rest..].partition_point(|other| other.row == segment.row);
        rest = of_row.end;
        // Those above have been joined already, and two segments of a row are not linked directly.
        let mut below = of_row.end;
        while let Some(other) = segments.get(below).filter(|other| other.row - segment.row <= reach) {
            let of_other = below..below + segments[below..].partition_point(|one| one.row == other.row);
            below = of_other.end;
            join_rows(&mut sets, segments, (of_row.clone(), of_other), reach);
        }
    }
    sets.numbered()
}

/// Joins the segments of two rows that are linked. No cell between the ends of a segment is further than the reach from
/// one of its cells, so only the ends count.
fn join_rows(
    sets: &mut DisjointSets,
    segments: &[Segment],
    (mut upper, mut lower): (Range<usize>, Range<usize>),
    reach: u32,
) {
    while let (Some(one), Some(other)) = (segments.get(upper.start), segments.get(lower.start))
        && !upper.is_empty()
        && !lower.is_empty()
    {
        if other.first <= one.last.saturating_add(reach) && one.first <= other.last.saturating_add(reach) {
            sets.join(upper.start, lower.start);
        }
        // The one that ends later may be linked to the next one, too.
        match one.last <= other.last {
            true => upper.start += 1,
            false => lower.start += 1,
        }
    }
}

/// Disjoint sets of numbers that are joined to larger ones.
struct DisjointSets {
    parents: Vec<u32>,
}

impl DisjointSets {
    fn new(count: usize) -> Self {
        Self { parents: (0..count as u32).collect() }
    }

    fn root(&mut self, mut member: usize) -> usize {
        while self.parents[member] as usize != member {
            self.parents[member] = self.parents[self.parents[member] as usize];
            member = self.parents[member] as usize;
        }
        member
    }

    fn join(&mut self, one: usize, other: usize) {
        let (one, other) = (self.root(one), self.root(other));
        self.parents[one.max(other)] = one.min(other) as u32;
    }

    /// The number of each member's set, from 0 in the order of their first members.
    fn numbered(self) -> Vec<u32> {
        let (mut numbers, mut sets) = (self.parents, 0);
        for member in 0..numbers.len() {
            let parent = numbers[member] as usize;
            // A parent comes first, and is numbered already.
            numbers[member] = if parent == member { sets } else { numbers[parent] };
            sets += u32::from(parent == member);
        }
        numbers
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::{GridGeometry, pose};
    use proptest::prelude::*;

    const WIDTH: usize = 30;
    const HEIGHT: usize = 20;

    fn geometry(width: usize, height: usize) -> GridGeometry {
        GridGeometry { width, height, resolution: 0.05, origin: pose(0.0, 0.0, 0.0) }
    }

    /// The objects' cells by their definition: two cells are linked within the reach along both axes.
    fn objects_of(cells: &[(usize, usize)], reach: usize) -> Vec<usize> {
        let mut object_of: Vec<usize> = (0..cells.len()).collect();
        loop {
            let before = object_of.clone();
            for (one, a) in cells.iter().enumerate() {
                for (other, b) in cells.iter().enumerate() {
                    if a.0.abs_diff(b.0) <= reach && a.1.abs_diff(b.1) <= reach {
                        object_of[one] = object_of[one].min(object_of[other]);
                    }
                }
            }
            if object_of == before {
                return object_of;
            }
        }
    }

    proptest! {
        #[test]
        fn cells_are_of_one_object_exactly_if_links_of_the_reach_lead_from_one_to_the_other(
            values in prop::collection::vec(prop::sample::select(vec![0_i8, 0, 0, 0, 0, 0, 100]), WIDTH * HEIGHT),
            reach in 1_u32..5,
        ) {
            let grid = Grid::new(geometry(WIDTH, HEIGHT), &values).unwrap();
            let cells: Vec<(usize, usize)> = grid.occupied().map(|cell| (cell.column, cell.row)).collect();
            let expected = objects_of(&cells, reach as usize);
            let segments = segments(&grid, reach);
            let objects = linked(&segments, reach);
            let of_cell = |(column, row): (usize, usize)| {
                let holds = |s: &Segment| s.row as usize == row && (s.first as usize..=s.last as usize).contains(&column);
                objects[segments.iter().position(holds).unwrap()]
            };
            let found: Vec<u32> = cells.iter().map(|cell| of_cell(*cell)).collect();
            for (one, other) in (0..cells.len()).flat_map(|one| (0..one).map(move |other| (one, other))) {
                prop_assert_eq!(expected[one] == expected[other], found[one] == found[other]);
            }
            prop_assert_eq!(segments.iter().map(|segment| segment.cells as usize).sum::<usize>(), cells.len());
        }
    }

    #[test]
    fn a_map_full_of_walls_takes_memory_for_its_rows_and_not_for_its_cells() {
        let values = vec![100; 500 * 40];
        let grid = Grid::new(geometry(500, 40), &values).unwrap();
        assert_eq!(segments(&grid, 2).len(), 40);
        each_loose_segment(&grid, &MapCleanerParameters::default(), |row, _| panic!("row {row} is part of a wall"));
    }
}
