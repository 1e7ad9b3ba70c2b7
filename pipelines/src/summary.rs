//! The summary of a run as JSON and as text.

use crate::merge_text::{write_explanation, write_merge};
use crate::table::Table;
use crate::text_wrapping::wrap;
use anyhow::{Result, bail};
use gridweave_logs::summary::{Areas, Summary};
use gridweave_runtime::engine::{RunReport, StageReport};
use gridweave_runtime::pipeline::suggest;
use serde::ser::{SerializeMap, Serializer};
use std::collections::BTreeMap;
use std::fmt::Write;

/// The summary of a run, as `--summary` writes it.
#[derive(Debug, serde::Serialize)]
pub struct RunSummary {
    /// The version of Gridweave.
    pub version: &'static str,
    /// The result of the merge; none if the pipeline merges nothing.
    #[serde(flatten)]
    pub merge: Option<Summary>,
    /// Statistics of every stage, in the order of the pipeline.
    #[serde(serialize_with = "by_name")]
    pub stages: Vec<StageSummary>,
}

/// Statistics of a stage.
#[derive(Clone, Debug, serde::Serialize)]
pub struct StageSummary {
    /// Its name.
    #[serde(skip)]
    pub name: String,
    /// Number of messages received.
    pub messages_in: u64,
    /// Number of messages sent.
    pub messages_out: u64,
    /// Time of its work, milliseconds.
    pub busy_ms: f64,
    /// Warnings about its input, with their counts.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub warnings: BTreeMap<String, u64>,
    /// Counts of its work by name.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub counts: BTreeMap<String, u64>,
    /// Areas of agreement and conflict of the maps that it has fused.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub area: Option<Areas>,
    /// Number of messages to it that a live run has dropped.
    #[serde(skip_serializing_if = "is_zero")]
    pub dropped: u64,
    /// Number of restarts in a live run.
    #[serde(skip_serializing_if = "is_zero")]
    pub restarts: u64,
}

fn is_zero(number: &u64) -> bool {
    *number == 0
}

fn by_name<S: Serializer>(stages: &[StageSummary], serializer: S) -> Result<S::Ok, S::Error> {
    let mut map = serializer.serialize_map(Some(stages.len()))?;
    stages.iter().try_for_each(|stage| map.serialize_entry(&stage.name, stage))?;
    map.end()
}

impl StageSummary {
    fn new(report: &StageReport, area: Option<Areas>) -> Self {
        Self {
            name: report.name.clone(),
            messages_in: report.messages_in,
            messages_out: report.messages_out,
            busy_ms: (report.busy.as_secs_f64() * 1e4).round() / 10.0,
            warnings: report.warnings.clone(),
            counts: report.counts.clone(),
            area,
            dropped: report.dropped,
            restarts: report.restarts,
        }
    }
}

impl RunSummary {
    /// Makes the summary of a run from the result of the merge, if there is one, and the report of the engine.
    pub fn new(mut merge: Option<Summary>, report: &RunReport) -> Self {
        let mut areas = merge.as_mut().map(|merge| std::mem::take(&mut merge.areas)).unwrap_or_default();
        let stages = report.stages.iter().map(|stage| StageSummary::new(stage, areas.remove(&stage.name))).collect();
        Self { version: env!("CARGO_PKG_VERSION"), merge, stages }
    }

    /// Formats the summary as JSON.
    pub fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).unwrap_or_default()
    }

    /// Whether a robot could not be merged.
    pub fn has_unmerged(&self) -> bool {
        self.merge.as_ref().is_some_and(|merge| !merge.unmerged.is_empty())
    }

    /// Checks that a run that merges maps had any.
    pub(crate) fn check_for_maps(&self) -> Result<()> {
        if self.merge.as_ref().is_some_and(|merge| merge.frames.is_empty() && merge.unmerged.is_empty()) {
            // Findings come first: the advice is for logs without any.
            bail!(
                "the input has no usable map{}\n\
                 a nav_msgs/msg/OccupancyGrid is needed for each robot, by default on /ROBOT/map; `gridweave info LOG` lists the \
                 topics, and [robots] in the pipeline file names those that are read",
                self.warning_texts()
            );
        }
        Ok(())
    }

    /// Formats the summary in lines of at most `width` columns, with the full reasons for some robots.
    pub fn to_text(&self, explained: &[String], width: Option<usize>) -> String {
        let mut text = String::new();
        // Writing to a string cannot fail.
        let _ = self.write_text(&mut text, width);
        for (robot, merge) in explained.iter().flat_map(|robot| self.merge.as_ref().map(|merge| (robot, merge))) {
            let _ = write_explanation(&mut text, merge, robot, width);
        }
        text
    }

    /// Checks that there are robots of these names.
    pub(crate) fn check_robots(&self, names: &[String]) -> Result<()> {
        let Some(merge) = &self.merge else { return Ok(()) };
        let known: Vec<&str> = merge.frames.keys().chain(merge.unmerged.keys()).map(String::as_str).collect();
        match names.iter().find(|name| !known.contains(&name.as_str())) {
            Some(name) => bail!(
                "there is no robot `{name}` to explain: {}",
                suggest(name, &known, "the robots").unwrap_or_default()
            ),
            None => Ok(()),
        }
    }

    fn write_text(&self, out: &mut String, width: Option<usize>) -> std::fmt::Result {
        if let Some(merge) = &self.merge {
            write_merge(out, merge, width)?;
        }
        for (stage, area) in self.stages.iter().filter_map(|stage| Some((&stage.name, stage.area?))) {
            write_areas(out, stage, &area, width)?;
        }
        self.warning_lines().try_for_each(|line| writeln!(out, "{}", wrap(&line, 2, width)))?;
        // Only live runs have dropped messages and restarts.
        for StageSummary { name, dropped, restarts, .. } in &self.stages {
            if *dropped > 0 {
                writeln!(
                    out,
                    "dropped: {name}: {dropped} messages, because its queue was full or it was being restarted"
                )?;
            }
            if *restarts > 0 {
                writeln!(out, "restarted: {name}: {restarts} times after a failure")?;
            }
        }
        let mut table = Table::new(["stage", "messages in", "out", "busy ms"]);
        for StageSummary { name, messages_in, messages_out, busy_ms, .. } in &self.stages {
            table.row([name.clone(), messages_in.to_string(), messages_out.to_string(), format!("{busy_ms:.1}")]);
        }
        write!(out, "\n{}", table.fit(width))
    }

    /// Formats the warnings, a line each.
    pub(crate) fn warning_lines(&self) -> impl Iterator<Item = String> {
        self.distinct_warnings().into_iter().map(|(what, stages, count)| {
            let times = if count == 1 { "once".to_owned() } else { format!("{count} times") };
            format!("warning: {}: {what} ({times})", stages.join(", "))
        })
    }

    /// Formats the texts of the warnings, an indented line each, for behind another line.
    pub(crate) fn warning_texts(&self) -> String {
        self.distinct_warnings().iter().map(|(what, ..)| format!("\n  {what}")).collect()
    }

    /// Each text of a warning once, in the order in which they appear, with the stages that warn so and their greatest
    /// count: several stages take the same map, and warn of it alike.
    fn distinct_warnings(&self) -> Vec<(&str, Vec<&str>, u64)> {
        let mut distinct: Vec<(&str, Vec<&str>, u64)> = Vec::new();
        // A log may have tens of thousands of topics with a text of their own.
        let mut places: BTreeMap<&str, usize> = BTreeMap::new();
        let warnings = self.stages.iter().flat_map(|stage| stage.warnings.iter().map(move |warning| (stage, warning)));
        for (StageSummary { name: stage, .. }, (what, count)) in warnings {
            let place = *places.entry(what).or_insert(distinct.len());
            match distinct.get_mut(place) {
                Some((_, stages, most)) => {
                    stages.push(stage);
                    *most = *count.max(most);
                }
                None => distinct.push((what, vec![stage], *count)),
            }
        }
        distinct
    }
}

/// Writes the known area of a fused map and the area in conflict.
fn write_areas(out: &mut String, stage: &str, area: &Areas, width: Option<usize>) -> std::fmt::Result {
    let Areas { known_to_one_m2, known_to_several_m2, in_conflict_m2, conflict_share } = *area;
    let mut line = format!("{stage}: {known_to_one_m2:.1} m2 known to one map, {known_to_several_m2:.1} m2 to several");
    if known_to_several_m2 > 0.0 {
        let percent = 100.0 * conflict_share;
        write!(line, ", which contradict each other on {in_conflict_m2:.1} m2 of it ({percent:.1} %)")?;
    }
    writeln!(out, "\n{}", wrap(&line, 2, width))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn a_warning_of_several_stages_is_one_line() {
        let stage = |name: &str, warnings: &[(&str, u64)]| StageReport {
            name: name.into(),
            warnings: warnings.iter().map(|(what, count)| ((*what).to_owned(), *count)).collect(),
            busy: Duration::ZERO,
            ..StageReport::default()
        };
        let stages =
            vec![stage("maps", &[("it is empty", 1)]), stage("fuser", &[("it is empty", 3), ("it is old", 1)])];
        let summary = RunSummary::new(None, &RunReport { stages });
        let lines: Vec<String> = summary.warning_lines().collect();
        assert_eq!(lines, ["warning: maps, fuser: it is empty (3 times)", "warning: fuser: it is old (once)"]);
        assert_eq!(summary.warning_texts(), "\n  it is empty\n  it is old");
    }
}
