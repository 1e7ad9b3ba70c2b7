//! Non-rigid registration of one map onto another, within the drift of a SLAM. It is tried where two maps contradict
//! each other as they came.

use super::ComparisonParameters;
use super::agreement::{Agreement, MapView, compare};
use crate::registration::non_rigid::{Body, DeformationParameters, deform_onto};
use crate::shared::deformation::Deformation;
use crate::shared::geometry::{Point2, PointPair, Pose2, RigidFit, covariance_about, fit_rigid, is_known};
use crate::shared::walls::{WallMap, stride};
use nalgebra::{Matrix2, Matrix3, Vector2};
use std::f64::consts::SQRT_2;

/// At most this many points are used to fit the nearest rigid transform.
const MOST_PLACES: usize = 4_000;

/// A deformation of map b onto map a, and the agreement of the maps under it.
#[derive(Clone, Copy, Debug)]
pub struct Deformed {
    /// The rigid `T_a_b` nearest to the deformation, over the points that both maps know.
    pub transform_a_b: Pose2,
    /// Covariance of (x, y, yaw) of the rigid transform that the deformation leaves, over the parts of the map,
    /// metres and radians.
    pub covariance: Matrix3<f64>,
    /// Root mean square of the displacement of points from the rigid transform, metres.
    pub rms: f64,
    /// Size of map b as it is deformed, as a share of its size. The deformation is estimated as small as the maps
    /// allow, so it does not reach the whole error of a wrong resolution.
    pub scale: f64,
    /// Cost of the deformation, see [`RefinedMap::cost`](crate::registration::non_rigid::RefinedMap::cost).
    pub cost: f64,
    /// Agreement of the maps with map b deformed.
    pub agreement: Agreement,
}

impl Deformed {
    /// Deforms map b onto map a, from an initial relative pose. `None` if the equations have no solution, or if the
    /// maps then have nothing in common. The [`bodies`](Self::bodies) of the maps serve for all poses.
    pub fn new(
        a: &MapView<'_>,
        b: &MapView<'_>,
        [body_a, body_b]: &[Body<'_>; 2],
        transform_a_b: &Pose2,
        parameters: &ComparisonParameters,
    ) -> Option<Self> {
        // Map a is fixed, so map b takes the deformation of both.
        let most = DeformationParameters {
            bend: SQRT_2 * parameters.bend,
            turn: SQRT_2 * parameters.turn,
            ..Default::default()
        };
        let (deformation, cost) = deform_onto(body_a, &body_b.at(*transform_a_b), &most)?;
        let walls = b.walls.deformed(&deformation);
        let deformed = MapView { grid: b.grid, walls: &walls, deformation: Some(&deformation) };
        let (nearest, scale) = nearest_rigid(a, b.walls, transform_a_b, &deformation)?;
        Some(Self {
            transform_a_b: nearest.transform_a_b,
            covariance: nearest.covariance,
            rms: nearest.rms,
            scale,
            cost,
            agreement: compare(a, &deformed, transform_a_b, parameters),
        })
    }

    /// Two maps, each in its own frame, as they are deformed.
    pub fn bodies<'a>(a: &MapView<'a>, b: &MapView<'a>) -> [Body<'a>; 2] {
        let spacing = DeformationParameters::default().spacing;
        [a, b].map(|map| Body::new(&map.grid, map.walls, Pose2::identity(), spacing))
    }
}

/// Fits the rigid `T_a_b` nearest to a deformation of map b, over the points that both maps know, and the size of map b
/// under it. The covariance of the transform is what the deformation leaves: points are displaced and turned against
/// it. Half of either may be the same everywhere, as far as the maps show, and then the transform is wrong by that.
fn nearest_rigid(
    a: &MapView<'_>,
    b: &WallMap,
    transform_a_b: &Pose2,
    deformation: &Deformation,
) -> Option<(RigidFit, f64)> {
    let samples = b.samples.iter().step_by(stride(b.samples.len(), MOST_PLACES));
    let places = samples.map(|sample| (sample.point, transform_a_b * deformation.apply(&sample.point)));
    let common: Vec<_> = places.filter(|(_, in_a)| is_known(a.value_at(in_a))).collect();
    let weight = 1.0 / common.len() as f64;
    let pairs: Vec<PointPair> = common.iter().map(|&(b, a)| PointPair { a, b, weight }).collect();
    let fit = fit_rigid(&pairs)?;
    let fitted = (transform_a_b.rotation.inverse() * fit.transform_a_b.rotation).angle();
    let turned = weight * common.iter().map(|(b, _)| (deformation.turn(b) - fitted).powi(2)).sum::<f64>();
    let middle = common.iter().fold(Vector2::zeros(), |sum, (b, _)| sum + weight * b.coords);
    let of_turn = covariance_about(&fit.transform_a_b, &middle.into(), &Matrix2::zeros(), 0.5 * turned);
    // With these weights the fit's own covariance is that of points with a variance of 1 whose errors are fully
    // correlated.
    Some((RigidFit { covariance: fit.covariance * (0.5 * fit.rms.powi(2)) + of_turn, ..fit }, scale(&pairs, &fit)))
}

/// Size of map a as a share of that of map b, by points of which the nearest rigid transform is known (Umeyama 1991,
/// equation 42).
fn scale(pairs: &[PointPair], fit: &RigidFit) -> f64 {
    let weight = 1.0 / pairs.len() as f64;
    let middle = pairs.iter().fold(Vector2::zeros(), |sum, pair| sum + weight * pair.b.coords);
    let middle_a = fit.transform_a_b * Point2::from(middle);
    let sums = pairs.iter().fold((0.0, f64::MIN_POSITIVE), |(along, square), pair| {
        let arm = pair.b.coords - middle;
        (along + (fit.transform_a_b.rotation * arm).dot(&(pair.a - middle_a)), square + arm.norm_squared())
    });
    sums.0 / sums.1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::pose;

    #[test]
    fn the_scale_is_that_of_the_points() {
        let points = [(0.0, 0.0), (4.0, 0.5), (1.0, 3.0), (-2.0, 5.0)].map(|(x, y)| Point2::new(x, y));
        for factor in [0.9, 1.0, 1.07] {
            let moved = |b: &Point2| pose(3.0, -2.0, 0.7) * Point2::from(factor * b.coords);
            let pairs = points.map(|b| PointPair { a: moved(&b), b, weight: 0.25 });
            let fit = fit_rigid(&pairs).unwrap();
            assert!((scale(&pairs, &fit) - factor).abs() < 1e-9);
        }
    }
}
