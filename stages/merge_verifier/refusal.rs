//! Why two maps are not merged.

use std::fmt;

/// Why an alignment may not be used. The texts are for the people who run the robots.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Refusal {
    /// The stage that sent it has refused it.
    #[error("{0}")]
    Before(String),
    /// Maps that have nothing to do with each other may agree as well.
    #[error(
        "{agree:.1} m of wall agree and {against:.1} m lie on the other map's free space, which may be chance: the place is right \
         with a probability of {probability:.3}, and at least {accept} is asked for (accept)"
    )]
    Chance {
        /// Metres of wall on which the maps agree.
        agree: f64,
        /// Metres of wall on free space.
        against: f64,
        /// The probability that it is right.
        probability: f64,
        /// What is asked for.
        accept: f64,
    },
    /// Walls lie where the other map knows free space.
    #[error(
        "the maps contradict each other: {agree:.1} m of wall agree, but {against:.1} m of wall lie on the other map's \
         free space ({:.0} % agree)",
        share * 100.0
    )]
    Contradiction {
        /// Metres of wall on which the maps agree.
        agree: f64,
        /// Metres of wall on free space.
        against: f64,
        /// The share that agrees, 0 to 1.
        share: f64,
    },
    /// Another hypothesis fits nearly as well.
    #[error(
        "the maps fit at several places, and it cannot be told which is right: with map b moved by {shift:.1} m and turned \
         by {turn:.0} degrees from the best of them {:.0} % as much speaks for it; the hypotheses are {hypotheses}",
        share * 100.0
    )]
    Ambiguous {
        /// How far the other place is, metres.
        shift: f64,
        /// How much map b is turned there, degrees.
        turn: f64,
        /// The evidence for the other place, as a share of that for the best.
        share: f64,
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
    /// Metres of wall that agree.
    pub wall_on_wall: f64,
}

impl fmt::Display for Hypotheses {
    fn fmt(&self, text: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (number, Hypothesis { x, y, yaw, wall_on_wall }) in self.0.iter().enumerate() {
            let comma = if number == 0 { "" } else { ", " };
            write!(text, "{comma}({x:.1} m, {y:.1} m, {yaw:.0} degrees: {wall_on_wall:.0} m of wall)")?;
        }
        Ok(())
    }
}
