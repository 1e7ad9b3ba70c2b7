//! Why two maps are not merged.

use super::{Alias, Candidate, Term};
use crate::registration::comparison::{Agreement, WallLengths};
use std::fmt;

/// Maps with a lesser inlier length, metres, are described as having nothing in common.
const LITTLE_WALL: f64 = 4.0;
/// Maps with a greater inlier ratio, which contradict each other all the same, do so in details.
const MOST_OF_THE_WALLS: f64 = 0.7;
/// Maps with a lesser share of inliers outside the two walls that fix the pose agree on one corner.
const LITTLE_ELSE: f64 = 0.5;

/// Why an alignment may not be used. The texts are for the user: [`headline`](Self::headline) and
/// [`advice`](Self::advice) are short, and the display text has all details.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Refusal {
    /// An earlier stage has refused it.
    #[error("{0}")]
    RefusedUpstream(String),
    /// The agreement may be by chance.
    #[error(
        "{:.1} m of wall agree ({:.0} % of it outside the two straight walls that fix the pose) and {:.1} m are on the other \
         map's free space, which may be chance: the probability of being right is {probability:.3}, and at least {accept} is \
         required (accept)",
        agreement.inlier_length, agreement.independent_share * 100.0, agreement.conflict_length
    )]
    Chance {
        /// Agreement of the maps.
        agreement: Agreement,
        /// The term by which it is most below a usual right hypothesis.
        weakest: Term,
        /// Probability that it is right.
        probability: f64,
        /// Probability required.
        accept: f64,
    },
    /// Walls of one map are on free space of the other.
    #[error(
        "the maps contradict each other: {:.1} m of wall agree, but {:.1} m of wall are on the other map's free space \
         ({:.0} % agree)",
        agreement.inlier_length, agreement.conflict_length, agreement.inlier_ratio() * 100.0
    )]
    Contradiction {
        /// Agreement of the maps.
        agreement: Agreement,
        /// The term by which it is most below a usual right hypothesis.
        weakest: Term,
    },
    /// Another hypothesis fits nearly as well.
    #[error(
        "the maps fit at several poses, and the evidence does not decide between them: the second-best pose, {shift:.1} m and \
         {turn:.0} degrees from the best, has a probability of {probability:.3}"
    )]
    Ambiguous {
        /// Distance of the other pose, metres.
        shift: f64,
        /// Rotation of map b to the other pose, degrees.
        turn: f64,
        /// Probability of the other pose.
        probability: f64,
        /// All hypotheses.
        listed: Listed,
    },
    /// The building is self-similar (perceptual aliasing).
    #[error(
        "the building is self-similar, and the evidence does not decide between two poses: a map agrees with itself {:.1} m and \
         {:.0} degrees away ({:.0} m of wall agree, {:.0} m do not); with map b moved by as much {:.0} m agree, and {:.0} m do not",
        alias.shift, alias.turn.to_degrees(), alias.itself.inlier_length, alias.itself.conflict_length,
        alias.there.inlier_length, alias.there.conflict_length
    )]
    Aliased {
        /// The other pose.
        alias: Alias,
    },
    /// The maps show one place, but no rigid transform fits them.
    #[error(
        "the maps fit at one pose only, but they are deformed by {rms:.2} m against each other, and {most:.2} m are allowed \
         (max_bend): at every rigid pose of map b, parts of it are off"
    )]
    Deformed {
        /// Root mean square of the displacement of points of map b from the nearest rigid pose, metres.
        rms: f64,
        /// Largest deformation allowed, metres.
        most: f64,
    },
    /// The initial poses do not allow it.
    #[error(
        "the pose is {shift:.1} m and {turn:.0} degrees away from the initial poses, which is more than they allow"
    )]
    OutsideWindow {
        /// Distance from the pose by the initial poses, metres.
        shift: f64,
        /// Rotation from the pose by the initial poses, degrees.
        turn: f64,
    },
    /// The user has chosen a hypothesis that does not exist.
    #[error("hypothesis {asked} was chosen, but there are only {count}")]
    NoSuchHypothesis {
        /// The number that was chosen.
        asked: usize,
        /// How many there are.
        count: usize,
    },
    /// Tags and maps propose different poses.
    #[error(
        "the evidence contradicts itself: the {other_source} propose a pose {shift:.1} m and {turn:.0} degrees away, where \
         {there:.0} m of wall agree, against {here:.0} m here"
    )]
    SourcesDisagree {
        /// Source of the other pose.
        other_source: String,
        /// Distance of the other pose, metres.
        shift: f64,
        /// Rotation of map b to the other pose, degrees.
        turn: f64,
        /// Inlier length at the other pose, metres.
        there: f64,
        /// Inlier length at this pose, metres.
        here: f64,
    },
}

/// One line for maps that may agree by chance, by the term which is the weakest.
fn chance(agreement: &Agreement, weakest: Term) -> String {
    let Agreement { inlier_length, conflict_length, independent_share, .. } = agreement;
    if agreement.constraints == 0 {
        return format!("{inlier_length:.0} m of wall agree, but all are parallel: the position along them is open");
    }
    match weakest {
        Term::Constraints if *independent_share < LITTLE_ELSE => {
            let fixing = (1.0 - independent_share) * inlier_length;
            format!(
                "{inlier_length:.0} m of wall agree, but {fixing:.0} m of them are one corner, which many rooms have"
            )
        }
        Term::PeakSignificance => {
            format!("{inlier_length:.0} m of wall agree, and nearly as much at other poses: it may be chance")
        }
        Term::MarginOverChance => {
            format!("{inlier_length:.0} m of wall agree, which is little more than walls like these do by chance")
        }
        _ => format!("{inlier_length:.0} m of wall agree and {conflict_length:.0} m contradict, which may be chance"),
    }
}

/// One line for maps that contradict each other, by the term which is the weakest.
fn contradiction(agreement: &Agreement, weakest: Term) -> String {
    if weakest == Term::ThingsOnOpenFloor && agreement.inlier_ratio() >= MOST_OF_THE_WALLS {
        let metres = agreement.details.on_open_floor;
        return format!("the walls agree, but {metres:.0} m of furniture stand where the other map has open floor");
    }
    if agreement.details.contradict() && agreement.inlier_ratio() >= MOST_OF_THE_WALLS {
        let WallLengths { inlier, conflict } = agreement.details.segments;
        return format!(
            "the long walls agree, but of furniture and short walls {inlier:.0} m do, {conflict:.0} m do not"
        );
    }
    let Agreement { inlier_length, conflict_length, .. } = agreement;
    format!("the maps contradict each other: {inlier_length:.0} m of wall agree, {conflict_length:.0} m do not")
}

impl Refusal {
    /// One line for the user; the whole reason if an earlier stage has refused it.
    pub fn headline(&self) -> String {
        match self {
            Self::RefusedUpstream(reason) => reason.clone(),
            Self::Chance { agreement, .. } | Self::Contradiction { agreement, .. }
                if agreement.inlier_length < LITTLE_WALL =>
            {
                "at no pose do the maps agree on more than a few metres of wall".to_owned()
            }
            Self::Chance { agreement, weakest, .. } => chance(agreement, *weakest),
            Self::Contradiction { agreement, weakest } => contradiction(agreement, *weakest),
            Self::Ambiguous { listed: Listed(all), .. } if all.len() > 1 => {
                format!("the maps fit at {} poses, and the evidence does not decide which is right", all.len())
            }
            Self::Ambiguous { shift, turn, .. } => {
                format!("the maps fit nearly as well {shift:.1} m and {turn:.0} degrees away")
            }
            Self::Aliased { alias: Alias { shift, turn, .. } } => {
                format!("the building is self-similar {shift:.1} m and {:.0} degrees away", turn.to_degrees())
            }
            Self::Deformed { rms, .. } => {
                format!("the maps belong together, but are deformed by {rms:.1} m against each other")
            }
            Self::OutsideWindow { shift, turn } => {
                format!("the maps fit {shift:.1} m and {turn:.0} degrees from the initial poses only")
            }
            Self::SourcesDisagree { other_source, shift, .. } => {
                format!("the {other_source} propose a pose {shift:.1} m away, where the maps fit better")
            }
            Self::NoSuchHypothesis { asked, count } => {
                format!("hypothesis {asked} was chosen, but there are only {count}")
            }
        }
    }

    /// What the user can do about robot b.
    pub fn advice(&self, b: &str) -> Option<String> {
        Some(match self {
            Self::RefusedUpstream(_) => return None,
            Self::Contradiction { agreement, .. } | Self::Chance { agreement, .. }
                if agreement.inlier_length < LITTLE_WALL =>
            {
                "let one robot drive where the other was, or let both see one tag".to_owned()
            }
            Self::Chance { .. } => {
                format!("drive where the other was, let both see one tag, or --initial {b}=X,Y,YAW")
            }
            Self::Contradiction { .. } => {
                format!("is it one floor, and nothing moved? Then --initial {b}=X,Y,YAW, or tags")
            }
            Self::Ambiguous { listed: Listed(all), .. } if all.len() > 1 => {
                format!("--accept {b}=N of these, --initial {b}=X,Y,YAW, or one common tag")
            }
            Self::Ambiguous { .. } | Self::SourcesDisagree { .. } => {
                format!("more tags that both have seen, or --initial {b}=X,Y,YAW")
            }
            Self::Deformed { .. } => {
                "close loops in the SLAM of one robot, or allow it with --set verifier.max_bend=1".to_owned()
            }
            Self::Aliased { .. } => format!("let both robots see one tag, or --initial {b}=X,Y,YAW"),
            Self::OutsideWindow { .. } => format!("are the poses right? --initial {b}=X,Y,YAW,STDDEV widens them"),
            Self::NoSuchHypothesis { .. } => "run without --accept to list them".to_owned(),
        })
    }
}

/// Hypotheses as they are listed for the user: one line each, numbered from 1.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Listed(pub Vec<ListedHypothesis>);

/// One hypothesis of the list.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ListedHypothesis {
    /// Translation of `T_a_b`, metres.
    pub x: f64,
    /// Translation of `T_a_b`, metres.
    pub y: f64,
    /// Rotation of `T_a_b`, radians.
    pub yaw: f64,
    /// Inlier length, metres.
    pub inlier_length: f64,
    /// Conflict length, metres.
    pub conflict_length: f64,
}

impl Listed {
    /// Lists candidates.
    pub(super) fn of(all: &[Candidate]) -> Self {
        let listed = |candidate: &Candidate| {
            let transform = candidate.hypothesis.transform_a_b;
            let (x, y, yaw) = (transform.translation.x, transform.translation.y, transform.rotation.angle());
            let Agreement { inlier_length, conflict_length, .. } = candidate.agreement;
            ListedHypothesis { x, y, yaw, inlier_length, conflict_length }
        };
        Self(all.iter().map(listed).collect())
    }
}

impl fmt::Display for Listed {
    fn fmt(&self, text: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (number, ListedHypothesis { x, y, yaw, inlier_length, conflict_length }) in (1..).zip(&self.0) {
            let listed = format!("  {number}: x {x:.1}, y {y:.1}, yaw {yaw:.2} ({:.0} deg)", yaw.to_degrees());
            writeln!(text, "{listed}: {inlier_length:.0} m of wall agree, {conflict_length:.0} m do not")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registration::comparison::Details;

    #[test]
    fn a_place_whose_long_walls_agree_and_whose_details_do_not_is_called_so() {
        let segments = WallLengths { inlier: 3.0, conflict: 9.0 };
        let agreement = |inlier_length: f64| Agreement {
            inlier_length,
            conflict_length: 20.0,
            details: Details { segments, on_open_floor: 6.2, ..Details::default() },
            ..Agreement::default()
        };
        let headline = |inlier_length: f64, weakest: Term| {
            Refusal::Contradiction { agreement: agreement(inlier_length), weakest }.headline()
        };
        let details = "the long walls agree, but of furniture and short walls 3 m do, 9 m do not";
        assert_eq!(headline(90.0, Term::ShortSegments), details);
        let things = "the walls agree, but 6 m of furniture stand where the other map has open floor";
        assert_eq!(headline(90.0, Term::ThingsOnOpenFloor), things);
        let maps = "the maps contradict each other: 25 m of wall agree, 20 m do not";
        assert_eq!(headline(25.0, Term::ThingsOnOpenFloor), maps);
    }

    #[test]
    fn maps_that_agree_on_more_than_a_corner_are_not_said_to_agree_on_one() {
        let headline = |independent_share: f64| {
            let agreement = Agreement {
                inlier_length: 11.0,
                conflict_length: 2.0,
                constraints: 2,
                independent_share,
                ..Agreement::default()
            };
            Refusal::Chance { agreement, weakest: Term::Constraints, probability: 0.8, accept: 0.98 }.headline()
        };
        assert_eq!(headline(0.1), "11 m of wall agree, but 10 m of them are one corner, which many rooms have");
        assert_eq!(headline(0.6), "11 m of wall agree and 2 m contradict, which may be chance");
    }
}
