//! `gridweave tap`: prints the messages of a link.

use super::MESSAGE_INTERVAL;
use super::link_choice::named_link;
use super::message_printer::{Printer, PrintingOptions, Types};
use super::running::{RunChoice, find_run};
use super::tap_remote::{RemoteOptions, tap_remote};
use crate::interrupt::stop_on_interrupt;
use crate::status::{BadUse, Status};
use crate::terminal::eprint_line;
use anyhow::Result;
use clap::Args;
use gridweave_runtime::engine::WatchedLink;
use gridweave_runtime::stage::Registry;
use std::sync::atomic::Ordering;
use std::thread;

/// Arguments of `gridweave tap`.
#[derive(Debug, Args)]
pub(crate) struct TapArgs {
    /// The link: STAGE.PORT, or STAGE if it has only one output; MACHINE:STAGE.PORT for a run on another machine, where
    /// MACHINE is the name of its bridge (with `gridweave-ros`).
    #[arg(value_name = "[MACHINE:]STAGE.PORT")]
    pub(crate) link: String,
    #[command(flatten)]
    pub(crate) printing: PrintingOptions,
    #[command(flatten)]
    pub(crate) remote: RemoteOptions,
    #[command(flatten)]
    pub(crate) run: RunChoice,
}

/// Prints messages until the run ends, the count is reached, or the user interrupts it.
pub(crate) fn tap(args: &TapArgs, registry: &Registry) -> Result<Status> {
    if let Some((machine, link)) = args.link.split_once(':') {
        return tap_remote((machine, link), &args.remote, &args.run, &args.printing, registry);
    }
    if !args.remote.is_empty() {
        let text = "--at and --set are for links of other machines: name the link as MACHINE:STAGE.PORT";
        return Err(BadUse(text.to_owned()).into());
    }
    let running = find_run(&args.run, registry)?;
    let link = named_link(&args.link, &running.pipeline)?;
    let stop = stop_on_interrupt("the tap ends");
    let mut watched = WatchedLink::open(&running.run, &running.pipeline, link.stage, link.port)?;
    let kind = &running.pipeline.stages[link.stage].kind;
    let mut printer = Printer::new(&args.printing, Types::new(kind, kind.outputs[link.port].port_type));
    loop {
        // Messages that were sent before the end of the run can be read after it.
        let is_last_look = stop.load(Ordering::Relaxed) || !running.run.is_running();
        watched.take(|_, message| printer.add(&message))?;
        if !printer.print()? || is_last_look {
            break;
        }
        thread::sleep(MESSAGE_INTERVAL);
    }
    if watched.missed() > 0 {
        eprint_line(format_args!("{} messages were missed: this program was too slow", watched.missed()));
    }
    Ok(Status::Done)
}
