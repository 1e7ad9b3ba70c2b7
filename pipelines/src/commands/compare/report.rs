//! The report of a comparison as text, Markdown, CSV and JSON.

use super::cases::Case;
use super::merge_case::MergeResult;
use super::rows::{Row, RowsBy, rows};
use crate::table::Table;
use crate::text_wrapping::wrap;
use serde_json::{Value, json};
use std::fmt::Write;

/// Results of a comparison.
pub(super) struct Report<'a> {
    pipelines: &'a [String],
    cases: &'a [Case],
    results: Vec<MergeResult>,
    rows: Vec<Row>,
}

impl<'a> Report<'a> {
    pub(super) fn new(pipelines: &'a [String], cases: &'a [Case], results: Vec<MergeResult>, by: RowsBy) -> Self {
        Self { rows: rows(pipelines, cases, &results, by), pipelines, cases, results }
    }

    /// Whether a run has failed.
    pub(super) fn has_failed(&self) -> bool {
        self.results.iter().any(|result| result.robots.is_err())
    }

    /// Formats the table and the failures in lines of at most `width` columns.
    pub(super) fn to_text(&self, width: Option<usize>) -> String {
        let failures = self.failures("");
        let failures = failures.lines().map(|line| wrap(line, 2, width) + "\n");
        self.table().fit(width) + &failures.collect::<String>()
    }

    /// Formats the table and the failures in Markdown.
    pub(super) fn to_markdown(&self) -> String {
        format!("{}{}", self.table().to_markdown(), self.failures("\n"))
    }

    /// Formats every number, in the units of the heads, as comma-separated values.
    pub(super) fn to_csv(&self) -> String {
        let heads = [
            "pipeline",
            "log",
            "runs",
            "failed",
            "robots",
            "success",
            "wrong",
            "refused",
            "median_m",
            "p90_m",
            "median_deg",
            "p90_deg",
            "time_s",
            "cpu_s",
            "memory_bytes",
        ];
        let mut table = Table::new(heads);
        for row in &self.rows {
            let counts =
                [row.runs, row.failed, row.robots, row.success, row.wrong, row.refused].map(|count| count.to_string());
            let numbers = [row.median_m, row.p90_m, row.median_deg, row.p90_deg, row.time_s, row.cpu_s];
            let numbers = numbers.map(|number| number.map(|number| number.to_string()).unwrap_or_default());
            let memory = row.memory_bytes.map(|bytes| bytes.to_string()).unwrap_or_default();
            let log = row.log.clone().unwrap_or_else(|| "all".into());
            table.row([row.pipeline.clone(), log].into_iter().chain(counts).chain(numbers).chain([memory]));
        }
        table.to_csv()
    }

    /// Formats the rows and every run as JSON.
    pub(super) fn to_json(&self) -> String {
        let run = |result: &MergeResult| {
            let (robots, failure) = match &result.robots {
                Ok(robots) => (json!(robots), Value::Null),
                Err(failure) => (json!([]), json!(failure)),
            };
            let usage = result.usage.as_ref();
            json!({
                "pipeline": self.pipelines[result.pipeline],
                "log": self.cases[result.case].name,
                "seed": result.seed,
                "robots": robots,
                "failure": failure,
                "time_s": usage.map(|usage| usage.time_s),
                "cpu_s": usage.map(|usage| usage.cpu_s),
                "memory_bytes": usage.map(|usage| usage.memory_bytes),
            })
        };
        let runs: Vec<Value> = self.results.iter().map(run).collect();
        format!("{:#}", json!({ "rows": self.rows, "runs": runs }))
    }

    fn table(&self) -> Table {
        let mut table = Table::new([
            "pipeline",
            "log",
            "success",
            "wrong",
            "refused",
            "failed",
            "error m",
            "90 %",
            "error deg",
            "90 %",
            "time s",
            "cpu s",
            "memory MB",
        ]);
        let number = |value: Option<f64>, digits: usize| {
            value.map_or_else(|| "-".to_owned(), |value| format!("{value:.digits$}"))
        };
        for row in &self.rows {
            table.row([
                row.pipeline.clone(),
                row.log.clone().unwrap_or_else(|| "all".into()),
                format!("{} of {}", row.success, row.robots),
                row.wrong.to_string(),
                row.refused.to_string(),
                row.failed.to_string(),
                number(row.median_m, 3),
                number(row.p90_m, 3),
                number(row.median_deg, 3),
                number(row.p90_deg, 3),
                number(row.time_s, 2),
                number(row.cpu_s, 2),
                number(row.memory_bytes.map(|bytes| bytes as f64 / 1e6), 0),
            ]);
        }
        table
    }

    /// A line for each run that has failed, each after the text `before`.
    fn failures(&self, before: &str) -> String {
        let mut text = String::new();
        for result in &self.results {
            let Err(failure) = &result.robots else { continue };
            let (pipeline, log) = (&self.pipelines[result.pipeline], &self.cases[result.case].name);
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{before}failed: {pipeline} on {log}, seed {}: {failure}", result.seed);
        }
        text
    }
}
