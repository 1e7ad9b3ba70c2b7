//! One process of a run: its stages in threads, and its words with the supervisor.

use super::suspend_detector::SuspendDetector;
use super::protocol::{Said, Told, say};
use crate::engine::links::Links;
use crate::engine::run_folder::RunFolder;
use crate::engine::run_links::watch_links;
use crate::engine::stage_thread::{Event, StageThread, tell};
use crate::engine::work_timer::working_for;
use crate::engine::{Failure, RunError};
use crate::link::SharedCounters;
use crate::link::{Control, LinkError};
use crate::pipeline::Pipeline;
use crate::stage::Registry;
use iceoryx2::service::ipc::Service;
use std::io::{self, BufRead, Write};
use std::path::Path;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, OnceLock};
use std::thread;
use std::time::{Duration, Instant};

/// A process says at least so often that it is alive.
pub(super) const ALIVE_INTERVAL: Duration = Duration::from_millis(200);

/// Runs the process called `process` of the run in `folder`, with the words of the supervisor on standard input and
/// those for it on standard output. `load` gives the pipeline that stands in a file.
///
/// # Errors
/// The run is not there, or it has no such process. How the stages go is told to the supervisor.
pub fn run_process(
    folder: &Path,
    process: &str,
    registry: &Registry,
    load: impl FnOnce(&Path, &Registry) -> Result<Pipeline, String>,
) -> Result<(), String> {
    let folder = RunFolder::join(folder).map_err(|error| error.to_string())?;
    let pipeline = load(&folder.pipeline(), registry)?;
    offer_to_the_system();
    let stages = pipeline.stages_of(process);
    if stages.is_empty() {
        return Err(format!("the pipeline {} has no process `{process}`", pipeline.name));
    }
    let supervisor = Supervisor { output: &mut io::stdout(), told: Instant::now() };
    let counters = folder.counters(&pipeline).map_err(|error| error.to_string())?;
    let control = Arc::new(Control::default());
    Process { pipeline: &pipeline, folder: &folder, stages: &stages, counters: &counters, control }.run(supervisor);
    Ok(())
}

/// The way to the supervisor: standard output, locked for a line at a time, as stages may print. That it is gone is seen at
/// standard input, so a failure to write is no news.
struct Supervisor<'a> {
    output: &'a mut dyn Write,
    told: Instant,
}

impl Supervisor<'_> {
    fn tell(&mut self, words: &Said) {
        self.told = Instant::now();
        let _ = say(&mut *self.output, words);
    }

    fn tell_alive(&mut self) {
        if self.told.elapsed() >= ALIVE_INTERVAL {
            self.tell(&Said::Alive);
        }
    }
}

/// When memory runs out, the system is to end a stage, which is seen and told, rather than the supervisor or a program
/// that has nothing to do with the run. Where it does not take the offer, nothing else changes.
fn offer_to_the_system() {
    let _ = std::fs::write("/proc/self/oom_score_adj", "500");
}

struct Process<'a> {
    pipeline: &'a Pipeline,
    folder: &'a RunFolder,
    /// The indexes of its stages.
    stages: &'a [usize],
    /// What the stages of the run show of themselves.
    counters: &'a Arc<SharedCounters>,
    /// What its stages are told.
    control: Arc<Control>,
}

impl Process<'_> {
    fn run(&self, mut supervisor: Supervisor<'_>) {
        let names = self.folder.names();
        let to_look_on = watch_links(&self.folder.as_running(), self.pipeline);
        let links = Links::new(self.pipeline, &names, self.counters).looked_on(to_look_on);
        let stop_reason = OnceLock::new();
        let (sender, receiver) = channel();
        listen(sender.clone());
        thread::scope(|scope| {
            for &stage in self.stages {
                let (sender, links, stop_reason) = (sender.clone(), &links, &stop_reason);
                let control = Arc::clone(&self.control);
                scope.spawn(move || StageThread::<Service>::start(links, stage, control, stop_reason, &sender));
            }
            drop(sender);
            self.report(&mut supervisor, &receiver, &stop_reason);
        });
    }

    /// Tells the supervisor how the stages go until all have ended.
    fn report(&self, supervisor: &mut Supervisor<'_>, events: &Receiver<Event>, stop_reason: &OnceLock<String>) {
        let mut running = self.stages.len();
        let mut hung = false;
        let mut awake = SuspendDetector::new(Instant::now());
        while running > 0 {
            let words = match events.recv_timeout(ALIVE_INTERVAL) {
                Ok(Event::Progress { stage, share, log_time }) => {
                    Some(Said::Progress { stage: self.name(stage), share, log_time })
                }
                Ok(Event::Ended { stage, result }) => {
                    running -= 1;
                    Some(match result {
                        Ok(report) => Said::Done { report },
                        Err(Failure::Link(LinkError::Stopped)) => Said::Stopped { stage: self.name(stage) },
                        Err(failure) => Said::Failed { stage: self.name(stage), failure },
                    })
                }
                Ok(Event::Drain) => {
                    self.control.drain(self.counters);
                    None
                }
                Ok(Event::Stop { reason }) => {
                    stop_reason.get_or_init(|| reason);
                    self.control.stop(self.counters);
                    None
                }
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => None,
            };
            let awake_for = awake.look(Instant::now());
            if !hung && let Some(words) = self.hung(awake_for) {
                hung = true;
                supervisor.tell(&words);
            }
            match words {
                Some(words) => supervisor.tell(&words),
                None => supervisor.tell_alive(),
            }
        }
    }

    /// The first stage that has worked on one message for longer than the pipeline allows, while the process was awake.
    fn hung(&self, awake_for: Duration) -> Option<Said> {
        let longest = self.pipeline.stall_timeout.filter(|longest| awake_for > *longest)?;
        let is_hung = |stage: usize| working_for(&self.counters.stage(stage)).is_some_and(|time| time > longest);
        let stage = self.stages.iter().copied().find(|&stage| is_hung(stage))?;
        let failure = Failure::Hung { seconds: longest.as_secs_f64() };
        Some(Said::Failed { stage: self.name(stage), failure })
    }

    fn name(&self, stage: usize) -> String {
        self.pipeline.stages[stage].name.clone()
    }
}

/// Listens to the supervisor in a thread of its own. When the supervisor is gone, that is a reason to stop.
fn listen(events: Sender<Event>) {
    thread::spawn(move || {
        for line in io::stdin().lock().lines() {
            let Ok(line) = line else { break };
            let event = match serde_json::from_str(&line) {
                Ok(Told::Stop { reason }) => Event::Stop { reason },
                Ok(Told::Drain) => Event::Drain,
                Err(error) => Event::Stop { reason: format!("the supervisor says what cannot be understood: {error}") },
            };
            tell(&events, event);
        }
        tell(&events, Event::Stop { reason: RunError::of_run(Failure::Orphaned).to_string() });
    });
}
