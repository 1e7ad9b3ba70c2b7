//! The terms of the log-odds.

use super::weights::{INTERCEPT, WEIGHTS};
use crate::registration::comparison::Agreement;

/// Least independent share of the inliers for the other terms to count in full: two walls fit any corner.
const FULL_SHARE: f64 = 0.5;
/// Beyond this the model of chance itself is in doubt.
const MOST_SIGNIFICANCE: f64 = 300.0;
/// Least standard deviation of a position, metres.
const LEAST_DEVIATION: f64 = 0.01;
/// A larger common area is no further evidence, square metres.
const MOST_AREA: f64 = 500.0;

/// The number of terms.
pub const COUNT: usize = 8;

/// A term of the log-odds that a hypothesis is right.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Term {
    /// Logarithm of the peak significance.
    PeakSignificance,
    /// Margin of the peak over what chance reaches, as a share of it.
    MarginOverChance,
    /// Logarithm of the largest standard deviation of the position over all directions, metres.
    Deviation,
    /// Logarithm of the area that both maps know.
    CommonArea,
    /// Logarithm of the number of independent constraints in the weaker direction.
    Constraints,
    /// Logarithm of the number of straight walls that contradict the other map, of the map that has fewer.
    ConflictingWalls,
    /// Logarithm of the ratio of inliers to conflicts of short straight segments.
    ShortSegments,
    /// Logarithm of the length of the things of either map that stand on open floor of the other one.
    ThingsOnOpenFloor,
}

impl Term {
    /// All terms, in the order of [`Terms`].
    pub const ALL: [Self; COUNT] = [
        Self::PeakSignificance,
        Self::MarginOverChance,
        Self::Deviation,
        Self::CommonArea,
        Self::Constraints,
        Self::ConflictingWalls,
        Self::ShortSegments,
        Self::ThingsOnOpenFloor,
    ];

    /// Name in the explanation of a decision and in the tables of the fit.
    pub fn name(self) -> &'static str {
        match self {
            Self::PeakSignificance => "peak significance",
            Self::MarginOverChance => "margin over chance",
            Self::Deviation => "standard deviation of the position",
            Self::CommonArea => "common area",
            Self::Constraints => "constraints in the weaker direction",
            Self::ConflictingWalls => "walls in conflict",
            Self::ShortSegments => "short pieces of wall",
            Self::ThingsOnOpenFloor => "things on open floor",
        }
    }

    /// The sign that its weight must have.
    pub fn sign(self) -> f64 {
        match self {
            Self::PeakSignificance
            | Self::MarginOverChance
            | Self::CommonArea
            | Self::Constraints
            | Self::ShortSegments => 1.0,
            Self::Deviation | Self::ConflictingWalls | Self::ThingsOnOpenFloor => -1.0,
        }
    }
}

/// Values of all terms for a hypothesis, in the order of [`Term::ALL`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Terms(pub [f64; COUNT]);

impl Terms {
    /// Terms of a hypothesis with a peak significance and a margin over chance, the standard deviation of its position,
    /// metres, and the agreement of the maps.
    pub fn new((significance, margin): (f64, f64), deviation: f64, agreement: &Agreement) -> Self {
        let Agreement { overlap, conflicting_walls, independent_share, constraints, details, .. } = *agreement;
        let confirmed = (independent_share / FULL_SHARE).min(1.0);
        Self([
            confirmed * significance.clamp(0.0, MOST_SIGNIFICANCE).ln_1p(),
            margin,
            (LEAST_DEVIATION + deviation).min(1.0).ln(),
            confirmed * overlap.clamp(1.0, MOST_AREA).ln(),
            (constraints as f64).ln_1p(),
            (conflicting_walls as f64).ln_1p(),
            details.segments.log_ratio(),
            details.on_open_floor.ln_1p(),
        ])
    }

    /// Contribution of each term to the log-odds.
    pub fn contributions(&self) -> [f64; COUNT] {
        // Not -0.
        std::array::from_fn(|index| WEIGHTS[index] * self.0[index] + 0.0)
    }

    /// Log-odds from the maps.
    pub fn log_odds(&self) -> f64 {
        INTERCEPT + self.contributions().iter().sum::<f64>()
    }
}
