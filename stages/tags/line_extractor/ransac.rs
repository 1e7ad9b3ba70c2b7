//! RANSAC for lines: draw two points, count the inliers of the line through them, remove those of a good line.

use super::line::Line;
use super::parameters::{LineExtractorParameters, Sampling, Scoring};
use super::plane_points::PlanePoints;
use super::scale::CellLengths;
use super::wall::{Wall, break_down, fit_stretch};
use rand::{Rng, RngExt};

/// Number of refits of a line to its inliers, after which these are counted again.
const REFITS: usize = 1;

/// Finds the walls among the points of the index, in the order they are found. No point belongs to two.
pub(super) fn find_walls(
    index: &PlanePoints,
    parameters: &LineExtractorParameters,
    scale: &CellLengths,
    random: &mut impl Rng,
) -> Vec<Wall> {
    let search = Search { index, parameters, scale };
    match parameters.scoring {
        Scoring::Points => search.by_points(random),
        Scoring::Percentage => search.by_percentage(random),
    }
}

/// The points that belong to no wall so far.
struct Pool {
    ids: Vec<usize>,
    /// For every point its index in `ids`, or [`TAKEN`].
    places: Vec<usize>,
}

/// Index of a point that is not in the pool.
const TAKEN: usize = usize::MAX;

impl Pool {
    fn new(count: usize) -> Self {
        Self { ids: (0..count).collect(), places: (0..count).collect() }
    }

    fn contains(&self, id: usize) -> bool {
        self.places[id] != TAKEN
    }

    fn remove(&mut self, id: usize) {
        if self.contains(id) {
            let place = std::mem::replace(&mut self.places[id], TAKEN);
            self.ids.swap_remove(place);
            if let Some(&moved) = self.ids.get(place) {
                self.places[moved] = place;
            }
        }
    }
}

/// A line through two drawn points.
struct Candidate {
    line: Line,
    /// One of the two points.
    from: usize,
    /// Number of inliers.
    count: usize,
}

/// A line with its inliers.
struct Found {
    line: Line,
    members: Vec<usize>,
}

struct Search<'a> {
    index: &'a PlanePoints,
    parameters: &'a LineExtractorParameters,
    scale: &'a CellLengths,
}

impl Search<'_> {
    /// Takes the longest unbroken walls first, with only their own inliers.
    fn by_points(&self, random: &mut impl Rng) -> Vec<Wall> {
        let mut pool = Pool::new(self.index.points().len());
        let (mut walls, mut iterations, mut misses) = (Vec::new(), 0, 0);
        while self.points_left(&pool)
            && iterations < self.parameters.max_iterations
            && misses < self.parameters.patience
        {
            let found = match self.best_candidate(&pool, &mut iterations, random) {
                Some(candidate) => self.unbroken_walls(&pool, &candidate),
                None => Vec::new(),
            };
            misses = if found.is_empty() { misses + 1 } else { 0 };
            for wall in found {
                wall.members.iter().for_each(|&id| pool.remove(id));
                walls.push(wall);
            }
        }
        walls
    }

    /// The loop of section 4.1.1: a line is taken with all its inliers once it has enough of all points.
    fn by_percentage(&self, random: &mut impl Rng) -> Vec<Wall> {
        let mut pool = Pool::new(self.index.points().len());
        let enough = self.parameters.min_share * self.index.points().len() as f64;
        let (mut walls, mut iterations) = (Vec::new(), 0);
        let mut best: Option<Candidate> = None;
        while self.points_left(&pool) && iterations < self.parameters.max_iterations {
            if let Some(candidate) = self.best_candidate(&pool, &mut iterations, random)
                && best.as_ref().is_none_or(|best| candidate.count > best.count)
            {
                best = Some(candidate);
            }
            let taken = best.take_if(|best| best.count as f64 > enough || iterations >= self.parameters.max_iterations);
            if let Some(candidate) = taken {
                let line = self.recounted(&pool, &candidate);
                walls.extend(self.parts(&line));
                line.members.iter().for_each(|&id| pool.remove(id));
            }
        }
        walls
    }

    fn points_left(&self, pool: &Pool) -> bool {
        pool.ids.len() >= 2 && pool.ids.len() as f64 >= self.parameters.stop_share * self.index.points().len() as f64
    }

    /// Draws a few lines and returns the one with most inliers.
    fn best_candidate(&self, pool: &Pool, iterations: &mut usize, random: &mut impl Rng) -> Option<Candidate> {
        let draws = self.parameters.candidates.min(self.parameters.max_iterations - *iterations);
        *iterations += draws;
        let mut best: Option<Candidate> = None;
        for _ in 0..draws {
            if let Some(candidate) = self.draw(pool, random)
                && best.as_ref().is_none_or(|best| candidate.count > best.count)
            {
                best = Some(candidate);
            }
        }
        best
    }

    fn draw(&self, pool: &Pool, random: &mut impl Rng) -> Option<Candidate> {
        let first = pool.ids[random.random_range(0..pool.ids.len())];
        let second = match self.parameters.sampling {
            Sampling::Uniform => pool.ids[random.random_range(0..pool.ids.len())],
            Sampling::Local => {
                let radius = self.scale.sampling_radius;
                self.index.draw_neighbour(first, radius / 4.0, radius, |id| pool.contains(id), random)?
            }
        };
        let points = self.index.points();
        let line = Line::through(&points[first], &points[second])?;
        let mut count = 0;
        self.visit_members(pool, &line, first, |_| count += 1);
        Some(Candidate { line, from: first, count })
    }

    /// Visits the remaining points near a line. Under `points` scoring only those connected with `from` count: the
    /// search ends at a gap.
    fn visit_members(&self, pool: &Pool, line: &Line, from: usize, mut visit: impl FnMut(usize)) {
        let max_gap = match self.parameters.scoring {
            Scoring::Points => self.scale.max_gap,
            Scoring::Percentage => f64::INFINITY,
        };
        let from = &self.index.points()[from];
        self.index.near_line(line, from, self.scale.reach, max_gap, |id| {
            let is_left = pool.contains(id);
            if is_left {
                visit(id);
            }
            is_left
        });
    }

    fn members(&self, pool: &Pool, line: &Line, from: usize) -> Vec<usize> {
        let mut members = Vec::new();
        self.visit_members(pool, line, from, |id| members.push(id));
        members
    }

    /// Fits a line to its inliers, and counts these again (the recount of section 4.1.1).
    fn recounted(&self, pool: &Pool, candidate: &Candidate) -> Found {
        let mut found = Found { line: candidate.line, members: self.members(pool, &candidate.line, candidate.from) };
        for _ in 0..REFITS {
            let points = self.index.points();
            let Some(&from) = found.members.first() else { break };
            let fitted = fit_stretch(self.parameters.fit, &found.line, found.members.iter().map(|&id| points[id]));
            let Some(fitted) = fitted else { break };
            found = Found { line: fitted.line, members: self.members(pool, &fitted.line, from) };
        }
        found
    }

    /// The parts of a line between its gaps.
    fn parts(&self, found: &Found) -> Vec<Wall> {
        let points = self.index.points();
        break_down(points, &found.members, &found.line, self.scale.max_gap)
            .into_iter()
            .filter_map(|members| Wall::of_members(points, members, &found.line, self.parameters.fit))
            .collect()
    }

    fn unbroken_walls(&self, pool: &Pool, candidate: &Candidate) -> Vec<Wall> {
        if candidate.count < self.parameters.min_points {
            return Vec::new();
        }
        let mut walls = self.parts(&self.recounted(pool, candidate));
        walls.retain(|wall| {
            wall.members.len() >= self.parameters.min_points && wall.stretch.length() >= self.scale.min_length
        });
        walls
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::Point2;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    fn walls_of(points: &[Point2], parameters: &LineExtractorParameters) -> Vec<Wall> {
        let scale = CellLengths::new(parameters, 0.05);
        let index = PlanePoints::new(points, 400, 400, scale.bucket_side);
        find_walls(&index, parameters, &scale, &mut ChaCha8Rng::seed_from_u64(1))
    }

    fn line_of_points(x: f64, y: f64, angle: f64, count: usize) -> impl Iterator<Item = Point2> {
        (0..count).map(move |i| Point2::new(x + angle.cos() * i as f64, y + angle.sin() * i as f64))
    }

    #[test]
    fn every_wall_of_many_is_found_and_no_point_is_shared() {
        let mut points: Vec<Point2> = Vec::new();
        for i in 0..20 {
            points.extend(line_of_points(20.0 + 15.0 * f64::from(i), 30.0, 1.3, 40));
        }
        let walls = walls_of(&points, &LineExtractorParameters::default());
        assert_eq!(walls.len(), 20);
        let mut members: Vec<usize> = walls.iter().flat_map(|wall| wall.members.clone()).collect();
        members.sort_unstable();
        members.dedup();
        assert_eq!(members.len(), 800);
    }

    #[test]
    fn too_few_points_have_no_walls() {
        for count in 0..12 {
            let points: Vec<Point2> = line_of_points(5.0, 5.0, 0.4, count).collect();
            assert!(walls_of(&points, &LineExtractorParameters::default()).is_empty());
            assert!(walls_of(&vec![Point2::new(5.5, 5.5); count], &LineExtractorParameters::default()).is_empty());
        }
    }
}
