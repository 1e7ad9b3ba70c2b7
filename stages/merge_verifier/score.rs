//! How probable it is that an alignment is right.
//!
//! There are three ways to be wrong, and what is left of certainty after all is the probability:
//!
//! - **by chance**: maps that have nothing to do with each other, or parts of one map that do not, agree somewhere. The
//!   more places were looked at, the better they agree at the best. How well that is, the other places of the same pair tell:
//!   by extreme value theory the best of many alike leads the next by as many units of their spread as an exponential variable
//!   has, so that a lead of `t` has the probability `exp(-t)` by chance (Gumbel 1958).
//! - **by likeness**: the building is alike in several parts, and the maps fit in another one nearly as well.
//! - **in part**: the maps agree in much and contradict each other in as much, as two floors of one building do.
//!
//! Places that a search has found are judged by a regression, see [`found_by_walls`](super::found_by_walls).
//!
//! Tags have not looked at walls, and ask for more agreement. Where the user knows the place, or enough tags and a search that has not
//! looked at tags have come to the same place, each by itself, it is one building and one floor, and two fifths are enough: what
//! contradicts is a bend that is too fine to be undone, or was moved.
//!
//! What comes out orders alignments by how sure they are, and is a probability only as far as the pairs on which it was chosen stand for
//! others; `tests/experiments/README.md` names them, and what came of it on others.

use super::found_by_walls::{CONFIRMING, among_alike, crossings, halves, log_odds};
use super::{Agreement, Rival};

/// No lead says more: from there on the model of chance itself is in doubt.
const MOST_LEAD: f64 = 10.0;
/// The lead of a place that enough tags, which agree with each other, tell by themselves.
const LEAD_OF_TAGS: f64 = 10.0;
/// The lead of a place that too few tags tell to be believed alone, and what another source adds that has found the same.
const LEAD_OF_FEW_TAGS: f64 = 5.0;

/// The logarithm of the odds of an alignment that is told by tags or the user, and for which nothing else speaks.
const PRIOR: f64 = -5.0;
/// Per unit of the evidence of walls: much less than 1, as walls of a building depend on each other.
const BY_EVIDENCE: f64 = 0.2;
/// Per unit of the lead.
const BY_LEAD: f64 = 1.0;
/// The share of the walls that agree at which a place that tags tell is as likely to be half of it only.
const AGREEMENT_OF_HALVES_BY_TAGS: f64 = 0.75;
/// The same where the user knows the place, or tags and a search over all places tell the same: it is one building, and what
/// contradicts is a bend, or was moved.
const AGREEMENT_OF_HALVES_WHERE_KNOWN: f64 = 0.4;
/// Per unit of the share of the walls that agree.
const BY_AGREEMENT: f64 = 140.0;

/// Evidence that a rival's is a share of is at least this: below, either is as good as none.
const LEAST_EVIDENCE: f64 = 1.0;
/// The share of the evidence that a rival has where it is as likely to be right as a place for which tags speak, if nothing else tells
/// them apart; and as one for which few tags speak, which may be those of another.
const LIKE_SHARE: f64 = 1.3;
const LIKE_SHARE_OF_FEW_TAGS: f64 = 0.7;
/// Per unit of that share.
const BY_SHARE: f64 = 35.0;
/// At the most, where the rival agrees in a smaller share of its walls than this place, and by how much smaller it begins to
/// count and counts most: what contradicts itself more is less like.
const BY_WORSE_AGREEMENT: f64 = 5.0;
const WORSE_AGREEMENT: (f64, f64) = (0.1, 0.25);

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
    /// What the maps say of each other there, as they are bent if they are.
    pub agreement: Agreement,
    /// If the maps agree as they are bent: how unlikely such a bend is, see [`BentPlace`](super::BentPlace).
    pub bend_cost: Option<f64>,
    /// The place elsewhere that is most like it; none if there is no other.
    pub rival: Option<Rival>,
}

impl Grounds {
    /// The share of the walls that agree which confirm the place and do not only fix it, 0 to 1. What tags or the user tell is not
    /// fixed by walls, and at least as much of them confirms it as is asked for.
    pub fn confirming(&self) -> f64 {
        let least = if self.is_found_by_walls_alone() && !self.is_expected { 0.0 } else { CONFIRMING };
        self.agreement.confirming.max(least)
    }

    /// The evidence at the place that is most like it, as a share of that here, 0 to 2.
    pub fn evidence_elsewhere(&self) -> f64 {
        let elsewhere = self.rival.map_or(0.0, |rival| rival.agreement.evidence.max(0.0));
        (elsewhere / self.agreement.evidence.max(LEAST_EVIDENCE)).min(2.0)
    }

    fn is_found_by_walls_alone(&self) -> bool {
        matches!(self.origin, Origin::Search { .. }) && !self.found_too
    }
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
    /// By how much less `chance` is for walls that cross free space.
    pub crossings: f64,
}

impl Odds {
    /// Of an alignment.
    pub fn new(grounds: &Grounds) -> Self {
        let Grounds { origin, found_too, found_by_tags_and_walls, is_expected, ref agreement, bend_cost, .. } =
            *grounds;
        let lead = origin.lead(found_too || is_expected);
        let likeness = likeness(grounds);
        let is_known = found_by_tags_and_walls || is_expected && matches!(origin, Origin::Search { .. });
        let is_told = is_known || !matches!(origin, Origin::Search { .. });
        let (chance, halves) = match is_told {
            true => {
                let evidence = agreement.evidence - bend_cost.unwrap_or_default();
                let halves = if is_known { AGREEMENT_OF_HALVES_WHERE_KNOWN } else { AGREEMENT_OF_HALVES_BY_TAGS };
                (PRIOR + BY_EVIDENCE * evidence + BY_LEAD * lead, halves)
            }
            false => (log_odds(lead, agreement, grounds.confirming(), bend_cost), halves(agreement)),
        };
        Self {
            chance,
            likeness,
            part: BY_AGREEMENT * (agreement.wall_agreement() - halves),
            crossings: if is_told { 0.0 } else { -crossings(agreement) },
        }
    }

    /// The probability that it is right, 0 to 1.
    pub fn probability(&self) -> f64 {
        1.0 / (1.0 + (-self.chance).exp() + (-self.likeness).exp() + (-self.part).exp())
    }

    /// Whether what contradicts is what the alignment lacks most to be as probable as that.
    pub fn lacks_agreement(&self, probability: f64) -> bool {
        let without = Self { chance: self.chance + self.crossings, ..*self };
        self.part < self.chance || without.probability() >= probability
    }
}

/// The odds against a place that is like it.
fn likeness(grounds: &Grounds) -> f64 {
    let Some(rival) = &grounds.rival else { return f64::INFINITY };
    if let (Origin::Search { lead }, false) = (grounds.origin, grounds.found_too) {
        let here = among_alike(lead, &grounds.agreement, grounds.bend_cost);
        return here - among_alike(rival.lead, &rival.agreement, rival.bend_cost);
    }
    // Tags, and another source, tell a place from those that are like it.
    let is_told = grounds.origin == Origin::Tags || grounds.found_too;
    let like = if is_told { LIKE_SHARE } else { LIKE_SHARE_OF_FEW_TAGS };
    let (from, most) = WORSE_AGREEMENT;
    let worse = (grounds.agreement.wall_agreement() - rival.agreement.wall_agreement() - from) / (most - from);
    BY_SHARE * (like - grounds.evidence_elsewhere()) + BY_WORSE_AGREEMENT * worse.clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Maps that have 50 m of wall to compare, of which so large a share agrees.
    fn agreement(evidence: f64, share: f64) -> Agreement {
        Agreement {
            overlap: 200.0,
            wall_on_wall: 50.0 * share,
            wall_on_free: 50.0 * (1.0 - share),
            wall_across: 0.0,
            evidence,
            confirming: 0.7,
            walls_either_way: 4,
            slide: 0.05,
            ..Default::default()
        }
    }

    /// Of maps that fit well in many rooms, and nowhere else.
    fn grounds(origin: Origin) -> Grounds {
        Grounds {
            origin,
            found_too: false,
            found_by_tags_and_walls: false,
            is_expected: false,
            agreement: agreement(300.0, 0.9),
            bend_cost: None,
            rival: None,
        }
    }

    /// Another place at which the maps say that of each other.
    fn rival(agreement: Agreement) -> Option<Rival> {
        Some(Rival { shift: 5.0, turn: 0.0, lead: 0.0, agreement, bend_cost: None })
    }

    /// The probability of a place of so much evidence, with a rival that has so large a share of it.
    fn probability(evidence: f64, evidence_elsewhere: f64, origin: Origin) -> f64 {
        let rival = rival(agreement(evidence_elsewhere * evidence.max(LEAST_EVIDENCE), 0.9));
        Odds::new(&Grounds { agreement: agreement(evidence, 0.9), rival, ..grounds(origin) }).probability()
    }

    /// The probability of a place that a search has found, with some of its agreement changed.
    fn found(lead: f64, change: impl FnOnce(&mut Agreement)) -> f64 {
        let mut grounds = grounds(Origin::Search { lead });
        change(&mut grounds.agreement);
        Odds::new(&grounds).probability()
    }

    #[test]
    fn a_longer_lead_and_more_to_compare_make_a_place_that_walls_have_found_more_probable() {
        let with = |lead: f64, overlap: f64| found(lead, |agreement| agreement.overlap = overlap);
        assert!(with(8.0, 100.0) > 0.999 && with(1.0, 100.0) < with(8.0, 100.0));
        assert!(with(1.0, 10.0) < 0.99 && with(1.0, 200.0) > 0.999);
        assert_eq!(with(1e9, 30.0), with(MOST_LEAD, 30.0));
    }

    #[test]
    fn tags_need_less_wall_and_tell_a_place_from_its_like() {
        assert!(probability(20.0, 1.0, Origin::Tags) > 0.999);
        assert!(probability(20.0, 0.0, Origin::FewTags) < 0.999 && probability(60.0, 0.0, Origin::FewTags) > 0.999);
        assert!(probability(60.0, 1.0, Origin::FewTags) < 0.01);
        assert!(probability(-20.0, 0.0, Origin::Tags) < 0.9);
        let told = Grounds {
            found_too: true,
            agreement: agreement(40.0, 0.8),
            rival: rival(agreement(40.0, 0.8)),
            ..grounds(Origin::Search { lead: 4.0 })
        };
        assert!(Odds::new(&told).probability() > 0.999);
    }

    #[test]
    fn what_tags_tell_must_agree_in_most_and_less_where_a_search_has_found_it_too() {
        let with = |share: f64, by_both: bool, origin: Origin| {
            let grounds = grounds(origin);
            let agreement = agreement(300.0, share);
            let grounds = Grounds { agreement, found_too: by_both, found_by_tags_and_walls: by_both, ..grounds };
            Odds::new(&grounds)
        };
        assert!(with(0.7, false, Origin::Tags).probability() < 0.01);
        assert!(with(0.7, false, Origin::Tags).lacks_agreement(0.999));
        assert!(with(0.85, false, Origin::Tags).probability() > 0.999);
        for origin in [Origin::Tags, Origin::Search { lead: 1.0 }] {
            assert!(with(0.4, true, origin).probability() < 0.6 && with(0.46, true, origin).probability() > 0.999);
        }
    }

    #[test]
    fn walls_that_cross_rooms_speak_against_a_place_and_rough_drawing_does_not() {
        let rough = |agreement: &mut Agreement| (agreement.wall_on_wall, agreement.wall_on_free) = (22.0, 28.0);
        assert!(found(8.0, rough) > 0.999);
        let other = |agreement: &mut Agreement| {
            rough(agreement);
            agreement.wall_across = 24.0;
        };
        assert!(found(8.0, other) < 0.99);
        let mut of_other = grounds(Origin::Search { lead: 8.0 });
        other(&mut of_other.agreement);
        assert!(Odds::new(&of_other).lacks_agreement(0.999));
        // The same share of more wall is more of it.
        let of = |metres: f64| {
            found(4.0, |agreement| {
                (agreement.wall_on_wall, agreement.wall_on_free, agreement.wall_across) =
                    (0.8 * metres, 0.2 * metres, 0.15 * metres);
            })
        };
        assert!(of(200.0) < of(20.0));
    }

    #[test]
    fn more_of_much_wall_must_agree_and_less_the_more_of_it_there_is() {
        let with = |share: f64, seen: f64| {
            found(9.0, |agreement| {
                (agreement.wall_on_wall, agreement.wall_on_free) = (share * seen, (1.0 - share) * seen);
            })
        };
        assert!(with(0.78, 100.0) < 0.6 && with(0.84, 100.0) > 0.999);
        assert!(with(0.7, 400.0) < 0.6 && with(0.76, 400.0) > 0.999);
        assert!(with(0.6, 60.0) > 0.999 && with(0.6, 80.0) < 0.01);
    }

    #[test]
    fn maps_that_share_one_room_must_agree_in_nearly_all_of_it() {
        let with = |overlap: f64, share: f64| {
            found(10.0, |agreement| {
                agreement.overlap = overlap;
                (agreement.wall_on_wall, agreement.wall_on_free) = (20.0 * share, 20.0 * (1.0 - share));
            })
        };
        assert!(with(25.0, 0.85) < 0.5 && with(25.0, 1.0) > 0.999);
        assert!(with(40.0, 0.85) > 0.999);
    }

    #[test]
    fn a_corner_that_fits_another_says_nothing() {
        let with = |confirming: f64| {
            found(9.0, |agreement| (agreement.confirming, agreement.walls_either_way) = (confirming, 1))
        };
        assert!(with(0.0) < 0.01 && with(0.14) < 0.01 && with(0.7) > 0.999);
    }

    #[test]
    fn walls_that_run_one_way_only_leave_a_place_open() {
        let with = |walls: usize| {
            found(1.0, |agreement| {
                (agreement.walls_either_way, agreement.overlap, agreement.evidence) = (walls, 40.0, 30.0);
            })
        };
        assert!(with(0) < 0.99 && with(0) < with(2) && with(4) > 0.999);
    }

    #[test]
    fn parts_that_each_fit_a_little_beside_speak_against_a_place() {
        let with = |slide: f64| found(1.0, |agreement| agreement.slide = slide);
        assert!(with(0.02) > 0.999 && with(0.5) < 0.99);
    }

    #[test]
    fn next_to_no_wall_is_no_evidence_however_much_space_is_free() {
        let little = |agreement: &mut Agreement| {
            (agreement.wall_on_wall, agreement.wall_on_free, agreement.slide) = (1.0, 0.0, 0.0);
            (agreement.walls_either_way, agreement.overlap, agreement.evidence) = (1, 40.0, 2.0);
        };
        assert!(found(5.0, little) < 0.99);
    }

    #[test]
    fn maps_that_are_bent_pay_for_the_bend() {
        let with = |bend_cost: Option<f64>| {
            let mut grounds = Grounds { bend_cost, ..grounds(Origin::Search { lead: 4.0 }) };
            grounds.agreement.overlap = 80.0;
            Odds::new(&grounds).probability()
        };
        assert!(with(Some(0.1)) < with(None) && with(Some(10.0)) > 0.999 && with(Some(130.0)) < 0.99);
    }

    #[test]
    fn a_place_that_contradicts_itself_is_not_like_one_that_does_not_however_much_wall_agrees_there() {
        let with = |elsewhere: Agreement| {
            let grounds = grounds(Origin::Search { lead: 8.0 });
            let agreement = agreement(80.0, 1.0);
            Odds::new(&Grounds { agreement, rival: rival(elsewhere), ..grounds }).probability()
        };
        assert!(with(agreement(80.0, 1.0)) < 0.9, "both may be right");
        let crossed = Agreement { wall_across: 8.0, walls_either_way: 2, ..agreement(100.0, 0.8) };
        assert!(with(crossed) > 0.999);
    }

    #[test]
    fn of_two_places_that_are_alike_the_one_that_the_search_prefers_is_a_little_more_probable() {
        let with = |lead: f64, lead_elsewhere: f64| {
            let grounds = grounds(Origin::Search { lead });
            let rival = rival(grounds.agreement).map(|rival| Rival { lead: lead_elsewhere, ..rival });
            Odds::new(&Grounds { rival, ..grounds }).probability()
        };
        assert!(with(4.0, 4.0) <= 0.5 && with(8.0, 8.0) <= 0.5);
        assert!(with(8.0, 0.0) > 0.6 && with(8.0, 0.0) < 0.95);
    }

    #[test]
    fn points_that_meet_speak_for_a_place_less_what_a_bend_costs() {
        let with = |evidence: f64, bend_cost: Option<f64>| {
            let mut grounds = Grounds { bend_cost, ..grounds(Origin::Search { lead: 1.0 }) };
            (grounds.agreement.evidence, grounds.agreement.overlap) = (evidence, 40.0);
            Odds::new(&grounds).chance
        };
        assert!(with(0.0, None) < with(20.0, None) && with(20.0, None) < with(100.0, None));
        assert!(with(100.0, None) - with(80.0, None) < with(20.0, None) - with(0.0, None));
        assert_eq!(with(-30.0, None), with(0.0, None));
    }

    #[test]
    fn where_the_user_knows_the_place_a_small_map_is_enough() {
        let small = Agreement { overlap: 15.0, wall_on_wall: 4.0, wall_on_free: 1.0, ..agreement(20.0, 0.8) };
        let small = Agreement { walls_either_way: 1, ..small };
        let small = Grounds { agreement: small, ..grounds(Origin::Search { lead: 3.0 }) };
        let expected = Grounds { is_expected: true, ..small };
        assert!(Odds::new(&small).probability() < 0.99 && Odds::new(&expected).probability() > 0.999);
        let ambiguous = Grounds { rival: rival(small.agreement), ..expected };
        assert!(Odds::new(&ambiguous).probability() < 0.9, "it is not known to the metre");
    }
}
