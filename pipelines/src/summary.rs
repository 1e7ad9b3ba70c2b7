//! What a run has found, as JSON and as text.

use crate::table::Table;
use anyhow::{Result, bail};
use gridweave_runtime::engine::RunReport;
use serde_json::{Map, Value, json};
use std::fmt::Write;

/// The key under which an entry of `stages` has what a fuser has found.
const AREA: &str = "area";

/// What a run has found: the form that `--summary` writes.
pub struct Summary {
    value: Map<String, Value>,
}

impl Summary {
    /// The summary of a run: what its frame solver reports, and what every stage has done.
    pub fn new(report: &RunReport) -> Self {
        let mut value = Map::new();
        for (_, result) in report.results("frame_solver") {
            if let Value::Object(result) = result {
                value.extend(result.clone());
            }
        }
        let mut stages = Map::new();
        for stage in &report.stages {
            let mut entry = json!({
                "messages_in": stage.messages_in,
                "messages_out": stage.messages_out,
                "busy_ms": (stage.busy.as_secs_f64() * 1e4).round() / 10.0,
            });
            if !stage.warnings.is_empty() {
                entry["warnings"] = json!(stage.warnings);
            }
            if let Some(area) = stage.result.as_ref().filter(|_| stage.kind == "grid_fuser") {
                entry[AREA] = area.clone();
            }
            for (name, count) in [("dropped", stage.dropped), ("restarts", stage.restarts)] {
                if count > 0 {
                    entry[name] = json!(count);
                }
            }
            stages.insert(stage.name.clone(), entry);
        }
        value.insert("stages".into(), stages.into());
        Self { value }
    }

    /// The JSON text.
    pub fn to_json(&self) -> String {
        serde_json::to_string_pretty(&self.value).unwrap_or_default()
    }

    /// The poses of the merged robots' map frames: the robot's name, and x, y (metres) and yaw (radians) in the
    /// reference robot's map frame.
    pub fn frames(&self) -> impl Iterator<Item = (&str, [f64; 3])> {
        self.object("frames")
            .map(|(robot, frame)| (robot, ["x", "y", "yaw"].map(|field| frame[field].as_f64().unwrap_or_default())))
    }

    /// Whether some robot could not be merged.
    pub fn has_unmerged(&self) -> bool {
        self.object("unmerged").next().is_some()
    }

    /// An error if the run was to merge maps, and there were none.
    pub fn check_for_maps(&self) -> Result<()> {
        let was_to_merge = self.value.contains_key("frames");
        if was_to_merge && self.object("frames").next().is_none() && !self.has_unmerged() {
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
        if let Some(reference) = self.value.get("reference").and_then(Value::as_str) {
            self.write_frames(out, reference)?;
        }
        for (robot, reason) in self.object("unmerged") {
            writeln!(out, "not merged: {robot}: {}", reason.as_str().unwrap_or_default())?;
        }
        for group in self.value.get("groups").and_then(Value::as_array).into_iter().flatten() {
            write_group(out, group)?;
        }
        self.write_alignments(out)?;
        self.write_areas(out)?;
        for (stage, what, count) in self.warnings() {
            let times = if count == 1 { "once".to_owned() } else { format!("{count} times") };
            writeln!(out, "warning: {stage}: {what} ({times})")?;
        }
        // Only a live run has any of these.
        for (stage, entry) in self.object("stages") {
            if let Some(count) = entry.get("dropped") {
                writeln!(out, "dropped: {stage}: {count} messages, for which it had no room or while it was away")?;
            }
            if let Some(count) = entry.get("restarts") {
                writeln!(out, "restarted: {stage}: {count} times after a failure")?;
            }
        }
        let mut table = Table::new(["stage", "messages in", "out", "busy ms"]);
        for (name, stage) in self.object("stages") {
            let busy = stage["busy_ms"].as_f64().unwrap_or_default();
            let row = [name.to_owned(), stage["messages_in"].to_string(), stage["messages_out"].to_string()];
            table.row(row.into_iter().chain([format!("{busy:.1}")]));
        }
        write!(out, "\n{table}")
    }

    fn write_frames(&self, out: &mut String, reference: &str) -> std::fmt::Result {
        let merged = self.frames().count();
        let all = merged + self.object("unmerged").count();
        match (merged, all) {
            (_, 1) => writeln!(out, "only {reference} has a map: there is nothing to merge it with")?,
            (1, _) => writeln!(out, "none of the other {} robots could be merged with {reference}", all - 1)?,
            _ => writeln!(out, "merged {merged} of {all} robots; map frames in the frame of {reference}:")?,
        }
        write!(out, "{}", frames_table(self.object("frames")))
    }

    fn write_alignments(&self, out: &mut String) -> std::fmt::Result {
        let Some(alignments) = self.value.get("alignments").and_then(Value::as_array) else { return Ok(()) };
        if alignments.is_empty() {
            return Ok(());
        }
        let mut table = Table::new(["pair", "accepted", "score", "method", "reason"]);
        for alignment in alignments {
            let text = |field: &str| alignment[field].as_str().unwrap_or_default().to_owned();
            let accepted = if alignment["accepted"] == true { "yes" } else { "no" };
            let score = format!("{:.3}", alignment["score"].as_f64().unwrap_or_default());
            table.row([format!("{} {}", text("a"), text("b")), accepted.into(), score, text("method"), text("reason")]);
        }
        write!(out, "\n{table}")
    }

    /// How much of each fused map is known, and how much of it is in conflict.
    fn write_areas(&self, out: &mut String) -> std::fmt::Result {
        for (stage, area) in self.object("stages").filter_map(|(name, stage)| Some((name, stage.get(AREA)?))) {
            let number = |field: &str| area[field].as_f64().unwrap_or_default();
            let [one, several] = ["known_to_one_m2", "known_to_several_m2"].map(number);
            write!(out, "\n{stage}: {one:.1} m2 known to one map, {several:.1} m2 to several")?;
            if several > 0.0 {
                let (conflict, percent) = (number("in_conflict_m2"), 100.0 * number("conflict_share"));
                write!(out, ", which contradict each other on {conflict:.1} m2 of it ({percent:.1} %)")?;
            }
            writeln!(out)?;
        }
        Ok(())
    }

    /// All warnings: stage, text, count.
    fn warnings(&self) -> impl Iterator<Item = (&str, &str, u64)> {
        self.object("stages").flat_map(|(stage, entry)| {
            let warnings = entry.get("warnings").and_then(Value::as_object).into_iter().flatten();
            warnings.map(move |(what, count)| (stage, what.as_str(), count.as_u64().unwrap_or_default()))
        })
    }

    fn object(&self, name: &str) -> impl Iterator<Item = (&str, &Value)> {
        let object = self.value.get(name).and_then(Value::as_object);
        object.into_iter().flatten().map(|(name, value)| (name.as_str(), value))
    }
}

/// Robots that are merged with each other, but not with the reference.
fn write_group(out: &mut String, group: &Value) -> std::fmt::Result {
    let reference = group["reference"].as_str().unwrap_or_default();
    let frames = group["frames"].as_object().into_iter().flatten();
    let frames = frames.map(|(robot, frame)| (robot.as_str(), frame));
    let count = frames.clone().count();
    writeln!(out, "{count} of these are tied to each other; map frames in the frame of {reference}:")?;
    write!(out, "{}", frames_table(frames))
}

/// Poses of map frames, as the frame solver reports them, with their standard deviations.
fn frames_table<'a>(frames: impl Iterator<Item = (&'a str, &'a Value)>) -> Table {
    let mut table = Table::new(["robot", "x m", "y m", "yaw deg", "std m", "std deg"]);
    for (robot, frame) in frames {
        let [x, y, yaw] = ["x", "y", "yaw"].map(|field| frame[field].as_f64().unwrap_or_default());
        let variance = |place: usize| frame["covariance"][place].as_f64().unwrap_or_default().max(0.0);
        let [std_position, std_yaw] = [(variance(0) + variance(4)).sqrt(), variance(8).sqrt().to_degrees()];
        let numbers = [x, y, yaw.to_degrees(), std_position, std_yaw];
        table.row(std::iter::once(robot.to_owned()).chain(numbers.map(|number| format!("{number:.3}"))));
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn robots_tied_to_each_other_only_are_shown_in_their_own_frame() {
        let frame = |x: f64| json!({"x": x, "y": 0.0, "yaw": 0.5, "covariance": vec![0.01; 9]});
        let Value::Object(value) = json!({
            "reference": "robot1",
            "frames": {"robot1": frame(0.0)},
            "unmerged": {"robot2": "it is tied to robot3 only", "robot3": "it is tied to robot2 only"},
            "groups": [{"reference": "robot2", "frames": {"robot2": frame(0.0), "robot3": frame(4.25)}}],
            "stages": {},
        }) else {
            panic!("an object was written");
        };
        let text = Summary { value }.to_text();
        let lines: Vec<&str> = text.lines().collect();
        let start = lines.iter().position(|line| line.starts_with("2 of these")).unwrap();
        assert_eq!(lines[start], "2 of these are tied to each other; map frames in the frame of robot2:");
        assert!(lines[start - 1].starts_with("not merged: robot3"), "{text}");
        assert!(lines[start + 3].contains("robot3") && lines[start + 3].contains("4.250"), "{text}");
    }
}
