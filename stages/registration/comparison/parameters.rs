//! How two maps are compared.

/// Tolerances of a comparison; `merge_verifier` takes them from its own parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ComparisonParameters {
    /// Distance within which two walls agree, metres; never less than 1.5 cells of the coarser map.
    pub wall_tolerance: f64,
    /// Side of the square regions that are compared independently, metres.
    pub region: f64,
    /// Standard deviation of the shift of a region along x and along y, metres.
    pub region_deviation: f64,
    /// Deformation: standard deviation of the displacement of two points of a map against each other, metres per
    /// square root of a metre between them.
    pub bend: f64,
    /// The same for their turn, radians per square root of a metre.
    pub turn: f64,
}
