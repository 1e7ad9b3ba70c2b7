//! The tables and plots of the experiment.

use super::one_alignment::AlignmentTime;
use super::record::{PlaceError, Record};
use super::{METHODS, Set};
use crate::plot::{Axis, Plot, Series, Shape};
use crate::results::Results;
use crate::statistics::{mean, median, quantile};
use anyhow::Result;
use gridweave::evaluate::RobotOutcome;
use gridweave::table::Table;

/// Table 4 of the paper: mean square error of five experiments, px^2.
const PAPER_ERROR: [f64; METHODS.len()] = [7178.27, 123.45, 2.6];
/// Table 4 of the paper: mean execution time of five experiments, ms, on a Core i7 of 2.8 GHz.
const PAPER_TIME: [f64; METHODS.len()] = [0.026, 10490.8, 18497.6];

/// Writes everything.
pub(super) fn write(sets: &[Set], results: &mut Results) -> Result<()> {
    let mut runs = Record::heads();
    for set in sets {
        set.records.iter().for_each(|record| runs.row(record.row(set.name)));
    }
    results.data("methods_runs", &runs)?;
    results.table("methods_table4", "Table 4 of the paper, and ours beside it.", &table_4(sets))?;
    results.table(
        "methods_errors",
        "Errors of the merged robots (median / mean / worst), and what became of all: right is within 0.5 m and 1 degree.",
        &errors(sets),
    )?;
    results.table(
        "methods_walls",
        "How far the walls of the two maps lie apart, m (root mean square; median of the robots), at the found place and \
         at the true one, and the share of the robots whose walls lie nearer at the found place.",
        &walls(sets),
    )?;
    results.table(
        "methods_alignment",
        "Time of one alignment, ms of one processor: from the last maps of a pair and their common tags to the transform \
         (medians; in brackets the slowest). The last column is how far it places the map from where the whole run does, at most.",
        &alignment_times(sets),
    )?;
    sets.iter().try_for_each(|set| results.plot(&format!("methods_{}", set.name), &distribution(set)))
}

/// The records of one method, by its place in [`METHODS`].
fn of_method(set: &Set, method: usize) -> impl Iterator<Item = &Record> + Clone {
    set.records.iter().filter(move |record| record.method == method + 1)
}

/// One number of the error of every merged robot.
fn error_values(set: &Set, method: usize, value: fn(&PlaceError) -> f64) -> Vec<f64> {
    of_method(set, method).filter_map(|record| record.error.as_ref().map(value)).collect()
}

/// One part of the time of every alignment.
fn alignment_values(set: &Set, method: usize, value: fn(&AlignmentTime) -> f64) -> Vec<f64> {
    of_method(set, method).filter_map(|record| record.alignment.as_ref().map(value)).collect()
}

fn table_4(sets: &[Set]) -> Table {
    let mut table = Table::new(["", "method 1", "method 2", "method 3"]);
    let mut row = |head: String, value: &dyn Fn(usize) -> String| {
        table.row(std::iter::once(head).chain((0..METHODS.len()).map(value)));
    };
    row("mean square error, px2: the paper, mean of five".into(), &|method| PAPER_ERROR[method].to_string());
    for set in sets {
        let values = |method| error_values(set, method, |error| error.square_cells);
        row(format!("- {}, median", set.title), &|method| significant(median(&values(method))));
        row(format!("- {}, mean", set.title), &|method| significant(mean(&values(method))));
    }
    row("time of one alignment, ms: the paper, mean of five".into(), &|method| PAPER_TIME[method].to_string());
    for set in sets {
        let values = |method| alignment_values(set, method, |time| time.total);
        row(format!("- {}, median", set.title), &|method| significant(median(&values(method))));
        row(format!("- {}, mean", set.title), &|method| significant(mean(&values(method))));
    }
    table
}

fn errors(sets: &[Set]) -> Table {
    let mut table = Table::new([
        "worlds",
        "method",
        "mse px2",
        "mse m2",
        "translation m",
        "rotation deg",
        "right",
        "wrong",
        "refused",
        "rightly refused",
    ]);
    for set in sets {
        for (method, pipeline) in METHODS.iter().enumerate() {
            let error = |value: fn(&PlaceError) -> f64| {
                let values = error_values(set, method, value);
                [median(&values), mean(&values), quantile(&values, 1.0)].map(significant).join(" / ")
            };
            let count = |outcome: RobotOutcome| {
                of_method(set, method).filter(|record| record.outcome == outcome).count().to_string()
            };
            table.row([
                set.title.clone(),
                format!("{} ({pipeline})", method + 1),
                error(|error| error.square_cells),
                error(|error| error.square_metres),
                error(|error| error.metres),
                error(|error| error.degrees),
                count(RobotOutcome::Right),
                count(RobotOutcome::Wrong),
                count(RobotOutcome::Refused),
                count(RobotOutcome::RightlyRefused),
            ]);
        }
    }
    table
}

fn walls(sets: &[Set]) -> Table {
    let mut table = Table::new(["worlds", "method", "found place", "true place", "nearer at the found place"]);
    for set in sets {
        for method in 0..METHODS.len() {
            let found = error_values(set, method, |error| error.walls);
            let truth = error_values(set, method, |error| error.true_walls);
            let nearer = found.iter().zip(&truth).filter(|(found, truth)| found < truth).count();
            table.row([
                set.title.clone(),
                (method + 1).to_string(),
                significant(median(&found)),
                significant(median(&truth)),
                format!("{nearer} of {}", found.len()),
            ]);
        }
    }
    table
}

fn alignment_times(sets: &[Set]) -> Table {
    let mut table =
        Table::new(["worlds", "method", "alignments", "lines", "classifier", "ICP", "all", "apart from the run, m"]);
    for set in sets {
        for method in 0..METHODS.len() {
            let time = |part: fn(&AlignmentTime) -> f64| {
                let values = alignment_values(set, method, part);
                format!("{} ({})", significant(median(&values)), significant(quantile(&values, 1.0)))
            };
            let apart: Vec<f64> = of_method(set, method).filter_map(|record| record.apart).collect();
            table.row([
                set.title.clone(),
                (method + 1).to_string(),
                alignment_values(set, method, |time| time.total).len().to_string(),
                time(|time| time.lines),
                time(|time| time.classifier),
                time(|time| time.icp),
                time(|time| time.total),
                significant(quantile(&apart, 1.0)),
            ]);
        }
    }
    table
}

/// For every error the share of the robots that lie better, by method. A curve that ends below 1 leaves out the robots
/// that were not merged.
fn distribution(set: &Set) -> Plot {
    let series = METHODS.iter().enumerate().map(|(method, pipeline)| {
        let all = of_method(set, method).filter(|record| record.outcome != RobotOutcome::RightlyRefused).count();
        let mut errors = error_values(set, method, |error| error.square_cells);
        errors.sort_by(f64::total_cmp);
        let points = errors.iter().zip(1..).map(|(error, rank)| (*error, f64::from(rank) / all as f64)).collect();
        Series::new(format!("method {}, {pipeline}", method + 1), points).with_mark(PAPER_ERROR[method])
    });
    Plot {
        title: format!("{} (dashed: the paper's means)", set.title),
        x: Axis::new("mean square error, squared cell widths").logarithmic(),
        y: Axis::new("share of the robots at or below it").range(0.0, 1.0),
        shape: Shape::Lines(series.collect()),
    }
}

/// A number to three digits, but not below 1e-8.
fn significant(value: f64) -> String {
    match value.abs() {
        size if !size.is_finite() => "-".to_owned(),
        size if size < 1e-8 => "0".to_owned(),
        size => format!("{value:.*}", (2.0 - size.log10().floor()).clamp(0.0, 8.0) as usize),
    }
}

#[cfg(test)]
mod tests {
    use super::significant;

    #[test]
    fn numbers_have_three_digits() {
        let text = [7178.27, 123.45, 2.6, 0.026, 0.000_012_34, 1e-12, -0.0, f64::NAN].map(significant);
        assert_eq!(text, ["7178", "123", "2.60", "0.0260", "0.0000123", "0", "0", "-"]);
    }
}
