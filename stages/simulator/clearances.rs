//! Positions at which a robot can stand: the distance from the nearest obstacle, on a raster over the building.

use super::floor_plan::FloorPlan;
use super::shape::{Rectangle, Solid};
use crate::shared::geometry::Point2;
use std::collections::VecDeque;

/// A robot is a disc of this radius, metres.
pub(super) const ROBOT_RADIUS: f64 = 0.28;
/// The side of a raster cell, metres.
const CELL: f64 = 0.1;
/// Distances above this are all the same to a robot, metres.
pub(super) const FREE_CLEARANCE: f64 = 0.8;

/// The distance from the nearest obstacle for every cell of a raster over a building.
#[derive(Clone, Debug)]
pub(super) struct Clearances {
    min: Point2,
    columns: usize,
    rows: usize,
    clearance: Vec<f32>,
    reachable: Vec<bool>,
}

impl Clearances {
    /// The free space of a building that can be reached from its first corridor.
    pub(super) fn of(plan: &FloorPlan) -> Self {
        let entrance = plan.corridors.first().map_or(plan.bounds.centre(), Rectangle::centre);
        Self::new(&plan.bounds, &plan.solids, &entrance)
    }

    /// The free space between solids. What can be reached from near `start` is reachable.
    pub(super) fn new(bounds: &Rectangle, solids: &[Solid], start: &Point2) -> Self {
        let columns = (bounds.width() / CELL).ceil().max(1.0) as usize;
        let rows = (bounds.height() / CELL).ceil().max(1.0) as usize;
        let count = columns * rows;
        let clearance = vec![FREE_CLEARANCE as f32; count];
        let mut space = Self { min: bounds.min, columns, rows, clearance, reachable: vec![false; count] };
        for solid in solids {
            space.add(solid);
        }
        space.flood(start);
        space
    }

    fn add(&mut self, solid: &Solid) {
        let Some(bounds) = Rectangle::bounding(&solid.corners) else { return };
        let bounds = bounds.expanded(FREE_CLEARANCE);
        let low = ((bounds.min - self.min) / CELL).map(|v| v.max(0.0) as usize);
        let high = ((bounds.max - self.min) / CELL).map(|v| v.max(0.0) as usize);
        for row in low.y..=high.y.min(self.rows - 1) {
            for column in low.x..=high.x.min(self.columns - 1) {
                let index = row * self.columns + column;
                let distance = solid.distance(&self.centre(index)) as f32;
                self.clearance[index] = self.clearance[index].min(distance);
            }
        }
    }

    fn flood(&mut self, start: &Point2) {
        let drivable = (0..self.clearance.len()).filter(|&index| self.is_drivable(index));
        let distance = |index: usize| (self.centre(index) - start).norm_squared();
        let Some(first) = drivable.min_by(|&a, &b| distance(a).total_cmp(&distance(b))) else { return };
        self.reachable[first] = true;
        let mut queue = VecDeque::from([first]);
        while let Some(index) = queue.pop_front() {
            for (neighbour, _) in self.neighbours(index).into_iter().flatten() {
                if self.is_drivable(neighbour) && !self.reachable[neighbour] {
                    self.reachable[neighbour] = true;
                    queue.push_back(neighbour);
                }
            }
        }
    }

    fn is_drivable(&self, index: usize) -> bool {
        f64::from(self.clearance[index]) >= ROBOT_RADIUS
    }

    /// The number of raster cells.
    pub(super) fn cell_count(&self) -> usize {
        self.clearance.len()
    }

    /// The middle of a raster cell.
    pub(super) fn centre(&self, index: usize) -> Point2 {
        let (row, column) = (index / self.columns, index % self.columns);
        Point2::new(self.min.x + (column as f64 + 0.5) * CELL, self.min.y + (row as f64 + 0.5) * CELL)
    }

    /// The raster cell of a point; the nearest one for points outside.
    pub(super) fn index(&self, point: &Point2) -> usize {
        let place = ((point - self.min) / CELL).map(|v| v.max(0.0) as usize);
        place.y.min(self.rows - 1) * self.columns + place.x.min(self.columns - 1)
    }

    /// The up to eight neighbours of a raster cell, with their distances in metres.
    pub(super) fn neighbours(&self, index: usize) -> [Option<(usize, f64)>; 8] {
        const STEPS: [(isize, isize); 8] = [(-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1)];
        let (row, column) = (index / self.columns, index % self.columns);
        STEPS.map(|(down, right)| {
            let row = row.checked_add_signed(down).filter(|&row| row < self.rows)?;
            let column = column.checked_add_signed(right).filter(|&column| column < self.columns)?;
            let length = if down != 0 && right != 0 { std::f64::consts::SQRT_2 } else { 1.0 };
            Some((row * self.columns + column, length * CELL))
        })
    }

    /// The distance from the nearest obstacle at a point, metres, at most 0.8 m.
    pub(super) fn clearance(&self, point: &Point2) -> f64 {
        self.clearance_at(self.index(point))
    }

    /// The distance from the nearest obstacle at a raster cell, metres.
    pub(super) fn clearance_at(&self, index: usize) -> f64 {
        f64::from(self.clearance[index])
    }

    /// Whether a robot can stand at a point and can reach it.
    pub(super) fn is_reachable(&self, point: &Point2) -> bool {
        self.is_reachable_at(self.index(point))
    }

    /// Whether a robot can reach a raster cell.
    pub(super) fn is_reachable_at(&self, index: usize) -> bool {
        self.reachable[index]
    }

    /// The points within `area` that a robot can reach, row by row.
    pub(super) fn places_in(&self, area: &Rectangle) -> Vec<Point2> {
        let low = ((area.min - self.min) / CELL).map(|v| v.max(0.0) as usize);
        let high = ((area.max - self.min) / CELL).map(|v| v.max(0.0) as usize);
        let rows = low.y..=high.y.min(self.rows - 1);
        let cells = rows.flat_map(|row| (low.x..=high.x.min(self.columns - 1)).map(move |column| (row, column)));
        cells
            .map(|(row, column)| row * self.columns + column)
            .filter(|&index| self.reachable[index])
            .map(|index| self.centre(index))
            .filter(|place| area.contains(place))
            .collect()
    }
}
