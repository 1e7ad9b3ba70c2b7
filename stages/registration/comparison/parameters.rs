//! How two maps are compared.

/// The tolerances of a comparison: `merge_verifier` takes them from its own parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ComparisonParameters {
    /// Two walls agree when they lie within this distance, metres; never less than 1.5 cells of the coarser map.
    pub wall_tolerance: f64,
    /// The side of the squares that are compared one by one, metres.
    pub region: f64,
    /// Standard deviation of how far a square is moved along x and along y, metres.
    pub region_deviation: f64,
    /// Standard deviation of the displacement of two places of a map against each other, metres for the root of each metre between them.
    pub bend: f64,
    /// The same of their turn, radians.
    pub turn: f64,
}
