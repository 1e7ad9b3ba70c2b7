//! Tables and curves of pairs.

use super::kinds::Kind;
use super::trial::PairTrial;
use crate::plot::{Axis, Plot, Series, Shape};
use crate::results::Results;
use crate::statistics::{median, quantile, wilson_interval};
use anyhow::Result;
use gridweave::evaluate::RobotOutcome;
use gridweave::table::Table;

/// Least overlap of the worlds for which the goal of 95 % is set.
const ENOUGH: f64 = 0.3;

/// Counts of some trials.
struct Counts<'a>(Vec<&'a PairTrial>);

impl Counts<'_> {
    fn of(&self, outcome: RobotOutcome) -> usize {
        self.0.iter().filter(|trial| trial.outcome == outcome).count()
    }

    /// Pairs, right, wrong, refused, the share that is right with its interval, errors.
    const HEADS: [&'static str; 9] = [
        "pairs",
        "right",
        "wrong",
        "refused",
        "right, 95 % interval",
        "error m, median",
        "95 %",
        "error deg, median",
        "95 %",
    ];

    fn cells(&self) -> impl Iterator<Item = String> {
        let right = self.of(RobotOutcome::Right);
        let refused = self.of(RobotOutcome::Refused) + self.of(RobotOutcome::RightlyRefused);
        let (low, high) = wilson_interval(right, self.0.len());
        let is_related = self.0.iter().any(|trial| trial.outcome != RobotOutcome::RightlyRefused);
        let interval =
            if is_related { format!("{:.0} % to {:.0} %", 100.0 * low, 100.0 * high) } else { "-".to_owned() };
        let errors = |error: fn(&PairTrial) -> Option<f64>| -> Vec<f64> {
            self.0.iter().filter_map(|trial| error(trial)).collect()
        };
        let (metres, degrees) = (errors(|trial| trial.error_m), errors(|trial| trial.error_deg));
        let number = |value: f64| if value.is_finite() { format!("{value:.3}") } else { "-".to_owned() };
        let counts = [self.0.len(), right, self.of(RobotOutcome::Wrong), refused].map(|count| count.to_string());
        let errors = [median(&metres), quantile(&metres, 0.95), median(&degrees), quantile(&degrees, 0.95)].map(number);
        counts.into_iter().chain([interval]).chain(errors)
    }
}

/// A row for each set, and for the random pairs that overlap enough.
pub(super) fn totals(sets: &[(&str, &Vec<PairTrial>)]) -> Table {
    let mut table = Table::new(["worlds"].into_iter().chain(Counts::HEADS));
    for (name, trials) in sets.iter().filter(|(_, trials)| !trials.is_empty()) {
        table.row([(*name).to_owned()].into_iter().chain(Counts(trials.iter().collect()).cells()));
        let enough: Vec<&PairTrial> =
            trials.iter().filter(|trial| trial.overlap.is_some_and(|overlap| overlap >= ENOUGH)).collect();
        if *name == "random" {
            let name = format!("{name}, {:.0} % overlap or more", 100.0 * ENOUGH);
            table.row([name].into_iter().chain(Counts(enough).cells()));
        }
    }
    table
}

/// Trials of worlds of many kinds, by kind.
pub(super) fn by_kind(trials: &[PairTrial]) -> Vec<(&'static str, Vec<PairTrial>)> {
    let of_kind = |kind: &Kind| {
        let is_of_kind = |trial: &&PairTrial| trial.kind == Some(*kind);
        (kind.name(), trials.iter().filter(is_of_kind).cloned().collect())
    };
    Kind::ALL.iter().map(of_kind).collect()
}

/// The random pairs by their overlap and by the drift of the poses.
pub(super) fn report_random(trials: &[PairTrial], results: &mut Results) -> Result<()> {
    let overlaps: Vec<f64> = (0..=10).map(|step| f64::from(step) / 10.0).collect();
    let drifts: Vec<f64> = (0..=8).map(|step| f64::from(step) * 0.0005).collect();
    curve(
        trials,
        &overlaps,
        |trial| trial.overlap,
        "align_overlap",
        "share of the smaller map that both know",
        results,
    )?;
    let enough: Vec<PairTrial> =
        trials.iter().filter(|trial| trial.overlap.is_some_and(|overlap| overlap >= ENOUGH)).cloned().collect();
    curve(
        &enough,
        &drifts,
        |trial| trial.drift,
        "align_drift",
        "drift after one metre, rad and m; 30 % overlap or more",
        results,
    )
}

/// A table and a plot of trials in bins of some property.
fn curve(
    trials: &[PairTrial],
    borders: &[f64],
    property: fn(&PairTrial) -> Option<f64>,
    name: &str,
    axis: &str,
    results: &mut Results,
) -> Result<()> {
    let mut table = Table::new([axis].into_iter().chain(Counts::HEADS));
    let outcomes = [("right", RobotOutcome::Right), ("wrong", RobotOutcome::Wrong), ("refused", RobotOutcome::Refused)];
    let mut curves = outcomes.map(|(name, outcome)| (name, outcome, Vec::new(), Vec::new()));
    for (number, bin) in borders.windows(2).enumerate() {
        let is_last = number + 2 == borders.len();
        let holds = |value: f64| (bin[0]..bin[1]).contains(&value) || (is_last && value >= bin[1]);
        let counts = Counts(trials.iter().filter(|trial| property(trial).is_some_and(holds)).collect());
        if counts.0.is_empty() {
            continue;
        }
        table.row([format!("{} to {}", bin[0], bin[1])].into_iter().chain(counts.cells()));
        let middle = (bin[0] + bin[1]) / 2.0;
        for (_, outcome, points, band) in &mut curves {
            let (low, high) = wilson_interval(counts.of(*outcome), counts.0.len());
            points.push((middle, counts.of(*outcome) as f64 / counts.0.len() as f64));
            band.push((middle, low, high));
        }
    }
    results.table(name, &format!("Random pairs by {axis}"), &table)?;
    let plot = Plot {
        title: "Merging two maps by the maps alone".to_owned(),
        x: Axis::new(axis),
        y: Axis::new("share of the pairs, with the 95 % interval").range(0.0, 1.0),
        shape: Shape::Lines(
            curves.into_iter().map(|(name, _, points, band)| Series::new(name, points).with_band(band)).collect(),
        ),
    };
    results.plot(name, &plot)
}
