//! Why two maps are not merged.

use super::{Alias, Candidate, Term};
use crate::registration::comparison::Agreement;
use std::fmt;

/// Maps that agree on less wall, metres, have nothing in common that could be contradicted: it only chooses the words.
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
        "{:.1} m of wall agree ({:.0} % of it beside the two straight walls that fix the place) and {:.1} m lie on the other \
         map's free space, which may be chance: the place is right with a probability of {probability:.3}, and at least {accept} is \
         asked for (accept)",
        agreement.inlier_length, agreement.independent_share * 100.0, agreement.conflict_length
    )]
    Chance {
        /// What the maps say of each other.
        agreement: Agreement,
        /// The term by which it falls short most of a usual right place.
        weakest: Term,
        /// The probability that it is right.
        probability: f64,
        /// What is asked for.
        accept: f64,
    },
    /// Walls lie where the other map knows free space.
    #[error(
        "the maps contradict each other: {:.1} m of wall agree, but {:.1} m of wall lie on the other map's free space \
         ({:.0} % agree)",
        agreement.inlier_length, agreement.conflict_length, agreement.inlier_ratio() * 100.0
    )]
    Contradiction {
        /// What the maps say of each other.
        agreement: Agreement,
    },
    /// Another hypothesis fits nearly as well.
    #[error(
        "the maps fit at several places, and none can be told from the others: with map b moved by {shift:.1} m and turned \
         by {turn:.0} degrees from the best of them the probability is {probability:.3}"
    )]
    Ambiguous {
        /// How far the other place is, metres.
        shift: f64,
        /// How much map b is turned there, degrees.
        turn: f64,
        /// How probable the other place is.
        probability: f64,
        /// All places.
        listed: Listed,
    },
    /// The building looks alike in two places.
    #[error(
        "the building looks alike in two places, and they cannot be told from each other: a map agrees with itself {:.1} m and \
         {:.0} degrees away ({:.0} m of wall agree, {:.0} m do not), and with map b moved and turned by as much {:.0} m agree, and \
         {:.0} m do not",
        alias.shift, alias.turn.to_degrees(), alias.itself.inlier_length, alias.itself.conflict_length,
        alias.there.inlier_length, alias.there.conflict_length
    )]
    Aliased {
        /// The other place.
        alias: Alias,
    },
    /// It is the place, but no rigid frame fits it.
    #[error(
        "the maps fit at one place only, but they are bent by {bend:.2} m against each other, and {most:.2} m are allowed (max_bend): \
         wherever map b is laid as a whole, parts of it lie beside their place"
    )]
    Bent {
        /// The root mean square of how far places of map b lie beside the nearest rigid place, metres.
        bend: f64,
        /// What is allowed, metres.
        most: f64,
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
    /// Tags and maps propose different places.
    #[error(
        "the evidence contradicts itself: the {source_of_rival} lay map b {shift:.1} m away and turned by {turn:.0} degrees, \
         where {rival:.0} m of wall agree, and {here:.0} m here"
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
            Self::Chance { agreement, .. } if agreement.inlier_length < LITTLE_WALL => {
                "there is no place at which the maps agree on more than a piece of wall".to_owned()
            }
            Self::Chance { agreement, weakest: Term::IndependentInliers, .. } => {
                let Agreement { inlier_length, independent_share, .. } = agreement;
                let fixing = (1.0 - independent_share) * inlier_length;
                format!(
                    "{inlier_length:.0} m of wall agree, but {fixing:.0} m of them are one corner, which many rooms have"
                )
            }
            Self::Chance { agreement, .. } if agreement.constraints == 0 => {
                format!(
                    "{:.0} m of wall agree, but all run one way: the place along them is open",
                    agreement.inlier_length
                )
            }
            Self::Chance { agreement, weakest: Term::PeakSignificance, .. } => {
                let Agreement { inlier_length, .. } = agreement;
                format!("{inlier_length:.0} m of wall agree, and nearly as much at other places: it may be chance")
            }
            Self::Chance { agreement, .. } => {
                let Agreement { inlier_length, conflict_length, .. } = agreement;
                format!("{inlier_length:.0} m of wall agree and {conflict_length:.0} m contradict, which may be chance")
            }
            Self::Contradiction { agreement } if agreement.inlier_length < LITTLE_WALL => {
                "there is no place at which the maps agree on more than a piece of wall".to_owned()
            }
            Self::Contradiction { agreement } => {
                let Agreement { inlier_length, conflict_length, .. } = agreement;
                format!(
                    "the maps contradict each other: {inlier_length:.0} m of wall agree, {conflict_length:.0} m do not"
                )
            }
            Self::Ambiguous { listed: Listed(all), .. } if all.len() > 1 => {
                format!("the maps fit at {} places, and it cannot be told which is right", all.len())
            }
            Self::Ambiguous { shift, turn, .. } => {
                format!("the maps fit nearly as well {shift:.1} m and {turn:.0} degrees from there")
            }
            Self::Aliased { alias: Alias { shift, turn, .. } } => {
                format!("the building looks alike {shift:.1} m and {:.0} degrees from there", turn.to_degrees())
            }
            Self::Bent { bend, .. } => {
                format!("the maps belong together, but are bent by {bend:.1} m against each other")
            }
            Self::Unexpected { shift, turn } => {
                format!("the maps fit {shift:.1} m and {turn:.0} degrees from the initial poses only")
            }
            Self::Elsewhere { source_of_rival, shift, .. } => {
                format!("the {source_of_rival} say {shift:.1} m away, where the maps fit better")
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
            Self::Contradiction { agreement } | Self::Chance { agreement, .. }
                if agreement.inlier_length < LITTLE_WALL =>
            {
                "drive one robot on where the other was, or one tag seen by both".to_owned()
            }
            Self::Chance { .. } => {
                format!("drive on where the other was, one tag seen by both, or --initial {b}=X,Y,YAW")
            }
            Self::Contradiction { .. } => {
                format!("is it one floor, and nothing moved? Then --initial {b}=X,Y,YAW, or tags")
            }
            Self::Ambiguous { listed: Listed(all), .. } if all.len() > 1 => {
                format!("--accept {b}=N of these, --initial {b}=X,Y,YAW, or one common tag")
            }
            Self::Ambiguous { .. } | Self::Elsewhere { .. } => {
                format!("more tags that both have seen, or --initial {b}=X,Y,YAW")
            }
            Self::Bent { .. } => {
                "close loops in the SLAM of one robot, or allow it with --set verifier.max_bend=1".to_owned()
            }
            Self::Aliased { .. } => format!("one tag seen by both, or --initial {b}=X,Y,YAW"),
            Self::Unexpected { .. } => format!("are the poses right? --initial {b}=X,Y,YAW,STDDEV widens them"),
            Self::NoSuchHypothesis { .. } => "leave --accept out to see which there are".to_owned(),
        })
    }
}

/// Places of map b in frame a, as people read them: a line each, numbered from 1.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Listed(pub Vec<ListedPlace>);

/// One place of map b.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ListedPlace {
    /// Translation of `T_a_b`, metres.
    pub x: f64,
    /// Translation of `T_a_b`, metres.
    pub y: f64,
    /// Rotation of `T_a_b`, radians.
    pub yaw: f64,
    /// Metres of wall that agree.
    pub inlier_length: f64,
    /// Metres of wall that lie on free space.
    pub conflict_length: f64,
}

impl Listed {
    /// The places of candidates.
    pub(super) fn of(all: &[Candidate]) -> Self {
        let place = |candidate: &Candidate| {
            let transform = candidate.hypothesis.transform_a_b;
            let (x, y, yaw) = (transform.translation.x, transform.translation.y, transform.rotation.angle());
            let Agreement { inlier_length, conflict_length, .. } = candidate.agreement;
            ListedPlace { x, y, yaw, inlier_length, conflict_length }
        };
        Self(all.iter().map(place).collect())
    }
}

impl fmt::Display for Listed {
    fn fmt(&self, text: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (number, ListedPlace { x, y, yaw, inlier_length, conflict_length }) in (1..).zip(&self.0) {
            let place = format!("  {number}: x {x:.1}, y {y:.1}, yaw {yaw:.2} ({:.0} deg)", yaw.to_degrees());
            writeln!(text, "{place}: {inlier_length:.0} m of wall agree, {conflict_length:.0} m do not")?;
        }
        Ok(())
    }
}
