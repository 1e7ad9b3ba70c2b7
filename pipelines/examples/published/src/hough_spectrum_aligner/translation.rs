//! Translations at which the projections of two maps correlate.

use super::WallCells;
use super::peak::{Peak, highest};
use nalgebra::{UnitComplex, Vector2};

/// A map's projection on an axis: how many occupied cells there are at each place along it. Carpin calls those on x and
/// y the X spectrum and the Y spectrum.
#[derive(Clone, Debug, PartialEq)]
pub struct Projection {
    /// The lower end of the first count, metres.
    pub start: f64,
    /// Counts, `cell` metres wide each.
    pub counts: Vec<u32>,
}

/// A translation along an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shift {
    /// Metres.
    pub metres: f64,
    /// Its standard deviation, metres.
    pub deviation: f64,
}

/// The projections of a map on the x and the y axis, turned by `angle` about its middle.
pub fn project(walls: &WallCells, angle: f64, cell: f64) -> [Projection; 2] {
    let turn = UnitComplex::new(angle);
    // A count more on either side, for what rounding moves over the edge.
    let half = (walls.radius / cell).ceil() + 1.0;
    let mut counts = [vec![0; 2 * half as usize], vec![0; 2 * half as usize]];
    for [x, y] in &walls.points {
        let turned = turn * Vector2::new(f64::from(*x), f64::from(*y)) / cell;
        for (place, counts) in [turned.x, turned.y].into_iter().zip(&mut counts) {
            if let Some(count) = counts.get_mut((place + half) as usize) {
                *count += 1;
            }
        }
    }
    counts.map(|counts| Projection { start: -half * cell, counts })
}

/// The translations of b along an axis at which the cross-correlation of both projections is highest, the best first,
/// at least `apart` metres from each other.
pub fn shifts(a: &Projection, b: &Projection, cell: f64, most: usize, apart: f64) -> Vec<Shift> {
    let (length_a, length_b) = (a.counts.len() as i64, b.counts.len() as i64);
    let correlation: Vec<f64> = (1 - length_b..length_a)
        .map(|shift| {
            let (from_a, from_b) = (shift.max(0) as usize, (-shift).max(0) as usize);
            let pairs = a.counts[from_a..].iter().zip(&b.counts[from_b..]);
            pairs.map(|(a, b)| u64::from(*a) * u64::from(*b)).sum::<u64>() as f64
        })
        .collect();
    let mean = correlation.iter().sum::<f64>() / correlation.len().max(1) as f64;
    let shift = |index: usize| {
        let value = |index: i64| {
            usize::try_from(index).ok().and_then(|index| correlation.get(index)).map_or(0.0, |value| *value)
        };
        let peak = Peak::at(index as i64, length_a.max(length_b), mean, value);
        let metres = a.start - b.start + (peak.place + (1 - length_b) as f64) * cell;
        Shift { metres, deviation: peak.deviation * cell }
    };
    highest(&correlation, most, apart / cell, None).into_iter().map(shift).collect()
}
