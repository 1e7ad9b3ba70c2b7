//! What a run has found, as JSON and as text.

use crate::table::Table;
use anyhow::{Result, bail};
use gridweave_logs::summary::{Areas, Frame, Summary};
use gridweave_runtime::engine::{RunReport, StageReport};
use serde::ser::{SerializeMap, Serializer};
use std::collections::BTreeMap;
use std::fmt::Write;

/// What a run has found and done: the form that `--summary` writes.
#[derive(Debug, serde::Serialize)]
pub struct RunSummary {
    /// What was merged; none if the pipeline merges nothing.
    #[serde(flatten)]
    pub merge: Option<Summary>,
    /// What every stage has done, in the order of the pipeline.
    #[serde(serialize_with = "by_name")]
    pub stages: Vec<StageSummary>,
}

/// What a stage has done.
#[derive(Clone, Debug, serde::Serialize)]
pub struct StageSummary {
    /// Its name.
    #[serde(skip)]
    pub name: String,
    /// Messages it was given.
    pub messages_in: u64,
    /// Messages it has sent.
    pub messages_out: u64,
    /// How long it worked, milliseconds.
    pub busy_ms: f64,
    /// What was wrong with its input, and how often.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub warnings: BTreeMap<String, u64>,
    /// What it has counted of its work.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub counts: BTreeMap<String, u64>,
    /// How far the maps agree that it has fused.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub area: Option<Areas>,
    /// Messages that a live run has dropped on their way to it.
    #[serde(skip_serializing_if = "is_zero")]
    pub dropped: u64,
    /// How often a live run has started it again.
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
    /// The summary of a run that has merged what `merge` says, if it was to merge anything.
    pub fn new(mut merge: Option<Summary>, report: &RunReport) -> Self {
        let mut areas = merge.as_mut().map(|merge| std::mem::take(&mut merge.areas)).unwrap_or_default();
        let stages = report.stages.iter().map(|stage| StageSummary::new(stage, areas.remove(&stage.name))).collect();
        Self { merge, stages }
    }

    /// The JSON text.
    pub fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).unwrap_or_default()
    }

    /// Whether some robot could not be merged.
    pub fn has_unmerged(&self) -> bool {
        self.merge.as_ref().is_some_and(|merge| !merge.unmerged.is_empty())
    }

    /// An error if the run was to merge maps, and there were none.
    pub(crate) fn check_for_maps(&self) -> Result<()> {
        if self.merge.as_ref().is_some_and(|merge| merge.frames.is_empty() && merge.unmerged.is_empty()) {
            bail!(
                "the input holds no map that can be used: a nav_msgs/msg/OccupancyGrid is needed for each robot, by \
                 default on /ROBOT/map; `gridweave info LOG` shows what there is, and [robots] in the pipeline file \
                 says what the topics are called{}",
                self.warnings().map(|(_, what, _)| format!("\n  {what}")).collect::<String>()
            );
        }
        Ok(())
    }

    /// The summary for people.
    pub fn to_text(&self) -> String {
        let mut text = String::new();
        // Writing to a string cannot fail.
        let _ = self.write_text(&mut text);
        text
    }

    fn write_text(&self, out: &mut String) -> std::fmt::Result {
        if let Some(merge) = &self.merge {
            write_merge(out, merge)?;
        }
        for (stage, area) in self.stages.iter().filter_map(|stage| Some((&stage.name, stage.area?))) {
            write_areas(out, stage, &area)?;
        }
        for (stage, what, count) in self.warnings() {
            let times = if count == 1 { "once".to_owned() } else { format!("{count} times") };
            writeln!(out, "warning: {stage}: {what} ({times})")?;
        }
        // Only a live run has any of these.
        for StageSummary { name, dropped, restarts, .. } in &self.stages {
            if *dropped > 0 {
                writeln!(out, "dropped: {name}: {dropped} messages, for which it had no room or while it was away")?;
            }
            if *restarts > 0 {
                writeln!(out, "restarted: {name}: {restarts} times after a failure")?;
            }
        }
        let mut table = Table::new(["stage", "messages in", "out", "busy ms"]);
        for StageSummary { name, messages_in, messages_out, busy_ms, .. } in &self.stages {
            table.row([name.clone(), messages_in.to_string(), messages_out.to_string(), format!("{busy_ms:.1}")]);
        }
        write!(out, "\n{table}")
    }

    /// All warnings: stage, text, count.
    fn warnings(&self) -> impl Iterator<Item = (&str, &str, u64)> {
        self.stages
            .iter()
            .flat_map(|stage| stage.warnings.iter().map(|(what, count)| (stage.name.as_str(), what.as_str(), *count)))
    }
}

fn write_merge(out: &mut String, merge: &Summary) -> std::fmt::Result {
    if let Some(reference) = &merge.reference {
        let merged = merge.frames.len();
        match (merged, merged + merge.unmerged.len()) {
            (_, 1) => writeln!(out, "only {reference} has a map: there is nothing to merge it with")?,
            (1, all) => writeln!(out, "none of the other {} robots could be merged with {reference}", all - 1)?,
            (_, all) => writeln!(out, "merged {merged} of {all} robots; map frames in the frame of {reference}:")?,
        }
        write!(out, "{}", frames_table(&merge.frames))?;
    }
    for (robot, reason) in &merge.unmerged {
        writeln!(out, "not merged: {robot}: {reason}")?;
    }
    for group in &merge.groups {
        let (count, reference) = (group.frames.len(), &group.reference);
        writeln!(out, "{count} of these are tied to each other; map frames in the frame of {reference}:")?;
        write!(out, "{}", frames_table(&group.frames))?;
    }
    if merge.alignments.is_empty() {
        return Ok(());
    }
    let mut table = Table::new(["pair", "accepted", "score", "method", "reason"]);
    for pair in &merge.alignments {
        let accepted = if pair.accepted { "yes" } else { "no" };
        let names = format!("{} {}", pair.a, pair.b);
        table.row([names, accepted.into(), format!("{:.3}", pair.score), pair.method.clone(), pair.reason.clone()]);
    }
    write!(out, "\n{table}")
}

/// How much of a fused map is known, and how much of it is in conflict.
fn write_areas(out: &mut String, stage: &str, area: &Areas) -> std::fmt::Result {
    let Areas { known_to_one_m2, known_to_several_m2, in_conflict_m2, conflict_share } = *area;
    write!(out, "\n{stage}: {known_to_one_m2:.1} m2 known to one map, {known_to_several_m2:.1} m2 to several")?;
    if known_to_several_m2 > 0.0 {
        let percent = 100.0 * conflict_share;
        write!(out, ", which contradict each other on {in_conflict_m2:.1} m2 of it ({percent:.1} %)")?;
    }
    writeln!(out)
}

/// Poses of map frames with their standard deviations.
fn frames_table(frames: &BTreeMap<String, Frame>) -> Table {
    let mut table = Table::new(["robot", "x m", "y m", "yaw deg", "std m", "std deg"]);
    for (robot, Frame { x, y, yaw, covariance }) in frames {
        let variance = |place: usize| covariance[place].max(0.0);
        let [std_position, std_yaw] = [(variance(0) + variance(4)).sqrt(), variance(8).sqrt().to_degrees()];
        let numbers = [*x, *y, yaw.to_degrees(), std_position, std_yaw];
        table.row(std::iter::once(robot.clone()).chain(numbers.map(|number| format!("{number:.3}"))));
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn robots_tied_to_each_other_only_are_shown_in_their_own_frame() {
        let frame = |x: f64| json!({"x": x, "y": 0.0, "yaw": 0.5, "covariance": vec![0.01; 9]});
        let merge = json!({
            "reference": "robot1",
            "frames": {"robot1": frame(0.0)},
            "unmerged": {"robot2": "it is tied to robot3 only", "robot3": "it is tied to robot2 only"},
            "groups": [{"reference": "robot2", "frames": {"robot2": frame(0.0), "robot3": frame(4.25)}}],
        });
        let merge = serde_json::from_value(merge).unwrap();
        let text = RunSummary::new(Some(merge), &RunReport::default()).to_text();
        let lines: Vec<&str> = text.lines().collect();
        let start = lines.iter().position(|line| line.starts_with("2 of these")).unwrap();
        assert_eq!(lines[start], "2 of these are tied to each other; map frames in the frame of robot2:");
        assert!(lines[start - 1].starts_with("not merged: robot3"), "{text}");
        assert!(lines[start + 3].contains("robot3") && lines[start + 3].contains("4.250"), "{text}");
    }
}
