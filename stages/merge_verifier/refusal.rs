//! Why two maps are not merged.

use super::{Agreement, Bounds};
use std::fmt;

/// Why an alignment may not be used. The texts are for the people who run the robots.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Refusal {
    /// The stage that sent it has refused it.
    #[error("{0}")]
    Before(String),
    /// The maps share too little.
    #[error("the maps overlap by {overlap:.0} m2, and at least {least:.0} m2 are needed")]
    Overlap {
        /// Area that both maps know, square metres.
        overlap: f64,
        /// What is asked for, square metres.
        least: f64,
    },
    /// Too little wall lies on wall.
    #[error("the maps agree on {length:.1} m of wall, and at least {least:.1} m are needed")]
    WallLength {
        /// Metres of wall on which the maps agree.
        length: f64,
        /// What is asked for, metres.
        least: f64,
    },
    /// Walls lie where the other map knows free space.
    #[error(
        "the maps contradict each other: {agree:.1} m of wall agree, but {against:.1} m of wall lie on the other map's \
         free space ({:.0} % agree, and at least {:.0} % are needed)",
        share * 100.0,
        least * 100.0
    )]
    WallAgreement {
        /// Metres of wall on which the maps agree.
        agree: f64,
        /// Metres of wall on free space.
        against: f64,
        /// The share that agrees, 0 to 1.
        share: f64,
        /// What is asked for, 0 to 1.
        least: f64,
    },
    /// The first guess is provisional, and the maps fit elsewhere nearly as well.
    #[error(
        "{:.0} % of the walls agree, but {:.0} % do with the map moved by {shift:.1} m and turned by {turn:.0} degrees, and \
         at least {:.0} % less are needed: it cannot be told which is right",
        share * 100.0,
        rival * 100.0,
        margin * 100.0
    )]
    Rival {
        /// The share of the walls that agree, 0 to 1.
        share: f64,
        /// The share that agrees elsewhere, 0 to 1.
        rival: f64,
        /// How far elsewhere is, metres.
        shift: f64,
        /// How much the map is turned there, degrees.
        turn: f64,
        /// By how much the share must be less, 0 to 1.
        margin: f64,
    },
    /// Another hypothesis fits nearly as well.
    #[error(
        "the maps fit at several places, and it cannot be told which is right: with map b moved by {shift:.1} m and turned \
         by {turn:.0} degrees from the best of them they fit {:.0} % as well, and at most {:.0} % are allowed; the hypotheses \
         are {hypotheses}",
        share * 100.0,
        most * 100.0
    )]
    Ambiguous {
        /// How far the other place is, metres.
        shift: f64,
        /// How much map b is turned there, degrees.
        turn: f64,
        /// The evidence for the other place, as a share of that for the best.
        share: f64,
        /// What is allowed.
        most: f64,
        /// All places.
        hypotheses: Hypotheses,
    },
    /// Another source has found a place at which the maps fit far better.
    #[error(
        "the evidence contradicts itself: the {source_of_rival} lay map b {shift:.1} m away and turned by {turn:.0} degrees, \
         where the maps fit far better ({rival:.0} m of wall agree, and {here:.0} m here)"
    )]
    Elsewhere {
        /// What the other place was found from.
        source_of_rival: String,
        /// How far it is, metres.
        shift: f64,
        /// How much map b is turned there, degrees.
        turn: f64,
        /// Metres of wall that agree there.
        rival: f64,
        /// Metres of wall that agree here.
        here: f64,
    },
}

impl Refusal {
    /// The first of some bounds that two maps do not meet, if there is one.
    pub(super) fn by_bounds(agreement: &Agreement, bounds: &Bounds) -> Option<Self> {
        let (agree, against, share) = (agreement.wall_on_wall, agreement.wall_on_free, agreement.wall_agreement());
        // Negated comparisons, so that a value that is no number refuses.
        let at_least = |value: f64, least: f64| value >= least;
        if !at_least(agreement.overlap, bounds.overlap) {
            Some(Self::Overlap { overlap: agreement.overlap, least: bounds.overlap })
        } else if !at_least(agree, bounds.wall_length) {
            Some(Self::WallLength { length: agree, least: bounds.wall_length })
        } else if !at_least(share, bounds.wall_agreement) {
            Some(Self::WallAgreement { agree, against, share, least: bounds.wall_agreement })
        } else {
            None
        }
    }
}

/// Places of map b in frame a, as people read them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Hypotheses(pub Vec<Hypothesis>);

/// One place of map b.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hypothesis {
    /// Translation of `T_a_b`, metres.
    pub x: f64,
    /// Translation of `T_a_b`, metres.
    pub y: f64,
    /// Rotation of `T_a_b`, degrees.
    pub yaw: f64,
    /// Evidence, metres of wall.
    pub evidence: f64,
}

impl fmt::Display for Hypotheses {
    fn fmt(&self, text: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (number, Hypothesis { x, y, yaw, evidence }) in self.0.iter().enumerate() {
            let comma = if number == 0 { "" } else { ", " };
            write!(text, "{comma}({x:.1} m, {y:.1} m, {yaw:.0} degrees: {evidence:.0} m of wall)")?;
        }
        Ok(())
    }
}
