//! `gridweave cat`: prints messages of logs as lines of JSON.

use crate::job::ReadingOptions;
use crate::status::Status;
use crate::terminal::{eprint_line, print};
use anyhow::Result;
use clap::Args;
use gridweave_logs::dynamic::{JsonOptions, Schema};
use gridweave_logs::names::{self, Input, TopicNaming};
use gridweave_logs::reader::LogFile;
use gridweave_runtime::message::LogTime;
use gridweave_runtime::stage::RobotTopics;
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

/// Arguments of `gridweave cat`.
#[derive(Debug, Args)]
pub(crate) struct CatArgs {
    /// Logs (MCAP, SQLite of rosbag2, rosbag2 folders, ROS 1 bags), by log time. ROBOT=LOG puts the topics and frames
    /// of a log under the name of its robot; otherwise all names are those of the log.
    #[arg(required = true, value_name = "LOG")]
    pub(crate) inputs: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) reading: ReadingOptions,
    /// End after N messages.
    #[arg(long, value_name = "N")]
    pub(crate) count: Option<u64>,
    /// Print at most N elements of an array, and how many more there are.
    #[arg(long, value_name = "N")]
    pub(crate) max_array: Option<usize>,
}

/// Output is printed in parts of about this size, bytes.
const PART: usize = 1 << 16;

/// Prints messages.
pub(crate) fn cat(args: &CatArgs) -> Result<Status> {
    let inputs: Vec<Input> = args.inputs.iter().map(|input| Input::new(input)).collect();
    let rules = args.reading.names.rules(TopicNaming::AsLogged)?;
    let (mut reader, names) = names::open(&inputs, &rules, &RobotTopics::default())?;
    let files = reader.files().clone();
    let origin = files.iter().filter_map(LogFile::first_time).min().map_or(LogTime::MIN, LogTime);
    let after = |seconds: f64| origin.plus_seconds(seconds);
    let start = args.reading.start.map_or(LogTime::MIN, after);
    let end = args.reading.end.map_or(LogTime::MAX, after);
    let options = JsonOptions { longest_array: args.max_array };
    let mut schemas: BTreeMap<(usize, u16), Option<Schema>> = BTreeMap::new();
    let mut unreadable = BTreeSet::new();
    let (mut left, mut text, mut renamed) = (args.count.unwrap_or(u64::MAX), String::new(), Vec::new());
    while left > 0
        && let Some(message) = reader.next_message()
    {
        if message.log_time > end {
            break;
        }
        let (file, number) = (message.file, message.channel);
        let Some(channel) = names.channel(file, number).filter(|_| names.wants(file, number)) else { continue };
        if message.log_time < start {
            continue;
        }
        let schema = schemas.entry((file, number)).or_insert_with(|| Schema::of_channel(channel).ok());
        let data = names.named(&message, &mut renamed);
        let decoded = schema.as_ref().and_then(|schema| Some(schema.decode(data).ok()?.to_json(options)));
        if decoded.is_none() && unreadable.insert(channel.topic.clone()) {
            eprint_line(format_args!(
                "warning: messages on {} cannot be decoded by their definition and are printed as null",
                channel.topic
            ));
        }
        let line = json!({
            "log_time": message.log_time.0,
            "publish_time": message.publish_time,
            "topic": channel.topic,
            "type": channel.schema_name,
            "sequence": message.sequence,
            "bytes": data.len(),
            "message": decoded.unwrap_or(Value::Null),
        });
        text.push_str(&line.to_string());
        text.push('\n');
        left -= 1;
        if text.len() > PART && !print(std::mem::take(&mut text))? {
            return Ok(Status::Done);
        }
    }
    print(text)?;
    for (file, damage) in reader.take_damage() {
        let path = files.get(file).map(LogFile::path).unwrap_or(std::path::Path::new(""));
        eprint_line(format_args!("{}: {damage}", path.display()));
    }
    for file in files.iter() {
        file.damage().iter().for_each(|damage| eprint_line(format_args!("{}: {damage}", file.path().display())));
    }
    Ok(Status::Done)
}
