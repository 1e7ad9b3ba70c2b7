//! Fixes the gauge freedom of all maps together, which no wall between them constrains: the mean displacement of the
//! reference's map is zero.

use super::body::Body;
use super::refine::RefinedMap;
use crate::shared::geometry::{PointPair, Pose2, fit_rigid};
use nalgebra::Vector3;

/// Moves all maps together so that the rigid transform nearest to the deformation of the reference map is the
/// identity. The deformations of the other maps follow, as they are in frames that stay.
pub fn anchor(maps: &mut [RefinedMap], bodies: &[Body<'_>], reference: usize) {
    let Some(change) = maps.get(reference).and_then(change) else { return };
    let of_maps: Vec<Pose2> = bodies
        .iter()
        .map(|body| body.transform_world_map.inverse() * bodies[reference].transform_world_map)
        .map(|transform_map_reference| transform_map_reference * change * transform_map_reference.inverse())
        .collect();
    // A frame that is too far away leaves all as it is.
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

/// The rigid transform from the deformed reference map to the rigid one, in its frame; none if it is not deformed.
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
