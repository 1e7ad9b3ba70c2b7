//! The Hough spectrum of a map.

use super::WallCells;
use rayon::prelude::*;
use std::f64::consts::PI;

/// How much the walls of a map run along each direction: `HS(theta)` = sum over rho of `HT(rho, theta)^2`, where
/// `HT(rho, theta)` is the number of occupied cells on the line `x cos(theta) + y sin(theta) = rho` (the Hough
/// transform).
///
/// It does not depend on where the map's origin lies, and turning the map by psi shifts it by psi. Its period is half a
/// turn.
#[derive(Clone, Debug, PartialEq)]
pub struct HoughSpectrum {
    /// `HS(theta)` for `theta = k * pi / values.len()`: theta is the direction of the normal of a wall, map frame,
    /// radians.
    pub values: Vec<f64>,
}

impl HoughSpectrum {
    /// The spectrum at `count` directions, with lines `cell` metres wide.
    ///
    /// Cells are counted in whole numbers, so that the order in which they come means nothing.
    pub fn new(walls: &WallCells, count: usize, cell: f64) -> Self {
        // A line more on either side, for what rounding moves over the edge.
        let half = (walls.radius / cell).ceil() + 1.0;
        let lines = 2 * half as usize + 1;
        let energy = |votes: &mut Vec<u32>, index: usize| {
            let theta = index as f64 * PI / count as f64;
            let (cosine, sine) = ((theta.cos() / cell) as f32, (theta.sin() / cell) as f32);
            let offset = half as f32 + 0.5;
            votes.fill(0);
            for [x, y] in &walls.points {
                let line = (x * cosine + y * sine + offset) as u32 as usize;
                if let Some(votes) = votes.get_mut(line) {
                    *votes += 1;
                }
            }
            votes.iter().map(|votes| u64::from(*votes).pow(2)).sum::<u64>() as f64
        };
        let values = (0..count).into_par_iter().map_init(|| vec![0; lines], energy).collect();
        Self { values }
    }

    /// The direction of most energy, radians from 0 to pi: the normal of most walls.
    pub fn main_direction(&self) -> f64 {
        let best = self
            .values
            .iter()
            .enumerate()
            .fold((0, f64::MIN), |best, (index, value)| if *value > best.1 { (index, *value) } else { best });
        best.0 as f64 * PI / self.values.len().max(1) as f64
    }
}
