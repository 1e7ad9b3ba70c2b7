//! Size and origin of the fused grid.

use super::{KnownArea, PlacedGrid};
use crate::shared::geometry::{GridGeometry, Point2, most_cells_over, pose};
use nalgebra::Vector2;

/// A rectangle along the world's axes, in cells of the fused grid, counted from the anchor.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Extent {
    low: Point2,
    high: Point2,
}

/// The lattice of the fused grid's cells, and its limits.
#[derive(Clone, Copy, Debug)]
pub struct CellLattice {
    /// A corner of a cell, metres in the world: that of the reference robot's map, so that its cells coincide with
    /// cells of the fused map.
    pub anchor: Point2,
    /// Metres per cell.
    pub resolution: f64,
    /// Longest side of a grid, metres.
    pub max_extent: f64,
    /// Largest number of cells of a grid.
    pub max_cells: u64,
}

/// The fused grid, and the maps in it.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    /// The fused grid in the world: along its axes, cropped to its known part. `None` if nothing is known.
    pub geometry: Option<GridGeometry>,
    /// For every map, whether it is in the grid.
    pub takes_part: Vec<Result<(), LeftOut>>,
}

/// Why a map is not in the fused grid.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum LeftOut {
    /// Its pose is not finite.
    #[error("its pose is not finite")]
    NotFinite,
    /// It is longer itself than the grid may be.
    #[error("it is longer than `max_extent`, {0} m: allow a longer fused map, --set fuser.max_extent=METRES")]
    TooLongAlone(f64),
    /// A side of the grid would be too long.
    #[error("it is so far away that the fused map would be longer than `max_extent`, {0} m; {DOUBT}")]
    TooLong(f64),
    /// The grid would have too many cells.
    #[error("the fused map would have more cells than `max_cells`, {0}; {DOUBT}")]
    TooManyCells(u64),
    /// Nearly all of the grid would be unknown.
    #[error("it is so far away that nearly all of the fused map would be unknown; {DOUBT}")]
    Unknown,
}

/// What puts a map far away, other than a wrong merge.
const DOUBT: &str = "does the origin of each map fit the poses of its robot?";

/// Computes the fused grid of the given maps, earlier maps first: a map that does not fit those before it is left
/// out.
pub fn layout_of(maps: &[(PlacedGrid<'_>, &KnownArea)], lattice: &CellLattice) -> Layout {
    let mut layout = Layout { geometry: None, takes_part: Vec::with_capacity(maps.len()) };
    let (mut whole, mut known): (Option<Extent>, f64) = (None, 0.0);
    for (map, area) in maps {
        let fits = extent(map, area, lattice).and_then(|extent| {
            let Some(extent) = extent else { return Ok(()) };
            let cells = area.cell_count() as f64 * (map.grid.geometry.resolution / lattice.resolution).powi(2);
            if extent.sides().max() * lattice.resolution > lattice.max_extent {
                return Err(LeftOut::TooLongAlone(lattice.max_extent));
            }
            let joined = whole.map_or(extent, |whole| whole.joined(&extent));
            layout.geometry = Some(lattice.geometry(&joined, known + cells)?);
            (whole, known) = (Some(joined), known + cells);
            Ok(())
        });
        layout.takes_part.push(fits);
    }
    layout
}

/// Bounding rectangle of the known part of a map, if there is any.
fn extent(map: &PlacedGrid<'_>, area: &KnownArea, lattice: &CellLattice) -> Result<Option<Extent>, LeftOut> {
    let mut extent: Option<Extent> = None;
    for corner in area.corners() {
        let in_cells = Point2::from((map.in_world(&corner) - lattice.anchor) / lattice.resolution);
        if !in_cells.coords.iter().all(|value| value.is_finite()) {
            return Err(LeftOut::NotFinite);
        }
        let corner = Extent { low: in_cells, high: in_cells };
        extent = Some(extent.map_or(corner, |extent| extent.joined(&corner)));
    }
    Ok(extent)
}

impl Extent {
    /// Lengths along x and y, cells.
    fn sides(&self) -> Vector2<f64> {
        self.high - self.low
    }

    fn joined(&self, other: &Self) -> Self {
        Self { low: self.low.inf(&other.low), high: self.high.sup(&other.high) }
    }
}

impl CellLattice {
    /// The grid of the cells whose centres are within the extent, about `known` of which are known.
    fn geometry(&self, extent: &Extent, known: f64) -> Result<GridGeometry, LeftOut> {
        let (left, width) = self.cells(extent.low.x, extent.high.x)?;
        let (bottom, height) = self.cells(extent.low.y, extent.high.y)?;
        let cells = width as f64 * height as f64;
        if cells > self.max_cells as f64 {
            return Err(LeftOut::TooManyCells(self.max_cells));
        }
        if cells > most_cells_over(known) {
            return Err(LeftOut::Unknown);
        }
        let corner = self.anchor + Vector2::new(left, bottom) * self.resolution;
        let origin = pose(corner.x, corner.y, 0.0);
        Ok(GridGeometry { width, height, resolution: self.resolution, origin })
    }

    /// First cell and number of cells on one axis.
    fn cells(&self, low: f64, high: f64) -> Result<(f64, usize), LeftOut> {
        // The extent's ends are mostly on the borders of cells; centres are half a cell away from rounding errors.
        let (mut first, mut behind) = ((low - 0.5).ceil(), (high - 0.5).floor() + 1.0);
        if behind <= first {
            (first, behind) = (low.floor(), low.floor() + 1.0);
        }
        let count = behind - first;
        let fits = count * self.resolution <= self.max_extent && count < f64::from(u32::MAX);
        if fits { Ok((first, count as usize)) } else { Err(LeftOut::TooLong(self.max_extent)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::{Cell, Grid, Pose2};
    use proptest::prelude::*;

    const LATTICE: CellLattice =
        CellLattice { anchor: Point2::new(-1.3, 2.7), resolution: 0.05, max_extent: 100.0, max_cells: 1_000_000 };

    fn geometry(width: usize, height: usize) -> GridGeometry {
        GridGeometry { width, height, resolution: 0.05, origin: pose(-1.3, 2.7, 0.0) }
    }

    fn grid(cells: &[i8]) -> Grid<'_> {
        Grid::new(geometry(6, cells.len() / 6), cells).unwrap()
    }

    fn layout_at(grid: Grid<'_>, poses: &[Pose2]) -> Layout {
        let area = KnownArea::of(&grid);
        let maps: Vec<_> =
            poses.iter().map(|&transform_world_map| (PlacedGrid::rigid(grid, transform_world_map), &area)).collect();
        layout_of(&maps, &LATTICE)
    }

    #[rustfmt::skip]
    const CELLS: [i8; 24] = [
        -1, -1, -1, -1, -1, -1,
        -1, -1,  0, 50, -1, -1,
        -1,  0, -1, -1, -1, -1,
        -1, -1, -1, -1, -1, -1,
    ];

    #[test]
    fn the_grid_is_cropped_and_coincides_with_the_reference_cells() {
        let layout = layout_at(grid(&CELLS), &[Pose2::identity()]);
        let geometry_of_layout = layout.geometry.unwrap();
        assert_eq!((geometry_of_layout.width, geometry_of_layout.height), (3, 2));
        let (mine, theirs) =
            (geometry_of_layout.centre(Cell { column: 0, row: 0 }), geometry(6, 4).centre(Cell { column: 1, row: 1 }));
        assert!((mine - theirs).norm() < 1e-12);
    }

    #[test]
    fn nothing_known_gives_no_grid() {
        assert_eq!(layout_at(grid(&[-1; 24]), &[Pose2::identity()]).geometry, None);
        assert_eq!(layout_of(&[], &LATTICE).geometry, None);
    }

    #[test]
    fn a_map_that_is_too_long_by_itself_is_called_so() {
        let long = GridGeometry { width: 6, height: 4, resolution: 50.0, origin: pose(-1.3, 2.7, 0.0) };
        let layout = layout_at(Grid::new(long, &CELLS).unwrap(), &[Pose2::identity()]);
        assert_eq!((layout.geometry, &layout.takes_part[..]), (None, &[Err(LeftOut::TooLongAlone(100.0))][..]));
    }

    #[test]
    fn absurd_poses_are_left_out() {
        let absurd =
            [pose(f64::NAN, 0.0, 0.0), pose(f64::INFINITY, 0.0, 0.0), pose(3e3, 0.0, 0.0), pose(1e300, 0.0, 0.0)];
        for bad in absurd {
            let layout = layout_at(grid(&CELLS), &[Pose2::identity(), bad, pose(1.0, 0.0, 0.3)]);
            assert_eq!(layout.takes_part.iter().map(Result::is_ok).collect::<Vec<_>>(), [true, false, true], "{bad:?}");
            assert!(layout.geometry.unwrap().width < 40);
        }
        let many_cells = layout_at(grid(&CELLS), &[Pose2::identity(), pose(60.0, 60.0, 0.0)]);
        let too_many = Err(LeftOut::TooManyCells(1_000_000));
        assert_eq!(many_cells.takes_part, [Ok(()), too_many], "1200 x 1200 cells are more than a million");
    }

    #[test]
    fn the_largest_grid_depends_on_the_known_area_and_not_on_the_distance() {
        let lattice = CellLattice { max_extent: 1e6, max_cells: 100_000_000, ..LATTICE };
        let known = vec![0; 6 * 4];
        let (grid, area) = (grid(&known), KnownArea::of(&grid(&known)));
        let at = |x: f64, y: f64| (PlacedGrid::rigid(grid, pose(x, y, 0.0)), &area);
        let layout = layout_of(&[at(0.0, 0.0), at(300.0, 300.0), at(150.0, 150.0)], &lattice);
        assert_eq!(layout.takes_part, [Ok(()), Err(LeftOut::Unknown), Ok(())]);
        assert!(layout.geometry.unwrap().cell_count() < 10_000_000);
    }

    proptest! {
        #[test]
        fn every_known_cell_is_on_the_grid(x in -9.0..9.0, y in -9.0..9.0, yaw in -4.0..4.0) {
            let transform_world_map = pose(x, y, yaw);
            let geometry_of_layout = layout_at(grid(&CELLS), &[transform_world_map]).geometry.unwrap();
            for cell in [Cell { column: 2, row: 1 }, Cell { column: 3, row: 1 }, Cell { column: 1, row: 2 }] {
                let centre = transform_world_map * geometry(6, 4).centre(cell);
                prop_assert!(geometry_of_layout.cell(&centre).is_some());
            }
        }
    }
}
