//! A map bent onto another, as far as the maps of a SLAM bend: what is compared where two maps contradict each other as
//! they came.

use super::ComparisonParameters;
use super::agreement::{Agreement, MapView, compare};
use crate::merge::elastic_refiner::{Body, ElasticRefinerParameters, refine};
use crate::shared::deformation::Deformation;
use crate::shared::geometry::{PointPair, Pose2, RigidFit, covariance_about, fit_rigid, is_known};
use crate::shared::walls::{WallMap, stride};
use nalgebra::{Matrix2, Matrix3, Vector2};
use std::f64::consts::SQRT_2;

/// The rigid transform that is nearest to a bend is fitted to so many places at the most.
const MOST_PLACES: usize = 4_000;

/// Where a map lies on another if it is bent, and what the two say of each other then.
#[derive(Clone, Copy, Debug)]
pub struct Deformed {
    /// The `T_a_b` that comes nearest to the bent map where both maps know the place.
    pub transform_a_b: Pose2,
    /// How far it may be from the place of any one part of the map: the covariance of (x, y, yaw) that the bend leaves, metres
    /// and radians.
    pub covariance: Matrix3<f64>,
    /// The root mean square of how far places lie from where that transform has them, metres.
    pub bend: f64,
    /// How unlikely such a bend is, see [`Bend::cost`](crate::merge::elastic_refiner::Bend::cost).
    pub cost: f64,
    /// What the bent map says.
    pub agreement: Agreement,
}

impl Deformed {
    /// Bends map b onto map a from an alignment on. `None` if it cannot be bent, or has nothing in common with map a then.
    pub fn new(
        a: &MapView<'_>,
        b: &MapView<'_>,
        transform_a_b: &Pose2,
        parameters: &ComparisonParameters,
    ) -> Option<Self> {
        // All is laid on map a, which is bent as well.
        let elastic = ElasticRefinerParameters {
            bend: SQRT_2 * parameters.bend,
            turn: SQRT_2 * parameters.turn,
            ..Default::default()
        };
        let bodies = [
            Body::new(&a.grid, a.walls, Pose2::identity(), elastic.spacing).kept(),
            Body::new(&b.grid, b.walls, *transform_a_b, elastic.spacing),
        ];
        let bend = refine(&bodies, &elastic)?.bends.pop()?;
        let walls = b.walls.bent(&bend.deformation);
        let bent = MapView { grid: b.grid, walls: &walls, bend: Some(&bend.deformation) };
        let nearest = nearest_rigid(a, b.walls, transform_a_b, &bend.deformation)?;
        Some(Self {
            transform_a_b: nearest.transform_a_b,
            covariance: nearest.covariance,
            bend: nearest.rms,
            cost: bend.cost,
            agreement: compare(a, &bent, transform_a_b, parameters),
        })
    }
}

/// The `T_a_b` nearest to a bend of map b, over the places that both maps know. Its covariance is what the bend leaves: places
/// lie beside where the transform has them, and are turned otherwise. Half of either may be the same everywhere, as far as
/// the maps can tell, and then it is wrong by that.
fn nearest_rigid(a: &MapView<'_>, b: &WallMap, transform_a_b: &Pose2, bend: &Deformation) -> Option<RigidFit> {
    let samples = b.samples.iter().step_by(stride(b.samples.len(), MOST_PLACES));
    let places = samples.map(|sample| (sample.point, transform_a_b * bend.apply(&sample.point)));
    let common: Vec<_> = places.filter(|(_, in_a)| is_known(a.value_at(in_a))).collect();
    let weight = 1.0 / common.len() as f64;
    let pairs: Vec<PointPair> = common.iter().map(|&(b, a)| PointPair { a, b, weight }).collect();
    let fit = fit_rigid(&pairs)?;
    let fitted = (transform_a_b.rotation.inverse() * fit.transform_a_b.rotation).angle();
    let turned = weight * common.iter().map(|(b, _)| (bend.turn(b) - fitted).powi(2)).sum::<f64>();
    let middle = common.iter().fold(Vector2::zeros(), |sum, (b, _)| sum + weight * b.coords);
    let of_turn = covariance_about(&fit.transform_a_b, &middle.into(), &Matrix2::zeros(), 0.5 * turned);
    // With these weights the fit's own covariance is that of places with a variance of 1 that are all wrong together.
    Some(RigidFit { covariance: fit.covariance * (0.5 * fit.rms.powi(2)) + of_turn, ..fit })
}
