//! The known cells of a raster.

use super::raster::{Bounds, Content, Raster};
use super::walk::Walk;
use nalgebra::{UnitComplex, Vector2};
use std::ops::RangeInclusive;

/// Unknown cells in a row that are visited, too, as that takes less time than to begin anew.
const SHORT_GAP: usize = 8;

/// A raster whose known cells are visited again and again, each time at another rotation.
pub struct KnownCells<'a> {
    raster: &'a Raster,
    /// Indices of the cells from a known one to another in the same row, with short gaps of unknown ones.
    runs: Vec<RangeInclusive<usize>>,
}

impl<'a> KnownCells<'a> {
    /// The known cells of a raster.
    pub fn new(raster: &'a Raster) -> Self {
        let mut runs: Vec<RangeInclusive<usize>> = Vec::new();
        for (row, cells) in raster.cells.chunks(raster.width.max(1)).enumerate() {
            let start = row * raster.width;
            let known = cells.iter().enumerate().filter(|(_, content)| **content != Content::Unknown);
            for index in known.map(|(column, _)| start + column) {
                match runs.last_mut() {
                    Some(run) if *run.start() >= start && index - run.end() <= SHORT_GAP => {
                        *run = *run.start()..=index;
                    }
                    _ => runs.push(index..=index),
                }
            }
        }
        Self { raster, runs }
    }

    /// The raster.
    pub fn raster(&self) -> &'a Raster {
        self.raster
    }

    /// Bounding box of the map turned by an angle about the origin of its frame: its lower corner, and its size,
    /// metres.
    pub(super) fn box_turned(&self, angle: f64) -> (Vector2<f64>, Vector2<f64>) {
        let (turn, mut bounds) = (UnitComplex::new(angle), Bounds::default());
        for index in self.runs.iter().flat_map(|run| [*run.start(), *run.end()]) {
            bounds.add(&(turn * self.raster.centre(index % self.raster.width, index / self.raster.width)));
        }
        let (least, most) = bounds.0.unwrap_or_default();
        (least, most - least)
    }

    /// Visits the known cells, and the unknown ones in short gaps, of the map turned by an angle: the content of each,
    /// and the index of the cell in which its centre is in a lattice with rows of `width` cells of `cell` metres,
    /// whose lower corner is given.
    pub(super) fn visit_turned(
        &self,
        angle: f64,
        corner: &Vector2<f64>,
        cell: f64,
        width: usize,
        mut visit: impl FnMut(Content, usize),
    ) {
        let (turn, raster) = (UnitComplex::new(angle), self.raster);
        let step = turn * Vector2::new(raster.cell, 0.0) / cell;
        for run in &self.runs {
            let first = raster.centre(run.start() % raster.width, run.start() / raster.width);
            let start = ((turn * first).coords - corner) / cell;
            let contents = raster.cells[run.clone()].iter();
            contents.zip(Walk::new(&start, &step, width)).for_each(|(content, place)| visit(*content, place));
        }
    }
}
