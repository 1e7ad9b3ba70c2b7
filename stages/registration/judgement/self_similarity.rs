//! Perceptual aliasing: whether the building is self-similar, so that a robot may have been in either of two places.
//!
//! Where two robots have seen the opposite ends of a symmetric building, much of their maps agrees half a turn off,
//! and little at the right pose, where only the middle is in both. A search for other poses does not show that, as
//! more wall agrees at the wrong one. But each map that reaches beyond the middle shows that the building is
//! self-similar: it agrees with itself, half a turn off.
//!
//! So an accepted pose has an alias for each pose at which a map agrees with itself, and the alias is a hypothesis
//! like any other, with log-odds against the accepted pose:
//!
//! - Self-similarity must explain all inliers. Where the map was seen to be similar to itself, it does; that the rest
//!   of the building is alike, too, is the less likely the more there is of the rest.
//! - Where parts of a building are similar but not the same, walls that agree by self-similarity contradict each
//!   other as often as the map contradicts itself; walls that are the same contradict each other by noise only, which
//!   is less.

use super::weights::ALIAS;
use super::{Decision, JudgementParameters};
use crate::registration::comparison::{Agreement, MapView, compare, overlap};
use crate::registration::icp::{IcpParameters, InitialGuess, refine};
use crate::registration::pose_window::PoseWindow;
use crate::registration::search::{CommonWalls, MapAlignerParameters, PreparedMap, self_similar_poses};
use crate::shared::geometry::Pose2;
use crate::shared::walls::{CORRELATION_LENGTH, WallMap};
use nalgebra::Matrix3;
use rayon::prelude::*;

/// Least inlier ratio and inlier length of self-similar poses, in more than a room: rooms of one building are alike,
/// and less wall agrees at many poses by chance.
const ALIKE_SHARE: f64 = 0.75;
const ALIKE_WALL: f64 = 20.0;
/// Share of that length and area that is enough before a pose is refined. The search takes walls for common that are
/// farther apart than inliers, and of any direction, so they are more than those.
const BEFORE_REFINEMENT: f64 = 0.5;
/// Bound of the log-likelihood ratio of contradictions: furniture that was moved is not in the model.
const MOST_CONTRADICTION: f64 = 10.0;
/// Area of a room, square metres.
const ROOM: f64 = 25.0;

/// Poses at which a map is similar to itself.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SelfSimilarity {
    /// `T_map_map` of these poses, and the agreement of the map with itself there.
    poses: Vec<(Pose2, Agreement)>,
}

impl SelfSimilarity {
    /// Searches a map for them.
    pub fn new(map: &MapView<'_>, parameters: &JudgementParameters) -> Self {
        let aligner = MapAlignerParameters::default();
        let cell = PreparedMap::least_cell(&map.grid).max(0.5 * aligner.cell);
        let prepared = PreparedMap::new("", &map.grid, cell, aligner.max_extent);
        let least_wall = BEFORE_REFINEMENT * ALIKE_WALL;
        let is_enough = |pose: &Pose2, common: &CommonWalls| {
            let is_much = common.length >= least_wall && common.agreement >= ALIKE_SHARE;
            is_much && overlap(map, map, pose) >= BEFORE_REFINEMENT * ROOM
        };
        let poses = prepared
            .map_or_else(|_| Vec::new(), |prepared| self_similar_poses(&prepared, &aligner, least_wall, is_enough));
        let compared = poses.par_iter().map(|pose| {
            let pose = registered(map.walls, map.walls, pose);
            (pose, compare(map, map, &pose, &parameters.comparison()))
        });
        Self { poses: compared.filter(|(_, agreement)| is_alike(agreement)).collect() }
    }
}

/// Another pose of map b that may be the right one, as the building is self-similar.
#[derive(Clone, Debug, PartialEq)]
pub struct Alias {
    /// Shift of the centroid of the inliers, metres.
    pub shift: f64,
    /// Rotation of map b, radians.
    pub turn: f64,
    /// Pose of map b in map a, `T_a_b`.
    pub transform_a_b: Pose2,
    /// Agreement of the maps at that pose.
    pub there: Agreement,
    /// Agreement of the self-similar map with itself.
    pub itself: Agreement,
    /// Terms of the log-odds, after the 1 of the first weight.
    pub terms: [f64; 3],
    /// Log-odds that the alias is right and not the accepted pose.
    pub log_odds: f64,
}

impl Alias {
    /// The most probable alias of an accepted pose; none if neither map is self-similar.
    pub fn likeliest(
        decision: &Decision,
        a: (&MapView<'_>, &SelfSimilarity),
        b: (&MapView<'_>, &SelfSimilarity),
        window: Option<&PoseWindow>,
        parameters: &JudgementParameters,
    ) -> Option<Self> {
        let all = Self::all(decision, a, b, window, parameters).into_iter();
        all.max_by(|one, other| one.log_odds.total_cmp(&other.log_odds))
    }

    /// All aliases of a pose, or those in a window. Each map is given with its self-similarity.
    pub fn all(
        decision: &Decision,
        (a, similar_a): (&MapView<'_>, &SelfSimilarity),
        (b, similar_b): (&MapView<'_>, &SelfSimilarity),
        window: Option<&PoseWindow>,
        parameters: &JudgementParameters,
    ) -> Vec<Self> {
        let (place, here) = (decision.candidate.transform_a_b(), decision.candidate.agreement);
        let by_a = similar_a.poses.iter().map(|(change, itself)| (change * place, itself));
        let by_b = similar_b.poses.iter().map(|(change, itself)| (place * change, itself));
        let alias = |(guess, itself): (Pose2, &Agreement)| {
            let transform_a_b = registered(a.walls, b.walls, &guess);
            let is_possible = window.is_none_or(|window| window.contains(&transform_a_b, 0.0, 0.0));
            if !is_possible || decision.candidate.is_at(&transform_a_b) {
                return None;
            }
            let (shift, turn) = decision.candidate.change(&transform_a_b);
            let there = compare(a, b, &transform_a_b, &parameters.comparison());
            if !is_alike(&there) {
                return None;
            }
            let by_contradiction = by_contradiction(&here, &there, itself);
            let terms = [
                unexplained(&here, itself),
                by_contradiction.clamp(-MOST_CONTRADICTION, MOST_CONTRADICTION),
                by_details(&there) - by_details(&here),
            ];
            let log_odds = ALIAS[0] + ALIAS[1..].iter().zip(terms).map(|(weight, term)| weight * term).sum::<f64>();
            Some(Self { shift, turn, transform_a_b, there, itself: *itself, terms, log_odds })
        };
        by_a.chain(by_b).filter_map(alias).collect()
    }
}

fn is_alike(agreement: &Agreement) -> bool {
    let is_much = agreement.inlier_length >= ALIKE_WALL && agreement.overlap >= ROOM;
    is_much && agreement.inlier_ratio() >= ALIKE_SHARE
}

/// How many times its own length self-similarity leaves unexplained of the inliers, negative: at an alias, the walls
/// where the map was not seen to be similar to itself agree all the same, as if the building went on as it was seen to
/// begin.
fn unexplained(here: &Agreement, itself: &Agreement) -> f64 {
    (1.0 - (here.inlier_length + 1.0) / (itself.inlier_length + 1.0)).min(0.0)
}

/// How far the details agree.
fn by_details(agreement: &Agreement) -> f64 {
    agreement.details.components.log_ratio() + agreement.details.segments.log_ratio()
}

/// Pose near a guess at which the walls of the maps are aligned.
fn registered(a: &WallMap, b: &WallMap, guess: &Pose2) -> Pose2 {
    let icp = IcpParameters::default();
    refine(a, b, &InitialGuess::new(*guess, Matrix3::zeros(), &icp), &icp).registration.transform_a_b
}

/// Log-likelihood ratio of two explanations of the conflicts: those `here` are noise and those `there` are as
/// frequent as the building's own self-conflicts (`itself`), or the other way round. Each correlation length of wall
/// is one sample.
fn by_contradiction(here: &Agreement, there: &Agreement, itself: &Agreement) -> f64 {
    let [here, there, itself] =
        [here, there, itself].map(|agreement| (agreement.inlier_length, agreement.conflict_length));
    let right = log_likelihood_of_noise_and_likeness(here, sum(there, itself));
    let wrong = log_likelihood_of_noise_and_likeness(there, sum(here, itself));
    (right - wrong) / CORRELATION_LENGTH
}

/// Inlier length and conflict length, metres.
type Lengths = (f64, f64);

fn sum(one: Lengths, other: Lengths) -> Lengths {
    (one.0 + other.0, one.1 + other.1)
}

/// Log-likelihood of two agreements by their most likely conflict ratios, where that of self-similarity, which
/// contains noise as well, is at least that of noise.
fn log_likelihood_of_noise_and_likeness(noise: Lengths, likeness: Lengths) -> f64 {
    match noise.1 * likeness.0 <= likeness.1 * noise.0 {
        true => log_likelihood(noise) + log_likelihood(likeness),
        false => log_likelihood(sum(noise, likeness)),
    }
}

/// Log-likelihood by the most likely conflict ratio.
fn log_likelihood((agree, contradict): Lengths) -> f64 {
    let of = |length: f64| if length > 0.0 { length * (length / (agree + contradict)).ln() } else { 0.0 };
    of(agree) + of(contradict)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registration::judgement::{Refusal, UserKnowledge, judge};
    use crate::registration::{Basis, Hypothesis};
    use crate::shared::geometry::{Point2, pose};
    use crate::shared::test_world::floor_plan::{DrawnMap, FloorPlan, drawing, seen};
    use gridweave_runtime::stage::InitialPose;
    use proptest::prelude::*;
    use std::f64::consts::PI;

    /// The west and the east of a building, both with its middle.
    fn ends(plan: &FloorPlan) -> (DrawnMap, DrawnMap) {
        let west = plan.draw(seen(-0.2, -0.2, 15.0, 12.2), drawing(3.0, 2.0, 0.4));
        (west, plan.draw(seen(5.0, -0.2, 20.2, 12.2), drawing(12.0, 6.0, -2.1)))
    }

    /// The decision on a pose with a significant peak, first without its alias, and then with it.
    fn judged(a: &DrawnMap, b: &DrawnMap, place: &Pose2, window: Option<&PoseWindow>) -> [Option<Refusal>; 2] {
        let hypothesis = Hypothesis {
            transform_a_b: *place,
            covariance: Matrix3::identity(),
            basis: Basis::Search { significance: 30.0, margin: 0.8 },
            source: "maps".to_owned(),
            reason: String::new(),
            is_refused: false,
            is_alternative_only: false,
        };
        let parameters = JudgementParameters::default();
        let (a, b) = (a.view(), b.view());
        let decision = judge(&a, &b, &[hypothesis], &UserKnowledge::default(), &parameters).unwrap();
        let alone = decision.refusal.clone();
        assert_eq!(decision.rests_on_maps_alone(), alone.is_none());
        let [similar_a, similar_b] = [&a, &b].map(|map| SelfSimilarity::new(map, &parameters));
        let alias = Alias::likeliest(&decision, (&a, &similar_a), (&b, &similar_b), window, &parameters);
        [alone, decision.against(alias.as_ref(), &parameters).refusal]
    }

    /// Half a turn about the middle of the buildings.
    fn half_turn() -> Pose2 {
        pose(20.0, 12.0, PI)
    }

    #[test]
    fn the_ends_of_a_symmetric_building_are_not_confused() {
        let (a, b) = ends(&FloorPlan::nearly_symmetric());
        let wrong = a.transform_world_map.inverse() * half_turn() * b.transform_world_map;
        let [alone, with_alias] = judged(&a, &b, &wrong, None);
        assert_eq!(alone, None, "the walls agree nearly everywhere");
        let Some(Refusal::Aliased { alias }) = with_alias else { panic!("{with_alias:?}") };
        assert!((alias.turn.abs() - PI).abs() < 0.02 && alias.shift < 10.0, "{alias:?}");
        assert!(alias.itself.inlier_ratio() > 0.9 && alias.there.inlier_ratio() > 0.9, "{alias:?}");
    }

    #[test]
    fn an_alias_outside_the_window_does_not_count() {
        let (a, b) = ends(&FloorPlan::nearly_symmetric());
        let right = a.transform_to(&b);
        let initial = InitialPose { yaw_stddev: 0.2, ..InitialPose::default() };
        let at = |place: &Pose2| {
            let (x, y, yaw) = (place.translation.x, place.translation.y, place.rotation.angle());
            PoseWindow::between(&initial, &InitialPose { x, y, yaw, ..initial })
        };
        assert!(judged(&a, &b, &right, None)[1].is_some());
        assert_eq!(judged(&a, &b, &right, Some(&at(&right)))[1], None);
    }

    #[test]
    fn a_building_with_little_self_similarity_has_no_alias() {
        let (a, b) = ends(&FloorPlan::office());
        assert_eq!(judged(&a, &b, &a.transform_to(&b), None), [None, None]);
    }

    #[test]
    fn a_pose_without_conflicts_is_distinguished_from_a_similar_one() {
        // One half has rooms that the other has not.
        let plan =
            FloorPlan::nearly_symmetric().with(&[[0.0, 8.0, 3.0, 8.0], [6.0, 9.0, 6.0, 12.0], [14.0, 9.5, 17.0, 9.5]]);
        let (a, b) = ends(&plan);
        let right = a.transform_to(&b);
        assert_eq!(judged(&a, &b, &right, None), [None, None]);
    }

    #[test]
    fn little_self_similarity_does_not_explain_much_that_agrees() {
        let itself = walls(29.0, 2.0);
        assert_eq!(unexplained(&walls(20.0, 0.0), &itself), 0.0);
        assert_eq!(unexplained(&walls(299.0, 8.0), &itself), -9.0);
    }

    fn walls(inlier_length: f64, conflict_length: f64) -> Agreement {
        Agreement { inlier_length, conflict_length, centre: Point2::origin(), ..Default::default() }
    }

    #[test]
    fn conflicts_as_frequent_as_those_of_the_building_with_itself_show_the_alias() {
        let itself = walls(80.0, 8.0);
        assert!(by_contradiction(&walls(160.0, 0.5), &walls(50.0, 6.0), &itself) > 10.0);
        assert!(by_contradiction(&walls(160.0, 15.0), &walls(50.0, 0.2), &itself) < -5.0);
        // However self-similar the building is, that does not explain more conflicts at the right pose.
        assert!(by_contradiction(&walls(160.0, 1.0), &walls(90.0, 25.0), &walls(50.0, 0.5)) > 10.0);
        assert!(by_contradiction(&walls(160.0, 15.0), &walls(50.0, 5.0), &itself).abs() < 1.0);
        assert_eq!(by_contradiction(&walls(0.0, 0.0), &walls(0.0, 0.0), &itself), 0.0);
    }

    proptest! {
        #[test]
        fn the_odds_of_a_pose_against_its_alias_are_the_inverse_of_those_of_the_alias(lengths: [u16; 6]) {
            let [here, there, itself] = [0, 2, 4].map(|at| walls(f64::from(lengths[at]), f64::from(lengths[at + 1])));
            let (odds, turned) = (by_contradiction(&here, &there, &itself), by_contradiction(&there, &here, &itself));
            prop_assert!(odds.is_finite() && (odds + turned).abs() <= 1e-6 * (1.0 + odds.abs()));
        }
    }
}
