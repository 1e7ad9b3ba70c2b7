//! Sharpness of the merged map: the thickness spread of walls, and the share of double walls.

use super::contacts::{DeformedBody, apart};
use super::{Body, DeformationParameters, RefinedMap};
use gridweave_runtime::ros::Sharpness;
use rayon::prelude::*;

/// Distance above which two drawings of one wall look like two walls, metres: two cells of most maps.
const DOUBLED: f64 = 0.1;
/// Distance above which walls count as different ones, with deformation, metres.
const SAME_WALL: f64 = 0.5;

/// Lengths of wall, metres.
#[derive(Clone, Copy, Default)]
struct Sum {
    length: f64,
    apart: f64,
    doubled: f64,
}

impl Sum {
    fn add(&mut self, length: f64, apart: f64) {
        self.length += length;
        self.apart += length * apart;
        self.doubled += if apart > DOUBLED { length } else { 0.0 };
    }

    fn sharpness(self) -> Sharpness {
        let share = |part: f64| if self.length > 0.0 { part / self.length } else { 0.0 };
        Sharpness { apart: share(self.apart), doubled: share(self.doubled) }
    }
}

/// For each body, the sharpness of the walls that other maps have as well: with rigid maps, and with deformation. Zeros
/// for those that are held.
pub fn sharpness(bodies: &[Body<'_>], maps: &[RefinedMap], parameters: &DeformationParameters) -> Vec<[Sharpness; 2]> {
    let deformed = bodies.iter().zip(maps).map(|(body, map)| DeformedBody::new(body, map.deformation.clone(), 0));
    let deformed: Vec<DeformedBody<'_>> = deformed.collect();
    let of_body = |b: usize| {
        let (mut rigid, mut as_deformed) = (Sum::default(), Sum::default());
        for a in (0..bodies.len()).filter(|a| *a != b && !maps[b].is_held) {
            let (length, found) = apart(&deformed[a], &deformed[b], SAME_WALL.min(parameters.reach));
            for at in found {
                rigid.add(length, at.rigid);
                as_deformed.add(length, at.deformed);
            }
        }
        [rigid.sharpness(), as_deformed.sharpness()]
    };
    (0..bodies.len()).into_par_iter().map(of_body).collect()
}
