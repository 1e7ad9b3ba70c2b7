//! How probable a place is that a search over all places has found by the walls, from what the walls say of each other there.
//!
//! A logistic regression on how far the place leads all others, how much both maps know, and what speaks for it and against it:
//!
//! - Two straight walls fix a place, and any corner fits any other. So lead, area and evidence count as far as walls beside these two agree,
//!   too, and confirm it.
//! - Walls that run one way only fit at many places along themselves: straight walls that agree are counted both ways.
//! - At the right place the parts of a map lie where they should, but for a bend; by chance each of them fits a little beside.
//! - Walls that cross the other map's free space speak against it. Where furniture was moved, or a wall is drawn roughly or is bent,
//!   maps of one place contradict each other as well; what counts is how much of what contradicts is walls that cross rooms.
//! - Where one map was bent onto the other, the bend counts.
//! - The evidence of all points counts by its root: much of it says the same again.
//!
//! Two bounds on the share of the walls that agree stand beside it: where much wall was seen, and where the maps share no more than a
//! room.
//!
//! The weights were fitted to hypotheses for pairs of published maps, of simulated buildings of eight kinds and of different buildings,
//! each with the sign that it must have, and once more to those of them that are not clearly wrong, where pairs of published maps that
//! belong together count four times. Then they were doubled and shifted, so that pairs of different buildings among these stay well
//! below a probability of 0.999. `tests/experiments/README.md` names the pairs, and what came of it on others.

use super::Agreement;

/// The logarithm of the odds where all else is 0.
const OF_NOTHING: f64 = -15.96;
/// Per unit of the lead, up to a lead from which on the model of chance itself is in doubt.
const BY_LEAD: f64 = 1.31;
const MOST_LEAD: f64 = 8.0;
/// The share of that by which the lead tells a place from others of the same maps: in a building whose parts are alike, the search prefers one
/// of them by what was moved or seen in it, and not by chance. It was not fitted: from 0.3 on, two more of fifty symmetric
/// buildings are merged wrongly.
const LEAD_AMONG_ALIKE: f64 = 0.2;
/// Per unit of the logarithm of the area that both maps know, square metres, up to an area from which on more tells no more.
const BY_AREA: f64 = 3.10;
const MOST_AREA: f64 = 500.0;
/// Of the share of the walls that agree which confirm the place, and do not only fix it.
const BY_CONFIRMING: f64 = 9.14;
/// So large must that share be for lead, area and evidence to count in full; and none of them counts where nothing confirms the place.
pub(super) const CONFIRMING: f64 = 0.5;
/// Per unit of the logarithm of 1 and the straight walls that agree in the one of two directions in which there are fewer.
const BY_WALLS: f64 = 3.05;
/// Per metre by which parts of the map slide.
const BY_SLIDE: f64 = -31.7;
/// Of the share of what contradicts that crosses rooms, and of the share that this is of all walls; where so many metres more that
/// contradict, and that agree, are taken to be there in any case, so that a share of little is a small one.
const BY_CROSSING_CONTRADICTION: f64 = -17.9;
const MORE_CONTRADICTION: f64 = 5.0;
const BY_CROSSING: f64 = -30.2;
const MORE_WALL: f64 = 40.0;
/// Per unit of the root of the cost of a bend.
const BY_BEND: f64 = -0.59;
/// What a bend costs beyond this counts so much more, as hardly any SLAM drifts so. It was not fitted: two warehouses with shelves alike came to
/// lie on each other by a bend of 124, and no right place that was accepted among the pairs rests on one above 100 but one.
const DEAR_BEND: f64 = 100.0;
const BY_DEAR_BEND: f64 = -0.25;
/// Per unit of the root of the evidence, less the cost of a bend.
const BY_EVIDENCE: f64 = 0.184;
/// Where less wall than this agrees, metres, so much is taken off for each that is missing. It was not fitted: a precaution against maps
/// that have much space and hardly any wall in common.
const LITTLE_WALL: f64 = 5.0;
const BY_LITTLE_WALL: f64 = -2.0;
/// The share of the walls that agree at which a place that walls have found is as likely to be half of it only, for any length of wall:
/// what was moved and drawn roughly has evened out then. What less wall tells is known less well: so much more of it must agree,
/// divided by the root of its metres.
const AGREEMENT_OF_HALVES_OF_MUCH_WALL: f64 = 0.62;
const MORE_OF_LESS_WALL: f64 = 1.6;
/// From how much wall on that begins to count, and from how much on it counts in full, metres that both maps have seen.
const MUCH_WALL: (f64, f64) = (60.0, 80.0);
/// The same where the maps share the area of one room: rooms of other buildings have the same corners and sizes.
const AGREEMENT_OF_HALVES_IN_A_ROOM: f64 = 0.9;
/// So large is a room, and so large is the area that the maps share if it is surely more than a room, square metres.
pub(super) const ROOM: (f64, f64) = (25.0, 40.0);

/// The logarithm of the odds that a place is right which leads all others by so much. `confirming` is the share of the walls that agree
/// which confirm it, and `bend_cost` is that of the bend if the maps were compared bent.
pub(super) fn log_odds(lead: f64, agreement: &Agreement, confirming: f64, bend_cost: Option<f64>) -> f64 {
    OF_NOTHING + of_lead(lead, confirming) + of_walls(agreement, confirming, bend_cost)
}

/// The part of the log-odds that tells places of the same two maps from each other, with one of them bent or as they came: by how much it
/// is more at one place than at another, that one is likelier.
pub(super) fn among_alike(lead: f64, agreement: &Agreement, bend_cost: Option<f64>) -> f64 {
    let confirming = agreement.confirming;
    LEAD_AMONG_ALIKE * of_lead(lead, confirming) + of_walls(agreement, confirming, bend_cost)
}

fn of_lead(lead: f64, confirming: f64) -> f64 {
    confirmed(confirming) * BY_LEAD * lead.clamp(0.0, MOST_LEAD)
}

/// How much of what speaks for a place counts, by the share of the walls that agree which confirm it.
fn confirmed(confirming: f64) -> f64 {
    (confirming / CONFIRMING).min(1.0)
}

fn of_walls(agreement: &Agreement, confirming: f64, bend_cost: Option<f64>) -> f64 {
    let bend_cost = bend_cost.unwrap_or_default().max(0.0);
    BY_CONFIRMING * confirming
        + confirmed(confirming) * BY_AREA * agreement.overlap.clamp(1.0, MOST_AREA).ln()
        + BY_WALLS * (agreement.walls_either_way as f64).ln_1p()
        + BY_SLIDE * agreement.slide
        + crossings(agreement)
        + confirmed(confirming) * BY_EVIDENCE * (agreement.evidence - bend_cost).max(0.0).sqrt()
        + of_bend(bend_cost)
        + BY_LITTLE_WALL * (LITTLE_WALL - agreement.wall_on_wall).max(0.0)
}

/// What a bend of some cost adds to the log-odds; not above 0.
fn of_bend(cost: f64) -> f64 {
    BY_BEND * cost.sqrt() + BY_DEAR_BEND * (cost - DEAR_BEND).max(0.0)
}

/// What walls that cross free space add to the log-odds; not above 0.
pub(super) fn crossings(agreement: &Agreement) -> f64 {
    let across = agreement.wall_across;
    BY_CROSSING_CONTRADICTION * across / (agreement.wall_on_free + MORE_CONTRADICTION)
        + BY_CROSSING * across / (agreement.wall_seen() + MORE_WALL)
}

/// The share of the walls that agree at which a place is as likely to be half of it only, as the maps came or as they are bent: where much
/// was seen, and in a room. Elsewhere 0, as the walls that cross rooms tell.
pub(super) fn halves(agreement: &Agreement) -> f64 {
    let seen = agreement.wall_seen();
    let of_much = AGREEMENT_OF_HALVES_OF_MUCH_WALL + MORE_OF_LESS_WALL / seen.max(1.0).sqrt();
    let in_room = (1.0 - share_of_way(agreement.overlap, ROOM)) * AGREEMENT_OF_HALVES_IN_A_ROOM;
    (share_of_way(seen, MUCH_WALL) * of_much).max(in_room)
}

/// How far a value has come from the first of two to the second, 0 to 1.
fn share_of_way(value: f64, (from, to): (f64, f64)) -> f64 {
    ((value - from) / (to - from)).clamp(0.0, 1.0)
}
