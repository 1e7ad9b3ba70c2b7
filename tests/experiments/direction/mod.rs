//! How exactly the direction of a map's walls is found: section 5.1 of Tsardoulias et al.
//!
//! The paper's map has 700 x 600 cells of 0.02 m and walls at -45 degrees, and was searched 1000 times. Here a map is
//! an office drawn at an angle that is known exactly ([`draw_map`](gridweave_stages::simulator::draw_map)), in five
//! styles of walls. A run goes from the grid to the direction: `line_extractor`, then the first half of
//! `quadrant_classifier`.
//!
//! Two things are random: the map, and what the stage draws. Most runs have a map and a stage seed of their own. That
//! one map is searched with many stage seeds, as in the paper, shows how much the stage itself adds.

mod measure;
mod report;
mod settings;

use super::results::Results;
use anyhow::Result;
use clap::Args;
use gridweave_stages::simulator::WallStyle;
use measure::{Case, Run, over_maps, over_rotations, over_stage_seeds};
use settings::Settings;

/// The wall styles with their names.
const STYLES: [(WallStyle, &str); 5] = [
    (WallStyle::Thin, "thin"),
    (WallStyle::Thick, "thick"),
    (WallStyle::Noisy, "noisy"),
    (WallStyle::TwoFaces, "two faces"),
    (WallStyle::Scanned, "scanned"),
];

/// Arguments of the experiment `direction`.
#[derive(Debug, Args)]
pub(super) struct DirectionArgs {
    /// How many maps of each style of walls are made, and with how many seeds one map of each is searched.
    #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u64).range(2..))]
    seeds: u64,
    /// The direction of the walls, degrees.
    #[arg(long, default_value_t = -45.0, allow_negative_numbers = true)]
    angle: f64,
    /// How many maps of each style are made at each angle from 0 to 89 degrees. 0 leaves the angles out.
    #[arg(long, default_value_t = 40)]
    maps_per_angle: u64,
}

/// What was measured of one style of walls under one set of parameters.
struct Series {
    style: &'static str,
    settings: &'static str,
    /// A map and a stage seed each.
    maps: Vec<Run>,
    /// One map, many stage seeds. Empty where it was not asked for.
    stage_seeds: Vec<Run>,
}

/// Does the experiment.
pub(super) fn run(args: &DirectionArgs, results: &mut Results) -> Result<()> {
    let settings = Settings::all();
    let mut series = Vec::new();
    for (walls, style) in STYLES {
        let case = Case { walls, degrees: args.angle };
        let by_settings = over_maps(case, args.seeds, &settings);
        for (settings, maps) in settings.iter().zip(by_settings) {
            let stage_seeds =
                if settings.is_ablation { Vec::new() } else { over_stage_seeds(case, args.seeds, settings) };
            series.push(Series { style, settings: settings.name, maps, stage_seeds });
        }
    }
    report::accuracy(&series, results)?;
    report::ablations(&series, &settings, results)?;
    report::histograms(&series, results)?;
    report::all_runs(&series, results)?;
    if args.maps_per_angle > 0 {
        let angles: Vec<f64> = (0..90).map(f64::from).collect();
        let curves: Vec<_> = STYLES
            .iter()
            .map(|&(walls, style)| (style, over_rotations(walls, &angles, args.maps_per_angle, &Settings::shipped())))
            .collect();
        report::rotations(&angles, &curves, results)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_experiment_leaves_tables_histograms_and_curves() {
        let folder = tempfile::TempDir::new().unwrap();
        let mut results = Results::new(folder.path()).unwrap();
        run(&DirectionArgs { seeds: 2, angle: 30.0, maps_per_angle: 0 }, &mut results).unwrap();
        let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
        // Maps under every set of parameters, and stage seeds under two of them; and the heads.
        let runs = STYLES.len() * 2 * (Settings::all().len() + 2);
        assert_eq!(read("direction_runs.csv").lines().count(), runs + 1);
        assert!(read("direction.csv").contains("the paper's parameters, two faces"));
        for name in ["histogram", "histogram_styles", "histogram_paper"] {
            assert!(read(&format!("direction_{name}.svg")).contains("</svg>"));
        }
    }
}
