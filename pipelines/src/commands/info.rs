//! `gridweave info`: shows the contents of logs or of map files.

use super::map_file_info;
use crate::job::{Inputs, NamingOptions};
use crate::shipped;
use crate::status::Status;
use crate::table::Table;
use crate::terminal::{print, print_line, width};
use crate::text_wrapping::wrap;
use anyhow::Result;
use clap::Args;
use gridweave_logs::info::{self, FileInfo, LogInfo, TopicInfo};
use gridweave_logs::names::{Input, TopicNaming};
use gridweave_logs::sink::InputFile;
use gridweave_runtime::pipeline::Overrides;
use gridweave_runtime::stage::Registry;
use gridweave_runtime::stage::RobotTopics;
use std::fmt::Write;
use std::path::PathBuf;

/// Arguments of `gridweave info`.
#[derive(Debug, Args)]
pub(crate) struct InfoArgs {
    /// Logs (MCAP, SQLite of rosbag2, rosbag2 folders, ROS 1 bags), each as LOG or ROBOT=LOG, or map files (map_server
    /// YAML).
    #[arg(required = true, value_name = "INPUT")]
    pub(crate) inputs: Vec<PathBuf>,
    /// Find the robots by the topic patterns of this pipeline.
    #[arg(long)]
    pub(crate) pipeline: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) names: NamingOptions,
    /// Read large logs in full, of which by default only the index and a few messages are read.
    #[arg(long)]
    pub(crate) all: bool,
    /// Print JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

/// Shows the contents of logs or of map files.
pub(crate) fn info(args: &InfoArgs, registry: &Registry) -> Result<Status> {
    if Inputs::of_maps_or_logs(&args.inputs, "info")? == Inputs::MapFiles {
        let maps = map_file_info::inspect(&args.inputs)?;
        match args.json {
            true => print_line(serde_json::to_string_pretty(&maps)?),
            false => print(map_file_info::to_text(&maps, width())),
        }?;
        return Ok(Status::Done);
    }
    let robots = match &args.pipeline {
        None => RobotTopics::default(),
        Some(path) => shipped::load(path, &Overrides::default(), registry)?.robots,
    };
    let inputs: Vec<Input> = args.inputs.iter().map(|input| Input::new(input)).collect();
    let inspect = if args.all { info::inspect } else { info::glance };
    let found = inspect(&inputs, &args.names.rules(TopicNaming::ByRobot)?, &robots)?;
    match args.json {
        true => print_line(serde_json::to_string_pretty(&found)?),
        false => print(to_text(&found, width())),
    }?;
    Ok(Status::Done)
}

fn to_text(found: &LogInfo, width: Option<usize>) -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    let _ = write_text(found, &mut text, width);
    text
}

fn write_text(found: &LogInfo, text: &mut String, width: Option<usize>) -> std::fmt::Result {
    for file in &found.files {
        let packed = match file.chunks {
            0 => file.container.clone(),
            chunks => format!("{}, {chunks} chunks ({})", file.container, file.compression.join(", ")),
        };
        let robot = file.robot.as_ref().map(|robot| format!(", of {robot}")).unwrap_or_default();
        writeln!(text, "{}  {}, {packed}{robot}", file.path.display(), size(file.size))?;
        write_beside(file, text)?;
    }
    if let Some(note) = &found.note {
        writeln!(text, "{}", wrap(note, 2, width))?;
    }
    let start = found.start.map(|start| format!(", from {start:.3} s")).unwrap_or_default();
    writeln!(text, "{} messages over {:.1} s{start}", found.messages, found.duration)?;
    if found.is_sampled {
        let note = "from the index and a few messages: sizes are estimates, and frames, clocks and tags may be missing \
                    (--all reads everything)";
        writeln!(text, "{}", wrap(note, 2, width))?;
    }
    if !found.topics.is_empty() {
        write!(text, "\n{}", topic_table(&found.topics, found.start.unwrap_or(0.0)).fit(width))?;
    }
    if !found.robots.is_empty() {
        let mut table = Table::new(["robot", "maps", "poses", "readings", "tags", "poses from"]);
        for (name, robot) in &found.robots {
            let maps = match robot.map_updates {
                0 => robot.maps.to_string(),
                updates => format!("{} + {updates} updates", robot.maps),
            };
            let counts = [robot.poses, robot.readings, robot.tags.len() as u64].map(|count| count.to_string());
            let poses_from = robot.poses_from.clone().unwrap_or_default();
            table.row([name.clone(), maps].into_iter().chain(counts).chain([poses_from]));
        }
        write!(text, "\n{}", table.fit(width))?;
    }
    if !found.problems.is_empty() {
        writeln!(text, "\nproblems")?;
    }
    let mut problems = found.problems.iter().map(|problem| wrap(&format!("  - {problem}"), 4, width));
    problems.try_for_each(|problem| writeln!(text, "{problem}"))
}

/// Writes what a file contains beside messages: the run that wrote it, metadata records and attachments.
fn write_beside(file: &FileInfo, text: &mut String) -> std::fmt::Result {
    if let Some(run) = &file.run {
        let pipeline: toml::Table = run.pipeline.parse().unwrap_or_default();
        let of_pipeline = |key: &str| pipeline.get("pipeline").and_then(|section| section.get(key));
        let name = of_pipeline("name").and_then(|name| name.as_str()).unwrap_or("without a name");
        let seed = of_pipeline("seed").map_or_else(String::new, |seed| format!(", seed {seed}"));
        write!(text, "  written by gridweave {}, pipeline {name}{seed} (--json shows its parameters)", run.version)?;
        writeln!(text, "{}", if run.inputs.is_empty() { "" } else { ", from" })?;
        for InputFile { name, bytes, sha256 } in &run.inputs {
            writeln!(text, "    {name}  {}, sha256 {sha256}", size(*bytes))?;
        }
    }
    let metadata: Vec<&str> = file.metadata.iter().map(String::as_str).collect();
    if !metadata.is_empty() {
        writeln!(text, "  metadata records: {}", metadata.join(", "))?;
    }
    match file.attachments {
        0 => Ok(()),
        count => writeln!(text, "  attachments: {count}"),
    }
}

/// Makes the table of topics, with times in seconds from `origin`: for each topic its rate, the longest gap between two
/// messages, the quality of service that the log records, and the frames in its messages.
fn topic_table(topics: &[TopicInfo], origin: f64) -> Table {
    let mut table =
        Table::new(["topic", "type", "messages", "size", "first s", "last s", "Hz", "gap s", "QoS", "frame"]);
    for topic in topics {
        table.row([
            topic_text(topic),
            if topic.type_name.is_empty() { "(no schema)".into() } else { topic.type_name.clone() },
            topic.messages.to_string(),
            size(topic.bytes),
            format!("{:.1}", topic.first - origin),
            format!("{:.1}", topic.last - origin),
            topic.rate.map(rate_text).unwrap_or_default(),
            if topic.messages > 1 { format!("{:.1}", topic.largest_gap) } else { String::new() },
            topic.qos.clone(),
            topic.frames.iter().map(String::as_str).collect::<Vec<_>>().join(" "),
        ]);
    }
    table
}

/// Formats a rate, with more digits for rates such as one map a minute.
fn rate_text(rate: f64) -> String {
    if rate < 1.0 { format!("{rate:.3}") } else { format!("{rate:.1}") }
}

/// Formats a topic, with its names in the logs if these differ.
fn topic_text(topic: &TopicInfo) -> String {
    let others: Vec<&str> = topic.logged.iter().map(String::as_str).filter(|logged| *logged != topic.topic).collect();
    match others.is_empty() {
        true => topic.topic.clone(),
        false => format!("{} (logged as {})", topic.topic, others.join(", ")),
    }
}

/// Formats a number of bytes with a suitable unit.
fn size(bytes: u64) -> String {
    match bytes {
        0..1_000 => format!("{bytes} B"),
        1_000..1_000_000 => format!("{:.1} kB", bytes as f64 / 1e3),
        1_000_000..1_000_000_000 => format!("{:.1} MB", bytes as f64 / 1e6),
        _ => format!("{:.1} GB", bytes as f64 / 1e9),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    #[test]
    fn the_text_lists_topics_robots_and_problems() {
        let topic = TopicInfo {
            topic: "/robot1/map".into(),
            messages: 3,
            bytes: 1_234_567,
            first: 10.0,
            last: 12.5,
            rate: Some(0.8),
            largest_gap: 2.0,
            qos: "latched".into(),
            frames: ["robot1/map".into()].into(),
            ..Default::default()
        };
        let poses_from = Some("/robot1/pose".to_owned());
        let robot = info::RobotInfo { maps: 3, poses: 12, poses_from, ..Default::default() };
        let found = LogInfo {
            messages: 3,
            start: Some(10.0),
            duration: 2.5,
            topics: vec![topic],
            robots: BTreeMap::from([("robot1".into(), robot)]),
            problems: vec!["there is no tag reading of robot1".into()],
            ..Default::default()
        };
        let expected = "\
3 messages over 2.5 s, from 10.000 s

  topic        type         messages    size  first s  last s     Hz  gap s  QoS      frame
  /robot1/map  (no schema)         3  1.2 MB      0.0     2.5  0.800    2.0  latched  robot1/map

  robot   maps  poses  readings  tags  poses from
  robot1     3     12         0     0  /robot1/pose

problems
  - there is no tag reading of robot1
";
        assert_eq!(to_text(&found, None), expected);
        assert_eq!(to_text(&LogInfo::default(), None), "0 messages over 0.0 s\n");
    }
}
