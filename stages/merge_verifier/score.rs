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
use gridweave_runtime::ros::Alignment;

/// No lead says more: from there on the model of chance itself is in doubt.
pub(super) const MOST_LEAD: f64 = 10.0;
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
pub(super) const LEAST_EVIDENCE: f64 = 1.0;
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
    /// Of an alignment. A stage that has looked for all other places says by its score how probable it is that the best of as many would
    /// not lead by as much by chance.
    pub fn of(alignment: &Alignment) -> Self {
        match alignment.hypotheses > 0 && alignment.source == "maps" {
            true => Self::Search { lead: -(1.0 - alignment.score.clamp(0.0, 1.0)).max(f64::MIN_POSITIVE).ln() },
            false if alignment.provisional => Self::FewTags,
            false => Self::Tags,
        }
    }

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
        let odds = here - among_alike(rival.lead, &rival.agreement, rival.bend_cost);
        return if rival.outdoes(&grounds.agreement, grounds.bend_cost) { odds.min(0.0) } else { odds };
    }
    // Tags, and another source, tell a place from those that are like it.
    let is_told = grounds.origin == Origin::Tags || grounds.found_too;
    let like = if is_told { LIKE_SHARE } else { LIKE_SHARE_OF_FEW_TAGS };
    let (from, most) = WORSE_AGREEMENT;
    let worse = (grounds.agreement.wall_agreement() - rival.agreement.wall_agreement() - from) / (most - from);
    BY_SHARE * (like - grounds.evidence_elsewhere()) + BY_WORSE_AGREEMENT * worse.clamp(0.0, 1.0)
}
