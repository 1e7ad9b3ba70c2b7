//! Where all maps lie together, which no wall between them shows: the reference's map stays where it is in the mean.

use super::body::Body;
use super::refine::Bend;
use crate::geometry::{PointPair, Pose2, fit_rigid};
use nalgebra::Vector3;

/// Moves all bends together so that those of the reference map are zero in the mean: the rigid transform that is nearest to its bend is
/// none. The bends of the others follow, as they are told in frames that stay.
pub(super) fn anchor(bends: &mut [Bend], bodies: &[Body<'_>], reference: usize) {
    let Some(change) = change(bends, bodies, reference) else { return };
    for (bend, body) in bends.iter_mut().zip(bodies) {
        let of_map = body.transform_world_map.inverse() * change * body.transform_world_map;
        let lattice = bend.deformation.lattice.clone();
        for (node, by) in bend.deformation.moves.iter_mut().enumerate() {
            let at = lattice.position(node);
            let moved = of_map * (at + by.xy());
            *by = Vector3::new(moved.x - at.x, moved.y - at.y, by.z + change.rotation.angle());
        }
    }
}

/// What takes the bent reference map back to where it is rigid, in the world; none without a reference.
fn change(bends: &[Bend], bodies: &[Body<'_>], reference: usize) -> Option<Pose2> {
    let (bend, body) = (bends.get(reference)?, bodies.get(reference)?);
    let pairs = bend.deformation.moves.iter().enumerate().map(|(node, by)| {
        let at = bend.deformation.lattice.position(node);
        let [a, b] = [at, at + by.xy()].map(|place| body.transform_world_map * place);
        PointPair { a, b, weight: 1.0 }
    });
    Some(fit_rigid(&pairs.collect::<Vec<_>>())?.transform_a_b)
}
