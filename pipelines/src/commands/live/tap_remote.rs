//! `gridweave tap MACHINE:STAGE.PORT`: prints the messages of a link of a run on another machine.
//!
//! The stage `bridge_tap` receives them. It connects to the same endpoint as the bridge of that machine: by default,
//! the one on which the `bridge_source` of a run on this machine listens.

use super::INTERRUPT_INTERVAL;
use super::bridge_settings::{bridge_kind, check, connect_parameters, settings};
use super::message_printer::{Printer, PrintingOptions, Types};
use super::running::{RunChoice, Running, find_run_with};
use crate::interrupt::stop_on_interrupt;
use crate::status::{BadUse, Status};
use crate::terminal::eprint_line;
use anyhow::{Context as _, Result};
use clap::Args;
use gridweave_runtime::pipeline::{Pipeline, StageSpec};
use gridweave_runtime::stage::{Context, Registry, StageError, StageHarness, bridge_counts};
use std::sync::atomic::Ordering;

/// The kinds of the stage that receives the messages, and of the one that machines connect to.
const TAP: &str = "bridge_tap";
const SOURCE: &str = "bridge_source";

/// The connection to a run on another machine.
#[derive(Debug, Args)]
pub(crate) struct RemoteOptions {
    /// The endpoint that the bridge of the other machine connects to, as tcp/HOST:PORT; by default that of a
    /// `bridge_source` here.
    #[arg(long, value_name = "ENDPOINT")]
    pub(crate) at: Vec<String>,
    /// Set a parameter of the connection to the other machine; `kinds bridge_tap` lists them.
    #[arg(long, value_name = "PARAMETER=VALUE")]
    pub(crate) set: Vec<String>,
}

impl RemoteOptions {
    /// Whether none is given.
    pub(super) fn is_empty(&self) -> bool {
        self.at.is_empty() && self.set.is_empty()
    }
}

/// Prints messages of a link on a machine until the run ends, the count is reached, or the user interrupts it.
pub(super) fn tap_remote(
    (machine, link): (&str, &str),
    remote: &RemoteOptions,
    run: &RunChoice,
    printing: &PrintingOptions,
    registry: &Registry,
) -> Result<Status> {
    let kind = bridge_kind(TAP, registry)?;
    let set = settings(&remote.set)?;
    let has_endpoint = !remote.at.is_empty() || ["connect", "zenoh_config"].iter().any(|&name| set.contains_key(name));
    let base =
        match has_endpoint {
            true => None,
            false => {
                let running = find_run_with(run, registry, |pipeline| sources(pipeline).next().is_some());
                Some(running.context(
                    "the endpoint that other machines connect to is not known: give it as `--at tcp/HOST:PORT`",
                )?)
            }
        };
    let mut parameters = base.as_ref().map_or_else(|| Ok(connect_parameters(&remote.at)), base_endpoint)?;
    parameters.insert("sender".into(), machine.into());
    parameters.insert("link".into(), link.into());
    parameters.insert("wait".into(), run.wait.into());
    parameters.extend(set);
    check(kind, &parameters)?;
    let stop = stop_on_interrupt("the tap ends");
    let context = Context { stage: "tap".to_owned(), ..Default::default() };
    let mut stage = StageHarness::with_context(kind, &parameters.to_string(), &context)?;
    let output = kind.outputs.first().map_or("", |output| output.name);
    let mut printer = Printer::new(printing, Types::default());
    loop {
        let base_has_ended = base.as_ref().is_some_and(|base| !base.run.is_running());
        let is_last_look = stop.load(Ordering::Relaxed) || base_has_ended;
        stage.node().wait(INTERRUPT_INTERVAL);
        let goes_on = stage.node().advance().map_err(bad_use)?;
        stage.take_messages(output).iter().for_each(|message| printer.add(message));
        if base_has_ended && goes_on {
            eprint_line(format_args!("the run that `{machine}` sends to has ended: the tap ends, too"));
        }
        if !printer.print()? || is_last_look || !goes_on {
            break;
        }
    }
    if let Some(missed) = stage.counts().get(bridge_counts::MISSED) {
        eprint_line(format_args!(
            "{missed} messages were missed: this program, or the connection to the machine, was too slow"
        ));
    }
    Ok(Status::Done)
}

/// Makes an error in the name of the machine or of the link an error in the command line.
fn bad_use(error: StageError) -> anyhow::Error {
    match error.parameter() {
        Some(_) => BadUse(error.to_string()).into(),
        None => error.into(),
    }
}

/// Finds the stages of a pipeline that other machines connect to.
fn sources(pipeline: &Pipeline) -> impl Iterator<Item = &StageSpec> {
    pipeline.stages.iter().filter(|stage| stage.kind.name == SOURCE)
}

/// Makes the parameters that connect a program on this machine to the endpoint of the machines that send to a run.
fn base_endpoint(running: &Running) -> Result<toml::Table> {
    let sources: Vec<_> = sources(&running.pipeline).collect();
    let name = running.name();
    let wrong = |what: &str| {
        Err(BadUse(format!("the run {name} {what}: give the endpoint of other machines as `--at tcp/HOST:PORT`"))
            .into())
    };
    match sources.as_slice() {
        [source] if source.parameters.contains_key("zenoh_config") => {
            wrong("has a `bridge_source` with a Zenoh configuration")
        }
        [source] => Ok(client_parameters(&source.parameters)),
        [] => wrong("has no `bridge_source`"),
        _ => wrong("has several `bridge_source`s"),
    }
}

/// Makes the parameters of a client of a `bridge_source` on this machine from the parameters of that stage.
fn client_parameters(source: &toml::Table) -> toml::Table {
    let copied = |names: &[&str]| {
        let given = names.iter().filter_map(|&name| Some((name.to_owned(), source.get(name)?.clone())));
        given.collect::<toml::Table>()
    };
    let mut parameters = copied(&["bridge", "insecure"]);
    if source.contains_key("authority") {
        parameters.extend(copied(&["authority", "certificate", "key"]));
    }
    let endpoints = |name: &str| {
        let given = source.get(name).and_then(toml::Value::as_array);
        let given = given.into_iter().flatten().filter_map(toml::Value::as_str);
        // A client cannot connect to the wildcard address.
        let own = |endpoint: &str| endpoint.replace("/0.0.0.0:", "/127.0.0.1:").replace("/[::]:", "/[::1]:");
        given.map(own).collect::<Vec<_>>()
    };
    let endpoints = if source.get("listen").is_some_and(|listen| listen.as_array().is_some_and(Vec::is_empty)) {
        endpoints("connect")
    } else {
        endpoints("listen")
    };
    parameters.extend(connect_parameters(&endpoints));
    parameters
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_client_connects_to_the_endpoint_of_the_sending_machines() {
        let parameters = |source: &str| client_parameters(&source.parse().unwrap());
        assert_eq!(parameters(""), toml::Table::new());
        assert_eq!(
            parameters(
                "bridge = \"floor\"\nlisten = [\"tcp/0.0.0.0:1\", \"tcp/[::]:2\"]\ninsecure = true\nend_after = 2"
            ),
            "bridge = \"floor\"\nconnect = [\"tcp/127.0.0.1:1\", \"tcp/[::1]:2\"]\ninsecure = true".parse().unwrap()
        );
        assert_eq!(
            parameters("listen = []\nconnect = [\"tcp/router:3\"]"),
            "connect = [\"tcp/router:3\"]".parse().unwrap()
        );
        let certificates = "certificate = \"base.pem\"\nkey = \"base.key\"\n";
        assert_eq!(parameters(certificates), toml::Table::new());
        let mutual = format!("{certificates}authority = \"fleet.pem\"");
        assert_eq!(parameters(&mutual), mutual.parse().unwrap());
    }
}
