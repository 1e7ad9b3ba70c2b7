//! `gridweave bridge`: forwards links of a run to a run on another machine.

use super::MESSAGE_INTERVAL;
use super::bridge_settings::{bridge_kind, check, connect_parameters, settings};
use super::link_choice::{Link, chosen_links};
use super::running::{RunChoice, find_run};
use crate::interrupt::stop_on_interrupt;
use crate::status::Status;
use crate::terminal::{eprint_line, print_line};
use anyhow::{Result, bail};
use clap::Args;
use gridweave_runtime::engine::{WatchedLink, watch_links, watch_statistics};
use gridweave_runtime::message::{Channel, Message, MessageFlags};
use gridweave_runtime::pipeline::Pipeline;
use gridweave_runtime::stage::{Context, InputWire, Node, Registry, StageKind, bridge_counts};
use std::collections::BTreeMap;
use std::sync::atomic::Ordering;
use std::thread;

/// Arguments of `gridweave bridge`.
#[derive(Debug, Args)]
pub(crate) struct BridgeArgs {
    /// The links: STAGE.PORT, or STAGE for all its outputs.
    #[arg(required = true, value_name = "LINK")]
    pub(crate) links: Vec<String>,
    /// The endpoint of the other machine, as tcp/HOST:PORT; its run has a `bridge_source`.
    #[arg(long, value_name = "ENDPOINT")]
    pub(crate) to: Vec<String>,
    /// Set a parameter of the bridge; `kinds bridge_sink` lists them.
    #[arg(long, value_name = "PARAMETER=VALUE")]
    pub(crate) set: Vec<String>,
    #[command(flatten)]
    pub(crate) run: RunChoice,
}

/// The kind of stage that sends to the other machine.
const SINK: &str = "bridge_sink";

/// Forwards links until the run ends or the user interrupts it.
pub(crate) fn bridge(args: &BridgeArgs, registry: &Registry) -> Result<Status> {
    let kind = bridge_kind(SINK, registry)?;
    let mut parameters = connect_parameters(&args.to);
    parameters.extend(settings(&args.set)?);
    check(kind, &parameters)?;
    let running = find_run(&args.run, registry)?;
    let links = chosen_links(&args.links, &running.pipeline)?;
    let context = Context {
        stage: "bridge".to_owned(),
        inputs: wires(&links, &running.pipeline, kind),
        statistics: Some(watch_statistics(&running.run, &running.pipeline)?),
        links: Some(watch_links(&running.run, &running.pipeline)),
        ..Default::default()
    };
    let stop = stop_on_interrupt("messages in the queues are sent");
    let mut sink = kind.make(parameters, &context, Vec::new())?;
    let open = |link: &Link| WatchedLink::open(&running.run, &running.pipeline, link.stage, link.port);
    let mut watched = links.iter().map(open).collect::<Result<Vec<_>, _>>()?;
    eprint_line(format_args!(
        "carries {} links of {}; ctrl-c ends the bridge, not the run",
        links.len(),
        running.name()
    ));
    let is_over = || stop.load(Ordering::Relaxed) || !running.run.is_running();
    let messages = carry(&mut watched, &mut sink, is_over)?;
    sink.finish()?;
    for (warning, count) in sink.warnings() {
        eprint_line(format_args!("warning: {warning} ({count} times)"));
    }
    let lost = lost(&sink.counts());
    let (carried, bytes) = (messages.saturating_sub(lost), count(&sink.counts(), bridge_counts::BYTES_SENT));
    print_line(format_args!("carried {carried} of {messages} messages of {} links, in {bytes} bytes", links.len()))?;
    let missed: u64 = watched.iter().map(WatchedLink::missed).sum();
    if missed > 0 {
        bail!("{missed} messages were missed: the bridge was too slow");
    }
    Ok(if lost > 0 { Status::Failed } else { Status::Done })
}

/// The inputs of the bridge, one for each link.
fn wires(links: &[Link], pipeline: &Pipeline, kind: &StageKind) -> Vec<InputWire> {
    let port = kind.inputs.first().map_or("", |input| input.name);
    let wire = |link: &Link| {
        let stage = &pipeline.stages[link.stage];
        let output = &stage.kind.outputs[link.port];
        let ros_type = output.port_type.name().to_owned();
        let definition = stage.kind.definition(&ros_type).unwrap_or_default().to_owned();
        InputWire { port, from: stage.name.clone(), output: output.name, ros_type, definition, ..Default::default() }
    };
    links.iter().map(wire).collect()
}

/// Sends the messages of the links, until `is_over`. Returns the number of messages.
fn carry(watched: &mut [WatchedLink], sink: &mut Node, is_over: impl Fn() -> bool) -> Result<u64> {
    let mut messages = 0;
    loop {
        // Messages that were sent before the end of the run can be read after it.
        let is_last_look = is_over();
        for (wire, link) in watched.iter_mut().enumerate() {
            let mut passed: Vec<Message> = Vec::new();
            link.take(|_, message| passed.push(message))?;
            for message in passed {
                let flags = message.header().flags;
                if flags.contains(MessageFlags::CHANNEL) {
                    sink.announce(wire, message.header().channel, &Channel::decode(message.bytes())?)?;
                } else if flags.contains(MessageFlags::DATA) {
                    sink.set_log_time(message.header().log_time);
                    sink.receive(0, &message.on_wire(wire))?;
                    messages += 1;
                }
            }
        }
        if is_last_look {
            return Ok(messages);
        }
        thread::sleep(MESSAGE_INTERVAL);
    }
}

fn count(counts: &BTreeMap<String, u64>, what: &str) -> u64 {
    counts.get(what).copied().unwrap_or_default()
}

/// The number of messages that did not arrive. Those taken by the other end do not show that: a receiver that was restarted
/// takes the retained messages once more.
fn lost(counts: &BTreeMap<String, u64>) -> u64 {
    [bridge_counts::UNACKNOWLEDGED, bridge_counts::DROPPED, bridge_counts::SUPERSEDED]
        .map(|what| count(counts, what))
        .iter()
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_of_a_program_without_a_bridge_names_the_one_that_has_it() {
        let args = BridgeArgs { links: Vec::new(), to: Vec::new(), set: Vec::new(), run: RunChoice::default() };
        let error = bridge(&args, &Registry::default()).unwrap_err().to_string();
        assert!(error.contains("gridweave-ros"), "{error}");
    }
}
