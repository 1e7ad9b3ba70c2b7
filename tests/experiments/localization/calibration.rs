//! Whether a certainty means what it says: of the places that are stated with a certainty of 0.7, the tag should be in
//! the window in 7 of 10.

use super::super::plot::{Axis, Plot, Series, Shape};
use super::super::results::Results;
use super::super::statistics::{mean, wilson_interval};
use super::drive::Drive;
use super::reading_counts::readout_name;
use super::trial::{Conditions, Likelihood, Outcome, outcomes};
use anyhow::Result;
use gridweave::table::Table;
use gridweave_stages::tags::tag_localizer::Readout;

/// The numbers of readings that are put together.
const COUNTS: [usize; 7] = [30, 60, 100, 150, 200, 250, 300];
/// The certainties are divided into so many parts of equal width.
const PARTS: usize = 10;
/// A part with fewer outcomes is not drawn.
const FEWEST: usize = 20;

/// Compares certainties with how often they hold, over all drives.
pub(super) fn run(seeds: u64, results: &mut Results) -> Result<()> {
    let mut table =
        Table::new(["likelihood", "read-out", "certainty from", "to", "outcomes", "mean certainty", "in window"]);
    let mut curves = vec![Series::new("as stated", vec![(0.0, 0.0), (1.0, 1.0)])];
    for likelihood in [Likelihood::Paper, Likelihood::Default] {
        for readout in [Readout::Blocks, Readout::Window] {
            let all: Vec<Outcome> = Drive::ALL
                .into_iter()
                .flat_map(|drive| {
                    outcomes(drive, &Conditions::default(), &likelihood.parameters(readout), &COUNTS, seeds)
                })
                .flatten()
                .collect();
            let mut points = Vec::new();
            let mut band = Vec::new();
            for part in 0..PARTS {
                let within = |outcome: &&Outcome| ((outcome.certainty * PARTS as f64) as usize).min(PARTS - 1) == part;
                let members: Vec<&Outcome> = all.iter().filter(within).collect();
                let certainty = mean(&members.iter().map(|outcome| outcome.certainty).collect::<Vec<_>>());
                let hits = members.iter().filter(|outcome| outcome.is_in_window).count();
                let share = hits as f64 / members.len() as f64;
                table.row([
                    likelihood.name().to_owned(),
                    readout_name(readout).to_owned(),
                    format!("{:.1}", part as f64 / PARTS as f64),
                    format!("{:.1}", (part + 1) as f64 / PARTS as f64),
                    members.len().to_string(),
                    format!("{certainty:.3}"),
                    format!("{share:.3}"),
                ]);
                if members.len() >= FEWEST {
                    let (low, high) = wilson_interval(hits, members.len());
                    points.push((certainty, share));
                    band.push((certainty, low, high));
                }
            }
            let name = format!("{}, {}", likelihood.name(), readout_name(readout));
            curves.push(Series::new(name, points).with_band(band));
        }
    }
    results.data("localization_calibration", &table)?;
    results.plot(
        "localization_calibration",
        &Plot {
            title: "How often the tag is in the window, by the certainty that is stated".into(),
            x: Axis::new("stated certainty").range(0.0, 1.0),
            y: Axis::new("share of tags in the window").range(0.0, 1.0),
            shape: Shape::Lines(curves),
        },
    )
}
