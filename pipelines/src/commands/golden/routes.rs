//! Which topics of `input.mcap` feed which inputs.

use super::case_file::Case;
use anyhow::{Result, bail};
use gridweave_logs::reader::LogFile;
use gridweave_logs::schemas::full_type_name;
use gridweave_runtime::message::{Channel, FixedText};
use gridweave_runtime::pipeline::quoted_list;
use gridweave_runtime::stage::{InputPort, PortType, match_robot};
use std::collections::BTreeMap;

/// One wire from the log to an input of the stage.
#[derive(Clone, Debug)]
pub(super) struct Feed {
    /// The input port, as an index among the kind's.
    pub(super) port: usize,
    /// Whether the port takes any type, so that channels are to be announced.
    pub(super) announces: bool,
    /// The channels of the log that it carries, by number.
    pub(super) channels: BTreeMap<u16, FedChannel>,
}

/// A channel of the log that feeds an input.
#[derive(Clone, Debug)]
pub(super) struct FedChannel {
    /// The robot that its messages are about.
    pub(super) robot: FixedText<64>,
    pub(super) topic: FixedText<128>,
    pub(super) channel: Channel,
}

/// The wires of a case, in the order of the stage's inputs.
pub(super) fn feeds(case: &Case, log: &LogFile) -> Result<Vec<Feed>> {
    let channels: Vec<(u16, Channel)> = log.channels().collect();
    let mut feeds = Vec::new();
    for (index, patterns) in &case.inputs {
        let Some(port) = case.stage.kind.inputs.get(*index) else { continue };
        let announces = port.port_type == PortType::Any;
        let found = patterns.iter().map(|pattern| matches(pattern, port, &channels));
        let found = found.collect::<Result<Vec<_>>>()?;
        match port.many {
            // As in a pipeline, where each output that is wired to such a port has a wire of its own.
            true => feeds.extend(found.into_iter().map(|channels| Feed { port: *index, announces, channels })),
            false => feeds.push(Feed { port: *index, announces, channels: found.into_iter().flatten().collect() }),
        }
    }
    Ok(feeds)
}

/// The channels whose topics fit a pattern.
fn matches(pattern: &str, port: &InputPort, channels: &[(u16, Channel)]) -> Result<BTreeMap<u16, FedChannel>> {
    let mut fitting = BTreeMap::new();
    for (number, channel) in channels {
        let Some(robot) = robot_of(pattern, &channel.topic) else { continue };
        let found = full_type_name(&channel.schema_name);
        match port.port_type {
            PortType::Ros(expected) if found != expected => bail!(
                "input.mcap has {} on `{}`, and the input `{}` takes {expected}{}",
                if found.is_empty() { "messages without a type" } else { &found },
                channel.topic,
                port.name,
                of_type(expected, channels)
            ),
            PortType::Ros(_) if channel.message_encoding != "cdr" => {
                bail!("the messages on `{}` are encoded as `{}`, not as `cdr`", channel.topic, channel.message_encoding)
            }
            _ => {}
        }
        let (robot, topic) = (FixedText::new(robot)?, FixedText::new(&channel.topic)?);
        fitting.insert(*number, FedChannel { robot, topic, channel: channel.clone() });
    }
    if fitting.is_empty() {
        let topics: Vec<&str> = channels.iter().map(|(_, channel)| channel.topic.as_str()).collect();
        let there = match topics.is_empty() {
            true => "it has no topics".to_owned(),
            false => format!("it has {}", quoted_list(&topics)),
        };
        bail!("no topic of input.mcap fits `{pattern}`, the input `{}`; {there}", port.name);
    }
    Ok(fitting)
}

/// The robot that a topic is about if it fits the pattern: an empty name where the pattern has none.
fn robot_of<'a>(pattern: &str, topic: &'a str) -> Option<&'a str> {
    match pattern.contains("{robot}") {
        true => match_robot(pattern, topic),
        false => (pattern == topic).then_some(""),
    }
}

fn of_type(expected: &str, channels: &[(u16, Channel)]) -> String {
    let of_type = channels.iter().filter(|(_, channel)| full_type_name(&channel.schema_name) == expected);
    let topics: Vec<&str> = of_type.map(|(_, channel)| channel.topic.as_str()).collect();
    match topics.is_empty() {
        true => ", which is on none of its topics".to_owned(),
        false => format!(", which is on {}", quoted_list(&topics)),
    }
}
