//! How long a read-out takes.

use super::super::results::Results;
use super::super::statistics::{median, quantile};
use super::drive::Drive;
use super::trial::{Conditions, Likelihood, Recording};
use anyhow::Result;
use gridweave::table::Table;
use gridweave_stages::tags::tag_localizer::Readout;
use std::time::Instant;

/// So many drives of each shape, one at a time.
const SEEDS: u64 = 20;
const COUNTS: [usize; 3] = [30, 100, 300];

/// Times read-outs, one at a time.
pub(super) fn run(results: &mut Results) -> Result<()> {
    let mut table = Table::new(["likelihood", "reflections", "readings", "median, ms", "95 %, ms"]);
    for (likelihood, reflections) in [(Likelihood::Paper, 0.0), (Likelihood::Default, 0.0), (Likelihood::Default, 0.2)]
    {
        let parameters = likelihood.parameters(Readout::Window);
        let conditions = Conditions { reflections, ..Default::default() };
        let mut times: Vec<(usize, f64)> = Vec::new();
        for (drive, seed) in Drive::ALL.into_iter().flat_map(|drive| (0..SEEDS).map(move |seed| (drive, seed))) {
            Recording::new(drive, &conditions, seed).replay(&parameters, |count, localizer| {
                if COUNTS.contains(&count) {
                    let start = Instant::now();
                    localizer.read_out_all();
                    times.push((count, 1e3 * start.elapsed().as_secs_f64()));
                }
            });
        }
        for count in COUNTS {
            let of_count: Vec<f64> = times.iter().filter(|(at, _)| *at == count).map(|(_, time)| *time).collect();
            table.row([
                likelihood.name().to_owned(),
                format!("{reflections:.2}"),
                count.to_string(),
                format!("{:.2}", median(&of_count)),
                format!("{:.2}", quantile(&of_count, 0.95)),
            ]);
        }
    }
    results.table("localization_time", "One read-out, over all drives:", &table)
}
