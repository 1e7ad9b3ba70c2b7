//! Readings that have come over a reflection, and are 0.3 m to 2 m too long.

use super::super::plot::{Axis, Plot, Series, Shape};
use super::super::results::Results;
use super::drive::Drive;
use super::score::Score;
use super::trial::{Conditions, Likelihood, final_outcomes};
use anyhow::Result;
use gridweave::table::Table;
use gridweave_stages::tags::tag_localizer::Readout;

const SHARES: [f64; 6] = [0.0, 0.05, 0.1, 0.2, 0.3, 0.5];

/// Scores whole drives with more and more reflections.
pub(super) fn run(seeds: u64, results: &mut Results) -> Result<()> {
    let mut table = Table::new(["likelihood", "drive", "reflections"].into_iter().chain(Score::HEADS));
    let mut curves = Vec::new();
    for likelihood in [Likelihood::Paper, Likelihood::Pure, Likelihood::Default] {
        for drive in Drive::ALL {
            let mut points = Vec::new();
            for reflections in SHARES {
                let conditions = Conditions { reflections, ..Default::default() };
                let score =
                    Score::new(&final_outcomes(drive, &conditions, &likelihood.parameters(Readout::Window), seeds));
                let names = [likelihood.name().to_owned(), drive.name().to_owned(), format!("{reflections:.2}")];
                table.row(names.into_iter().chain(score.cells()));
                points.push((reflections, score.median));
            }
            // A straight drive leaves the mirror image in half of the cases, with reflections or without.
            if drive != Drive::Straight {
                curves.push(Series::new(format!("{}, {}", drive.name(), likelihood.name()), points));
            }
        }
    }
    results.table("localization_reflections", "300 readings, some of them reflections:", &table)?;
    results.plot(
        "localization_reflections",
        &Plot {
            title: format!("Error of a tag's place after 300 readings (median of {seeds} drives)"),
            x: Axis::new("share of reflections").range(0.0, 0.5),
            y: Axis::new("error, m").logarithmic(),
            shape: Shape::Lines(curves),
        },
    )
}
