//! Parameters of the deformation of maps.

/// How far maps are deformed, and which walls are aligned with each other. All values are positive and finite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeformationParameters {
    /// Spacing of the nodes, metres: within such a distance a map counts as rigid.
    pub spacing: f64,
    /// Standard deviation of the displacement of two points of a map against each other, metres per square root of a
    /// metre between them.
    pub bend: f64,
    /// Standard deviation of the turn of two points of a map against each other, radians per square root of a metre
    /// between them.
    pub turn: f64,
    /// Largest distance of walls, with rigid maps, that are aligned with each other, metres.
    pub reach: f64,
}

impl Default for DeformationParameters {
    fn default() -> Self {
        Self { spacing: 3.0, bend: 0.05, turn: 0.01, reach: 2.0 }
    }
}
