//! Extracts the straight walls of an occupancy grid: section 4.1.1 of Tsardoulias et al.

use super::faces::{Offset, fit_faces};
use super::line::{Line, Stretch};
use super::merge::merge_walls;
use super::parameters::{Fit, LineExtractorParameters};
use super::plane_points::PlanePoints;
use super::ransac::find_walls;
use super::reliability::reliability;
use super::scale::CellLengths;
use super::surface::surface_cells;
use super::wall::{Wall, fit_stretch};
use crate::shared::geometry::{Cell, Grid, Point2};
use gridweave_runtime::ros::Segment;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Number of fits of a segment to all cells near it.
const FINAL_FITS: usize = 3;
/// Most fits of a segment to its faces, and the motion of its ends, in cells, below which it has converged.
const FACE_FITS: usize = 4;
const ENOUGH: f64 = 0.25;
/// Least share of a wall away from the border of the grid for the rest to be left out of the fit.
const LEAST_INSIDE: f64 = 0.5;
/// Outlier bound of the last fits, standard deviations from the line: what stands at a wall is left out.
const OUTLIER_DEVIATIONS: f64 = 2.5;

/// Extracts the straight walls of a grid, the best supported first, in metres of the map frame.
///
/// The same grid, parameters and seed give the same walls.
pub fn extract_segments(grid: &Grid<'_>, parameters: &LineExtractorParameters, seed: u64) -> Vec<Segment> {
    let scale = CellLengths::new(parameters, grid.geometry.resolution);
    let index_of =
        |points: &[Point2]| PlanePoints::new(points, grid.geometry.width, grid.geometry.height, scale.bucket_side);
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let middle = |cell: Cell| Point2::new(cell.column as f64 + 0.5, cell.row as f64 + 0.5);
    let cells: Vec<Point2> = surface_cells(grid, scale.reach).into_iter().map(middle).collect();

    let index = index_of(&sub_sample(&cells, parameters.max_points, &mut random));
    let walls = find_walls(&index, parameters, &scale, &mut random);
    let walls = merge_walls(index.points(), walls, parameters, &scale);

    let all = if index.points().len() == cells.len() { index } else { index_of(&cells) };
    let mut segments: Vec<Segment> = walls
        .iter()
        .filter_map(|wall| final_fit(&all, wall, parameters.fit, &scale))
        .filter(|(stretch, _)| stretch.length() >= scale.min_length)
        .map(|(stretch, inliers)| {
            let reliability = reliability(grid, &stretch, scale.reach);
            segment(grid, &stretch, reliability, inliers)
        })
        .filter(|segment| segment.reliability >= parameters.min_reliability)
        .filter(|segment| [segment.x1, segment.y1, segment.x2, segment.y2].iter().all(|value| value.is_finite()))
        .collect();
    segments.sort_by_key(|segment| std::cmp::Reverse(segment.inliers));
    segments
}

/// A random sample of `count` points, or all if there are no more.
fn sub_sample(points: &[Point2], count: usize, random: &mut impl Rng) -> Vec<Point2> {
    let mut sample = points.to_vec();
    if count < sample.len() {
        for place in 0..count {
            let other = random.random_range(place..sample.len());
            sample.swap(place, other);
        }
        sample.truncate(count);
    }
    sample
}

/// Fits a wall to all cells near it. Returns the stretch and the number of cells.
fn final_fit(index: &PlanePoints, wall: &Wall, fit: Fit, scale: &CellLengths) -> Option<(Stretch, usize)> {
    let stretch = match fit {
        Fit::Faces => fit_to_faces(index, wall.stretch, scale),
        Fit::LeastSquares | Fit::Ends => fit_to_cells(index, wall.stretch, fit, scale)?,
    };
    let mut count = 0;
    visit_along(index, &stretch, scale.reach, |_| count += 1);
    (count > 0).then_some((stretch, count))
}

/// The part of a stretch that determines its direction.
///
/// Where walls meet, cells of the other wall are on one side of this one and would turn it. And where a thick wall
/// leaves the grid, a wedge of it remains, whose centre line is half way between the wall and the border: it would
/// turn the wall towards the border.
fn inner(index: &PlanePoints, stretch: &Stretch, scale: &CellLengths) -> Stretch {
    let margin = if stretch.length() > 6.0 * scale.reach { scale.reach } else { 0.0 };
    let inner = Stretch { line: stretch.line, start: stretch.start + margin, end: stretch.end - margin };
    // A wall along a border of the grid has no other part.
    let inside = inner.inside(&index.size(), scale.reach);
    inside.filter(|part| part.length() >= LEAST_INSIDE * inner.length()).unwrap_or(inner)
}

/// Fits a stretch to the faces of its wall.
fn fit_to_faces(index: &PlanePoints, mut stretch: Stretch, scale: &CellLengths) -> Stretch {
    let mut cells = Vec::new();
    for _ in 0..FACE_FITS {
        let inner = inner(index, &stretch, scale);
        let middle = (inner.start + inner.end) / 2.0;
        cells.clear();
        visit_along(index, &inner, scale.reach, |point| {
            cells.push(Offset { along: inner.line.along(&point) - middle, across: inner.line.across(&point) });
        });
        let Some(correction) = fit_faces(&cells, inner.length() / 2.0, scale.reach) else { break };
        let Some(line) = inner.line.corrected(middle, &correction) else { break };
        let ends = stretch.ends();
        let Some(turned) = Stretch::between_farthest(line, ends.into_iter()) else { break };
        let moved = ends.iter().map(|end| line.distance(end)).fold(0.0, f64::max);
        stretch = turned;
        if moved < ENOUGH {
            break;
        }
    }
    stretch
}

/// Fits a stretch to all cells near it.
fn fit_to_cells(index: &PlanePoints, mut stretch: Stretch, fit: Fit, scale: &CellLengths) -> Option<Stretch> {
    let mut reach = scale.reach;
    let mut near = Vec::new();
    for _ in 0..FINAL_FITS {
        near.clear();
        visit_along(index, &inner(index, &stretch, scale), reach, |point| near.push(point));
        let cells = near.iter().copied();
        let Some(fitted) = fit_stretch(fit, &stretch.line, cells.clone()) else { break };
        // The cells at the ends were not fitted, but they belong to the wall.
        let [first, last] = stretch.ends();
        stretch = Stretch::between_farthest(fitted.line, cells.clone().chain([first, last]))?;
        if fit == Fit::Ends {
            break;
        }
        let squares: f64 = cells.map(|cell| fitted.line.distance(&cell).powi(2)).sum();
        reach =
            (OUTLIER_DEVIATIONS * (squares / near.len() as f64).sqrt()).clamp(1.0_f64.min(scale.reach), scale.reach);
    }
    Some(stretch)
}

/// Visits the points within `reach` of a stretch, between its ends.
fn visit_along(index: &PlanePoints, stretch: &Stretch, reach: f64, mut visit: impl FnMut(Point2)) {
    index.near_stretch(stretch, reach, |id| {
        let point = index.points()[id];
        if (stretch.start..=stretch.end).contains(&stretch.line.along(&point)) {
            visit(point);
        }
    });
}

fn segment(grid: &Grid<'_>, stretch: &Stretch, reliability: f64, inliers: usize) -> Segment {
    let line: &Line = &stretch.line;
    let in_map = |along: f64| grid.geometry.origin * Point2::from(line.at(along).coords * grid.geometry.resolution);
    let (first, last) = (in_map(stretch.start), in_map(stretch.end));
    Segment {
        x1: first.x,
        y1: first.y,
        x2: last.x,
        y2: last.y,
        reliability,
        inliers: u32::try_from(inliers).unwrap_or(u32::MAX),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::{GridGeometry, pose, turn_difference};
    use std::f64::consts::{FRAC_PI_2, PI};

    const GEOMETRY: (usize, usize, f64) = (240, 240, 0.05);

    /// A room of 8 m by 5 m with walls of single cells, turned by `angle`, in a grid with its own origin.
    fn room(angle: f64) -> (GridGeometry, Vec<i8>) {
        let (width, height, resolution) = GEOMETRY;
        let geometry = GridGeometry { width, height, resolution, origin: pose(-3.0, 7.0, 0.4) };
        let mut cells = vec![0; width * height];
        let corners = [[-4.0, -2.5], [4.0, -2.5], [4.0, 2.5], [-4.0, 2.5]].map(Point2::from);
        let transform = geometry.origin * pose(6.0, 6.0, angle - 0.4);
        for (index, from) in corners.iter().enumerate() {
            let to = corners[(index + 1) % 4];
            for step in 0..1000 {
                let point = transform * Point2::from(from.coords.lerp(&to.coords, f64::from(step) / 1000.0));
                let cell = geometry.cell(&point).unwrap();
                cells[geometry.index(cell)] = 100;
            }
        }
        (geometry, cells)
    }

    /// A solid wall of 7.5 cells across a grid of 700 x 600 cells of 0.02 m, through a point in cells.
    fn thick_wall(angle: f64, through: [f64; 2]) -> (GridGeometry, Vec<i8>) {
        let (width, height) = (700, 600);
        let across = |cell: usize| {
            let (x, y) = ((cell % width) as f64 + 0.5 - through[0], (cell / width) as f64 + 0.5 - through[1]);
            y * angle.cos() - x * angle.sin()
        };
        let cells = (0..width * height).map(|cell| if across(cell).abs() <= 3.75 { 100 } else { 0 }).collect();
        (GridGeometry { width, height, resolution: 0.02, origin: pose(0.0, 0.0, 0.0) }, cells)
    }

    fn length(segment: &Segment) -> f64 {
        (segment.x2 - segment.x1).hypot(segment.y2 - segment.y1)
    }

    #[test]
    fn the_four_walls_of_a_room_are_found_at_any_angle() {
        for degrees in (0..180).step_by(7) {
            let angle = f64::from(degrees).to_radians();
            let (geometry, cells) = room(angle);
            let grid = Grid::new(geometry, &cells).unwrap();
            let segments = extract_segments(&grid, &LineExtractorParameters::default(), 5);
            assert_eq!(segments.len(), 4, "{degrees} {segments:?}");
            let lengths: Vec<f64> = segments.iter().map(length).collect();
            for (length, expected) in lengths.iter().zip([8.0, 8.0, 5.0, 5.0]) {
                assert!((length - expected).abs() < 0.35, "{degrees} {lengths:?}");
            }
            for segment in &segments {
                let direction = (segment.y2 - segment.y1).atan2(segment.x2 - segment.x1);
                assert!(turn_difference(direction, angle, FRAC_PI_2).abs() < 0.005, "{degrees} {segment:?}");
                assert!(segment.reliability > 0.95);
            }
            let long = (segments[0].y2 - segments[0].y1).atan2(segments[0].x2 - segments[0].x1);
            assert!(turn_difference(long, angle, PI).abs() < 0.005);
        }
    }

    #[test]
    fn the_same_seed_gives_the_same_segments_and_a_sub_sample_the_same_walls() {
        let (geometry, cells) = room(0.3);
        let grid = Grid::new(geometry, &cells).unwrap();
        let all = LineExtractorParameters::default();
        assert_eq!(extract_segments(&grid, &all, 9), extract_segments(&grid, &all, 9));
        let some = LineExtractorParameters { max_points: 300, ..all.clone() };
        let (all, some) = (extract_segments(&grid, &all, 9), extract_segments(&grid, &some, 9));
        assert_eq!(some.len(), 4);
        assert!((length(&all[0]) - length(&some[0])).abs() < 0.3);
        assert!(some[0].inliers > 140, "they are fitted to all cells");
    }

    #[test]
    fn a_thick_wall_is_not_turned_where_the_border_of_the_grid_cuts_it() {
        // In the middle of the grid; leaving it above, in a long wedge; leaving it to the right.
        for through in [[350.0, 300.0], [500.0, 595.0], [695.0, 400.0]] {
            for degrees in [2.0, 4.0, 10.0, 30.0, 77.0, 86.0_f64] {
                let (geometry, cells) = thick_wall(degrees.to_radians(), through);
                let grid = Grid::new(geometry, &cells).unwrap();
                for seed in 0..5 {
                    let wall = extract_segments(&grid, &LineExtractorParameters::default(), seed)[0];
                    let angle = (wall.y2 - wall.y1).atan2(wall.x2 - wall.x1);
                    let error = turn_difference(angle, degrees.to_radians(), PI).to_degrees();
                    assert!(error.abs() < 0.03, "{through:?} {degrees} {error}");
                }
            }
        }
    }

    #[test]
    fn odd_grids_do_no_harm() {
        let parameters = LineExtractorParameters::default();
        for resolution in [1e-9, 0.05, 5.0, 1e300] {
            for x in [0.0, 1e300, f64::MAX] {
                let geometry = GridGeometry { width: 60, height: 40, resolution, origin: pose(x, 0.0, 0.7) };
                let cells = vec![100; 2400];
                let segments = extract_segments(&Grid::new(geometry, &cells).unwrap(), &parameters, 1);
                assert!(segments.iter().all(|s| [s.x1, s.y1, s.x2, s.y2, s.reliability].iter().all(|v| v.is_finite())));
            }
        }
    }
}
