//! How certain a tag's place is, and how wrong (Tsardoulias et al., section 3 and figure 4).
//!
//! A robot drives 3 m past a tag, straight, along a quarter of a circle, or once round a small circle, and reads it
//! every centimetre. The tag is anywhere within range. The paper's likelihood is compared with the localizer's
//! defaults, then readings and poses are made worse.

mod calibration;
mod drive;
mod picture;
mod pose_errors;
mod reading_counts;
mod reflections;
mod score;
mod trial;

use super::results::Results;
use anyhow::Result;
use clap::Args;

/// Arguments of the experiment `localization`.
#[derive(Debug, Args)]
pub(super) struct LocalizationArgs {
    /// How many drives for each point, each with its own seed.
    #[arg(long, default_value_t = 200)]
    seeds: u64,
}

/// Does the experiment.
pub(super) fn run(args: &LocalizationArgs, results: &mut Results) -> Result<()> {
    reading_counts::run(args.seeds, results)?;
    calibration::run(args.seeds, results)?;
    reflections::run(args.seeds, results)?;
    pose_errors::run(args.seeds, results)?;
    picture::run(results)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_leaves_tables_plots_and_a_picture() {
        let folder = tempfile::tempdir().unwrap();
        run(&LocalizationArgs { seeds: 3 }, &mut Results::new(folder.path()).unwrap()).unwrap();
        for name in [
            "localization_readings.csv",
            "localization_certainty_paper.svg",
            "localization_certainty_default.svg",
            "localization_error.svg",
            "localization_calibration.csv",
            "localization_calibration.svg",
            "localization_reflections.csv",
            "localization_reflections.svg",
            "localization_poses.csv",
            "localization_poses.svg",
            "localization_grids.png",
        ] {
            assert!(folder.path().join(name).metadata().unwrap().len() > 100, "{name}");
        }
    }
}
