//! How often a merge succeeds as the world gets worse: the question that Tsardoulias et al. leave open in section 6.
//!
//! Two robots explore one simulated building; one property of the world at a time is varied, all others keep the
//! simulator's defaults. A merge is right below 0.5 m and 1 degree, wrong above, and refused if the robots were not
//! merged. That is measured against where the robots' map frames are. Where poses drift, maps are bent, and another
//! rigid frame aligns the places that both have driven through better: the error against the best such frame is
//! reported as well.

use super::plot::{Axis, Plot, Series, Shape};
use super::results::Results;
use super::statistics::{NORMALISED_95, median, quantile, wilson_interval};
use super::trial::World;
use anyhow::Result;
use clap::{Args, ValueEnum};
use gridweave::common_places::{CommonPlaces, FromBest};
use gridweave::evaluate::{RIGHT_DEGREES, RIGHT_METRES, RobotOutcome, RobotResult};
use gridweave::table::Table;
use gridweave_runtime::stage::Registry;
use rayon::prelude::*;

/// Arguments of the experiment `noise`.
#[derive(Debug, Args)]
pub(super) struct NoiseArgs {
    /// How many worlds for each value, each with its own seed.
    #[arg(long, default_value_t = 50)]
    seeds: u64,
    /// The first seed.
    #[arg(long, default_value_t = 1)]
    first_seed: u64,
    /// The pipeline that merges.
    #[arg(long, default_value = "tag_merge")]
    pipeline: String,
    /// Vary only this; all if none is given.
    #[arg(long, value_enum)]
    only: Vec<Property>,
}

/// What is varied.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Property {
    /// Standard deviation of the tags' ranges.
    TagNoise,
    /// The same, with the paper's read-out window of 6 cm whatever the noise.
    TagNoiseFixedWindow,
    /// Share of the readings that are lost.
    LostReadings,
    /// Share of the readings that come over a reflection.
    Reflections,
    /// Drift of the poses.
    Drift,
    /// Share of its rooms that a robot has in common with the other.
    Overlap,
    /// How many tags there are in the building.
    Tags,
}

/// One way to vary the world.
struct Sweep {
    name: &'static str,
    title: &'static str,
    axis: &'static str,
    values: &'static [f64],
    /// The parameter of the simulator that takes the values.
    parameter: &'static str,
    /// Parameters of the pipeline's stages.
    merge: &'static [&'static str],
}

const NOISES: &[f64] = &[0.05, 0.1, 0.15, 0.2, 0.3, 0.5, 0.75, 1.0];

impl Property {
    fn sweep(self) -> Sweep {
        let (parameter, title, axis, values): (_, _, _, &[f64]) = match self {
            Self::TagNoise => ("tag_noise", "Noise of the tags' ranges", "standard deviation of a range, m", NOISES),
            Self::TagNoiseFixedWindow => {
                let title = "Noise of the tags' ranges, read-out window of 6 cm";
                let merge = &["tags.window_deviations=0"];
                return Sweep { name: "tag_noise_fixed_window", title, merge, ..Self::TagNoise.sweep() };
            }
            Self::LostReadings => (
                "lost_readings",
                "Lost readings of tags",
                "share of the readings that are lost",
                &[0.0, 0.2, 0.4, 0.6, 0.8, 0.9, 0.95],
            ),
            Self::Reflections => (
                "reflections",
                "Readings over a reflection, 0.3 m to 2 m too long",
                "share of the readings that are reflected",
                &[0.0, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5],
            ),
            Self::Drift => (
                "drift",
                "Drift of the poses, loop closures every 10 m",
                "standard deviation after one metre, rad and m",
                &[0.0, 0.001, 0.002, 0.004, 0.007, 0.01, 0.015, 0.02],
            ),
            Self::Overlap => (
                "overlap",
                "Overlap of the maps",
                "share of a robot's rooms that the other has as well",
                &[0.1, 0.2, 0.3, 0.4, 0.5, 0.65, 0.8, 1.0],
            ),
            Self::Tags => (
                "tags",
                "Tags in the building (20 m x 15 m)",
                "number of tags",
                &[4.0, 6.0, 9.0, 12.0, 18.0, 24.0, 36.0],
            ),
        };
        Sweep { name: parameter, title, axis, values, parameter, merge: &[] }
    }
}

impl Sweep {
    /// The settings of the simulator for a value.
    fn world(&self, value: f64) -> String {
        format!("{}={value}", self.parameter)
    }
}

/// What became of one world.
struct Trial {
    seed: u64,
    robot: RobotResult,
    /// Distances of places that both robots have driven through.
    common: Option<CommonPlaces>,
}

/// Does the experiment.
pub(super) fn run(args: &NoiseArgs, registry: &Registry, results: &mut Results) -> Result<()> {
    let all = Property::value_variants();
    let properties = if args.only.is_empty() { all } else { &args.only };
    properties.iter().try_for_each(|property| sweep(&property.sweep(), args, registry, results))
}

/// The columns of a table, but for the first.
const HEADS: [&str; 18] = [
    "right",
    "wrong",
    "refused",
    "right, 95 % interval",
    "error m, median",
    "95 %",
    "error deg, median",
    "95 %",
    "within the covariance's 95 %",
    "common places m, rigid: median",
    "90 %",
    "bent: median",
    "90 %",
    "wrong by the best rigid frame",
    "deg from it, median",
    "95 %",
    "within the covariance's 95 % of it",
    "wrong by the common places",
];

const OUTCOMES: [RobotOutcome; 3] = [RobotOutcome::Right, RobotOutcome::Wrong, RobotOutcome::Refused];

fn sweep(sweep: &Sweep, args: &NoiseArgs, registry: &Registry, results: &mut Results) -> Result<()> {
    let mut table = Table::new(std::iter::once(sweep.axis).chain(HEADS));
    let mut data = Table::new([
        sweep.axis,
        "seed",
        "outcome",
        "error m",
        "error deg",
        "normalised error squared",
        "m from the best rigid frame",
        "deg from it",
        "m apart at common places, median",
        "90 %",
        "reason",
    ]);
    let mut shares: [Vec<(f64, f64)>; 3] = Default::default();
    let mut bands: [Vec<(f64, f64, f64)>; 3] = Default::default();
    for &value in sweep.values {
        let trials = trials(sweep, value, args, registry)?;
        let counts = OUTCOMES.map(|outcome| trials.iter().filter(|trial| trial.robot.outcome == outcome).count());
        for ((share, band), count) in shares.iter_mut().zip(&mut bands).zip(counts) {
            let (low, high) = wilson_interval(count, trials.len());
            share.push((value, count as f64 / trials.len() as f64));
            band.push((value, low, high));
        }
        table.row(std::iter::once(value.to_string()).chain(summary(&trials, counts)));
        trials.into_iter().for_each(|trial| data.row(trial.row(value)));
    }
    let name = format!("noise_{}", sweep.name);
    results.table(&name, &format!("## {}", sweep.title), &table)?;
    results.data(&format!("{name}_trials"), &data)?;
    let series = ["right", "wrong", "refused"].into_iter().zip(shares).zip(bands);
    let plot = Plot {
        title: sweep.title.to_owned(),
        x: Axis::new(sweep.axis),
        y: Axis::new("share of the worlds, with the 95 % interval").range(0.0, 1.0),
        shape: Shape::Lines(series.map(|((name, share), band)| Series::new(name, share).with_band(band)).collect()),
    };
    results.plot(&name, &plot)
}

/// What many worlds come to: the cells below [`HEADS`].
fn summary(trials: &[Trial], counts: [usize; 3]) -> Vec<String> {
    let number = |value: f64| if value.is_finite() { format!("{value:.3}") } else { "-".to_owned() };
    let within = |normalised: &[f64]| {
        let within = normalised.iter().filter(|error| **error < NORMALISED_95).count();
        format!("{within} of {}", normalised.len())
    };
    let errors = |error: fn(&Trial) -> Option<f64>| trials.iter().filter_map(error).collect::<Vec<f64>>();
    let (metres, degrees) = (errors(|trial| trial.robot.error_m), errors(|trial| trial.robot.error_deg));
    let places: Vec<&CommonPlaces> = trials.iter().filter_map(|trial| trial.common.as_ref()).collect();
    let common_parts: [fn(&CommonPlaces) -> f64; 4] = [
        |places| places.rigid.median_m,
        |places| places.rigid.p90_m,
        |places| places.deformed.unwrap_or(places.rigid).median_m,
        |places| places.deformed.unwrap_or(places.rigid).p90_m,
    ];
    let common = common_parts.map(|part| median(&places.iter().map(|places| part(places)).collect::<Vec<f64>>()));
    let best: Vec<FromBest> = places.iter().filter_map(|places| places.from_best).collect();
    let is_wrong = |best: &&FromBest| best.metres >= RIGHT_METRES || best.degrees >= RIGHT_DEGREES;
    let turned: Vec<f64> = best.iter().map(|best| best.degrees).collect();
    let (low, high) = wilson_interval(counts[0], trials.len());

    let mut cells = counts.map(|count| count.to_string()).to_vec();
    cells.push(format!("{:.0} % to {:.0} %", 100.0 * low, 100.0 * high));
    cells.extend([median(&metres), quantile(&metres, 0.95), median(&degrees), quantile(&degrees, 0.95)].map(number));
    cells.push(within(&errors(|trial| trial.robot.normalised_error_squared)));
    cells.extend(common.map(number));
    cells.push(best.iter().filter(is_wrong).count().to_string());
    cells.extend([median(&turned), quantile(&turned, 0.95)].map(number));
    cells.push(within(&best.iter().filter_map(|best| best.normalised_error_squared).collect::<Vec<f64>>()));
    cells.push(places.iter().filter(|places| is_wrong_by_places(places)).count().to_string());
    cells
}

impl Trial {
    /// The row of a world with a value.
    fn row(self, value: f64) -> [String; 11] {
        let number = |value: Option<f64>| value.map_or_else(String::new, |value| format!("{value:.6}"));
        let from_best = self.common.and_then(|common| common.from_best);
        let rigid = self.common.map(|common| common.rigid);
        [
            value.to_string(),
            self.seed.to_string(),
            self.robot.outcome.words().to_owned(),
            number(self.robot.error_m),
            number(self.robot.error_deg),
            number(self.robot.normalised_error_squared),
            number(from_best.map(|best| best.metres)),
            number(from_best.map(|best| best.degrees)),
            number(rigid.map(|rigid| rigid.median_m)),
            number(rigid.map(|rigid| rigid.p90_m)),
            self.robot.reason.unwrap_or_default(),
        ]
    }
}

/// Whether places that both robots have driven through are farther apart by the rigid frames than they must be: by half
/// a metre in the median, or by a metre at 90 %.
fn is_wrong_by_places(common: &CommonPlaces) -> bool {
    let best = common.from_best.map(|best| best.best);
    let beyond = |found: f64, best: Option<f64>, most: f64| found >= most + best.unwrap_or_default();
    beyond(common.rigid.median_m, best.map(|best| best.median_m), RIGHT_METRES)
        || beyond(common.rigid.p90_m, best.map(|best| best.p90_m), 2.0 * RIGHT_METRES)
}

fn trials(sweep: &Sweep, value: f64, args: &NoiseArgs, registry: &Registry) -> Result<Vec<Trial>> {
    let world_settings = ["robots=2".to_owned(), sweep.world(value)];
    let merge_settings: Vec<String> = sweep.merge.iter().map(|setting| (*setting).to_owned()).collect();
    let seeds: Vec<u64> = (args.first_seed..args.first_seed.saturating_add(args.seeds)).collect();
    let one = |&seed: &u64| {
        let world = World::simulate(&world_settings, seed, registry)?;
        let merge = world.merge(&args.pipeline, &merge_settings, registry)?;
        let common = merge.evaluation.common;
        Ok(merge.evaluation.robots.into_iter().map(move |robot| Trial { seed, robot, common }))
    };
    let trials: Result<Vec<_>> = seeds.par_iter().map(one).collect();
    Ok(trials?.into_iter().flatten().collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_runtime::pipeline::Overrides;

    #[test]
    fn every_sweep_sets_parameters_that_there_are() {
        let registry = gridweave::shipped::registry([]);
        let load = |pipeline: &str, settings: &[String]| {
            let mut overrides = Overrides::default();
            overrides.set_for_kind("mcap_sink", "file", "out.mcap");
            if pipeline != "simulate" {
                overrides.set_for_kind("mcap_source", "files", vec!["in.mcap".to_owned()]);
            }
            settings.iter().for_each(|setting| overrides.set(setting).unwrap());
            assert!(gridweave::shipped::load(pipeline.as_ref(), &overrides, &registry).is_ok(), "{settings:?}");
        };
        for sweep in Property::value_variants().iter().map(|property| property.sweep()) {
            let worlds = sweep.values.iter().map(|value| format!("simulator.{}", sweep.world(*value)));
            worlds.for_each(|world| load("simulate", &[world]));
            load("tag_merge", &sweep.merge.iter().map(|setting| (*setting).to_owned()).collect::<Vec<_>>());
        }
    }
}
