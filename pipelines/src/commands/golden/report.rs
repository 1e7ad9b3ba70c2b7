//! The report on all cases as text and JSON.

use super::check_case::{CaseOutcome, CaseStatus};
use super::compare::{Comparison, GridDifference, MessageDifference};
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Results of all cases.
#[derive(Debug)]
pub(super) struct Report {
    /// Cases by kind and then by name.
    pub(super) cases: Vec<CaseOutcome>,
    /// Stage kinds that should have a case and have none.
    pub(super) kinds_without_a_case: Vec<String>,
}

impl Report {
    /// Whether a case has failed or is missing.
    pub(super) fn has_failed(&self) -> bool {
        self.count(|status| *status == CaseStatus::Failed) > 0 || !self.kinds_without_a_case.is_empty()
    }

    fn count(&self, of: impl Fn(&CaseStatus) -> bool) -> usize {
        self.cases.iter().filter(|case| of(&case.status)).count()
    }

    /// Formats a line for every case, and below it what is wrong.
    pub(super) fn to_text(&self, folder: &Path) -> String {
        let mut text = String::new();
        // Writing to a string cannot fail.
        let _ = self.write_text(folder, &mut text);
        text
    }

    fn write_text(&self, folder: &Path, text: &mut String) -> std::fmt::Result {
        for case in &self.cases {
            write_case(case, text)?;
        }
        for kind in &self.kinds_without_a_case {
            writeln!(text, "FAILED   {kind}: this stage kind has no case in {}", folder.display())?;
        }
        let (passed, failed) =
            (self.count(|status| *status == CaseStatus::Passed), self.count(|s| *s == CaseStatus::Failed));
        let blessed = self.cases.len() - passed - failed;
        let cases = if self.cases.len() == 1 { "case" } else { "cases" };
        write!(text, "{} {cases}: {passed} as expected", self.cases.len())?;
        if blessed > 0 {
            write!(text, ", {blessed} blessed")?;
        }
        if failed > 0 {
            write!(text, ", {failed} failed")?;
        }
        match self.kinds_without_a_case.len() {
            0 => writeln!(text),
            1 => writeln!(text, "; 1 stage kind without a case"),
            count => writeln!(text, "; {count} stage kinds without a case"),
        }
    }

    /// Formats the report as JSON.
    pub(super) fn to_json(&self) -> Value {
        json!({
            "cases": self.cases.iter().map(case_json).collect::<Vec<_>>(),
            "kinds_without_a_case": self.kinds_without_a_case,
            "failed": self.has_failed(),
        })
    }
}

fn write_case(case: &CaseOutcome, text: &mut String) -> std::fmt::Result {
    match &case.status {
        CaseStatus::Passed => return writeln!(text, "ok       {}", case.name),
        CaseStatus::Failed => writeln!(text, "FAILED   {}", case.name)?,
        CaseStatus::Blessed(reason) => writeln!(text, "blessed  {}: {reason}", case.name)?,
    }
    for problem in &case.problems {
        writeln!(text, "    {}", problem.trim_end().replace('\n', "\n    "))?;
    }
    if let Some(comparison) = &case.comparison {
        if case.status == CaseStatus::Failed && !comparison.is_empty() {
            writeln!(text, "    {}", comparison.summary())?;
        }
        write_differences(comparison, text)?;
        for (at, grid) in comparison.grids.iter().enumerate() {
            writeln!(text, "    {}{}", grid_text(grid), picture_text(case, at))?;
        }
    }
    if let Some(written) = &case.written {
        writeln!(text, "    the messages of the stage: {}", written.got.display())?;
    }
    Ok(())
}

/// Writes the differences; each message is named once.
fn write_differences(comparison: &Comparison, text: &mut String) -> std::fmt::Result {
    let mut last = None;
    for difference in &comparison.differences {
        let MessageDifference { topic, log_time, field, expected, got } = difference;
        let message = (topic, log_time);
        if let (Some(topic), Some(log_time)) = message
            && last != Some(message)
        {
            writeln!(text, "    {topic} at {log_time}")?;
        }
        last = Some(message);
        let indent = if topic.is_some() { "      " } else { "    " };
        let field = field.as_ref().map(|field| format!("{field}: ")).unwrap_or_default();
        writeln!(text, "{indent}{field}expected {expected}, got {got}")?;
    }
    match comparison.count - comparison.differences.len().min(comparison.count) {
        0 => Ok(()),
        more => writeln!(text, "    and {more} more (--limit COUNT shows more of them)"),
    }
}

fn grid_text(grid: &GridDifference) -> String {
    let GridDifference { topic, log_time, cells, expected, .. } = grid;
    format!("{topic} at {log_time}: {cells} of {} cells differ", expected.len())
}

fn picture_text(case: &CaseOutcome, at: usize) -> String {
    match picture(case, at) {
        None => String::new(),
        Some(Ok(path)) => format!(", shown in {}", path.display()),
        Some(Err(problem)) => format!("; they are not drawn: {problem}"),
    }
}

fn picture(case: &CaseOutcome, at: usize) -> Option<&Result<PathBuf, String>> {
    case.written.as_ref()?.pictures.get(at)
}

fn case_json(case: &CaseOutcome) -> Value {
    let (status, reason) = match &case.status {
        CaseStatus::Passed => ("passed", None),
        CaseStatus::Failed => ("failed", None),
        CaseStatus::Blessed(reason) => ("blessed", Some(reason)),
    };
    let comparison = case.comparison.as_ref();
    let differences = comparison.map(|found| found.differences.iter().map(difference_json).collect::<Vec<_>>());
    let grids = comparison.map(|found| {
        let grid = |(at, grid): (usize, &GridDifference)| {
            let picture = picture(case, at).and_then(|picture| picture.as_ref().ok());
            json!({
                "topic": grid.topic,
                "log_time": grid.log_time.0,
                "cells": grid.cells,
                "of": grid.expected.len(),
                "picture": picture.map(|path| path.display().to_string()),
            })
        };
        found.grids.iter().enumerate().map(grid).collect::<Vec<_>>()
    });
    json!({
        "case": case.name,
        "status": status,
        "blessed": reason,
        "problems": case.problems,
        "differences": differences.unwrap_or_default(),
        "count": comparison.map_or(0, |found| found.count),
        "differing": comparison.map_or(0, |found| found.differing),
        "missing": comparison.map_or(0, |found| found.missing),
        "surplus": comparison.map_or(0, |found| found.surplus),
        "grids": grids.unwrap_or_default(),
        "got": case.written.as_ref().map(|written| written.got.display().to_string()),
    })
}

fn difference_json(difference: &MessageDifference) -> Value {
    let MessageDifference { topic, log_time, field, expected, got } = difference;
    json!({
        "topic": topic,
        "log_time": log_time.map(|time| time.0),
        "field": field,
        "expected": expected,
        "got": got,
    })
}
