//! How large the fused grid is, and where its cells lie.

use super::{KnownArea, PlacedGrid};
use crate::geometry::{GridGeometry, Point2, pose};

/// A rectangle along the world's axes, in cells of the fused grid, counted from the anchor.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Extent {
    low: Point2,
    high: Point2,
}

/// The lattice that the fused grid's cells lie on, and its limits.
#[derive(Clone, Copy, Debug)]
pub struct Lattice {
    /// A corner of a cell, metres in the world: that of the reference robot's map, so that its cells fall on cells of
    /// the fused map.
    pub anchor: Point2,
    /// Metres a cell.
    pub resolution: f64,
    /// The longest side that a grid may have, metres.
    pub max_extent: f64,
    /// The most cells that a grid may have.
    pub max_cells: u64,
}

/// Where the fused cells lie, and which maps take part.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    /// The fused grid in the world: along its axes, cropped to what is known. `None` if nothing is.
    pub geometry: Option<GridGeometry>,
    /// For every map, whether it is part of it. A map is not if its pose is no finite number, or if it would make the
    /// grid larger than the limits allow.
    pub takes_part: Vec<bool>,
}

/// Lays out the fused grid of the given maps, earlier maps first: a map that does not fit those before it is left out.
pub fn lay_out(maps: &[(PlacedGrid<'_>, &KnownArea)], lattice: &Lattice) -> Layout {
    let mut whole: Option<Extent> = None;
    let mut takes_part = Vec::with_capacity(maps.len());
    for (map, area) in maps {
        let extent = extent(map, area, lattice);
        let joined = match (whole, extent) {
            (Some(one), Ok(Some(next))) => Some(one.joined(&next)),
            (one, Ok(next)) => one.or(next),
            (_, Err(NotFinite)) => None,
        };
        let fits = extent.is_ok() && joined.is_none_or(|joined| lattice.geometry(&joined).is_some());
        if fits {
            whole = joined;
        }
        takes_part.push(fits);
    }
    Layout { geometry: whole.and_then(|extent| lattice.geometry(&extent)), takes_part }
}

#[derive(Clone, Copy)]
struct NotFinite;

fn extent(map: &PlacedGrid<'_>, area: &KnownArea, lattice: &Lattice) -> Result<Option<Extent>, NotFinite> {
    let transform_world_grid = map.transform_world_grid();
    let mut extent: Option<Extent> = None;
    for corner in area.corners() {
        let in_world = transform_world_grid * (corner * map.grid.geometry.resolution);
        let in_cells = Point2::from((in_world - lattice.anchor) / lattice.resolution);
        if !in_cells.coords.iter().all(|value| value.is_finite()) {
            return Err(NotFinite);
        }
        let corner = Extent { low: in_cells, high: in_cells };
        extent = Some(extent.map_or(corner, |extent| extent.joined(&corner)));
    }
    Ok(extent)
}

impl Extent {
    fn joined(&self, other: &Self) -> Self {
        Self { low: self.low.inf(&other.low), high: self.high.sup(&other.high) }
    }
}

impl Lattice {
    /// The grid of the cells whose centres lie within the extent. `None` if it is beyond the limits.
    fn geometry(&self, extent: &Extent) -> Option<GridGeometry> {
        let (left, width) = self.cells(extent.low.x, extent.high.x)?;
        let (bottom, height) = self.cells(extent.low.y, extent.high.y)?;
        let is_small = (width as u64).checked_mul(height as u64).is_some_and(|cells| cells <= self.max_cells);
        let corner = self.anchor + nalgebra::Vector2::new(left, bottom) * self.resolution;
        let origin = pose(corner.x, corner.y, 0.0);
        is_small.then_some(GridGeometry { width, height, resolution: self.resolution, origin })
    }

    /// The first cell and the number of cells on one axis.
    fn cells(&self, low: f64, high: f64) -> Option<(f64, usize)> {
        // The extent's ends lie on the borders of cells, mostly; centres are half a cell away from rounding errors.
        let (mut first, mut behind) = ((low - 0.5).ceil(), (high - 0.5).floor() + 1.0);
        if behind <= first {
            (first, behind) = (low.floor(), low.floor() + 1.0);
        }
        let count = behind - first;
        (count * self.resolution <= self.max_extent && count < f64::from(u32::MAX)).then_some((first, count as usize))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Cell, Grid, Pose2};
    use proptest::prelude::*;

    const LATTICE: Lattice =
        Lattice { anchor: Point2::new(-1.3, 2.7), resolution: 0.05, max_extent: 100.0, max_cells: 1_000_000 };

    fn geometry(width: usize, height: usize) -> GridGeometry {
        GridGeometry { width, height, resolution: 0.05, origin: pose(-1.3, 2.7, 0.0) }
    }

    fn grid(cells: &[i8]) -> Grid<'_> {
        Grid::new(geometry(6, cells.len() / 6), cells).unwrap()
    }

    fn lay_out_at(grid: Grid<'_>, poses: &[Pose2]) -> Layout {
        let area = KnownArea::of(&grid);
        let maps: Vec<_> =
            poses.iter().map(|&transform_world_map| (PlacedGrid { grid, transform_world_map }, &area)).collect();
        lay_out(&maps, &LATTICE)
    }

    #[rustfmt::skip]
    const CELLS: [i8; 24] = [
        -1, -1, -1, -1, -1, -1,
        -1, -1,  0, 50, -1, -1,
        -1,  0, -1, -1, -1, -1,
        -1, -1, -1, -1, -1, -1,
    ];

    #[test]
    fn the_grid_is_cropped_and_lies_on_the_reference_cells() {
        let layout = lay_out_at(grid(&CELLS), &[Pose2::identity()]);
        let laid = layout.geometry.unwrap();
        assert_eq!((laid.width, laid.height), (3, 2));
        let (mine, theirs) =
            (laid.centre(Cell { column: 0, row: 0 }), geometry(6, 4).centre(Cell { column: 1, row: 1 }));
        assert!((mine - theirs).norm() < 1e-12);
    }

    #[test]
    fn nothing_known_gives_no_grid() {
        assert_eq!(lay_out_at(grid(&[-1; 24]), &[Pose2::identity()]).geometry, None);
        assert_eq!(lay_out(&[], &LATTICE).geometry, None);
    }

    #[test]
    fn absurd_poses_are_left_out() {
        let absurd =
            [pose(f64::NAN, 0.0, 0.0), pose(f64::INFINITY, 0.0, 0.0), pose(3e3, 0.0, 0.0), pose(1e300, 0.0, 0.0)];
        for bad in absurd {
            let layout = lay_out_at(grid(&CELLS), &[Pose2::identity(), bad, pose(1.0, 0.0, 0.3)]);
            assert_eq!(layout.takes_part, [true, false, true], "{bad:?}");
            assert!(layout.geometry.unwrap().width < 40);
        }
        let many_cells = lay_out_at(grid(&CELLS), &[Pose2::identity(), pose(60.0, 60.0, 0.0)]);
        assert_eq!(many_cells.takes_part, [true, false], "1200 x 1200 cells are more than a million");
    }

    proptest! {
        #[test]
        fn every_known_cell_lies_on_the_grid(x in -9.0..9.0, y in -9.0..9.0, yaw in -4.0..4.0) {
            let transform_world_map = pose(x, y, yaw);
            let laid = lay_out_at(grid(&CELLS), &[transform_world_map]).geometry.unwrap();
            for cell in [Cell { column: 2, row: 1 }, Cell { column: 3, row: 1 }, Cell { column: 1, row: 2 }] {
                let centre = transform_world_map * geometry(6, 4).centre(cell);
                prop_assert!(laid.cell(&centre).is_some());
            }
        }
    }
}
