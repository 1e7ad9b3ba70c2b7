//! Perceptual aliasing: whether the building looks alike in two places, so that a robot may have been in either.
//!
//! Where two robots have seen the opposite ends of a symmetric building, much of their maps agrees half a turn off, and little at the
//! right place, where only the middle is in both. No search for other places tells that, as more wall agrees at the wrong one. But each
//! map that reaches beyond the middle tells that the building is alike there: it agrees with itself, half a turn off.
//!
//! Then a place and its alias differ in what contradicts. Where parts of a building are alike but not the same, walls that agree by
//! likeness contradict each other as often as the map contradicts itself at the other place; and walls that are the same contradict each
//! other for noise alone, which is less. So the maps tell the places from each other by which of the two has the share of contradiction that
//! likeness has.

use super::found_by_walls::ROOM;
use super::{Agreement, MapView, MergeVerifierParameters, Rival, Verdict, compare};
use crate::geometry::Pose2;
use crate::icp_refiner::{FirstGuess, IcpParameters, refine};
use crate::map_aligner::{MapAlignerParameters, PreparedMap, self_similar_places};
use crate::place_window::PlaceWindow;
use crate::walls::{CORRELATION_LENGTH, WallMap};
use nalgebra::Matrix3;

/// Two places are alike if so large a share of the walls agrees where they are laid on each other, and so many metres, in more than a room:
/// rooms of one building are alike, and less wall meets at many places by chance.
const ALIKE_SHARE: f64 = 0.75;
const ALIKE_WALL: f64 = 20.0;

/// Where a map looks like itself.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SelfSimilarity {
    /// Places at which the map lies on itself, `T_map_map`, and what it says of itself there.
    places: Vec<(Pose2, Agreement)>,
}

impl SelfSimilarity {
    /// Searches for it in a map.
    pub fn new(map: &MapView<'_>, parameters: &MergeVerifierParameters) -> Self {
        let aligner = MapAlignerParameters::default();
        let cell = PreparedMap::least_cell(&map.grid).max(0.5 * aligner.cell);
        let prepared = PreparedMap::new("", &map.grid, cell, aligner.max_extent);
        let places = prepared.map_or_else(|_| Vec::new(), |prepared| self_similar_places(&prepared, &aligner));
        let registered = places.iter().map(|place| registered(map.walls, map.walls, place));
        let compared = registered.map(|place| (place, compare(map, map, &place, parameters)));
        let places = compared.filter(|(_, agreement)| is_alike(agreement)).collect();
        Self { places }
    }
}

/// Another place of map b that may be the right one, as the building is alike there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Alias {
    /// The other place, and what the maps say of each other there.
    pub rival: Rival,
    /// What the one map that is alike says of itself.
    pub itself: Agreement,
    /// The logarithm of the odds against it.
    pub log_odds: f64,
}

impl Alias {
    /// The alias of an accepted place that is likeliest to be the right one, of all or of those in a window; none if the building is
    /// alike nowhere. Each map comes with where it looks like itself.
    pub fn of(
        verdict: &Verdict<'_>,
        (a, similar_a): (&MapView<'_>, &SelfSimilarity),
        (b, similar_b): (&MapView<'_>, &SelfSimilarity),
        window: Option<&PlaceWindow>,
        parameters: &MergeVerifierParameters,
    ) -> Option<Self> {
        let (transform_a_b, agreement) = (verdict.candidate.transform_a_b(), verdict.candidate.agreement);
        let by_a = similar_a.places.iter().map(|(place, itself)| (place * transform_a_b, itself));
        let by_b = similar_b.places.iter().map(|(place, itself)| (transform_a_b * place, itself));
        let aliases = by_a.chain(by_b).filter_map(|(place, itself)| {
            let alias_a_b = registered(a.walls, b.walls, &place);
            let there = || compare(a, b, &alias_a_b, parameters);
            let rival = Rival::of(&transform_a_b, &agreement.centre, &alias_a_b, there)?;
            let log_odds = log_odds(&agreement, &rival.agreement, itself);
            let may_be = window.is_none_or(|window| window.contains(&alias_a_b, 0.0, 0.0));
            (may_be && is_alike(&rival.agreement)).then_some(Self { rival, itself: *itself, log_odds })
        });
        aliases.min_by(|one, other| one.log_odds.total_cmp(&other.log_odds))
    }
}

fn is_alike(agreement: &Agreement) -> bool {
    let is_much = agreement.wall_on_wall >= ALIKE_WALL && agreement.overlap >= ROOM.0;
    is_much && agreement.wall_agreement() >= ALIKE_SHARE
}

/// The place near a guess at which the walls of the maps lie on each other.
fn registered(a: &WallMap, b: &WallMap, guess: &Pose2) -> Pose2 {
    let icp = IcpParameters::default();
    refine(a, b, &FirstGuess::new(*guess, Matrix3::zeros(), &icp), &icp).registration.transform_a_b
}

/// The logarithm of how much likelier it is that the maps contradict each other `here` for noise, and `there` as the building contradicts
/// `itself` in likeness, than the other way round. Each length at which walls are independent of each other is one sample.
fn log_odds(here: &Agreement, there: &Agreement, itself: &Agreement) -> f64 {
    let [here, there, itself] = [here, there, itself].map(|agreement| (agreement.wall_on_wall, agreement.wall_on_free));
    let right = log_likelihood_of_noise_and_likeness(here, sum(there, itself));
    let wrong = log_likelihood_of_noise_and_likeness(there, sum(here, itself));
    (right - wrong) / CORRELATION_LENGTH
}

/// Lengths of wall that agree and that contradict, metres.
type Lengths = (f64, f64);

fn sum(one: Lengths, other: Lengths) -> Lengths {
    (one.0 + other.0, one.1 + other.1)
}

/// Of two places, by the shares of contradiction that are likeliest, where that of likeness, which has noise as well, is at least that of
/// noise.
fn log_likelihood_of_noise_and_likeness(noise: Lengths, likeness: Lengths) -> f64 {
    match noise.1 * likeness.0 <= likeness.1 * noise.0 {
        true => log_likelihood(noise) + log_likelihood(likeness),
        false => log_likelihood(sum(noise, likeness)),
    }
}

/// By the share of contradiction that is likeliest.
fn log_likelihood((agree, contradict): Lengths) -> f64 {
    let of = |length: f64| if length > 0.0 { length * (length / (agree + contradict)).ln() } else { 0.0 };
    of(agree) + of(contradict)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Point2, pose};
    use crate::merge_verifier::{Refusal, UserKnowledge, judge};
    use crate::test_world::floor_plan::{DrawnMap, FloorPlan, drawing, seen};
    use gridweave_runtime::ros::Alignment;
    use gridweave_runtime::stage::InitialPose;
    use proptest::prelude::*;
    use std::f64::consts::PI;

    /// The west and the east of a building, both with its middle.
    fn ends(plan: &FloorPlan) -> (DrawnMap, DrawnMap) {
        let west = plan.draw(seen(-0.2, -0.2, 15.0, 12.2), drawing(3.0, 2.0, 0.4));
        (west, plan.draw(seen(5.0, -0.2, 20.2, 12.2), drawing(12.0, 6.0, -2.1)))
    }

    /// The judgement on a place that leads all others by the walls alone, first without its alias, and then with it.
    fn judged(a: &DrawnMap, b: &DrawnMap, place: &Pose2, window: Option<&PlaceWindow>) -> [Option<Refusal>; 2] {
        let source = "maps".to_owned();
        let found =
            Alignment { source, accepted: true, provisional: true, hypotheses: 1, score: 1.0, ..Default::default() };
        let mut alignment = found;
        alignment.set_transform_a_b(place);
        let parameters = MergeVerifierParameters::default();
        let (a, b) = (a.view(), b.view());
        let verdict = judge(&a, &b, &[&alignment], &UserKnowledge::default(), &parameters).unwrap();
        let alone = verdict.refusal.clone();
        assert_eq!(verdict.rests_on_walls_alone(), alone.is_none());
        let [similar_a, similar_b] = [&a, &b].map(|map| SelfSimilarity::new(map, &parameters));
        let alias = Alias::of(&verdict, (&a, &similar_a), (&b, &similar_b), window, &parameters);
        [alone, verdict.against(alias.as_ref(), parameters.accept).refusal]
    }

    /// Half a turn about the middle of the buildings.
    fn half_turn() -> Pose2 {
        pose(20.0, 12.0, PI)
    }

    #[test]
    fn the_ends_of_a_symmetric_building_are_not_taken_for_each_other() {
        let (a, b) = ends(&FloorPlan::nearly_symmetric());
        let wrong = a.transform_world_map.inverse() * half_turn() * b.transform_world_map;
        let [alone, with_alias] = judged(&a, &b, &wrong, None);
        assert_eq!(alone, None, "the walls agree nearly everywhere");
        let Some(Refusal::Aliased { shift, turn, itself, there }) = with_alias else { panic!("{with_alias:?}") };
        assert!((turn.abs() - 180.0).abs() < 1.0 && shift < 10.0, "{shift} m, {turn} degrees");
        assert!(itself.wall_agreement() > 0.9 && there.wall_agreement() > 0.9, "{itself:?}, {there:?}");
    }

    #[test]
    fn an_alias_that_the_user_rules_out_is_none() {
        let (a, b) = ends(&FloorPlan::nearly_symmetric());
        let right = a.transform_to(&b);
        let initial = InitialPose { yaw_stddev: 0.2, ..InitialPose::default() };
        let at = |place: &Pose2| {
            let (x, y, yaw) = (place.translation.x, place.translation.y, place.rotation.angle());
            PlaceWindow::between(&initial, &InitialPose { x, y, yaw, ..initial })
        };
        assert!(judged(&a, &b, &right, None)[1].is_some());
        assert_eq!(judged(&a, &b, &right, Some(&at(&right)))[1], None);
    }

    #[test]
    fn a_building_that_is_alike_in_little_is_told_from_what_it_is_like() {
        let (a, b) = ends(&FloorPlan::office());
        assert_eq!(judged(&a, &b, &a.transform_to(&b), None), [None, None]);
    }

    #[test]
    fn a_place_without_contradiction_is_told_from_one_that_is_only_like_it() {
        // One half has rooms that the other has not.
        let plan =
            FloorPlan::nearly_symmetric().with(&[[0.0, 8.0, 3.0, 8.0], [6.0, 9.0, 6.0, 12.0], [14.0, 9.5, 17.0, 9.5]]);
        let (a, b) = ends(&plan);
        let right = a.transform_to(&b);
        assert_eq!(judged(&a, &b, &right, None), [None, None]);
    }

    fn walls(wall_on_wall: f64, wall_on_free: f64) -> Agreement {
        Agreement { wall_on_wall, wall_on_free, centre: Point2::origin(), ..Default::default() }
    }

    #[test]
    fn what_contradicts_as_likeness_does_is_the_alias() {
        let itself = walls(80.0, 8.0);
        assert!(log_odds(&walls(160.0, 0.5), &walls(50.0, 6.0), &itself) > 10.0);
        assert!(log_odds(&walls(160.0, 15.0), &walls(50.0, 0.2), &itself) < -5.0);
        // However well the building is like itself, it is no reason to contradict more at the right place.
        assert!(log_odds(&walls(160.0, 1.0), &walls(90.0, 25.0), &walls(50.0, 0.5)) > 10.0);
        assert!(log_odds(&walls(160.0, 15.0), &walls(50.0, 5.0), &itself).abs() < 1.0);
        assert_eq!(log_odds(&walls(0.0, 0.0), &walls(0.0, 0.0), &itself), 0.0);
    }

    proptest! {
        #[test]
        fn the_odds_of_a_place_against_its_alias_are_those_of_the_alias_turned_round(lengths: [u16; 6]) {
            let [here, there, itself] = [0, 2, 4].map(|at| walls(f64::from(lengths[at]), f64::from(lengths[at + 1])));
            let (odds, turned) = (log_odds(&here, &there, &itself), log_odds(&there, &here, &itself));
            prop_assert!(odds.is_finite() && (odds + turned).abs() <= 1e-6 * (1.0 + odds.abs()));
        }
    }
}
