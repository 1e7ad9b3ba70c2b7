//! Where all maps lie together, which no wall between them shows: the reference's map stays where it is in the mean.

use super::body::Body;
use super::refine::RefinedMap;
use crate::shared::geometry::{PointPair, Pose2, fit_rigid};
use nalgebra::Vector3;

/// Moves all bends together so that those of the reference map are zero in the mean: the rigid transform that is nearest to its bend is
/// none. The bends of the others follow, as they are told in frames that stay.
pub(super) fn anchor(maps: &mut [RefinedMap], bodies: &[Body<'_>], reference: usize) {
    let Some(change) = maps.get(reference).and_then(change) else { return };
    let of_maps: Vec<Pose2> = bodies
        .iter()
        .map(|body| body.transform_world_map.inverse() * bodies[reference].transform_world_map)
        .map(|transform_map_reference| transform_map_reference * change * transform_map_reference.inverse())
        .collect();
    // A frame that lies too far away for numbers leaves all as it is.
    if !of_maps.iter().all(|of_map| of_map.translation.vector.iter().all(|value| value.is_finite())) {
        return;
    }
    for (map, of_map) in maps.iter_mut().zip(&of_maps) {
        let lattice = &map.deformation.lattice;
        for (node, by) in map.deformation.moves.iter_mut().enumerate() {
            let at = lattice.position(node);
            let moved = of_map * (at + by.xy());
            *by = Vector3::new(moved.x - at.x, moved.y - at.y, by.z + change.rotation.angle());
        }
    }
}

/// What takes the bent reference map back to where it is rigid, in its frame; none if it is not bent.
fn change(reference: &RefinedMap) -> Option<Pose2> {
    let moves = &reference.deformation.moves;
    if moves.iter().all(|by| by.iter().all(|value| *value == 0.0)) {
        return None;
    }
    let pairs = moves.iter().enumerate().map(|(node, by)| {
        let a = reference.deformation.lattice.position(node);
        PointPair { a, b: a + by.xy(), weight: 1.0 }
    });
    Some(fit_rigid(&pairs.collect::<Vec<_>>())?.transform_a_b)
}
