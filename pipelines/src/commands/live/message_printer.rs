//! The messages of a link, printed line by line.

use crate::terminal::print;
use anyhow::Result;
use clap::Args;
use gridweave_logs::dynamic::{JsonOptions, Schema};
use gridweave_logs::schemas::schema_text;
use gridweave_runtime::message::{Channel, Message, MessageFlags};
use gridweave_runtime::stage::{PortType, StageKind};
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// Maximum number of elements of an array that are printed.
const LONGEST_ARRAY: usize = 16;

/// How messages are printed, and how many.
#[derive(Debug, Args)]
pub(crate) struct PrintingOptions {
    /// Print each message as a line of JSON.
    #[arg(long)]
    pub(crate) json: bool,
    /// End after N messages.
    #[arg(long, value_name = "N")]
    pub(crate) count: Option<u64>,
}

/// Printer of messages up to a count.
pub(super) struct Printer {
    types: Types,
    as_json: bool,
    left: u64,
    lines: String,
}

impl Printer {
    pub(super) fn new(options: &PrintingOptions, types: Types) -> Self {
        Self { types, as_json: options.json, left: options.count.unwrap_or(u64::MAX), lines: String::new() }
    }

    /// Takes a message, or the announcement of a channel.
    pub(super) fn add(&mut self, message: &Message) {
        if let Some(line) = self.types.line(message, self.as_json).filter(|_| self.left > 0) {
            self.left -= 1;
            self.lines.push_str(&line);
            self.lines.push('\n');
        }
    }

    /// Prints the collected lines. Returns whether more are wanted.
    pub(super) fn print(&mut self) -> Result<bool> {
        Ok(print(std::mem::take(&mut self.lines))? && self.left > 0)
    }
}

/// The types of the messages of a link.
#[derive(Default)]
pub(super) struct Types {
    /// The type of the port, for messages without an announced channel.
    port: Option<(String, Option<Schema>)>,
    channels: BTreeMap<u32, (String, Option<Schema>)>,
}

impl Types {
    pub(super) fn new(kind: &StageKind, port: PortType) -> Self {
        let text = |name: &str| kind.definition(name).map(str::to_owned).or_else(|| schema_text(name));
        let schema = |name: &str| Schema::parse(name, &text(name)?).ok();
        let port = match port {
            PortType::Ros(name) => Some((name.to_owned(), schema(name))),
            PortType::Any => None,
        };
        Self { port, channels: BTreeMap::new() }
    }

    /// Formats a message; `None` for the announcement of a channel.
    fn line(&mut self, message: &Message, as_json: bool) -> Option<String> {
        let header = message.header();
        if header.flags.contains(MessageFlags::CHANNEL) {
            if let Ok(channel) = Channel::decode(message.bytes()) {
                let schema = Schema::of_channel(&channel).ok();
                self.channels.insert(header.channel, (channel.schema_name, schema));
            }
            return None;
        }
        let of_type = self.channels.get(&header.channel).or(self.port.as_ref());
        let name = of_type.map_or("of unknown type (announced earlier)", |(name, _)| name.as_str());
        let time = header.log_time;
        if !as_json {
            return Some(format!("{time}  {}  {name}  {} bytes", header.topic, header.length));
        }
        let options = JsonOptions { longest_array: Some(LONGEST_ARRAY) };
        let decoded =
            of_type.and_then(|(_, schema)| Some(schema.as_ref()?.decode(message.bytes()).ok()?.to_json(options)));
        let object = json!({
            "log_time": time.0,
            "topic": header.topic.as_str(),
            "robot": header.robot.as_str(),
            "type": of_type.map(|(name, _)| name.as_str()),
            "sequence": header.sequence,
            "bytes": header.length,
            "message": decoded.unwrap_or(Value::Null),
        });
        Some(object.to_string())
    }
}
