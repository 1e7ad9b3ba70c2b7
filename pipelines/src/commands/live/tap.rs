//! `gridweave tap`: prints the messages of a link as they pass.

use super::link_choice::named_links;
use super::running::{RunChoice, find_run};
use crate::interrupt::stop_on_interrupt;
use crate::status::{BadUse, Status};
use crate::terminal::{print, say};
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

/// What `gridweave tap` is told.
#[derive(Debug, Args)]
pub(crate) struct TapArgs {
    /// The link: STAGE.PORT, or STAGE if it has one output only.
    #[arg(value_name = "STAGE.PORT")]
    pub(crate) link: String,
    /// Print each message as a line of JSON.
    #[arg(long)]
    pub(crate) json: bool,
    /// End after so many messages.
    #[arg(long, value_name = "N")]
    pub(crate) count: Option<u64>,
    #[command(flatten)]
    pub(crate) run: RunChoice,
}

/// So often it is looked for messages.
pub(super) const LOOK_INTERVAL: Duration = Duration::from_millis(5);
/// Of a longer array only so many elements are printed.
const LONGEST_ARRAY: usize = 16;

/// Prints what passes.
pub(crate) fn tap(args: &TapArgs, registry: &Registry) -> Result<Status> {
    let running = find_run(&args.run, registry)?;
    let links = named_links(&args.link, &running.pipeline)?;
    let [link] = links.as_slice() else {
        let names: Vec<String> = links.iter().map(|link| link.name(&running.pipeline)).collect();
        return Err(BadUse(format!("`{}` has several outputs: choose one of {}", args.link, names.join(", "))).into());
    };
    let stop = stop_on_interrupt("the tap ends");
    let mut watched = WatchedLink::open(&running.run, &running.pipeline, link.stage, link.port)?;
    let kind = &running.pipeline.stages[link.stage].kind;
    let mut types = Types::new(kind, kind.outputs[link.port].port_type);
    let mut left = args.count.unwrap_or(u64::MAX);
    loop {
        // What has passed before the run ended is still there after it.
        let is_last_look = stop.load(Ordering::Relaxed) || !running.run.is_running();
        let mut lines = String::new();
        watched.take(|_, message| {
            if let Some(line) = types.line(&message, args.json).filter(|_| left > 0) {
                left -= 1;
                lines.push_str(&line);
                lines.push('\n');
            }
        })?;
        if !print(lines)? || left == 0 || is_last_look {
            break;
        }
        thread::sleep(LOOK_INTERVAL);
    }
    if watched.missed() > 0 {
        say(format_args!("{} messages were missed, as this program was too slow for them", watched.missed()));
    }
    Ok(Status::Done)
}

/// The types of the messages of a link.
struct Types {
    /// That of the port, for messages that come on no channel of their own.
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

    /// What is printed of a message; nothing of the announcement of a channel.
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
        let name = of_type.map_or("of a type that was announced before", |(name, _)| name.as_str());
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
