//! The whole of it: search, judge, refine.

use super::fine_search::covariance;
use super::{MapAlignerParameters, Raster, Refusal, refine_peak, search};
use crate::geometry::{Grid, Pose2};
use nalgebra::Matrix3;

/// A cell of a raster is at least as many cells of the grid wide: then, however the grid is turned, none in its midst is
/// left out.
const LEAST_CELLS: f64 = 1.5;

/// A first guess of how two maps lie to each other.
#[derive(Clone, Debug, PartialEq)]
pub struct MapAlignment {
    /// `T_a_b`.
    pub transform_a_b: Pose2,
    /// Covariance of (x, y, yaw), metres and radians.
    pub covariance: Matrix3<f64>,
    /// By how much the place stands out: 1 less what the best other place scores of it, 0 to 1.
    pub margin: f64,
    /// About the length of wall on which the maps agree, metres.
    pub wall_in_common: f64,
    /// The share of the walls of map b that meet walls, and not free space, of map a, 0 to 1.
    pub wall_agreement: f64,
    /// How far the best other place is, metres, and how much the map is turned there, radians.
    pub runner_up_change: (f64, f64),
}

impl MapAlignment {
    /// What speaks for it, in plain words.
    pub fn reason(&self) -> String {
        let (shift, turn) = self.runner_up_change;
        format!(
            "the maps alone: {:.0} m of walls in common, and at the best of all other places, {shift:.1} m and {:.0} \
             degrees away, they fit {:.0} % as well",
            self.wall_in_common,
            turn.to_degrees(),
            100.0 * (1.0 - self.margin),
        )
    }
}

/// A robot's map, as it takes part.
#[derive(Clone, Copy, Debug)]
pub struct NamedMap<'a> {
    /// Whose it is.
    pub robot: &'a str,
    /// Its cells.
    pub grid: Grid<'a>,
}

/// Finds how map b lies on map a.
pub fn align_maps(
    a: &NamedMap<'_>,
    b: &NamedMap<'_>,
    parameters: &MapAlignerParameters,
) -> Result<MapAlignment, Refusal> {
    let least = LEAST_CELLS * a.grid.geometry.resolution.max(b.grid.geometry.resolution);
    let raster = |map: &NamedMap<'_>, cell: f64| {
        let raster = Raster::new(&map.grid, cell.max(least), parameters.max_extent)
            .ok_or_else(|| Refusal::TooLarge { robot: map.robot.to_owned(), most: parameters.max_extent })?;
        let has_walls = raster.wall_cells().next().is_some();
        if has_walls { Ok(raster) } else { Err(Refusal::NoWalls { robot: map.robot.to_owned() }) }
    };
    let (coarse_a, coarse_b) = (raster(a, parameters.cell)?, raster(b, parameters.cell)?);
    let found = search(&coarse_a, &coarse_b, parameters).ok_or(Refusal::NoFit)?;
    let (share, (shift, turn)) = (found.runner_up_share(), found.runner_up_change());
    if found.wall_in_common < parameters.min_wall_length {
        let (length, least) = (found.wall_in_common, parameters.min_wall_length);
        return Err(Refusal::TooLittleInCommon { length, least });
    }
    if share > parameters.max_runner_up {
        let most = parameters.max_runner_up;
        return Err(Refusal::Ambiguous { share, most, shift, turn: turn.to_degrees() });
    }
    let (fine_a, fine_b) = (raster(a, parameters.fine_cell)?, raster(b, parameters.fine_cell)?);
    let transform_a_b = refine_peak(&fine_a, &fine_b, &found.best.transform_a_b, &found.centre, parameters);
    Ok(MapAlignment {
        transform_a_b,
        covariance: covariance(&transform_a_b, &found.centre, fine_a.cell, parameters),
        margin: 1.0 - share,
        wall_in_common: found.wall_in_common,
        wall_agreement: found.wall_agreement,
        runner_up_change: (shift, turn),
    })
}
