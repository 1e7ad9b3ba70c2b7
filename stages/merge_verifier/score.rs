//! How probable it is that an alignment is right.
//!
//! There are three ways to be wrong, and what is left of certainty after all is the probability:
//!
//! - **by chance**: maps that have nothing to do with each other, or parts of one map that do not, agree somewhere. The
//!   more places were looked at, the better they agree at the best. How well that is, the other places of the same pair tell:
//!   by extreme value theory the best of many alike leads the next by as many units of their spread as an exponential variable
//!   has, so that a lead of `t` has the probability `exp(-t)` by chance (Gumbel 1958); and the evidence of walls in places that
//!   do not depend on each other counts against it. But two straight walls fix a place, and any corner fits any other: what
//!   walls alone have found counts as far as others confirm it.
//! - **by likeness**: the building is alike in several parts, and the maps fit in another one nearly as well.
//! - **in part**: the maps agree in much and contradict each other in as much, as two floors of one building do. Where a
//!   search over all places has come to this one, agreement must clearly be more than half, or than two fifths where this one
//!   leads all others by far more than chance does; of much wall, seven tenths to five sixths, as parts of one building that are
//!   alike agree on much and contradict each other on as much. So do rows of rooms of one depth, of buildings that have nothing
//!   else in common: where what contradicts does not lie beside a wall that runs alike, as a bend or a rough drawing leaves it, it
//!   is three quarters of less wall, too. Where the maps share no more than a room, it is nearly all: rooms of other buildings have
//!   the same corners and sizes, while a map is right in every room, however it is bent as a whole. Where one map was bent onto the
//!   other they must agree in more: a bend lays what is of one place on each other, and changes little elsewhere. Tags have not
//!   looked at walls, and ask for more of them. Where enough tags and a search that has not looked at tags have come to the same
//!   place, each by itself, it is one building and one floor, and two fifths are enough: what contradicts is a bend that is too
//!   fine to be undone, or was moved.
//!
//! How unlikely a bend is counts against chance like evidence: bends and walls are measured in the same units.
//!
//! The form is that of a logistic model. Its weights were chosen on pairs of published maps, of recorded logs and of unrelated
//! buildings, which `tests/experiments/README.md` names; on other maps they have not been judged. What comes out orders
//! alignments by how sure they are, and is a probability only as far as those pairs stand for others.

/// The logarithm of the odds of an alignment for which nothing speaks.
const PRIOR: f64 = -5.0;
/// Per unit of the evidence of walls: much less than 1, as walls of a building depend on each other.
const BY_EVIDENCE: f64 = 0.2;
/// Per unit of the lead.
const BY_LEAD: f64 = 1.0;
/// So large a share of the walls that agree must confirm a place that was found by the walls alone, and not only fix it, for them to
/// count in full; and none of them counts where none confirms it.
pub(super) const CONFIRMING: f64 = 0.4;
/// No lead says more: from there on the model of chance itself is in doubt.
const MOST_LEAD: f64 = 10.0;
/// The lead of a place that enough tags, which agree with each other, tell by themselves.
const LEAD_OF_TAGS: f64 = 10.0;
/// The lead of a place that too few tags tell to be believed alone, and what another source adds that has found the same.
const LEAD_OF_FEW_TAGS: f64 = 5.0;
/// The share of the evidence that a rival has where it is as likely to be right, if nothing else tells them apart.
const LIKE_SHARE: f64 = 0.7;
/// The same where tags speak for one of the two.
const LIKE_SHARE_BESIDE_TAGS: f64 = 1.3;
/// Per unit of that share.
const BY_SHARE: f64 = 35.0;
/// At the most, where the rival agrees in a smaller share of its walls than this place, and by how much smaller it begins to
/// count and counts most: what contradicts itself more is less like.
const BY_WORSE_AGREEMENT: f64 = 5.0;
const WORSE_AGREEMENT: (f64, f64) = (0.1, 0.25);

/// The share of the walls that agree at which a place that a search has found is as likely to be half of it only.
const AGREEMENT_OF_HALVES: f64 = 0.5;
/// The same where the place leads all others as chance brings about in one of twenty thousand pairs: it is one building then, and
/// what contradicts is a bend, or was moved. And from which lead on that begins to count, and from which on it counts in full.
const AGREEMENT_OF_HALVES_IF_FAR_AHEAD: f64 = 0.4;
const FAR_AHEAD: (f64, f64) = (5.0, 10.0);
/// The same where much wall was seen, for any length of it: what was moved and drawn roughly has evened out, and what is left speaks
/// against it. What less wall tells is known less well: so much more of it must agree, divided by the root of its metres.
const AGREEMENT_OF_HALVES_OF_MUCH_WALL: f64 = 0.62;
const MORE_OF_LESS_WALL: f64 = 1.6;
/// From how much wall on that begins to count, and from how much on it counts in full, metres that both maps have seen.
const MUCH_WALL: (f64, f64) = (60.0, 80.0);
/// The same of less wall where next to none of what contradicts lies beside a wall that runs alike: nothing is drawn roughly or bent there, and
/// the walls are others. And of which share of it on that begins to count for less, and from which on not at all.
const AGREEMENT_OF_HALVES_OF_OTHER_WALLS: f64 = 0.75;
const DRAWN_BESIDE: (f64, f64) = (0.1, 0.2);
/// The same where one map is bent onto the other: what was only bent agrees in nearly all then, and unrelated maps agree in
/// little more than before.
pub(super) const AGREEMENT_OF_HALVES_IF_BENT: f64 = 0.7;
/// The same where the user knows the place, or tags and a search over all places tell the same: it is one building, and what
/// contradicts is a bend, or was moved.
const AGREEMENT_OF_HALVES_WHERE_KNOWN: f64 = 0.4;
/// The same where the maps share the area of one room.
const AGREEMENT_OF_HALVES_IN_A_ROOM: f64 = 0.9;
/// The same for a place that tags tell.
const AGREEMENT_OF_HALVES_BY_TAGS: f64 = 0.75;
/// Per unit of that share.
const BY_AGREEMENT: f64 = 140.0;
/// So large is a room at the most, and so large is the area that the maps share if it is surely more than a room, square metres.
const ROOM: (f64, f64) = (40.0, 60.0);

/// What makes places stand out from all others, before the maps are compared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Origin {
    /// A search over all places; how far this one leads the others, in units of their spread.
    Search {
        /// The lead.
        lead: f64,
    },
    /// Enough tags.
    Tags,
    /// Few tags.
    FewTags,
}

impl Origin {
    /// The lead that it stands for, if another source tells the same or not.
    fn lead(self, is_told_too: bool) -> f64 {
        let own = match self {
            Self::Search { lead } => lead,
            Self::Tags => LEAD_OF_TAGS,
            Self::FewTags => LEAD_OF_FEW_TAGS,
        };
        let more = if is_told_too { LEAD_OF_FEW_TAGS } else { 0.0 };
        (own + more).clamp(0.0, MOST_LEAD)
    }
}

/// What an alignment is judged by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grounds {
    /// What it was found from.
    pub origin: Origin,
    /// Whether another source has found the same.
    pub found_too: bool,
    /// Whether enough tags tell it, and a search over all places has come to the same first.
    pub found_by_tags_and_walls: bool,
    /// Whether the user knows about where the maps lie, and it is there.
    pub is_expected: bool,
    /// The evidence of walls, see [`Agreement`](super::Agreement).
    pub evidence: f64,
    /// The share of the walls that agree, 0 to 1.
    pub wall_agreement: f64,
    /// The share of the walls that contradict which lie beside a wall that runs alike, 0 to 1.
    pub drawn_beside: f64,
    /// The share of the walls that agree which confirm the place and do not only fix it, 0 to 1. What tags or the user tell is not
    /// fixed by walls, and all of them confirm it.
    pub confirming: f64,
    /// Length of wall of one map of which the other knows what is there, metres.
    pub wall_seen: f64,
    /// The area that both maps know, square metres.
    pub overlap: f64,
    /// If the maps agree as they are bent: how unlikely such a bend is, see [`BentPlace`](super::BentPlace).
    pub bend_cost: Option<f64>,
    /// The most evidence at another place, as a share of that here.
    pub evidence_elsewhere: f64,
    /// The share of the walls that agree there, 0 to 1.
    pub agreement_elsewhere: f64,
}

/// The odds, as logarithms, that an alignment is not wrong in one way each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Odds {
    /// Against chance.
    pub chance: f64,
    /// Against a place that is like it.
    pub likeness: f64,
    /// Against a place at which the maps agree in part.
    pub part: f64,
}

impl Odds {
    /// Of an alignment.
    pub fn new(grounds: &Grounds) -> Self {
        let Grounds {
            origin,
            found_too,
            found_by_tags_and_walls,
            is_expected,
            evidence,
            wall_agreement,
            drawn_beside,
            confirming,
            wall_seen,
            overlap,
            bend_cost,
            evidence_elsewhere,
            agreement_elsewhere,
        } = *grounds;
        // Tags, and another source, tell a place from those that are like it.
        let is_told = origin == Origin::Tags || found_too;
        let like = if is_told { LIKE_SHARE_BESIDE_TAGS } else { LIKE_SHARE };
        let (from, most) = WORSE_AGREEMENT;
        let worse = (wall_agreement - agreement_elsewhere - from) / (most - from);
        let halves = match origin {
            _ if found_by_tags_and_walls => AGREEMENT_OF_HALVES_WHERE_KNOWN,
            Origin::Search { .. } if is_expected => AGREEMENT_OF_HALVES_WHERE_KNOWN,
            Origin::Search { lead } => {
                let share_of_room = 1.0 - share_of_way(overlap, ROOM);
                let of_little =
                    between(AGREEMENT_OF_HALVES, AGREEMENT_OF_HALVES_IF_FAR_AHEAD, share_of_way(lead, FAR_AHEAD));
                let in_rooms = match bend_cost {
                    Some(_) => AGREEMENT_OF_HALVES_IF_BENT,
                    None => {
                        let share_of_drawn = share_of_way(drawn_beside, DRAWN_BESIDE);
                        let of_little = between(AGREEMENT_OF_HALVES_OF_OTHER_WALLS, of_little, share_of_drawn);
                        let of_much = AGREEMENT_OF_HALVES_OF_MUCH_WALL + MORE_OF_LESS_WALL / wall_seen.max(1.0).sqrt();
                        between(of_little, of_much, share_of_way(wall_seen, MUCH_WALL))
                    }
                };
                between(in_rooms, AGREEMENT_OF_HALVES_IN_A_ROOM, share_of_room)
            }
            Origin::Tags | Origin::FewTags => AGREEMENT_OF_HALVES_BY_TAGS,
        };
        let confirmed = share_of_way(confirming, (0.0, CONFIRMING));
        let by_walls = BY_EVIDENCE * (evidence - bend_cost.unwrap_or_default());
        let by_lead = BY_LEAD * origin.lead(found_too || is_expected);
        Self {
            chance: PRIOR + confirmed * by_walls.max(0.0) + by_walls.min(0.0) + confirmed * by_lead,
            likeness: BY_SHARE * (like - evidence_elsewhere) + BY_WORSE_AGREEMENT * worse.clamp(0.0, 1.0),
            part: BY_AGREEMENT * (wall_agreement - halves),
        }
    }

    /// The probability that it is right, 0 to 1.
    pub fn probability(&self) -> f64 {
        1.0 / (1.0 + (-self.chance).exp() + (-self.likeness).exp() + (-self.part).exp())
    }
}

/// How far a value has come from the first of two to the second, 0 to 1.
fn share_of_way(value: f64, (from, to): (f64, f64)) -> f64 {
    ((value - from) / (to - from)).clamp(0.0, 1.0)
}

/// The value at so large a share of the way from one to another.
fn between(from: f64, to: f64, share: f64) -> f64 {
    from + share * (to - from)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of maps that fit well in many rooms.
    const GROUNDS: Grounds = Grounds {
        origin: Origin::Tags,
        found_too: false,
        found_by_tags_and_walls: false,
        is_expected: false,
        evidence: 300.0,
        wall_agreement: 0.9,
        drawn_beside: 0.5,
        confirming: 0.7,
        wall_seen: 50.0,
        overlap: 200.0,
        bend_cost: None,
        evidence_elsewhere: 0.0,
        agreement_elsewhere: 0.9,
    };

    fn probability(evidence: f64, evidence_elsewhere: f64, origin: Origin) -> f64 {
        let grounds = Grounds { origin, evidence, evidence_elsewhere, ..GROUNDS };
        Odds::new(&grounds).probability()
    }

    #[test]
    fn more_evidence_a_longer_lead_and_poorer_rivals_make_an_alignment_more_probable() {
        let searched =
            |evidence: f64, lead: f64, elsewhere: f64| probability(evidence, elsewhere, Origin::Search { lead });
        let sure = searched(60.0, 8.0, 0.1);
        assert!(sure > 0.999, "{sure}");
        assert!(searched(10.0, 8.0, 0.1) < sure && searched(60.0, 0.0, 0.1) < sure && searched(60.0, 8.0, 0.9) < 0.01);
        assert!(searched(0.0, 0.0, 0.0) < 0.01);
        assert!((searched(60.0, 1e9, 0.1) - searched(60.0, MOST_LEAD, 0.1)).abs() < 1e-12);
        assert!(searched(f64::NEG_INFINITY, 1.0, 0.0) == 0.0);
    }

    #[test]
    fn tags_need_less_wall_and_tell_a_place_from_its_like() {
        assert!(probability(20.0, 1.0, Origin::Tags) > 0.999);
        assert!(probability(20.0, 0.0, Origin::FewTags) < 0.999 && probability(60.0, 0.0, Origin::FewTags) > 0.999);
        assert!(probability(60.0, 1.0, Origin::FewTags) < 0.01);
        assert!(probability(-20.0, 0.0, Origin::Tags) < 0.9);
        let origin = Origin::Search { lead: 4.0 };
        let grounds = Grounds {
            origin,
            found_too: true,
            evidence: 40.0,
            wall_agreement: 0.8,
            evidence_elsewhere: 1.0,
            ..GROUNDS
        };
        assert!(Odds::new(&grounds).probability() > 0.999);
    }

    #[test]
    fn maps_that_contradict_each_other_as_much_as_they_agree_are_not_of_one_place() {
        let with = |wall_agreement: f64, origin: Origin| {
            Odds::new(&Grounds { origin, wall_agreement, ..GROUNDS }).probability()
        };
        let searched = Origin::Search { lead: 5.0 };
        assert!(with(0.5, searched) < 0.6 && with(0.6, searched) > 0.999);
        let far_ahead = Origin::Search { lead: 20.0 };
        assert!(with(0.4, far_ahead) < 0.6 && with(0.46, far_ahead) > 0.999);
        assert!(with(0.46, Origin::Search { lead: 7.0 }) < 0.9);
        assert!(with(0.7, Origin::Tags) < 0.01 && with(0.85, Origin::Tags) > 0.999);
        let others = |wall_agreement: f64, drawn_beside: f64| {
            Odds::new(&Grounds { origin: far_ahead, wall_agreement, drawn_beside, ..GROUNDS }).probability()
        };
        assert!(others(0.67, 0.07) < 0.01 && others(0.85, 0.07) > 0.999 && others(0.48, 0.2) > 0.999);
        let by_both = |wall_agreement: f64, origin: Origin| {
            let grounds = Grounds { origin, wall_agreement, found_too: true, found_by_tags_and_walls: true, ..GROUNDS };
            Odds::new(&grounds).probability()
        };
        for origin in [Origin::Tags, Origin::Search { lead: 1.0 }] {
            assert!(by_both(0.4, origin) < 0.6 && by_both(0.46, origin) > 0.999);
        }
    }

    #[test]
    fn a_corner_that_fits_another_says_nothing() {
        let with = |confirming: f64| {
            let origin = Origin::Search { lead: 9.0 };
            Odds::new(&Grounds { origin, confirming, evidence: 40.0, ..GROUNDS }).probability()
        };
        assert!(with(0.0) < 0.01 && with(0.14) < 0.9 && with(0.4) > 0.999);
        assert_eq!(with(0.4), with(0.7));
    }

    #[test]
    fn more_of_much_wall_must_agree_and_less_the_more_of_it_there_is() {
        let with = |wall_agreement: f64, wall_seen: f64| {
            let origin = Origin::Search { lead: 20.0 };
            Odds::new(&Grounds { origin, wall_agreement, wall_seen, ..GROUNDS }).probability()
        };
        assert!(with(0.78, 100.0) < 0.6 && with(0.84, 100.0) > 0.999);
        assert!(with(0.7, 400.0) < 0.6 && with(0.76, 400.0) > 0.999);
        assert!(with(0.6, 60.0) > 0.999 && with(0.6, 80.0) < 0.01);
    }

    #[test]
    fn maps_that_are_bent_must_agree_in_more_and_pay_for_the_bend() {
        let with = |wall_agreement: f64, bend_cost: Option<f64>| {
            let origin = Origin::Search { lead: 8.0 };
            Odds::new(&Grounds { origin, wall_agreement, bend_cost, evidence: 80.0, ..GROUNDS }).probability()
        };
        assert!(with(0.6, None) > 0.999 && with(0.6, Some(0.0)) < 0.01);
        assert!(with(0.8, Some(10.0)) > 0.999 && with(0.8, Some(80.0)) < 0.99);
    }

    #[test]
    fn a_place_that_contradicts_itself_more_is_less_like() {
        let with = |evidence_elsewhere: f64, agreement_elsewhere: f64| {
            let origin = Origin::Search { lead: 8.0 };
            let wall_agreement = 1.0;
            let grounds =
                Grounds { origin, wall_agreement, evidence_elsewhere, agreement_elsewhere, evidence: 80.0, ..GROUNDS };
            Odds::new(&grounds).probability()
        };
        assert!(with(0.6, 0.95) < 0.99 && with(0.6, 0.75) > 0.999);
        assert!(with(0.75, 0.5) < 0.99, "but there is as much that speaks for it");
    }

    #[test]
    fn maps_that_share_one_room_must_agree_in_nearly_all_of_it() {
        let with = |overlap: f64, wall_agreement: f64| {
            let origin = Origin::Search { lead: 20.0 };
            Odds::new(&Grounds { origin, wall_agreement, overlap, ..GROUNDS }).probability()
        };
        assert!(with(34.0, 0.89) < 0.5 && with(34.0, 1.0) > 0.999);
        assert!(with(60.0, 0.89) > 0.999);
        assert!(with(45.0, 0.7) < with(55.0, 0.7));
    }

    #[test]
    fn where_the_user_knows_the_place_a_small_map_is_enough() {
        let small = Grounds {
            origin: Origin::Search { lead: 3.0 },
            evidence: 20.0,
            wall_agreement: 0.8,
            overlap: 15.0,
            ..GROUNDS
        };
        let expected = Grounds { is_expected: true, ..small };
        assert!(Odds::new(&small).probability() < 0.9 && Odds::new(&expected).probability() > 0.999);
        let ambiguous = Grounds { evidence_elsewhere: 0.9, ..expected };
        assert!(Odds::new(&ambiguous).probability() < 0.01, "it is not known to the metre");
    }
}
