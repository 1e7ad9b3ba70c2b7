//! Rows of the table: counts, errors and times over several runs of a pipeline.

use super::cases::Case;
use super::merge_case::MergeResult;
use crate::evaluate::RobotOutcome;
use clap::ValueEnum;
use serde::Serialize;

/// Grouping of runs in rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum RowsBy {
    /// A row for each log.
    Log,
    /// A row for each input on the command line.
    Input,
    /// A row for each pipeline.
    Pipeline,
}

/// Statistics of several runs of one pipeline.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Row {
    pub(super) pipeline: String,
    /// The log or input; none for all.
    pub(super) log: Option<String>,
    pub(super) runs: usize,
    /// Runs that have failed.
    pub(super) failed: usize,
    /// Robots with a truth, without the reference, in complete runs.
    pub(super) robots: usize,
    /// Robots that are right or rightly refused.
    pub(super) success: usize,
    /// Robots that are merged with a wrong pose.
    pub(super) wrong: usize,
    /// Robots that could be merged and were refused.
    pub(super) refused: usize,
    pub(super) median_m: Option<f64>,
    pub(super) p90_m: Option<f64>,
    pub(super) median_deg: Option<f64>,
    pub(super) p90_deg: Option<f64>,
    /// Median over the runs.
    pub(super) time_s: Option<f64>,
    pub(super) cpu_s: Option<f64>,
    /// Maximum over the runs.
    pub(super) memory_bytes: Option<u64>,
}

/// Makes the rows of all pipelines; the last of each is for all its runs.
pub(super) fn rows(pipelines: &[String], cases: &[Case], results: &[MergeResult], by: RowsBy) -> Vec<Row> {
    let group = |case: &Case| match by {
        RowsBy::Log => Some(case.name.clone()),
        RowsBy::Input => Some(case.input.clone()),
        RowsBy::Pipeline => None,
    };
    let groups: Vec<Option<String>> = cases.iter().map(group).collect();
    let mut different = groups.clone();
    different.dedup();
    if different.len() > 1 {
        different.push(None);
    }
    let row = |pipeline: usize, wanted: &Option<String>| {
        let is_one =
            |result: &&MergeResult| result.pipeline == pipeline && (wanted.is_none() || groups[result.case] == *wanted);
        Row::of(&pipelines[pipeline], wanted, &results.iter().filter(is_one).collect::<Vec<_>>())
    };
    (0..pipelines.len()).flat_map(|pipeline| different.iter().map(move |group| row(pipeline, group))).collect()
}

impl Row {
    fn of(pipeline: &str, log: &Option<String>, results: &[&MergeResult]) -> Self {
        let robots: Vec<_> = results.iter().filter_map(|result| result.robots.as_ref().ok()).flatten().collect();
        let count = |outcomes: &[RobotOutcome]| robots.iter().filter(|robot| outcomes.contains(&robot.outcome)).count();
        let error_m = sorted(robots.iter().filter_map(|robot| robot.error_m));
        let error_deg = sorted(robots.iter().filter_map(|robot| robot.error_deg));
        let usages = || results.iter().filter_map(|result| result.usage.as_ref());
        let unknown = count(&[RobotOutcome::NoTruth]);
        Self {
            pipeline: pipeline.to_owned(),
            log: log.clone(),
            runs: results.len(),
            failed: results.iter().filter(|result| result.robots.is_err()).count(),
            robots: robots.len() - unknown,
            success: count(&[RobotOutcome::Right, RobotOutcome::RightlyRefused]),
            wrong: count(&[RobotOutcome::Wrong]),
            refused: count(&[RobotOutcome::Refused]),
            median_m: at(&error_m, 0.5),
            p90_m: at(&error_m, 0.9),
            median_deg: at(&error_deg, 0.5),
            p90_deg: at(&error_deg, 0.9),
            time_s: at(&sorted(usages().map(|usage| usage.time_s)), 0.5),
            cpu_s: at(&sorted(usages().map(|usage| usage.cpu_s)), 0.5),
            memory_bytes: usages().map(|usage| usage.memory_bytes).max(),
        }
    }
}

fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.filter(|value| value.is_finite()).collect();
    values.sort_by(f64::total_cmp);
    values
}

/// Quantile of sorted values: `share` of them are no greater.
fn at(sorted: &[f64], share: f64) -> Option<f64> {
    sorted.get((share * sorted.len().checked_sub(1)? as f64).round() as usize).copied()
}

#[cfg(test)]
mod tests {
    use super::super::score::{CaseTruth, Scored};
    use super::*;
    use std::path::PathBuf;

    fn case(name: &str, input: &str) -> Case {
        let truth = CaseTruth::Frames(PathBuf::new());
        let files = Vec::new();
        Case { name: name.into(), input: input.into(), log: PathBuf::new(), reference: None, truth, files }
    }

    fn result(pipeline: usize, case: usize, robots: &[(RobotOutcome, f64)]) -> MergeResult {
        let scored = |&(outcome, error): &(RobotOutcome, f64)| {
            let error = error.is_finite().then_some(error);
            Scored { robot: "r".into(), outcome, error_m: error, error_deg: error }
        };
        MergeResult { pipeline, case, seed: 1, robots: Ok(robots.iter().map(scored).collect()), usage: None }
    }

    #[test]
    fn outcomes_are_counted_and_errors_are_those_of_all_that_was_merged() {
        use RobotOutcome::{NoTruth, Refused, Right, RightlyRefused, Wrong};
        let (cases, none) = ([case("a", "in"), case("b", "in")], f64::NAN);
        let mut results = vec![
            result(0, 0, &[(Right, 0.1), (Wrong, 3.0), (NoTruth, none)]),
            result(0, 1, &[(Right, 0.2), (Refused, none), (RightlyRefused, none)]),
            result(1, 0, &[(Right, 0.3)]),
            result(1, 1, &[]),
        ];
        results[3].robots = Err("it was ended by signal 9".into());
        let pipelines = ["p".to_owned(), "q".to_owned()];
        let all = rows(&pipelines, &cases, &results, RowsBy::Log);
        let named: Vec<(&str, Option<&str>)> =
            all.iter().map(|row| (row.pipeline.as_str(), row.log.as_deref())).collect();
        assert_eq!(
            named,
            [("p", Some("a")), ("p", Some("b")), ("p", None), ("q", Some("a")), ("q", Some("b")), ("q", None)]
        );
        let total = &all[2];
        assert_eq!((total.robots, total.success, total.wrong, total.refused), (5, 3, 1, 1));
        assert_eq!((total.median_m, total.p90_m), (Some(0.2), Some(3.0)));
        assert_eq!((all[5].runs, all[5].failed, all[5].robots), (2, 1, 1));
        assert_eq!(all[4].median_m, None);
        assert_eq!(rows(&pipelines, &cases, &results, RowsBy::Input).len(), 2, "one input is all");
        assert_eq!(rows(&pipelines, &cases, &results, RowsBy::Pipeline)[0].log, None);
    }
}
