//! Drawn maps of buildings with exactly known wall directions, without a drive, to measure the estimate of the
//! direction.
//!
//! A random building of rooms, doors and furniture is centred on a grid and turned by a given angle; what is beyond
//! the grid is cut off. Its walls are drawn in one of several [styles](WallStyle), or scanned by a lidar from many
//! positions. The errors of the drawn walls are those of maps of lasers: single cells and whole stretches behind
//! furniture are missing, walls waver slowly (scans with small pose errors) and from cell to cell (range noise),
//! there is furniture at odd angles, and single cells are occupied at random.

use super::floor_plan::{BuildingSize, FloorPlan};
use super::room::WALL;
use super::scanned_map::{ScanSettings, scan_building};
use super::shape::{Rectangle, Solid, between};
use crate::shared::geometry::{Cell, GridGeometry, Point2, Pose2, UNKNOWN, pose};
use crate::shared::scan_grid::SnapshotMap;
use nalgebra::Vector2;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

/// Between the two faces of a wall under [`WallStyle::TwoFaces`], metres.
const FACE_DISTANCE: f64 = 0.12;
/// Spacing of the random displacements of a slowly wavering wall, metres; it is linear between.
const WAVER_LENGTH: f64 = 0.5;
/// The lengths of the stretches that furniture hides, metres.
const HIDDEN_LENGTH: (f64, f64) = (0.2, 1.0);

/// How the walls of a drawn map look.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum WallStyle {
    /// Straight lines of single cells.
    Thin,
    /// Solid, 15 cm thick, with straight faces.
    Thick,
    /// Lines of single cells that waver.
    Noisy,
    /// The two faces of each wall, 12 cm apart, each a line of single cells that wavers independently.
    TwoFaces,
    /// A lidar scan from many positions, with small pose errors.
    Scanned,
}

/// Settings of a drawn map.
#[derive(Clone, Debug, PartialEq)]
pub struct DrawnMapSettings {
    /// How the walls look.
    pub walls: WallStyle,
    /// Cells along x.
    pub width: usize,
    /// Cells along y.
    pub height: usize,
    /// Resolution, metres per cell.
    pub resolution: f64,
    /// Direction of the building's x axis in the map frame, radians. Walls are along it and across it.
    pub yaw: f64,
    /// Size of the building along its corridor, metres, 10 or more.
    pub building_width: f64,
    /// Size of the building across its corridor, metres, 9 or more.
    pub building_height: f64,
    /// Pieces of furniture a square metre of a room.
    pub clutter: f64,
    /// Standard deviation of the slow wavering, metres; it is of one piece over about half a metre. Thin and thick
    /// walls do not waver.
    pub waver: f64,
    /// Standard deviation of a wall cell's displacement across the wall, metres. Thin and thick walls have none.
    pub jitter: f64,
    /// Share of the wall cells that are missing one by one, 0 to 1.
    pub missing: f64,
    /// Hidden stretches of 0.2 m to 1 m a metre of wall.
    pub hidden: f64,
    /// Occupied cells where nothing stands, a square metre.
    pub stray: f64,
    /// How the building is scanned under [`WallStyle::Scanned`].
    pub scans: ScanSettings,
}

impl DrawnMapSettings {
    /// A map of the size that section 5.1 of Tsardoulias et al. uses: 700 x 600 cells of 0.02 m, filled by an office.
    pub fn office(walls: WallStyle, yaw: f64) -> Self {
        Self {
            walls,
            width: 700,
            height: 600,
            resolution: 0.02,
            yaw,
            building_width: 13.4,
            building_height: 11.4,
            clutter: 0.2,
            waver: 0.01,
            jitter: 0.01,
            missing: 0.15,
            hidden: 0.25,
            stray: 3.0,
            scans: ScanSettings::default(),
        }
    }

    fn building(&self) -> BuildingSize {
        BuildingSize {
            layout: super::floor_plan::Layout::Random,
            width: self.building_width,
            height: self.building_height,
            room_width: 4.0,
            room_depth: 6.1,
            corridor_width: 1.8,
            clutter: self.clutter,
        }
    }

    /// An empty grid, its lower left corner at the origin of the map frame.
    fn geometry(&self) -> GridGeometry {
        let Self { width, height, resolution, .. } = *self;
        GridGeometry { width, height, resolution, origin: pose(0.0, 0.0, 0.0) }
    }
}

/// Draws a map of a random building. The same settings and seed give the same map; the same seed gives the same
/// building at every angle and in every style.
pub fn draw_map(settings: &DrawnMapSettings, seed: u64) -> SnapshotMap {
    let stream = |stream: u64| {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(stream);
        random
    };
    let plan = FloorPlan::random(&settings.building(), &mut stream(0));
    let geometry = settings.geometry();
    let middle = Point2::new(geometry.width as f64, geometry.height as f64) * (geometry.resolution / 2.0);
    let transform_map_building =
        pose(middle.x, middle.y, settings.yaw) * pose(-plan.bounds.centre().x, -plan.bounds.centre().y, 0.0);
    let mut random = stream(1);
    if settings.walls == WallStyle::Scanned {
        return scan_building(&plan, &transform_map_building, geometry, &settings.scans, &mut random);
    }

    let mut drawing = Drawing::new(geometry, transform_map_building, &plan.bounds);
    for (index, solid) in plan.solids.iter().enumerate() {
        drawing.draw_solid(solid, index < plan.wall_count, settings, &mut random);
    }
    let area = geometry.cell_count() as f64 * geometry.resolution.powi(2);
    for _ in 0..(area * settings.stray) as usize {
        let cell =
            Cell { column: random.random_range(0..geometry.width), row: random.random_range(0..geometry.height) };
        drawing.mark(cell, 0.0, &mut random);
    }
    SnapshotMap { geometry, cells: drawing.cells }
}

/// A map under construction.
struct Drawing {
    geometry: GridGeometry,
    transform_map_building: Pose2,
    cells: Vec<i8>,
    /// For every cell, whether something has been drawn there, be it seen or missing.
    is_decided: Vec<bool>,
}

impl Drawing {
    /// A map that knows the inside of the building, and finds it empty.
    fn new(geometry: GridGeometry, transform_map_building: Pose2, building: &Rectangle) -> Self {
        let transform_building_map = transform_map_building.inverse();
        let cells = (0..geometry.cell_count())
            .map(|index| {
                let centre = geometry.centre(Cell { column: index % geometry.width, row: index / geometry.width });
                if building.contains(&(transform_building_map * centre)) { 0 } else { UNKNOWN }
            })
            .collect();
        Self { geometry, transform_map_building, cells, is_decided: vec![false; geometry.cell_count()] }
    }

    fn draw_solid(&mut self, solid: &Solid, is_wall: bool, settings: &DrawnMapSettings, random: &mut impl Rng) {
        let bounds = Rectangle::bounding(&solid.corners).filter(|_| is_wall);
        match (settings.walls, bounds) {
            (WallStyle::Thick, Some(bounds)) => self.fill(&bounds, settings, random),
            (WallStyle::TwoFaces, Some(bounds)) => {
                let faces = Solid::from(bounds.expanded((FACE_DISTANCE - WALL) / 2.0));
                faces.sides().for_each(|side| self.draw_face(side, settings, random));
            }
            (_, Some(bounds)) => self.draw_face(middle_line(&bounds), settings, random),
            (_, None) => solid.sides().for_each(|side| self.draw_face(side, settings, random)),
        }
    }

    /// Fills a wall.
    fn fill(&mut self, wall: &Rectangle, settings: &DrawnMapSettings, random: &mut impl Rng) {
        let transform_building_map = self.transform_map_building.inverse();
        let corners: Vec<Point2> =
            Solid::from(*wall).corners.iter().map(|corner| self.transform_map_building * corner).collect();
        let Some(reach) = Rectangle::bounding(&corners) else { return };
        let GridGeometry { width, height, resolution, .. } = self.geometry;
        let cells = |metres: f64, count: usize| ((metres / resolution).max(0.0) as usize).min(count);
        for row in cells(reach.min.y, height)..cells(reach.max.y + resolution, height) {
            for column in cells(reach.min.x, width)..cells(reach.max.x + resolution, width) {
                let cell = Cell { column, row };
                if wall.contains(&(transform_building_map * self.geometry.centre(cell))) {
                    self.mark(cell, settings.missing, random);
                }
            }
        }
    }

    /// Draws a line of single cells, with gaps, that wavers if the style wants it.
    fn draw_face(&mut self, (from, to): (Point2, Point2), settings: &DrawnMapSettings, random: &mut impl Rng) {
        let length = (to - from).norm();
        let Some(along) = (to - from).try_normalize(1e-9) else { return };
        let across = Vector2::new(-along.y, along.x);
        let is_straight = matches!(settings.walls, WallStyle::Thin | WallStyle::Thick);
        let (waver, jitter) = if is_straight { (0.0, 0.0) } else { (settings.waver, settings.jitter) };
        let resolution = self.geometry.resolution;

        let mut normal = |deviation: f64| deviation * random.sample::<f64, _>(StandardNormal);
        let knots: Vec<f64> = (0..(length / WAVER_LENGTH) as usize + 2).map(|_| normal(waver)).collect();
        let hidden = hidden_stretches(length, settings.hidden, random);
        for step in 0..(length / resolution).ceil() as usize {
            let displaced = jitter * random.sample::<f64, _>(StandardNormal);
            // Two points a cell leave no gaps in lines at an angle.
            for place in [0.25, 0.75].map(|part| (step as f64 + part) * resolution) {
                if place > length || hidden.iter().any(|(low, high)| (*low..*high).contains(&place)) {
                    continue;
                }
                let (knot, share) = ((place / WAVER_LENGTH) as usize, (place / WAVER_LENGTH).fract());
                let wavering = knots[knot] * (1.0 - share) + knots[knot + 1] * share;
                let point = self.transform_map_building * (from + along * place + across * (wavering + displaced));
                if let Some(cell) = self.geometry.cell(&point) {
                    self.mark(cell, settings.missing, random);
                }
            }
        }
    }

    /// Makes a cell occupied, more or less surely, or misses it for good.
    fn mark(&mut self, cell: Cell, missing: f64, random: &mut impl Rng) {
        let index = self.geometry.index(cell);
        if !self.is_decided[index] {
            self.is_decided[index] = true;
            if random.random::<f64>() >= missing {
                self.cells[index] = random.random_range(70..=100);
            }
        }
    }
}

/// The line along the middle of a wall.
fn middle_line(wall: &Rectangle) -> (Point2, Point2) {
    let centre = wall.centre();
    match wall.width() > wall.height() {
        true => (Point2::new(wall.min.x, centre.y), Point2::new(wall.max.x, centre.y)),
        false => (Point2::new(centre.x, wall.min.y), Point2::new(centre.x, wall.max.y)),
    }
}

/// The stretches of a line that cannot be seen: `rate` a metre in the mean.
fn hidden_stretches(length: f64, rate: f64, random: &mut impl Rng) -> Vec<(f64, f64)> {
    let count = (length * rate + random.random::<f64>()) as usize;
    let stretch = |_| {
        let from = between(random, 0.0, length);
        (from, from + between(random, HIDDEN_LENGTH.0, HIDDEN_LENGTH.1))
    };
    (0..count).map(stretch).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::is_occupied;
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

    const STYLES: [WallStyle; 5] =
        [WallStyle::Thin, WallStyle::Thick, WallStyle::Noisy, WallStyle::TwoFaces, WallStyle::Scanned];

    fn occupied(map: &SnapshotMap) -> Vec<Point2> {
        let cells = map.cells.iter().enumerate().filter(|(_, value)| is_occupied(**value));
        let width = map.geometry.width;
        cells.map(|(index, _)| map.geometry.centre(Cell { column: index % width, row: index / width })).collect()
    }

    #[test]
    fn the_same_seed_gives_the_same_map_and_another_seed_another() {
        for style in STYLES {
            let settings = DrawnMapSettings::office(style, 0.3);
            let map = draw_map(&settings, 4);
            assert_eq!(map, draw_map(&settings, 4));
            assert_ne!(map.cells, draw_map(&settings, 5).cells);
            assert_eq!((map.geometry.width, map.geometry.height, map.cells.len()), (700, 600, 420_000));
        }
    }

    /// How much the occupied cells pile up when they are projected onto a direction: the sum of squares of a histogram
    /// of `width` metres.
    fn sharpness(points: &[Point2], direction: f64, width: f64) -> f64 {
        let mut bins = std::collections::BTreeMap::new();
        for point in points {
            for angle in [direction, direction + FRAC_PI_2] {
                let place = point.x * -angle.sin() + point.y * angle.cos();
                *bins.entry((place / width).floor() as i64).or_insert(0.0) += 1.0;
            }
        }
        bins.values().map(|count: &f64| count * count).sum()
    }

    #[test]
    fn the_walls_of_every_style_run_in_the_direction_that_was_asked_for() {
        for style in STYLES {
            for yaw in [-FRAC_PI_4, 0.2, 1.0] {
                let points = occupied(&draw_map(&DrawnMapSettings::office(style, yaw), 3));
                let at = |degrees: f64| sharpness(&points, yaw + degrees.to_radians(), 0.06);
                let beside = [-20.0, -3.0, -1.0, 1.0, 3.0, 20.0].map(at).into_iter().fold(0.0, f64::max);
                assert!(at(0.0) > 1.1 * beside, "{style:?} {yaw}: {} {beside}", at(0.0));
            }
        }
    }

    #[test]
    fn the_styles_hold_as_many_cells_as_their_walls_are_thick() {
        let count = |style| occupied(&draw_map(&DrawnMapSettings::office(style, 0.5), 2)).len() as f64;
        let [thin, thick, noisy, two_faces, scanned] = STYLES.map(count);
        assert!(thick > 2.0 * thin && two_faces > 1.3 * noisy && noisy > 0.8 * thin);
        assert!(thin > 3000.0 && scanned > 3000.0 && thick < 60_000.0);
    }

    #[test]
    fn gaps_and_stray_cells_are_as_many_as_asked_for() {
        let plain = DrawnMapSettings {
            missing: 0.0,
            hidden: 0.0,
            stray: 0.0,
            ..DrawnMapSettings::office(WallStyle::Thin, 0.0)
        };
        let count = |settings: &DrawnMapSettings| occupied(&draw_map(settings, 6)).len() as f64;
        let all = count(&plain);
        let stray = count(&DrawnMapSettings { stray: 3.0, ..plain.clone() }) - all;
        assert!((stray - 504.0).abs() < 30.0, "{stray}");
        let share = count(&DrawnMapSettings { missing: 0.3, ..plain.clone() }) / all;
        assert!((share - 0.7).abs() < 0.04, "{share}");
        let share = count(&DrawnMapSettings { hidden: 0.5, ..plain }) / all;
        assert!(share > 0.65 && share < 0.85, "{share}");
    }
}
