//! Runs from a map to the direction of its walls, and how far they are off.

use super::settings::Settings;
use gridweave_stages::shared::geometry::{Grid, turn_difference};
use gridweave_stages::simulator::{DrawnMapSettings, SnapshotMap, WallStyle, draw_map};
use gridweave_stages::tags::line_extractor::extract_segments;
use gridweave_stages::tags::quadrant_classifier::map_direction;
use rayon::prelude::*;
use std::f64::consts::FRAC_PI_2;

/// The number of maps that are made at once, in parallel.
const BATCH: u64 = 32;

/// A kind of map.
#[derive(Clone, Copy, Debug)]
pub(super) struct Case {
    /// How its walls look.
    pub(super) walls: WallStyle,
    /// Their direction, degrees.
    pub(super) degrees: f64,
}

impl Case {
    fn map(self, seed: u64) -> SnapshotMap {
        draw_map(&DrawnMapSettings::office(self.walls, self.degrees.to_radians()), seed)
    }
}

/// One run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Run {
    pub(super) map_seed: u64,
    pub(super) stage_seed: u64,
    /// The direction found less the true one, degrees. No number if no walls were found.
    pub(super) error: f64,
    /// The standard deviation that the stage reports, degrees.
    pub(super) deviation: f64,
    /// Whether the stage takes its direction for valid.
    pub(super) valid: bool,
    /// How many walls were found.
    pub(super) segments: usize,
}

/// A map and a stage seed for each run: the runs under each set of parameters. All sets see the same maps.
pub(super) fn over_maps(case: Case, seeds: u64, settings: &[Settings]) -> Vec<Vec<Run>> {
    let mut runs = vec![Vec::new(); settings.len()];
    let mut first = 0;
    while first < seeds {
        let batch: Vec<u64> = (first..seeds.min(first + BATCH)).collect();
        let maps: Vec<SnapshotMap> = batch.par_iter().map(|&seed| case.map(seed)).collect();
        for (settings, runs) in settings.iter().zip(&mut runs) {
            runs.extend(batch.iter().zip(&maps).filter_map(|(&seed, map)| measure(case, map, seed, seed, settings)));
        }
        first += BATCH;
    }
    runs
}

/// One map, searched with many stage seeds.
pub(super) fn over_stage_seeds(case: Case, seeds: u64, settings: &Settings) -> Vec<Run> {
    let map = case.map(0);
    (0..seeds).filter_map(|seed| measure(case, &map, 0, seed, settings)).collect()
}

/// Maps at several angles, degrees, each with its own seed: the errors at each angle.
pub(super) fn over_rotations(walls: WallStyle, degrees: &[f64], maps: u64, settings: &Settings) -> Vec<Vec<f64>> {
    let at = |(index, &degrees): (usize, &f64)| {
        let case = Case { walls, degrees };
        let seeds = (0..maps).map(|map| index as u64 * maps + map);
        let runs = seeds.filter_map(|seed| measure(case, &case.map(seed), seed, seed, settings));
        runs.map(|run| run.error).filter(|error| error.is_finite()).collect()
    };
    degrees.par_iter().enumerate().map(at).collect()
}

/// Measures one run. `None` for a map that is not a grid, which does not happen for drawn maps.
fn measure(case: Case, map: &SnapshotMap, map_seed: u64, stage_seed: u64, settings: &Settings) -> Option<Run> {
    let grid = Grid::new(map.geometry, &map.cells).ok()?;
    let segments = extract_segments(&grid, &settings.lines, stage_seed);
    let direction = map_direction(&segments, &settings.classifier);
    let error = turn_difference(direction.angle, case.degrees.to_radians(), FRAC_PI_2).to_degrees();
    Some(Run {
        map_seed,
        stage_seed,
        error: if direction.agreement > 0.0 { error } else { f64::NAN },
        deviation: direction.deviation.to_degrees(),
        valid: direction.valid,
        segments: segments.len(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCANNED: Case = Case { walls: WallStyle::Scanned, degrees: -45.0 };

    #[test]
    fn the_error_is_that_of_the_direction_and_the_same_each_time() {
        let settings = [Settings::shipped()];
        let [first, second] = [(), ()].map(|()| over_maps(SCANNED, 2, &settings).remove(0));
        assert_eq!(first, second);
        assert!(first.iter().all(|run| run.error.abs() < 0.2 && run.valid && run.segments > 10), "{first:?}");
        assert_eq!(first[..1], over_stage_seeds(SCANNED, 1, &settings[0]));
    }

    #[test]
    fn the_errors_at_an_angle_are_those_of_maps_at_that_angle() {
        let settings = Settings::shipped();
        let errors = over_rotations(WallStyle::Thin, &[0.0, 44.0, 89.0], 2, &settings);
        assert_eq!(errors.iter().map(Vec::len).collect::<Vec<_>>(), [2, 2, 2]);
        assert!(errors.iter().flatten().all(|error| error.abs() < 0.2), "{errors:?}");
        let case = Case { walls: WallStyle::Thin, degrees: 0.0 };
        let alone = over_maps(case, 2, std::slice::from_ref(&settings)).remove(0);
        assert_eq!(errors[0], alone.iter().map(|run| run.error).collect::<Vec<_>>());
    }

    #[test]
    fn where_no_walls_are_found_there_is_no_error() {
        let mut settings = Settings::shipped();
        settings.lines.min_length = 100.0;
        let run = over_stage_seeds(SCANNED, 1, &settings)[0];
        assert!(run.error.is_nan() && !run.valid && run.segments == 0);
    }
}
