//! Other places where two maps fit: what an alignment must be better than.

use super::agreement::compare_sampled;
use super::{Agreement, MapView, MergeVerifierParameters};
use crate::geometry::{Point2, Pose2};
use crate::icp_refiner::{FirstGuess, IcpParameters, approach};
use nalgebra::{Matrix3, UnitComplex, Vector2};
use std::f64::consts::{FRAC_PI_2, SQRT_2};

/// An alignment whose middle lies within this many metres of another, and that is turned by less than [`SAME_TURN`], is
/// the same one: registration leads what is so near to one place, unless the walls fit at both.
const SAME_PLACE: f64 = 0.3;
/// Radians.
const SAME_TURN: f64 = 0.2;

/// Another place of map b at which its walls lie on those of map a.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rival {
    /// How far the middle of the common section is moved, metres.
    pub shift: f64,
    /// By how much map b is turned, radians.
    pub turn: f64,
    /// By how much a search over all places prefers it to all others, see [`Origin::Search`](super::Origin::Search); 0 if none has.
    pub lead: f64,
    /// What the maps say of each other there.
    pub agreement: Agreement,
    /// If map b is bent there: how unlikely such a bend is, see [`BentPlace`](super::BentPlace).
    pub bend_cost: Option<f64>,
}

impl Rival {
    /// What lies at `rival_a_b` as a rival of the alignment `transform_a_b`, whose walls in common have their middle at
    /// `centre`, frame a. `None` if the two are the same.
    pub fn of(
        transform_a_b: &Pose2,
        centre: &Point2,
        rival_a_b: &Pose2,
        compare: impl FnOnce() -> Agreement,
    ) -> Option<Self> {
        let change = rival_a_b * transform_a_b.inverse();
        let (shift, turn) = ((change * centre - centre).norm(), change.rotation.angle());
        let is_another = shift >= SAME_PLACE || turn.abs() >= SAME_TURN;
        is_another.then(|| Self { shift, turn, lead: 0.0, agreement: compare(), bend_cost: None })
    }

    /// Whether more speaks for it than for a place at which the maps say that, bent at that cost, and less against it: then it is as likely
    /// to be right, whatever else tells them apart.
    pub fn outdoes(&self, agreement: &Agreement, bend_cost: Option<f64>) -> bool {
        let evidence = |agreement: &Agreement, cost: Option<f64>| agreement.evidence - cost.unwrap_or_default();
        evidence(&self.agreement, self.bend_cost) > evidence(agreement, bend_cost)
            && self.agreement.wall_agreement() > agreement.wall_agreement()
    }
}

/// The rival near an alignment `T_a_b` for which the walls speak most, if any do.
///
/// Map b is turned by quarter turns about `centre`, a place in frame a, and moved by up to `rival_reach`; each of these is
/// registered and compared, both by a sample of the points. In a building whose rooms are alike the maps fit at many
/// places, and so their fitting at one says little. And if the maps have nothing to do with each other, the one place at
/// which tags have laid them by chance is as good as any other: that it is by far the best of n has a probability of
/// 1 / n at most.
pub fn best_rival_nearby(
    a: &MapView<'_>,
    b: &MapView<'_>,
    transform_a_b: &Pose2,
    centre: &Point2,
    parameters: &MergeVerifierParameters,
) -> Option<Rival> {
    let icp = IcpParameters::default();
    let mut best: Option<Rival> = None;
    for start in starts(centre, parameters.rival_reach, &icp) {
        let guess = FirstGuess::new(start * transform_a_b, Matrix3::zeros(), &icp);
        let rival_a_b = approach(a.walls, b.walls, &guess, &icp);
        let compare = || compare_sampled(a, b, &rival_a_b, parameters, icp.coarse_points);
        let Some(rival) = Rival::of(transform_a_b, centre, &rival_a_b, compare) else { continue };
        let evidence = rival.agreement.evidence;
        if evidence > best.map_or(0.0, |best| best.agreement.evidence) {
            best = Some(rival);
        }
    }
    best
}

/// The changes of an alignment to begin with, in frame a: quarter turns about a place, and shifts on a raster so wide that
/// registration finds all there is between.
fn starts(centre: &Point2, reach: f64, icp: &IcpParameters) -> impl Iterator<Item = Pose2> {
    let centre = *centre;
    // Then no place is farther from one of them than partners may lie.
    let spacing = SQRT_2 * icp.max_distance;
    let steps = (reach / spacing) as i32;
    let shifts = (-steps..=steps).flat_map(move |x| (-steps..=steps).map(move |y| (x, y)));
    let shifts = shifts.map(move |(x, y)| Vector2::new(f64::from(x), f64::from(y)) * spacing);
    shifts.filter(move |shift| shift.norm() <= reach + 1e-9).flat_map(move |shift| {
        let turned = (0..4).map(|turns| UnitComplex::new(f64::from(turns) * FRAC_PI_2));
        let is_another = move |turn: &UnitComplex<f64>| shift.norm() > 0.0 || turn.angle().abs() > SAME_TURN;
        turned.filter(is_another).map(move |turn| {
            let offset = centre.coords + shift - turn * centre.coords;
            Pose2::from_parts(offset.into(), turn)
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::pose;
    use crate::test_world::floor_plan::{DrawnMap, FloorPlan, drawing, seen};
    use std::f64::consts::PI;

    fn rival(a: &DrawnMap, b: &DrawnMap, transform_a_b: &Pose2) -> Option<Rival> {
        let centre = a.transform_world_map.inverse() * Point2::new(10.0, 6.0);
        best_rival_nearby(&a.view(), &b.view(), transform_a_b, &centre, &MergeVerifierParameters::default())
    }

    #[test]
    fn the_starts_are_all_quarter_turns_and_shifts_but_the_alignment_itself() {
        let centre = Point2::new(3.0, -2.0);
        let starts = |rival_reach: f64| -> Vec<Pose2> {
            super::starts(&centre, rival_reach, &IcpParameters::default()).collect()
        };
        assert_eq!(starts(0.0).len(), 3);
        assert!(starts(0.0).iter().all(|start| (start * centre - centre).norm() < 1e-9));
        assert_eq!(starts(2.0).len(), 9 * 4 - 1);
        assert_eq!(starts(4.0).len(), 25 * 4 - 1);
        assert!(starts(4.0).iter().all(|start| (start * centre - centre).norm() < 4.0 + 1e-9));
    }

    #[test]
    fn a_building_with_rooms_of_all_sizes_has_no_good_rival() {
        let office = FloorPlan::office();
        let a = office.draw(seen(-0.2, -0.2, 14.0, 12.2), drawing(3.0, 2.0, 0.4));
        let b = office.draw(seen(5.0, -0.2, 20.2, 12.2), drawing(12.0, 6.0, -2.1));
        let share = rival(&a, &b, &a.transform_to(&b)).map_or(0.0, |rival| rival.agreement.wall_agreement());
        assert!(share < 0.8, "{share}");
    }

    #[test]
    fn the_right_place_is_found_as_the_rival_of_a_wrong_one() {
        let office = FloorPlan::office();
        let part = seen(-0.2, -0.2, 20.2, 12.2);
        let (a, b) = (office.draw(part, drawing(3.0, 2.0, 0.0)), office.draw(part, drawing(12.0, 6.0, -2.1)));
        for wrong in [pose(2.3, 0.4, 0.0), pose(-1.0, -3.0, 0.0), pose(3.0, 0.3, 0.02)] {
            let rival = rival(&a, &b, &(wrong * a.transform_to(&b))).unwrap();
            assert!(rival.agreement.wall_agreement() > 0.95, "{wrong}: {rival:?}");
            assert!((rival.shift - wrong.translation.vector.norm()).abs() < 0.3, "{wrong}: {rival:?}");
        }
    }

    #[test]
    fn a_hall_looks_the_same_after_half_a_turn() {
        let hall = FloorPlan::hall();
        let part = seen(-0.2, -0.2, 20.2, 12.2);
        let (a, b) = (hall.draw(part, drawing(3.0, 2.0, 0.4)), hall.draw(part, drawing(12.0, 6.0, -2.1)));
        let rival = rival(&a, &b, &a.transform_to(&b)).unwrap();
        assert!(rival.agreement.wall_agreement() > 0.95 && (rival.turn.abs() - PI).abs() < 0.02, "{rival:?}");
        assert!(rival.shift < 0.1, "{rival:?}");
    }
}
