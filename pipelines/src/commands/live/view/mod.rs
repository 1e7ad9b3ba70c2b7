//! `gridweave view`: shows the merge of a run in progress as a page for a browser.
//!
//! The links of the run are watched ([`watched`]), and the state of the merge is served to browsers ([`server`]).

mod server;
mod watched;

use super::MESSAGE_INTERVAL;
use super::running::{RunChoice, Running, find_run};
use crate::commands::report::LivePage;
use crate::interrupt::stop_on_interrupt;
use crate::status::Status;
use crate::terminal::{eprint_line, print_line};
use anyhow::Result;
use clap::Args;
use gridweave_runtime::engine::{stage_statistics, watch_stages};
use gridweave_runtime::link::StageCounters;
use gridweave_runtime::stage::{Registry, StageStatistics};
use serde_json::{Map, Value, json};
use server::PageServer;
use std::net::SocketAddr;
use std::sync::atomic::Ordering;
use std::thread;
use std::time::{Duration, Instant};
use watched::WatchedRun;

/// Arguments of `gridweave view`.
#[derive(Debug, Args)]
pub(crate) struct ViewArgs {
    /// The address to serve the page on. Every program that can connect to it can see the page: 0.0.0.0:PORT lets other
    /// machines in. Port 0 is any free port.
    #[arg(long, value_name = "HOST:PORT", default_value = "127.0.0.1:8766")]
    address: SocketAddr,
    #[command(flatten)]
    run: RunChoice,
}

/// Minimum interval between two changes of the page.
const SHORTEST_INTERVAL: Duration = Duration::from_millis(300);
/// Making a change takes time from the run: after it the view pauses for so many times its duration.
const PAUSE_FACTOR: u32 = 4;
/// Timeout for browsers to take the last change at the end of the run.
const END_TIMEOUT: Duration = Duration::from_secs(3);

/// Serves the page until the run ends.
pub(crate) fn view(args: &ViewArgs, registry: &Registry) -> Result<Status> {
    let running = find_run(&args.run, registry)?;
    let page = LivePage::new(running.name());
    let mut server = PageServer::start(args.address, page.empty()?)?;
    let stop = stop_on_interrupt("the view ends");
    let counters = watch_stages(&running.run, &running.pipeline)?;
    let mut watched = WatchedRun::open(&running)?;
    print_line(format_args!("open http://{} in a browser; ctrl-c ends the view, not the run", server.address()))?;
    let (mut next, mut is_new) = (Instant::now(), true);
    loop {
        // Messages that were sent before the end of the run can be read after it.
        let is_last_look = !running.run.is_running();
        is_new |= watched.take()?;
        if is_new && (is_last_look || server.is_watched() && Instant::now() >= next) {
            let start = Instant::now();
            server.show(&page.change(&watched.state, watched.seconds(), &summary(&running, &counters))?);
            is_new = false;
            next = Instant::now() + SHORTEST_INTERVAL.max(PAUSE_FACTOR * start.elapsed());
        }
        if is_last_look {
            server.end(END_TIMEOUT);
            eprint_line("the run has ended");
            break;
        }
        if stop.load(Ordering::Relaxed) {
            break;
        }
        thread::sleep(MESSAGE_INTERVAL);
    }
    if watched.missed() > 0 {
        eprint_line(format_args!("{} messages were missed: this program was too slow", watched.missed()));
    }
    Ok(Status::Done)
}

/// Statistics of the stages so far, in the form of the summary of a run.
fn summary(running: &Running, counters: &[StageCounters]) -> Value {
    let stage = |done: StageStatistics| {
        let mut stage = json!({
            "messages_in": done.messages_in,
            "messages_out": done.messages_out,
            "busy_ms": done.busy_ms,
            "dropped": done.dropped,
            "restarts": done.restarts,
        });
        if done.warnings > 0 {
            stage["warnings"] = json!({ "the text is printed at the end of the run": done.warnings });
        }
        (done.name, stage)
    };
    let stages: Map<String, Value> = stage_statistics(&running.pipeline, counters).into_iter().map(stage).collect();
    json!({ "stages": stages })
}
