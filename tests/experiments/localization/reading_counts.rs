//! Certainty and error against the number of readings.

use super::super::plot::{Axis, Plot, Series, Shape};
use super::super::results::Results;
use super::drive::Drive;
use super::score::Score;
use super::trial::{Conditions, Likelihood, outcomes};
use anyhow::Result;
use gridweave::table::Table;
use gridweave_stages::tags::tag_localizer::Readout;

/// The numbers of readings of the curves.
const COUNTS: [usize; 10] = [10, 20, 30, 50, 75, 100, 150, 200, 250, 300];
/// Those of figure 4, which the table shows.
const SHOWN: [usize; 4] = [30, 100, 200, 300];

/// What tables call a read-out.
pub(super) fn readout_name(readout: Readout) -> &'static str {
    match readout {
        Readout::Blocks => "blocks",
        Readout::Window => "window",
    }
}

/// Scores all drives, likelihoods and read-outs at rising numbers of readings.
pub(super) fn run(seeds: u64, results: &mut Results) -> Result<()> {
    let mut data = table();
    let mut errors = Vec::new();
    for likelihood in [Likelihood::Paper, Likelihood::Default] {
        let mut shown = table();
        let mut certainties = Vec::new();
        for readout in [Readout::Blocks, Readout::Window] {
            for drive in Drive::ALL {
                let parameters = likelihood.parameters(readout);
                let by_count = outcomes(drive, &Conditions::default(), &parameters, &COUNTS, seeds);
                let scores: Vec<(usize, Score)> =
                    COUNTS.iter().zip(&by_count).map(|(&count, outcomes)| (count, Score::new(outcomes))).collect();
                for (count, score) in &scores {
                    let names = [likelihood.name(), readout_name(readout), drive.name()].map(str::to_owned);
                    let row: Vec<String> = names.into_iter().chain([count.to_string()]).chain(score.cells()).collect();
                    data.row(row.iter().cloned());
                    if SHOWN.contains(count) {
                        shown.row(row);
                    }
                }
                let curve = |value: fn(&Score) -> f64| {
                    scores.iter().map(|(count, score)| (*count as f64, value(score))).collect()
                };
                let name = format!("{}, {}", drive.name(), readout_name(readout));
                certainties.push(Series::new(name, curve(|score| score.certainty)));
                if readout == Readout::Window {
                    let name = format!("{}, {}", drive.name(), likelihood.name());
                    errors.push(Series::new(name, curve(|score| score.median)));
                }
            }
        }
        let name = likelihood.name();
        println!("The likelihood of the {name}:\n\n{}", shown.to_terminal().unwrap_or_else(|| shown.to_markdown()));
        results.plot(
            &format!("localization_certainty_{name}"),
            &Plot {
                title: format!("Certainty of a tag, {name} likelihood (mean of {seeds} drives)"),
                x: Axis::new("readings").range(0.0, 300.0),
                y: Axis::new("certainty").range(0.0, 1.0),
                shape: Shape::Lines(certainties),
            },
        )?;
    }
    results.plot(
        "localization_error",
        &Plot {
            title: format!("Error of a tag's place, window read-out (median of {seeds} drives)"),
            x: Axis::new("readings").range(0.0, 300.0),
            y: Axis::new("error, m").logarithmic(),
            shape: Shape::Lines(errors),
        },
    )?;
    results.data("localization_readings", &data)
}

fn table() -> Table {
    Table::new(["likelihood", "read-out", "drive", "readings"].into_iter().chain(Score::HEADS))
}
