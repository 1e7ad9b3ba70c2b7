//! The rotations at which the walls of two maps run alike.

use super::HoughSpectrum;
use super::peak::{Peak, highest};
use std::f64::consts::PI;

/// A rotation of map b on map a.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rotation {
    /// Radians, from 0 to pi; the opposite one is as good.
    pub angle: f64,
    /// Its standard deviation, radians.
    pub deviation: f64,
}

/// The circular cross-correlation of two Hough spectra: `CC(k)` = sum over i of `HS_a(i) HS_b(i - k)`. It is high where
/// map b, turned by `k * pi / count`, has walls that run as those of map a.
pub fn correlate_spectra(a: &HoughSpectrum, b: &HoughSpectrum) -> Vec<f64> {
    let (a, b) = (&a.values, &b.values);
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    (0..a.len().min(b.len()))
        .map(|shift| {
            let (end, start) = b.split_at(b.len() - shift);
            product(&a[..shift], start) + product(&a[shift..], end)
        })
        .collect()
}

/// The highest peaks of the cross-correlation of two spectra of equal length, the highest first, at least `apart`
/// radians from each other.
pub fn rotations(a: &HoughSpectrum, b: &HoughSpectrum, most: usize, apart: f64) -> Vec<Rotation> {
    let correlation = correlate_spectra(a, b);
    let count = correlation.len();
    let step = PI / count.max(1) as f64;
    let mean = correlation.iter().sum::<f64>() / count.max(1) as f64;
    let peaks = highest(&correlation, most, apart / step, Some(count as f64));
    let rotation = |index: usize| {
        let value = |index: i64| correlation[index.rem_euclid(count as i64) as usize];
        let peak = Peak::at(index as i64, count as i64 / 2, mean, value);
        Rotation { angle: (peak.place * step).rem_euclid(PI), deviation: peak.deviation * step }
    };
    peaks.into_iter().map(rotation).collect()
}
