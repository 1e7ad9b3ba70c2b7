//! `gridweave play`: sends the messages of logs to a live pipeline at the pace at which they were logged.

use super::INTERRUPT_INTERVAL;
use super::pace::{Pace, Paced, begins_with_header};
use super::running::{RunChoice, Running, find_run};
use crate::interrupt::stop_on_interrupt;
use crate::status::{BadUse, Status};
use crate::terminal::print_line;
use anyhow::{Context as _, Result, bail};
use clap::Args;
use gridweave_runtime::engine::{ExternalSender, SenderStopper};
use gridweave_runtime::stage::{Context, Node, OutputEnd, OutputSink, PortType, Registry};
use std::cell::RefCell;
use std::io;
use std::path::PathBuf;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

/// Arguments of `gridweave play`.
#[derive(Debug, Args)]
pub(crate) struct PlayArgs {
    /// The logs: MCAP files, and folders of ROS 2 bags. Several are merged by log time.
    #[arg(required = true, value_name = "LOG")]
    pub(crate) logs: Vec<PathBuf>,
    /// The rate relative to the recording; 0 is as fast as the pipeline takes the messages.
    #[arg(long, default_value_t = 1.0)]
    pub(crate) rate: f64,
    /// Repeat the logs with later log times until interrupted.
    #[arg(long = "loop")]
    pub(crate) repeat: bool,
    /// Seconds from the first message at which to begin. The last map of each robot before that is sent first.
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0)]
    pub(crate) start: f64,
    /// Seconds from the first message at which to end.
    #[arg(long, value_name = "SECONDS")]
    pub(crate) end: Option<f64>,
    /// The stage to send as, if several stages of the pipeline take messages from outside.
    #[arg(long, value_name = "NAME")]
    pub(crate) stage: Option<String>,
    #[command(flatten)]
    pub(crate) run: RunChoice,
}

/// The kind of source that reads logs.
const SOURCE: &str = "mcap_source";
/// Timeout for the stages of the run to connect, and to take the last messages.
const READY_TIMEOUT: Duration = Duration::from_secs(10);

/// Plays logs.
pub(crate) fn play(args: &PlayArgs, registry: &Registry) -> Result<Status> {
    if !(args.rate.is_finite() && args.rate >= 0.0) {
        return Err(BadUse("--rate must be 0 or more".to_owned()).into());
    }
    let player = Player { args, registry, context: Context { stage: "play".to_owned(), ..Default::default() } };
    // Errors in the logs are reported before the search for a run.
    player.source(Vec::new())?;
    let running = find_run(&args.run, registry)?;
    let stage = external_stage(&running, args.stage.as_deref())?;
    let player = Player { context: running.pipeline.context(stage), ..player };
    let stop = stop_on_interrupt("no more messages are sent");
    let stopped = Arc::new(AtomicBool::new(false));
    let sender = ExternalSender::join(&running.run, &running.pipeline, stage)?;
    if !sender.wait_for_readers(READY_TIMEOUT) {
        bail!("the stages that read `{}` do not connect", running.pipeline.stages[stage].name);
    }
    let is_over = || stop.load(Ordering::Relaxed) || !running.run.is_running();
    let pace = Rc::new(RefCell::new(Pace::new(args.rate)));
    let links = || player.links(&running, stage, &sender, &pace);
    let result = watch_while(&is_over, &stopped, &sender.stopper(), || player.play_all(&links, &pace, &stopped));
    let result = result.context("cannot start a thread")?;
    let messages = pace.borrow().messages();
    match result {
        Err(_) if stopped.load(Ordering::Relaxed) => {}
        other => other?,
    }
    let is_taken = sender.wait_until_taken(READY_TIMEOUT);
    print_line(format_args!("played {messages} messages into {}", running.name()))?;
    if !running.run.is_running() {
        bail!("the run ended before the log did");
    }
    if !is_taken {
        bail!("the run has not taken the last messages within {} s", READY_TIMEOUT.as_secs());
    }
    Ok(Status::Done)
}

/// Finds the stage of a run that takes messages from outside.
fn external_stage(running: &Running, name: Option<&str>) -> Result<usize> {
    let stages = running.pipeline.stages.iter().enumerate();
    let external: Vec<(usize, &str)> = stages
        .filter(|(_, stage)| stage.kind.is_external())
        .map(|(index, stage)| (index, stage.name.as_str()))
        .collect();
    let names = || external.iter().map(|(_, name)| *name).collect::<Vec<_>>().join(", ");
    match (name, external.as_slice()) {
        (_, []) => bail!("{} takes no messages from outside: it has no `live_source`", running.name()),
        (None, [(stage, _)]) => Ok(*stage),
        (None, _) => Err(BadUse(format!("choose one of the stages {} with --stage", names())).into()),
        (Some(name), _) => match external.iter().find(|(_, other)| *other == name) {
            Some((stage, _)) => Ok(*stage),
            None => Err(BadUse(format!("no stage `{name}` takes messages from outside; there are {}", names())).into()),
        },
    }
}

/// Does some work while another thread waits for `is_over`, and then sets `stopped` and stops the input stream.
///
/// # Errors
/// The thread cannot be started.
fn watch_while<T>(
    is_over: &(impl Fn() -> bool + Sync),
    stopped: &AtomicBool,
    sender: &SenderStopper,
    work: impl FnOnce() -> T,
) -> io::Result<T> {
    let done = AtomicBool::new(false);
    thread::scope(|scope| {
        let watch = || {
            while !done.load(Ordering::Relaxed) {
                if is_over() {
                    stopped.store(true, Ordering::Relaxed);
                    sender.stop();
                }
                thread::sleep(INTERRUPT_INTERVAL);
            }
        };
        thread::Builder::new().spawn_scoped(scope, watch)?;
        let result = work();
        done.store(true, Ordering::Relaxed);
        Ok(result)
    })
}

struct Player<'a> {
    args: &'a PlayArgs,
    registry: &'a Registry,
    /// Robots and topics of the pipeline.
    context: Context,
}

impl Player<'_> {
    /// Makes a source that reads the logs from their beginning, and sends on these links.
    fn source(&self, links: Vec<OutputEnd>) -> Result<Node> {
        let mut parameters = toml::Table::new();
        let files = self.args.logs.iter().map(|path| {
            let text = path.to_str().ok_or_else(|| BadUse(format!("the path {} is not UTF-8", path.display())))?;
            Ok(toml::Value::from(text))
        });
        parameters.insert("files".into(), files.collect::<Result<Vec<_>, BadUse>>()?.into());
        parameters.insert("start".into(), self.args.start.into());
        if let Some(end) = self.args.end {
            parameters.insert("end".into(), end.into());
        }
        let kind = self.registry.get(SOURCE).context("this program cannot read logs")?;
        Ok(kind.make(parameters, &self.context, links)?)
    }

    /// Makes the links of the source: each output leads to that of the same name of the stage that it sends as.
    fn links(
        &self,
        running: &Running,
        stage: usize,
        sender: &ExternalSender,
        pace: &Rc<RefCell<Pace>>,
    ) -> Result<Vec<OutputEnd>> {
        let kind = self.registry.get(SOURCE).context("this program cannot read logs")?;
        let spec = &running.pipeline.stages[stage];
        let links = kind.outputs.iter().map(|output| {
            let port = spec.kind.outputs.iter().position(|port| port.name == output.name);
            let link = port.and_then(|port| sender.output(port));
            let has_stamp = matches!(output.port_type, PortType::Ros(name) if begins_with_header(name));
            let paced = |link| -> Box<dyn OutputSink> { Box::new(Paced::new(Rc::clone(pace), link, has_stamp)) };
            let sink = link.map(paced);
            OutputEnd { topic: port.and_then(|port| spec.topics.get(port)).cloned().unwrap_or_default(), sink }
        });
        Ok(links.collect())
    }

    fn play_all(
        &self,
        links: &dyn Fn() -> Result<Vec<OutputEnd>>,
        pace: &Rc<RefCell<Pace>>,
        stopped: &Arc<AtomicBool>,
    ) -> Result<()> {
        pace.borrow_mut().stop_with(Arc::clone(stopped));
        loop {
            let mut source = self.source(links()?)?;
            while source.advance()? && !stopped.load(Ordering::Relaxed) {}
            // The warnings of a repetition are the same.
            for (warning, count) in source.warnings().iter().filter(|_| !pace.borrow().is_repeated()) {
                tracing::warn!("{count} times: {warning}");
            }
            if !self.args.repeat || stopped.load(Ordering::Relaxed) || !pace.borrow_mut().begin_repetition() {
                return Ok(());
            }
        }
    }
}
