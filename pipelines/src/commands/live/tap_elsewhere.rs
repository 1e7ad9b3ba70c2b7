//! `gridweave tap MACHINE:STAGE.PORT`: prints the messages of a link of a run on another machine.
//!
//! The stage `bridge_tap` takes them. It connects to where that machine's bridge does: where the `bridge_source` of a run on this
//! machine listens, unless it is told otherwise.

use super::bridge_settings::{bridge_kind, check, connecting_to, settings};
use super::running::{Running, find_run_with};
use super::tap::{Printer, TapArgs, Types};
use crate::interrupt::stop_on_interrupt;
use crate::status::{BadUse, Status};
use crate::terminal::say;
use anyhow::{Context as _, Result};
use gridweave_runtime::pipeline::{Pipeline, StageSpec};
use gridweave_runtime::stage::{Context, LoneStage, Registry, StageError};
use std::sync::atomic::Ordering;
use std::time::Duration;

/// The kind of stage that takes what passes, and the one that machines connect to.
const TAP: &str = "bridge_tap";
const SOURCE: &str = "bridge_source";
/// What the stage counts of what it was too slow for.
const MISSED: &str = "messages missed";
/// So often it is looked whether the user has had enough.
const LOOK_INTERVAL: Duration = Duration::from_millis(50);

/// Prints what passes.
pub(super) fn tap_elsewhere(args: &TapArgs, machine: &str, link: &str, registry: &Registry) -> Result<Status> {
    let kind = bridge_kind(TAP, registry)?;
    let set = settings(&args.set)?;
    let is_told = !args.at.is_empty() || ["connect", "zenoh_config"].iter().any(|&name| set.contains_key(name));
    let base = match is_told {
        true => None,
        false => {
            let running = find_run_with(&args.run, registry, |pipeline| sources(pipeline).next().is_some());
            Some(running.context("it is not known where other machines connect to; `--at tcp/HOST:PORT` says so")?)
        }
    };
    let mut parameters = base.as_ref().map_or_else(|| Ok(connecting_to(&args.at)), door)?;
    parameters.insert("sender".into(), machine.into());
    parameters.insert("link".into(), link.into());
    parameters.insert("wait".into(), args.run.wait.into());
    parameters.extend(set);
    check(kind, &parameters)?;
    let stop = stop_on_interrupt("the tap ends");
    let context = Context { stage: "tap".to_owned(), ..Default::default() };
    let mut stage = LoneStage::with_context(kind, &parameters.to_string(), &context)?;
    let output = kind.outputs.first().map_or("", |output| output.name);
    let mut printer = Printer::new(args, Types::default());
    loop {
        let is_cut_off = base.as_ref().is_some_and(|base| !base.run.is_running());
        let is_last_look = stop.load(Ordering::Relaxed) || is_cut_off;
        stage.node().wait(LOOK_INTERVAL);
        let goes_on = stage.node().advance().map_err(bad_use)?;
        stage.take_messages(output).iter().for_each(|message| printer.add(message));
        if is_cut_off && goes_on {
            say(format_args!("the run that `{machine}` sends to has ended, and with it the way to what passes there"));
        }
        if !printer.print()? || is_last_look || !goes_on {
            break;
        }
    }
    if let Some(missed) = stage.counts().get(MISSED) {
        say(format_args!(
            "{missed} messages were missed, as this program, or the way to the machine, was too slow for them"
        ));
    }
    Ok(Status::Done)
}

/// What is wrong with the machine or the link that was named is bad use.
fn bad_use(error: StageError) -> anyhow::Error {
    match error.parameter() {
        Some(_) => BadUse(error.to_string()).into(),
        None => error.into(),
    }
}

/// The stages of a pipeline that other machines connect to.
fn sources(pipeline: &Pipeline) -> impl Iterator<Item = &StageSpec> {
    pipeline.stages.iter().filter(|stage| stage.kind.name == SOURCE)
}

/// The parameters by which a program on this machine connects to where the machines do that send to a run.
fn door(running: &Running) -> Result<toml::Table> {
    let sources: Vec<_> = sources(&running.pipeline).collect();
    let name = running.name();
    let wrong = |what: &str| {
        Err(BadUse(format!("the run {name} {what}: say where other machines connect to by `--at tcp/HOST:PORT`"))
            .into())
    };
    match sources.as_slice() {
        [source] if source.parameters.contains_key("zenoh_config") => {
            wrong("has a `bridge_source` with a configuration of Zenoh")
        }
        [source] => Ok(way_in(&source.parameters)),
        [] => wrong("has no `bridge_source`"),
        _ => wrong("has several `bridge_source`s"),
    }
}

/// The parameters of who connects to a `bridge_source` of this machine, from those that it has.
fn way_in(source: &toml::Table) -> toml::Table {
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
        // All addresses of this machine is none to connect to.
        let own = |endpoint: &str| endpoint.replace("/0.0.0.0:", "/127.0.0.1:").replace("/[::]:", "/[::1]:");
        given.map(own).collect::<Vec<_>>()
    };
    let doors = if source.get("listen").is_some_and(|listen| listen.as_array().is_some_and(Vec::is_empty)) {
        endpoints("connect")
    } else {
        endpoints("listen")
    };
    parameters.extend(connecting_to(&doors));
    parameters
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_in_is_that_of_the_machines_which_send() {
        let way = |source: &str| way_in(&source.parse().unwrap());
        assert_eq!(way(""), toml::Table::new());
        assert_eq!(
            way("bridge = \"floor\"\nlisten = [\"tcp/0.0.0.0:1\", \"tcp/[::]:2\"]\ninsecure = true\nend_after = 2"),
            "bridge = \"floor\"\nconnect = [\"tcp/127.0.0.1:1\", \"tcp/[::1]:2\"]\ninsecure = true".parse().unwrap()
        );
        assert_eq!(way("listen = []\nconnect = [\"tcp/router:3\"]"), "connect = [\"tcp/router:3\"]".parse().unwrap());
        let certificates = "certificate = \"base.pem\"\nkey = \"base.key\"\n";
        assert_eq!(way(certificates), toml::Table::new());
        let mutual = format!("{certificates}authority = \"fleet.pem\"");
        assert_eq!(way(&mutual), mutual.parse().unwrap());
    }

    #[test]
    fn a_program_without_a_bridge_says_which_has_one() {
        let args = TapArgs {
            link: "robot1:slam.map".to_owned(),
            json: false,
            count: None,
            at: Vec::new(),
            set: Vec::new(),
            run: Default::default(),
        };
        let error = super::super::tap::tap(&args, &Registry::default()).unwrap_err().to_string();
        assert!(error.contains("gridweave-ros"), "{error}");
    }
}
