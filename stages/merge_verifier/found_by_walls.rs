//! How probable a place is that a search over all places has found by the walls, from what the walls say of each other there.
//!
//! A logistic regression on how far the place leads all others, how much both maps know, and what speaks against it:
//!
//! - Two straight walls fix a place, and any corner fits any other. So lead and area count as far as walls beside these two agree, too, and
//!   confirm it.
//! - Walls that cross the other map's free space speak against it. Where furniture was moved, or a wall is drawn roughly or is bent,
//!   maps of one place contradict each other as well; that does not count.
//! - Where one map was bent onto the other, the bend counts, and what contradicts all the same.
//!
//! Two bounds on the share of the walls that agree stand beside it: where much wall was seen, and where the maps share no more than a
//! room.
//!
//! The weights were fitted to hypotheses for pairs of published maps, of simulated buildings of eight kinds and of different buildings,
//! and then doubled and shifted, so that no pair of different buildings among these reaches a probability of 0.999.
//! `tests/experiments/README.md` names the pairs, and what came of it on others.

use super::Agreement;

/// The logarithm of the odds where all else is 0, and per unit of the lead,
const OF_NOTHING: f64 = -14.0;
const BY_LEAD: f64 = 0.89;
/// of the logarithm of the area that both maps know, square metres, up to an area from which on more tells no more,
const BY_AREA: f64 = 5.63;
const MOST_AREA: f64 = 200.0;
/// of the share of the walls that cross the other's free space, and of the logarithm of 1 and their metres,
const BY_CROSSING_SHARE: f64 = -34.8;
const BY_CROSSING: f64 = -2.17;
/// and of the root of the cost of a bend.
const BY_BEND: f64 = -0.38;
/// A bend lays walls on each other in wrong places, too, where rooms are alike, but not all of them: per unit of the share of the walls
/// that contradict where a map is bent. It was not fitted, but chosen on two simulated buildings of equal rooms, which it keeps apart,
/// and on the bent logs, which it leaves merged.
const BY_CONTRADICTION_IF_BENT: f64 = -7.0;
/// So large a share of the walls that agree must confirm the place, and not only fix it, for lead and area to count in full; and neither
/// counts where none confirms it.
pub(super) const CONFIRMING: f64 = 0.5;
/// Of less evidence than this so much is taken off for each unit that is missing. The fit gives that next to no weight; it is a
/// precaution against maps that have much space and hardly any wall in common.
const LITTLE_EVIDENCE: f64 = 10.0;
const BY_LITTLE_EVIDENCE: f64 = -1.0;
/// The share of the walls that agree at which a place that walls have found is as likely to be half of it only, for any length of wall:
/// what was moved and drawn roughly has evened out then. What less wall tells is known less well: so much more of it must agree,
/// divided by the root of its metres.
const AGREEMENT_OF_HALVES_OF_MUCH_WALL: f64 = 0.62;
const MORE_OF_LESS_WALL: f64 = 1.6;
/// From how much wall on that begins to count, and from how much on it counts in full, metres that both maps have seen.
const MUCH_WALL: (f64, f64) = (60.0, 80.0);
/// The same where the maps share the area of one room: rooms of other buildings have the same corners and sizes.
const AGREEMENT_OF_HALVES_IN_A_ROOM: f64 = 0.9;
/// So large is a room at the most, and so large is the area that the maps share if it is surely more than a room, square metres.
const ROOM: (f64, f64) = (40.0, 60.0);

/// The logarithm of the odds that a place is right which leads all others by so much. `confirming` is the share of the walls that agree
/// which confirm it, and `bend_cost` is that of the bend if the maps were compared bent.
pub(super) fn log_odds(lead: f64, agreement: &Agreement, confirming: f64, bend_cost: Option<f64>) -> f64 {
    OF_NOTHING + confirmed(confirming) * BY_LEAD * lead + by_walls(agreement, confirming, bend_cost)
}

/// Whether a place is more probable with one map bent, at a cost, than as the maps came.
pub(super) fn is_better_bent(bent: &Agreement, cost: f64, rigid: &Agreement) -> bool {
    by_walls(bent, bent.confirming, Some(cost)) > by_walls(rigid, rigid.confirming, None)
}

/// How much of what speaks for a place counts, by the share of the walls that agree which confirm it.
fn confirmed(confirming: f64) -> f64 {
    (confirming / CONFIRMING).min(1.0)
}

/// The part of the log-odds that a bend changes.
fn by_walls(agreement: &Agreement, confirming: f64, bend_cost: Option<f64>) -> f64 {
    confirmed(confirming) * BY_AREA * agreement.overlap.clamp(1.0, MOST_AREA).ln()
        + crossings(agreement)
        + bend_cost.map_or(0.0, |cost| {
            BY_CONTRADICTION_IF_BENT * (1.0 - agreement.wall_agreement()) + BY_BEND * cost.max(0.0).sqrt()
        })
        + BY_LITTLE_EVIDENCE * (LITTLE_EVIDENCE - agreement.evidence).max(0.0)
}

/// What walls that cross free space add to the log-odds; not above 0.
pub(super) fn crossings(agreement: &Agreement) -> f64 {
    let across = agreement.wall_across;
    let share = across / agreement.wall_seen().max(f64::MIN_POSITIVE);
    BY_CROSSING_SHARE * share + BY_CROSSING * across.ln_1p()
}

/// The share of the walls that agree at which a place is as likely to be half of it only: of much wall, as the maps came, and in a room.
/// Elsewhere 0, as the walls that cross rooms tell.
pub(super) fn halves(agreement: &Agreement, is_bent: bool) -> f64 {
    let seen = agreement.wall_seen();
    let of_much = AGREEMENT_OF_HALVES_OF_MUCH_WALL + MORE_OF_LESS_WALL / seen.max(1.0).sqrt();
    let of_much = if is_bent { 0.0 } else { share_of_way(seen, MUCH_WALL) * of_much };
    let in_room = (1.0 - share_of_way(agreement.overlap, ROOM)) * AGREEMENT_OF_HALVES_IN_A_ROOM;
    of_much.max(in_room)
}

/// How far a value has come from the first of two to the second, 0 to 1.
fn share_of_way(value: f64, (from, to): (f64, f64)) -> f64 {
    ((value - from) / (to - from)).clamp(0.0, 1.0)
}
