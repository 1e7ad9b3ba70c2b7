//! Routes from the topics of `input.mcap` to the inputs of the stage.

use super::case_file::Case;
use anyhow::{Result, bail};
use gridweave_logs::reader::LogFile;
use gridweave_logs::schemas::full_type_name;
use gridweave_runtime::message::{Channel, FixedText};
use gridweave_runtime::pipeline::quoted_list;
use gridweave_runtime::stage::{InputPort, PortType, match_robot};
use std::collections::BTreeMap;

/// A wire from the log to an input of the stage.
#[derive(Clone, Debug)]
pub(super) struct InputStream {
    /// The input port, as an index among the kind's.
    pub(super) port: usize,
    /// Whether the port takes any type, so that channels are to be announced.
    pub(super) announces: bool,
    /// The channels of the log that it carries, by number.
    pub(super) channels: BTreeMap<u16, RoutedChannel>,
}

/// A channel of the log that is sent to an input.
#[derive(Clone, Debug)]
pub(super) struct RoutedChannel {
    /// The robot that its messages are about.
    pub(super) robot: FixedText<64>,
    pub(super) topic: FixedText<128>,
    pub(super) channel: Channel,
}

/// Makes the wires of a case, in the order of the stage's inputs.
pub(super) fn input_streams(case: &Case, log: &LogFile) -> Result<Vec<InputStream>> {
    let channels: Vec<(u16, Channel)> = log.channels().collect();
    let mut streams = Vec::new();
    for (index, patterns) in &case.inputs {
        let Some(port) = case.stage.kind.inputs.get(*index) else { continue };
        let announces = port.port_type == PortType::Any;
        let found = patterns.iter().map(|pattern| matches(pattern, port, &channels));
        let found = found.collect::<Result<Vec<_>>>()?;
        match port.many {
            // As in a pipeline, where each output is connected to such a port by a separate wire.
            true => streams.extend(found.into_iter().map(|channels| InputStream { port: *index, announces, channels })),
            false => {
                let channels = found.into_iter().flatten().collect();
                streams.push(InputStream { port: *index, announces, channels });
            }
        }
    }
    Ok(streams)
}

/// Finds the channels whose topics match a pattern.
fn matches(pattern: &str, port: &InputPort, channels: &[(u16, Channel)]) -> Result<BTreeMap<u16, RoutedChannel>> {
    let mut matching = BTreeMap::new();
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
        matching.insert(*number, RoutedChannel { robot, topic, channel: channel.clone() });
    }
    if matching.is_empty() {
        let topics: Vec<&str> = channels.iter().map(|(_, channel)| channel.topic.as_str()).collect();
        let there = match topics.is_empty() {
            true => "it has no topics".to_owned(),
            false => format!("it has {}", quoted_list(&topics)),
        };
        bail!("no topic of input.mcap matches `{pattern}` of the input `{}`; {there}", port.name);
    }
    Ok(matching)
}

/// The robot of a topic that matches the pattern: an empty name if the pattern has no `{robot}`.
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
