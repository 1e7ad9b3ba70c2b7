//! Why two maps are not merged.

use super::Agreement;
use super::found_by_walls::CONFIRMING;
use std::fmt;

/// Maps that agree on less wall, metres, have nothing in common that could be contradicted.
const LITTLE_WALL: f64 = 4.0;

/// Why an alignment may not be used. The texts are for the people who run the robots: [`headline`](Self::headline) and
/// [`advice`](Self::advice) for those who look at many, and the whole for those who ask.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Refusal {
    /// The stage that sent it has refused it.
    #[error("{0}")]
    Before(String),
    /// Maps that have nothing to do with each other may agree as well.
    #[error(
        "{agree:.1} m of wall agree ({:.0} % of it beside the two straight walls that fix the place) and {against:.1} m lie on the other \
         map's free space, which may be chance: the place is right with a probability of {probability:.3}, and at least {accept} is \
         asked for (accept)",
        confirming * 100.0
    )]
    Chance {
        /// Metres of wall on which the maps agree.
        agree: f64,
        /// Metres of wall on free space.
        against: f64,
        /// The share of the walls that agree which confirm the place and do not only fix it; a half at least where something else
        /// tells it.
        confirming: f64,
        /// Whether walls alone tell it, and all that agree run one way.
        runs_one_way: bool,
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
         by {turn:.0} degrees from the best of them {:.0} % as much speaks for it",
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
    /// The building looks alike in two places.
    #[error(
        "the building looks alike in two places, and it cannot be told in which of them it is: a map agrees with itself {shift:.1} m and \
         {turn:.0} degrees away ({:.0} m of wall agree, {:.0} m do not), and with map b moved and turned by as much {:.0} m agree, and \
         {:.0} m do not",
        itself.wall_on_wall, itself.wall_on_free, there.wall_on_wall, there.wall_on_free
    )]
    Aliased {
        /// How far the other place is, metres.
        shift: f64,
        /// How much map b is turned there, degrees.
        turn: f64,
        /// What one of the maps says of itself.
        itself: Agreement,
        /// What the maps say of each other at the other place.
        there: Agreement,
    },
    /// It lies where the user knows the maps not to lie.
    #[error("it is {shift:.1} m and {turn:.0} degrees away from the initial poses, which is more than they allow")]
    Unexpected {
        /// How far it is from what is known, metres.
        shift: f64,
        /// How much map b is turned from what is known, degrees.
        turn: f64,
    },
    /// The user has chosen a hypothesis that is not there.
    #[error("hypothesis {asked} was asked for, and there are {count}")]
    NoSuchHypothesis {
        /// The number that was asked for.
        asked: usize,
        /// How many there are.
        count: usize,
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
    /// What was found, in a line; the whole where a stage before has refused it.
    pub fn headline(&self) -> String {
        match self {
            Self::Before(reason) => reason.clone(),
            Self::Chance { agree, confirming, .. } if *confirming < CONFIRMING => {
                let fixing = (1.0 - confirming) * agree;
                format!("{agree:.0} m of wall agree, but {fixing:.0} m of them are one corner, which many rooms have")
            }
            Self::Chance { agree, runs_one_way: true, .. } => {
                format!("{agree:.0} m of wall agree, but all run one way: the place along them is open")
            }
            Self::Chance { agree, against, .. } => {
                format!("{agree:.0} m of wall agree and {against:.0} m contradict, which may be chance")
            }
            Self::Contradiction { agree, .. } if *agree < LITTLE_WALL => {
                "there is no place at which the maps agree on more than a piece of wall".to_owned()
            }
            Self::Contradiction { agree, against, .. } => {
                format!("the maps contradict each other: {agree:.0} m of wall agree, {against:.0} m do not")
            }
            Self::Ambiguous { hypotheses: Hypotheses(all), .. } if all.len() > 1 => {
                format!("the maps fit at {} places, and it cannot be told which is right", all.len())
            }
            Self::Ambiguous { shift, turn, .. } => {
                format!("the maps fit nearly as well {shift:.1} m and {turn:.0} degrees from there")
            }
            Self::Aliased { shift, turn, .. } => {
                format!("the building looks alike {shift:.1} m and {turn:.0} degrees from there")
            }
            Self::Unexpected { shift, turn } => {
                format!("the maps fit {shift:.1} m and {turn:.0} degrees from the initial poses only")
            }
            Self::Elsewhere { source_of_rival, shift, .. } => {
                format!("the {source_of_rival} say {shift:.1} m away, where the maps fit far better")
            }
            Self::NoSuchHypothesis { asked, count } => {
                format!("hypothesis {asked} was asked for, and there are {count}")
            }
        }
    }

    /// What would help with robot b.
    pub fn advice(&self, b: &str) -> Option<String> {
        Some(match self {
            Self::Before(_) => return None,
            Self::Contradiction { agree, .. } if *agree < LITTLE_WALL => {
                "drive one robot on where the other was, or one tag seen by both".to_owned()
            }
            Self::Chance { .. } => {
                format!("drive on where the other was, one tag seen by both, or --initial {b}=X,Y,YAW")
            }
            Self::Contradiction { .. } => {
                format!("is it one floor, and nothing moved? Then --initial {b}=X,Y,YAW, or tags")
            }
            Self::Ambiguous { hypotheses: Hypotheses(all), .. } if all.len() > 1 => {
                format!("--accept {b}=N of these, --initial {b}=X,Y,YAW, or one common tag")
            }
            Self::Ambiguous { .. } | Self::Elsewhere { .. } => {
                format!("more tags that both have seen, or --initial {b}=X,Y,YAW")
            }
            Self::Aliased { .. } => format!("one tag seen by both, or --initial {b}=X,Y,YAW"),
            Self::Unexpected { .. } => format!("are the poses right? --initial {b}=X,Y,YAW,STDDEV widens them"),
            Self::NoSuchHypothesis { .. } => "leave --accept out to see which there are".to_owned(),
        })
    }
}

/// Places of map b in frame a, as people read them: a line each, numbered from 1.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Hypotheses(pub Vec<Hypothesis>);

/// One place of map b.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hypothesis {
    /// Translation of `T_a_b`, metres.
    pub x: f64,
    /// Translation of `T_a_b`, metres.
    pub y: f64,
    /// Rotation of `T_a_b`, radians.
    pub yaw: f64,
    /// Metres of wall that agree.
    pub wall_on_wall: f64,
    /// Metres of wall that lie on free space.
    pub wall_on_free: f64,
}

impl fmt::Display for Hypotheses {
    fn fmt(&self, text: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (number, Hypothesis { x, y, yaw, wall_on_wall, wall_on_free }) in (1..).zip(&self.0) {
            let place = format!("  {number}: x {x:.1}, y {y:.1}, yaw {yaw:.2} ({:.0} deg)", yaw.to_degrees());
            writeln!(text, "{place}: {wall_on_wall:.0} m of wall agree, {wall_on_free:.0} m do not")?;
        }
        Ok(())
    }
}
