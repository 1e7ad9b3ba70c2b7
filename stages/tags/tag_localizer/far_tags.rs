//! Tags that are read from far away, as by UWB radios: their positions, together with the calibration of the robot's
//! radio.
//!
//! A radio measures `(1 + scale) distance + offset`: delays in antennas and clocks make ranges of tens of metres too
//! long by metres. Both are the same for all tags of a robot, so they are estimated with the positions: nonlinear least
//! squares by Gauss-Newton, with Cauchy weights against echoes. From the equations of each tag its position is
//! eliminated (Schur complement), so the work grows with the readings and not with the area.

use super::noise::{Noise, cost, weight};
use super::{GridSize, Likelihood, Posterior, Ray, Readout, Ring, TagLocalizerParameters, TagMode, read_out};
use crate::shared::geometry::{Point2, wrap_angle};
use nalgebra::{Matrix2, Vector2};

/// Iterations before and after the noise is estimated.
const ITERATIONS: usize = 40;
/// An iteration that moves every tag by less is the last, metres.
const SETTLED: f64 = 1e-4;
/// Share of the readings that are at most as long as the radius of the grid on which a tag is searched.
const MOST_READINGS: f64 = 0.95;
/// Radius of the grid of a tag without ranges, in reaches of a tag of short range.
const WIDER: f64 = 4.0;
/// Factor by which that grid reaches farther.
const MARGIN: f64 = 1.2;
/// Least share of outliers in that search.
const SEARCH_OUTLIERS: f64 = 0.05;
/// Cells along a side of its window.
const SEARCH_WINDOW: usize = 3;
/// Least distance from a sensor, metres: at less, a direction is undefined.
const NEAREST: f64 = 1e-3;
/// Two positions of a tag that are as probable as each other differ by more than so many standard deviations.
const DISTINCT: f64 = 3.0;

/// The readings of a tag.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct FarTag {
    /// Ranges, in the order of the drive.
    pub(super) ranges: Vec<Ring>,
    /// Positions at which it was seen.
    pub(super) seen: Vec<Ring>,
    /// Directions.
    pub(super) rays: Vec<Ray>,
}

/// The calibration of a radio, and its prior.
#[derive(Clone, Copy, Debug)]
struct Calibration {
    /// Offset in metres, and scale.
    value: Vector2<f64>,
    /// The inverse of their prior variances.
    information: Vector2<f64>,
}

/// Normal equations of one tag: of its position, of the calibration, and of both.
#[derive(Clone, Copy, Debug, Default)]
struct Equations {
    place: Matrix2<f64>,
    mixed: Matrix2<f64>,
    calibration: Matrix2<f64>,
    place_gradient: Vector2<f64>,
    calibration_gradient: Vector2<f64>,
}

/// A tag while it is being located.
struct Estimate<'a> {
    tag: &'a FarTag,
    place: Point2,
    /// The grid on which it was searched.
    grid: GridSize,
    /// Share of the probability of the mode in which it was searched.
    mass: f64,
    noise: Noise,
}

/// Locates tags of one robot, each `None` where its readings determine no position.
pub(super) fn locate(tags: &[FarTag], parameters: &TagLocalizerParameters) -> Vec<Option<TagMode>> {
    let information = |stddev: f64| stddev.max(1e-9).powi(-2);
    let TagLocalizerParameters { offset_stddev, scale_stddev, .. } = *parameters;
    let mut calibration = Calibration {
        value: Vector2::zeros(),
        information: Vector2::new(information(offset_stddev), information(scale_stddev)),
    };
    let mut estimates: Vec<Option<Estimate<'_>>> = tags.iter().map(|tag| Estimate::new(tag, parameters)).collect();
    solve(&mut estimates, &mut calibration);
    for estimate in estimates.iter_mut().flatten() {
        estimate.noise = estimate.found_noise(&calibration);
    }
    let covariance = solve(&mut estimates, &mut calibration);
    estimates.iter().map(|estimate| estimate.as_ref()?.mode(&calibration, &covariance?)).collect()
}

/// Refines all positions and the calibration, and returns the covariance of the latter; `None` if it is not determined.
/// A tag whose readings determine no position is dropped.
fn solve(estimates: &mut [Option<Estimate<'_>>], calibration: &mut Calibration) -> Option<Matrix2<f64>> {
    let mut covariance = None;
    for _ in 0..ITERATIONS {
        let prior = Matrix2::from_diagonal(&calibration.information);
        let (mut whole, mut gradient) = (prior, prior * calibration.value);
        let mut solved: Vec<Option<(Equations, Matrix2<f64>)>> = Vec::with_capacity(estimates.len());
        for estimate in estimates.iter_mut() {
            let equations = estimate.as_ref().map(|estimate| estimate.equations(calibration));
            let inverse = equations.and_then(|equations| Some((equations, equations.place.try_inverse()?)));
            if let Some((equations, inverse)) = &inverse {
                let mixed = equations.mixed.transpose() * inverse;
                whole += equations.calibration - mixed * equations.mixed;
                gradient += equations.calibration_gradient - mixed * equations.place_gradient;
            } else {
                *estimate = None;
            }
            solved.push(inverse);
        }
        let inverse = whole.try_inverse()?;
        covariance = Some(inverse);
        let change = -(inverse * gradient);
        calibration.value += change;
        let mut largest: f64 = 0.0;
        for (estimate, solved) in estimates.iter_mut().zip(solved) {
            let (Some(moved), Some((equations, inverse))) = (estimate.as_mut(), solved) else { continue };
            let step = -(inverse * (equations.place_gradient + equations.mixed * change));
            moved.place += step;
            match moved.place.iter().all(|value| value.is_finite()) {
                true => largest = largest.max(step.norm()),
                false => *estimate = None,
            }
        }
        if !calibration.value.iter().all(|value| value.is_finite()) {
            return None;
        }
        if largest < SETTLED {
            break;
        }
    }
    covariance
}

impl<'a> Estimate<'a> {
    /// Searches a tag on a grid that holds all places from which it could have been read, where the calibration is part
    /// of the noise.
    fn new(tag: &'a FarTag, parameters: &TagLocalizerParameters) -> Option<Self> {
        let TagLocalizerParameters { offset_stddev, scale_stddev, outlier_share, reach, .. } = *parameters;
        let mut radii: Vec<f64> = tag.ranges.iter().map(|ring| ring.radius).collect();
        radii.sort_by(f64::total_cmp);
        let usual = radii.get((radii.len().saturating_sub(1) as f64 * MOST_READINGS) as usize);
        let largest = usual.copied().unwrap_or(WIDER * reach);
        let seen = || tag.seen.iter().chain(&tag.ranges).map(|ring| ring.centre);
        let centres: Vec<Point2> = seen().chain(tag.rays.iter().map(|ray| ray.origin)).collect();
        let anchor = *centres.first()?;
        let centre = anchor + centres.iter().map(|place| place - anchor).sum::<Vector2<f64>>() / centres.len() as f64;
        let spread = centres.iter().map(|place| (place - centre).norm()).fold(0.0, f64::max);
        let cells = parameters.cells();
        let grid = GridSize { centre, cells, resolution: 2.0 * (MARGIN * largest + spread) / cells as f64 };
        let uncalibrated = tag.ranges.iter().map(|ring| {
            let calibration = offset_stddev.powi(2) + (scale_stddev * ring.radius).powi(2);
            Ring { variance: ring.variance + calibration, ..*ring }
        });
        let rings = uncalibrated.chain(tag.seen.iter().copied());
        let outliers = outlier_share.max(SEARCH_OUTLIERS);
        let likelihood = Likelihood::new(rings, tag.rays.iter().copied(), outliers, largest);
        let mode = read_out(&Posterior::new(&likelihood, grid)?, Readout::Window, SEARCH_WINDOW)?;
        Some(Self { tag, place: mode.position, grid, mass: mode.mass, noise: Noise::CLAIMED })
    }

    /// Residual of a range at the tag's place, in standard deviations.
    fn residual(&self, ring: &Ring, calibration: &Calibration) -> f64 {
        let distance = (self.place - ring.centre).norm();
        let expected = (1.0 + calibration.value[1]) * distance + calibration.value[0];
        (ring.radius - expected) / (ring.variance.sqrt() * self.noise.factor)
    }

    fn equations(&self, calibration: &Calibration) -> Equations {
        let mut equations = Equations::default();
        for ring in &self.tag.ranges {
            let offset = self.place - ring.centre;
            let distance = offset.norm().max(NEAREST);
            let residual = self.residual(ring, calibration);
            let weight = weight(residual) / self.noise.correlated;
            let stddev = ring.variance.sqrt() * self.noise.factor;
            let by_place = -(1.0 + calibration.value[1]) * offset / (distance * stddev);
            let by_calibration = Vector2::new(-1.0, -distance) / stddev;
            equations.place += weight * by_place * by_place.transpose();
            equations.mixed += weight * by_place * by_calibration.transpose();
            equations.calibration += weight * by_calibration * by_calibration.transpose();
            equations.place_gradient += weight * residual * by_place;
            equations.calibration_gradient += weight * residual * by_calibration;
        }
        for ring in &self.tag.seen {
            let residual = (self.place - ring.centre) / ring.variance.sqrt();
            let weight = weight(residual.norm());
            equations.place += Matrix2::identity() * (weight / ring.variance);
            equations.place_gradient += weight * residual / ring.variance.sqrt();
        }
        for ray in &self.tag.rays {
            let offset = self.place - ray.origin;
            let distance = offset.norm().max(NEAREST);
            let stddev = (ray.variance + ray.origin_variance / (distance * distance)).sqrt();
            let residual = wrap_angle(offset.y.atan2(offset.x) - ray.bearing) / stddev;
            let weight = weight(residual);
            let by_place = Vector2::new(-offset.y, offset.x) / (distance * distance * stddev);
            equations.place += weight * by_place * by_place.transpose();
            equations.place_gradient += weight * residual * by_place;
        }
        equations
    }

    /// The noise of the ranges by their residuals: at least what they claim.
    fn found_noise(&self, calibration: &Calibration) -> Noise {
        let claimed = Self { noise: Noise::CLAIMED, ..*self };
        let residuals: Vec<f64> = self.tag.ranges.iter().map(|ring| claimed.residual(ring, calibration)).collect();
        Noise::of(&residuals)
    }

    /// Negative log-likelihood of the readings.
    fn cost(&self, calibration: &Calibration) -> f64 {
        let ranges: f64 = self.tag.ranges.iter().map(|ring| cost(self.residual(ring, calibration))).sum();
        let seen = self.tag.seen.iter().map(|ring| cost((self.place - ring.centre).norm() / ring.variance.sqrt()));
        let rays = self.tag.rays.iter().map(|ray| {
            let offset = self.place - ray.origin;
            cost(wrap_angle(offset.y.atan2(offset.x) - ray.bearing) / ray.variance.sqrt())
        });
        ranges / self.noise.correlated + seen.sum::<f64>() + rays.sum::<f64>()
    }

    /// The estimate, where the covariance of the calibration widens that of the tag. `None` if it is not determined.
    fn mode(&self, calibration: &Calibration, covariance: &Matrix2<f64>) -> Option<TagMode> {
        let equations = self.equations(calibration);
        let inverse = equations.place.try_inverse()?;
        let by_calibration = inverse * equations.mixed;
        let covariance = inverse + by_calibration * covariance * by_calibration.transpose();
        let certainty = self.mass * self.share_of_mirror_image(calibration, &covariance);
        // Too few readings may lead it anywhere.
        let is_in_grid = (self.place - self.grid.centre).amax() <= 0.5 * self.grid.resolution * self.grid.cells as f64;
        let is_valid = is_in_grid && certainty.is_finite() && covariance.iter().all(|value| value.is_finite());
        let (position, mass) = (self.place, self.mass);
        is_valid.then_some(TagMode { position, covariance, certainty, window: position, mass })
    }

    /// The probability of the place beside that of its mirror image in the line of the drive, which fits nearly as well
    /// where the robot drove straight on.
    fn share_of_mirror_image(&self, calibration: &Calibration, covariance: &Matrix2<f64>) -> f64 {
        let count = self.tag.ranges.len() as f64;
        let anchor = self.place;
        let mean = self.tag.ranges.iter().map(|ring| ring.centre - anchor).sum::<Vector2<f64>>() / count;
        let spread = self.tag.ranges.iter().fold(Matrix2::zeros(), |sum, ring| {
            let offset = ring.centre - anchor - mean;
            sum + offset * offset.transpose()
        });
        if !spread.iter().all(|value| value.is_finite()) {
            return 1.0;
        }
        let axes = spread.symmetric_eigen();
        let along = axes.eigenvectors.column(axes.eigenvalues.imax()).into_owned();
        // From the middle of the drive to the tag, and its mirror image.
        let offset = -mean;
        let mirrored = 2.0 * along * along.dot(&offset) - offset;
        let mut mirror = Self { place: anchor + mean + mirrored, ..*self };
        for _ in 0..ITERATIONS {
            let equations = mirror.equations(calibration);
            let Some(inverse) = equations.place.try_inverse() else { return 1.0 };
            mirror.place -= inverse * equations.place_gradient;
        }
        let apart = mirror.place - self.place;
        let distance = covariance.try_inverse().map_or(0.0, |inverse| apart.dot(&(inverse * apart)));
        // It may have moved to the same place.
        let is_another = distance > DISTINCT * DISTINCT && mirror.place.iter().all(|value| value.is_finite());
        if !is_another {
            return 1.0;
        }
        1.0 / (1.0 + (self.cost(calibration) - mirror.cost(calibration)).exp())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, Normal};

    const TAGS: [Point2; 4] =
        [Point2::new(40.0, 5.0), Point2::new(-20.0, 35.0), Point2::new(10.0, -45.0), Point2::new(25.0, 30.0)];

    /// Ranges along a path, `(1 + scale) d + offset` with noise of half a metre, and a share of echoes.
    fn read(path: impl Fn(f64) -> (f64, f64), offset: f64, scale: f64, echoes: f64) -> Vec<FarTag> {
        let mut random = ChaCha8Rng::seed_from_u64(7);
        let noise = Normal::new(0.0, 0.5).unwrap();
        let tag = |place: &Point2| {
            let ring = |step: i32| {
                let (x, y) = path(f64::from(step) / 300.0);
                let centre = Point2::new(x, y);
                let mut radius = (1.0 + scale) * (place - centre).norm() + offset + noise.sample(&mut random);
                if random.random::<f64>() < echoes {
                    radius += 30.0 * random.random::<f64>();
                }
                Ring { centre, radius, variance: 0.25 }
            };
            FarTag { ranges: (0..300).map(ring).collect(), ..FarTag::default() }
        };
        TAGS.iter().map(tag).collect()
    }

    /// Around a field of 40 m x 30 m.
    fn round(way: f64) -> (f64, f64) {
        let angle = std::f64::consts::TAU * way;
        (20.0 * angle.cos(), 15.0 * angle.sin())
    }

    #[test]
    fn tags_far_away_are_located_with_an_honest_covariance() {
        for (offset, scale) in [(0.0, 0.0), (2.0, 0.0), (0.3, 0.07)] {
            let modes = locate(&read(round, offset, scale, 0.15), &TagLocalizerParameters::default());
            for (mode, tag) in modes.into_iter().zip(TAGS) {
                let mode = mode.unwrap();
                let error = mode.position - tag;
                let squared = error.dot(&(mode.covariance.try_inverse().unwrap() * error));
                assert!(error.norm() < 2.0 && squared < 14.0, "{offset} {scale}: {error} {squared}");
                assert!(mode.certainty > 0.95 && mode.covariance.trace().sqrt() < 1.5, "{mode:?}");
            }
        }
    }

    #[test]
    fn a_straight_drive_leaves_two_places() {
        let modes = locate(&read(|way| (40.0 * way - 20.0, 0.0), 0.0, 0.0, 0.0), &TagLocalizerParameters::default());
        assert!(modes.into_iter().flatten().all(|mode| mode.certainty < 0.6));
    }

    #[test]
    fn directions_of_a_tag_resolve_its_mirror_image() {
        let mut tags = read(|way| (40.0 * way - 20.0, 0.0), 0.0, 0.0, 0.0);
        for (tag, place) in tags.iter_mut().zip(TAGS) {
            let ray = |ring: &Ring| {
                let offset = place - ring.centre;
                Ray { origin: ring.centre, bearing: offset.y.atan2(offset.x), variance: 0.01, origin_variance: 0.0 }
            };
            tag.rays = tag.ranges.iter().step_by(30).map(ray).collect();
        }
        for (mode, tag) in locate(&tags, &TagLocalizerParameters::default()).into_iter().zip(TAGS) {
            let mode = mode.unwrap();
            assert!((mode.position - tag).norm() < 1.0 && mode.certainty > 0.95, "{mode:?}");
        }
    }

    #[test]
    fn a_tag_without_ranges_or_with_one_has_no_place() {
        let one = Ring { centre: Point2::origin(), radius: 20.0, variance: 0.1 };
        let tags = [FarTag::default(), FarTag { ranges: vec![one], ..FarTag::default() }];
        let modes = locate(&tags, &TagLocalizerParameters::default());
        assert!(modes[0].is_none() && modes[1].is_none_or(|mode| mode.certainty < 0.5), "{modes:?}");
    }
}
