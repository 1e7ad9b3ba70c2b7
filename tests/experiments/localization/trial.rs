//! One drive past one tag, and what the localizer makes of it.

use super::drive::{Drive, READINGS, SPACING, Scene, WAY};
use gridweave_runtime::message::LogTime;
use gridweave_stages::shared::geometry::Point2;
use gridweave_stages::tags::tag_localizer::{Position, Readout, TagLocalizer, TagLocalizerParameters, TagMode};
use nalgebra::{Matrix2, Vector2};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use rayon::prelude::*;

/// Standard deviation of a range, metres (Tsardoulias et al., section 3).
const RANGE_STDDEV: f64 = 0.05;
/// A reflection is too long by this much, metres, as in the simulator.
const DETOUR: std::ops::Range<f64> = 0.3..2.0;
/// Independent errors of poses change every so many readings: 0.1 m.
const INDEPENDENT_AFTER: usize = 10;
/// The share of the probability of two normal errors within their ellipse is 95 % at this squared distance.
const ELLIPSE_95: f64 = 5.991;
/// Readings come at 10 Hz.
const TICK_SECONDS: f64 = 0.1;

/// Which likelihood the localizer multiplies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Likelihood {
    /// The paper's: every reading by itself, pure Gaussians, exact poses, a grid of 300 x 300 cells.
    Paper,
    /// The localizer's defaults, but without a share of outliers.
    Pure,
    /// The localizer's defaults.
    Default,
}

impl Likelihood {
    /// What tables call it.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::Pure => "outlier_share = 0",
            Self::Default => "default",
        }
    }

    /// The localizer's parameters.
    pub(super) fn parameters(self, readout: Readout) -> TagLocalizerParameters {
        let defaults = TagLocalizerParameters { readout, ..Default::default() };
        match self {
            Self::Paper => TagLocalizerParameters {
                grid_size: 6.0,
                outlier_share: 0.0,
                pose_stddev: 0.0,
                position_stddev: 0.0,
                min_travel: 0.0,
                ..defaults
            },
            Self::Pure => TagLocalizerParameters { outlier_share: 0.0, ..defaults },
            Self::Default => defaults,
        }
    }
}

/// How the errors of the poses of one drive hang together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum PoseError {
    /// A new one every 0.1 m.
    Independent,
    /// One for the whole drive.
    #[default]
    Shared,
    /// A random walk from none at the start of the drive.
    Drifting,
}

impl PoseError {
    /// All of them.
    pub(super) const ALL: [Self; 3] = [Self::Independent, Self::Shared, Self::Drifting];

    /// What tables call it.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Independent => "independent",
            Self::Shared => "shared",
            Self::Drifting => "drifting",
        }
    }
}

/// What is wrong with readings and poses.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Conditions {
    /// Share of the readings that are reflections.
    pub(super) reflections: f64,
    /// How the errors of the poses hang together.
    pub(super) pose_error: PoseError,
    /// Standard deviation of the poses along each axis, metres; of drifting ones at the end of the drive.
    pub(super) pose_stddev: f64,
    /// Whether the poses come with their covariance.
    pub(super) is_known: bool,
}

/// What the localizer says of a tag, against the truth.
#[derive(Clone, Copy, Debug)]
pub(super) struct Outcome {
    /// The certainty that it states.
    pub(super) certainty: f64,
    /// Whether the tag is in the window or block that has this certainty.
    pub(super) is_in_window: bool,
    /// From the stated place to the tag, metres.
    pub(super) error: f64,
    /// Whether the tag is in the ellipse that holds 95 % by the stated covariance.
    pub(super) is_in_ellipse: bool,
}

impl Outcome {
    fn new(mode: &TagMode, tag: &Point2, parameters: &TagLocalizerParameters) -> Self {
        let error = mode.position - tag;
        let half_window = 0.5 * parameters.window_cells(RANGE_STDDEV) as f64 * parameters.resolution;
        Self {
            certainty: mode.certainty,
            is_in_window: (mode.window - tag).amax() <= half_window,
            error: error.norm(),
            is_in_ellipse: mode
                .covariance
                .try_inverse()
                .is_some_and(|information| error.dot(&(information * error)) <= ELLIPSE_95),
        }
    }
}

/// One drive: what the robot believes its positions to be, and the ranges that it reads there.
pub(super) struct Recording {
    /// What is true.
    pub(super) scene: Scene,
    /// Where the robot believes to be, and the range, at each reading.
    pub(super) readings: Vec<(Position, f64)>,
}

impl Recording {
    /// A drive by its seed. The same seed gives the same scene and noise under all conditions.
    pub(super) fn new(drive: Drive, conditions: &Conditions, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let scene = Scene::new(drive, &mut random);
        let normal = |random: &mut ChaCha8Rng| -> f64 { random.sample(StandardNormal) };
        let normals = |random: &mut ChaCha8Rng| Vector2::new(normal(random), normal(random));
        let shared = normals(&mut random);
        let mut walk = Vector2::zeros();
        let mut independent = Vector2::zeros();
        let mut readings = Vec::with_capacity(scene.places.len());
        for (index, place) in scene.places.iter().enumerate() {
            let way = SPACING * index as f64;
            walk += normals(&mut random) * (SPACING / WAY).sqrt();
            let fresh = normals(&mut random);
            if index % INDEPENDENT_AFTER == 0 {
                independent = fresh;
            }
            let (error, variance) = match conditions.pose_error {
                PoseError::Independent => (independent, 1.0),
                PoseError::Shared => (shared, 1.0),
                PoseError::Drifting => (walk, (way + SPACING) / WAY),
            };
            let known = if conditions.is_known { conditions.pose_stddev.powi(2) * variance } else { 0.0 };
            let position = Position {
                place: place + error * conditions.pose_stddev,
                covariance: Matrix2::from_diagonal_element(known),
                yaw: 0.0,
                yaw_variance: 0.0,
            };
            let is_reflected = random.random::<f64>() < conditions.reflections;
            let detour = random.random_range(DETOUR);
            let noise = RANGE_STDDEV * normal(&mut random);
            let way_of_signal = (scene.tag - place).norm() + if is_reflected { detour } else { 0.0 };
            readings.push((position, (way_of_signal + noise).max(0.0)));
        }
        Self { scene, readings }
    }

    /// Gives the readings to a localizer one by one. `after` is called with their number so far.
    pub(super) fn replay(&self, parameters: &TagLocalizerParameters, mut after: impl FnMut(usize, &mut TagLocalizer)) {
        let mut localizer = TagLocalizer::new(parameters.clone());
        for (index, (position, range)) in self.readings.iter().enumerate() {
            let time = LogTime(1_000_000_000).plus_seconds(TICK_SECONDS * index as f64);
            // No pose is late and no reading lacks one: the only readings left out are those beyond the reach.
            localizer.add_pose(time, *position, |_| ());
            let _beyond_reach = localizer.add_reading(time, "tag", *range, RANGE_STDDEV);
            after(index + 1, &mut localizer);
        }
    }
}

/// What comes of many drives of one shape, each with its own seed: for each of `counts` readings, which must rise,
/// the outcomes by seed.
pub(super) fn outcomes(
    drive: Drive,
    conditions: &Conditions,
    parameters: &TagLocalizerParameters,
    counts: &[usize],
    seeds: u64,
) -> Vec<Vec<Outcome>> {
    let by_seed: Vec<Vec<Option<Outcome>>> = (0..seeds)
        .into_par_iter()
        .map(|seed| {
            let recording = Recording::new(drive, conditions, seed);
            let mut outcomes = Vec::with_capacity(counts.len());
            recording.replay(parameters, |count, localizer| {
                if counts.contains(&count) {
                    localizer.read_out_all();
                    let mode = localizer.modes().next().map(|(_, mode, _)| *mode);
                    outcomes.push(mode.map(|mode| Outcome::new(&mode, &recording.scene.tag, parameters)));
                }
            });
            outcomes
        })
        .collect();
    let at = |index: usize| by_seed.iter().filter_map(|outcomes| outcomes.get(index).copied().flatten()).collect();
    (0..counts.len()).map(at).collect()
}

/// What comes of whole drives.
pub(super) fn final_outcomes(
    drive: Drive,
    conditions: &Conditions,
    parameters: &TagLocalizerParameters,
    seeds: u64,
) -> Vec<Outcome> {
    outcomes(drive, conditions, parameters, &[READINGS], seeds).pop().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn conditions_change_what_they_name_and_nothing_else() {
        let record = |conditions: Conditions| Recording::new(Drive::Curved, &conditions, 5);
        let plain = record(Conditions::default());
        let reflected = record(Conditions { reflections: 0.3, ..Default::default() });
        let same = plain.readings.iter().zip(&reflected.readings).filter(|(a, b)| a == b).count();
        assert!((170..250).contains(&same), "{same} of 300");
        assert_eq!(plain.scene.tag, reflected.scene.tag);
        for pose_error in PoseError::ALL {
            let wrong = record(Conditions { pose_error, pose_stddev: 0.1, is_known: true, ..Default::default() });
            let off: Vec<Vector2<f64>> =
                wrong.readings.iter().zip(&plain.readings).map(|(a, b)| a.0.place - b.0.place).collect();
            let steps = off.windows(2).filter(|pair| (pair[1] - pair[0]).norm() > 1e-12).count();
            let expected = match pose_error {
                PoseError::Independent => 29,
                PoseError::Shared => 0,
                PoseError::Drifting => 299,
            };
            assert_eq!(steps, expected, "{pose_error:?}");
            assert!((wrong.readings[READINGS - 1].0.covariance.m11 - 0.01).abs() < 1e-9, "{pose_error:?}");
            assert!(wrong.readings.iter().zip(&plain.readings).all(|(a, b)| a.1 == b.1), "ranges are as before");
        }
    }

    #[test]
    fn a_circling_robot_finds_its_tag() {
        let parameters = Likelihood::Default.parameters(Readout::Window);
        let outcomes = outcomes(Drive::Circling, &Conditions::default(), &parameters, &[30, 300], 4);
        assert_eq!((outcomes.len(), outcomes[0].len(), outcomes[1].len()), (2, 4, 4));
        assert!(outcomes[1].iter().all(|outcome| outcome.error < 0.15 && outcome.is_in_ellipse), "{outcomes:?}");
        assert!(outcomes[0].iter().all(|outcome| outcome.certainty < 0.5), "{outcomes:?}");
    }
}
