//! `gridweave tap`: prints the messages of a link.

use super::link_choice::named_link;
use super::running::{RunChoice, find_run};
use super::tap_remote::tap_remote;
use crate::interrupt::stop_on_interrupt;
use crate::status::{BadUse, Status};
use crate::terminal::{eprint_line, print};
use anyhow::Result;
use clap::Args;
use gridweave_logs::dynamic::{JsonOptions, Schema};
use gridweave_logs::schemas::schema_text;
use gridweave_runtime::engine::WatchedLink;
use gridweave_runtime::message::{Channel, Message, MessageFlags};
use gridweave_runtime::stage::{PortType, Registry, StageKind};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::sync::atomic::Ordering;
use std::thread;
use std::time::Duration;

/// Arguments of `gridweave tap`.
#[derive(Debug, Args)]
pub(crate) struct TapArgs {
    /// The link: STAGE.PORT, or STAGE if it has only one output; MACHINE:STAGE.PORT for a run on another machine, where MACHINE is
    /// the name of its bridge (with `gridweave-ros`).
    #[arg(value_name = "[MACHINE:]STAGE.PORT")]
    pub(crate) link: String,
    /// Print each message as a line of JSON.
    #[arg(long)]
    pub(crate) json: bool,
    /// End after N messages.
    #[arg(long, value_name = "N")]
    pub(crate) count: Option<u64>,
    /// The endpoint that the bridge of the other machine connects to, as tcp/HOST:PORT; by default that of a `bridge_source` here.
    #[arg(long, value_name = "ENDPOINT")]
    pub(crate) at: Vec<String>,
    /// Set a parameter of the connection to the other machine; `kinds bridge_tap` lists them.
    #[arg(long, value_name = "PARAMETER=VALUE")]
    pub(crate) set: Vec<String>,
    #[command(flatten)]
    pub(crate) run: RunChoice,
}

/// Interval at which messages are read.
pub(super) const LOOK_INTERVAL: Duration = Duration::from_millis(5);
/// Maximum number of elements of an array that are printed.
const LONGEST_ARRAY: usize = 16;

/// Prints messages until the run ends, the count is reached, or the user interrupts it.
pub(crate) fn tap(args: &TapArgs, registry: &Registry) -> Result<Status> {
    if let Some((machine, link)) = args.link.split_once(':') {
        return tap_remote(args, machine, link, registry);
    }
    if !(args.at.is_empty() && args.set.is_empty()) {
        let text = "--at and --set are for links of other machines: name the link as MACHINE:STAGE.PORT";
        return Err(BadUse(text.to_owned()).into());
    }
    let running = find_run(&args.run, registry)?;
    let link = named_link(&args.link, &running.pipeline)?;
    let stop = stop_on_interrupt("the tap ends");
    let mut watched = WatchedLink::open(&running.run, &running.pipeline, link.stage, link.port)?;
    let kind = &running.pipeline.stages[link.stage].kind;
    let mut printer = Printer::new(args, Types::new(kind, kind.outputs[link.port].port_type));
    loop {
        // Messages that were sent before the end of the run can be read after it.
        let is_last_look = stop.load(Ordering::Relaxed) || !running.run.is_running();
        watched.take(|_, message| printer.add(&message))?;
        if !printer.print()? || is_last_look {
            break;
        }
        thread::sleep(LOOK_INTERVAL);
    }
    if watched.missed() > 0 {
        eprint_line(format_args!("{} messages were missed: this program was too slow", watched.missed()));
    }
    Ok(Status::Done)
}

/// Printer of messages up to a count.
pub(super) struct Printer {
    types: Types,
    as_json: bool,
    left: u64,
    lines: String,
}

impl Printer {
    pub(super) fn new(args: &TapArgs, types: Types) -> Self {
        Self { types, as_json: args.json, left: args.count.unwrap_or(u64::MAX), lines: String::new() }
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
    fn new(kind: &StageKind, port: PortType) -> Self {
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
