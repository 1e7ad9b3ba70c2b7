//! Lengths of the parameters in cells of one grid.

use super::parameters::LineExtractorParameters;

/// A straight wall of single cells at any angle is within this many cells of a line.
const LEAST_REACH: f64 = 0.75;

/// Lengths of the parameters in cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct CellLengths {
    /// See [`LineExtractorParameters::inlier_distance`].
    pub(super) reach: f64,
    /// See [`LineExtractorParameters::sampling_radius`].
    pub(super) sampling_radius: f64,
    /// See [`LineExtractorParameters::max_gap`].
    pub(super) max_gap: f64,
    /// See [`LineExtractorParameters::min_length`].
    pub(super) min_length: f64,
    /// See [`LineExtractorParameters::merge_distance`].
    pub(super) merge_distance: f64,
    /// Side of the buckets of cells: a quarter of the sampling radius.
    pub(super) bucket_side: f64,
}

impl CellLengths {
    /// The lengths for a grid of `resolution` metres a cell.
    pub(super) fn new(parameters: &LineExtractorParameters, resolution: f64) -> Self {
        // Cells of many metres, or of less than an atom, must not make a search endless or a radius empty.
        let cells = |metres: f64, least: f64| (metres / resolution).clamp(least, 1e6);
        let sampling_radius = cells(parameters.sampling_radius, 4.0);
        Self {
            reach: cells(parameters.inlier_distance, LEAST_REACH),
            sampling_radius,
            max_gap: cells(parameters.max_gap, 1.5),
            min_length: cells(parameters.min_length, 0.0),
            merge_distance: cells(parameters.merge_distance, 0.0),
            bucket_side: sampling_radius / 4.0,
        }
    }
}
