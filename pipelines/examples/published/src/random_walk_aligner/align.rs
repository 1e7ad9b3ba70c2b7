//! Relative poses of two maps by random walks.

use super::walk::{WalkEnd, walk};
use super::{ClassifiedMap, RandomWalkParameters, dissimilarity};
use crate::pair_aligner::{RatedPose, known_area};
use gridweave_stages::registration::search::{Content, NamedMap, PreparedMap, Raster, SearchRefusal};
use gridweave_stages::shared::geometry::{Pose2, quarter_turn};
use nalgebra::{Isometry2, Matrix3, UnitComplex, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Relative poses of map b in map a, each apart from the others, those of least dissimilarity first. The same maps,
/// parameters and seed give the same poses.
///
/// # Errors
/// A map has no walls, or is too large.
pub fn align_by_walks(
    a: &NamedMap<'_>,
    b: &NamedMap<'_>,
    parameters: &RandomWalkParameters,
    seed: u64,
) -> Result<Vec<RatedPose>, SearchRefusal> {
    let cell = parameters.cell.max(PreparedMap::least_cell(&a.grid)).max(PreparedMap::least_cell(&b.grid));
    let (map_a, map_b) = (classified(a, cell, parameters)?, classified(b, cell, parameters)?);
    let walks = Walks { a: &map_a, b: &map_b, parameters, seed };
    let mut ends: Vec<WalkEnd> = (0..parameters.walks).into_par_iter().map(|number| walks.walk(number)).collect();
    // Of equals the first comes first.
    ends.sort_by(|one, other| one.value.total_cmp(&other.value));

    let known = known_area(&a.grid).min(known_area(&b.grid));
    let mut found: Vec<RatedPose> = Vec::new();
    for end in &ends {
        let (transform, covariance) = walks.transform(end);
        let hypothesis = RatedPose::new(&a.grid, &b.grid, transform, covariance, known);
        let is_known =
            |other: &RatedPose| hypothesis.is_near(other, &map_b.middle(), parameters.apart, parameters.apart_yaw);
        if !found.iter().any(is_known) {
            found.push(hypothesis);
        }
    }
    Ok(found)
}

fn classified(
    map: &NamedMap<'_>,
    cell: f64,
    parameters: &RandomWalkParameters,
) -> Result<ClassifiedMap, SearchRefusal> {
    let robot = || map.robot.to_owned();
    let raster = Raster::new(&map.grid, cell, parameters.max_extent)
        .ok_or_else(|| SearchRefusal::TooLarge { robot: robot(), most: parameters.max_extent })?;
    if !raster.cells.contains(&Content::Wall) {
        return Err(SearchRefusal::NoWalls { robot: robot() });
    }
    Ok(ClassifiedMap::new(raster, parameters.max_points))
}

/// Walks over the relative poses of two maps: x and y of the centre of map b from that of map a, and the rotation.
struct Walks<'a> {
    a: &'a ClassifiedMap,
    b: &'a ClassifiedMap,
    parameters: &'a RandomWalkParameters,
    seed: u64,
}

impl Walks<'_> {
    fn walk(&self, number: usize) -> WalkEnd {
        // A random stream for each walk, so that the threads do not matter.
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(number as u64);
        let sector = TAU / self.parameters.walks as f64;
        let yaw = (number as f64 + random.random::<f64>()) * sector;
        let RandomWalkParameters { first_move, first_turn, .. } = *self.parameters;
        let psi = |place: &Vector3<f64>| dissimilarity(self.a, self.b, &self.at(place));
        let first = Vector3::new(first_move, first_move, first_turn);
        walk(Vector3::new(0.0, 0.0, yaw), &first, &self.least().inf(&first), self.parameters, &mut random, psi)
    }

    /// The least deviations of moves: a quarter of a cell, at the rim of map b too.
    fn least(&self) -> Vector3<f64> {
        let cell = 0.25 * self.a.cell();
        Vector3::new(cell, cell, cell / self.b.radius().max(cell))
    }

    /// `T_a_b`.
    fn at(&self, place: &Vector3<f64>) -> Pose2 {
        let turn = UnitComplex::new(place.z);
        let translation = self.a.middle().coords + place.xy() - turn * self.b.middle().coords;
        Isometry2::from_parts(translation.into(), turn)
    }

    /// End of a walk, and the covariance: the spread of its last moves, and at least that of its shortest moves.
    fn transform(&self, end: &WalkEnd) -> (Pose2, Matrix3<f64>) {
        let transform = self.at(&end.place);
        let arm = -quarter_turn(&(transform.rotation * self.b.middle().coords));
        let jacobian = Matrix3::new(1.0, 0.0, arm.x, 0.0, 1.0, arm.y, 0.0, 0.0, 1.0);
        let least = self.least();
        let about_middle = end.spread + Matrix3::from_diagonal(&least.component_mul(&least));
        (transform, jacobian * about_middle * jacobian.transpose())
    }
}
