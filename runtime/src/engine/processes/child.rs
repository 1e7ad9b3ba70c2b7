//! A process of a run: its stages in threads, and its reports to the supervisor.

use super::protocol::{ProcessReport, SupervisorCommand, write_line};
use super::suspend_detector::SuspendDetector;
use crate::engine::calls::wait_for_long_call;
use crate::engine::links::Links;
use crate::engine::run_folder::RunFolder;
use crate::engine::run_links::watch_links;
use crate::engine::stage_thread::{Event, StageThread, send_event};
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

/// The time that stages have to stop once the supervisor is gone. A stage that works on a message for longer is ended
/// with its process: nothing is left that could use its result or end it.
const ORPHAN_GRACE: Duration = Duration::from_secs(5);

/// The maximum time between two reports of a process.
pub(super) const ALIVE_INTERVAL: Duration = Duration::from_millis(200);

/// Runs the process called `process` of the run in `folder`, with commands of the supervisor on standard input and
/// reports to it on standard output. `load` reads a pipeline from a file.
///
/// # Errors
/// The run does not exist, or it has no such process. Failures of stages are reported to the supervisor instead.
pub fn run_process(
    folder: &Path,
    process: &str,
    registry: &Registry,
    load: impl FnOnce(&Path, &Registry) -> Result<Pipeline, String>,
) -> Result<(), String> {
    let folder = RunFolder::join(folder).map_err(|error| error.to_string())?;
    let pipeline = load(&folder.pipeline(), registry)?;
    raise_oom_score();
    let stages = pipeline.stages_of(process);
    if stages.is_empty() {
        return Err(format!("the pipeline {} has no process `{process}`", pipeline.name));
    }
    let supervisor = Supervisor { output: &mut io::stdout(), last_report: Instant::now() };
    let counters = folder.counters(&pipeline).map_err(|error| error.to_string())?;
    let control = Arc::new(Control::default());
    let process = Process { pipeline: &pipeline, folder: &folder, stages: &stages, counters: &counters, control };
    process.run(supervisor).map_err(|error| format!("cannot start a thread: {error}"))
}

/// The connection to the supervisor: standard output, locked for a line at a time, as stages may print. A failure to
/// write is ignored, as the end of the supervisor is noticed at standard input.
struct Supervisor<'a> {
    output: &'a mut dyn Write,
    last_report: Instant,
}

impl Supervisor<'_> {
    fn send(&mut self, report: &ProcessReport) {
        self.last_report = Instant::now();
        let _ = write_line(&mut *self.output, report);
    }

    fn send_alive(&mut self) {
        if self.last_report.elapsed() >= ALIVE_INTERVAL {
            self.send(&ProcessReport::Alive);
        }
    }
}

/// Raises the score of this process for the kernel's out-of-memory killer. When memory runs out, it then kills a stage,
/// which is detected and reported, rather than the supervisor or an unrelated program. Failing to do so is harmless.
fn raise_oom_score() {
    let _ = std::fs::write("/proc/self/oom_score_adj", "500");
}

struct Process<'a> {
    pipeline: &'a Pipeline,
    folder: &'a RunFolder,
    /// The indexes of its stages.
    stages: &'a [usize],
    /// The shared counters of the run.
    counters: &'a Arc<SharedCounters>,
    /// The requests to its stages.
    control: Arc<Control>,
}

impl Process<'_> {
    /// Fails if the thread that reads the commands cannot be started.
    fn run(&self, mut supervisor: Supervisor<'_>) -> io::Result<()> {
        let names = self.folder.names();
        let observable = watch_links(&self.folder.as_running(), self.pipeline);
        let links = Links::new(self.pipeline, &names, self.counters).with_observable(observable);
        let stop_reason = OnceLock::new();
        let (sender, receiver) = channel();
        read_commands(sender.clone())?;
        thread::scope(|scope| {
            for &stage in self.stages {
                let (events, links, stop_reason) = (sender.clone(), &links, &stop_reason);
                let control = Arc::clone(&self.control);
                let work = move || StageThread::<Service>::start(links, stage, control, stop_reason, &events);
                if let Err(error) = thread::Builder::new().spawn_scoped(scope, work) {
                    let failure = Failure::Process(format!("cannot start a thread: {error}"));
                    send_event(&sender, Event::Ended { stage, result: Err(failure) });
                }
            }
            drop(sender);
            self.report(&mut supervisor, &receiver, &stop_reason);
        });
        Ok(())
    }

    /// Reports the events of the stages to the supervisor until all have ended.
    fn report(&self, supervisor: &mut Supervisor<'_>, events: &Receiver<Event>, stop_reason: &OnceLock<String>) {
        let mut running = self.stages.len();
        let mut hung = false;
        let mut suspend_detector = SuspendDetector::new(Instant::now());
        while running > 0 {
            let report = match events.recv_timeout(ALIVE_INTERVAL) {
                Ok(Event::Progress { stage, share, log_time }) => {
                    Some(ProcessReport::Progress { stage: self.name(stage), share, log_time })
                }
                Ok(Event::Ended { stage, result }) => {
                    running -= 1;
                    Some(match result {
                        Ok(report) => ProcessReport::Done { stage_report: report },
                        Err(Failure::Link(LinkError::Stopped)) => ProcessReport::Stopped { stage: self.name(stage) },
                        Err(failure) => ProcessReport::Failed { stage: self.name(stage), failure },
                    })
                }
                Ok(Event::Drain) => {
                    self.control.drain(self.counters);
                    None
                }
                Ok(Event::Stop { reason }) => {
                    stop_reason.get_or_init(|| reason);
                    self.control.stop(self.counters);
                    end_if_stuck();
                    None
                }
                Err(RecvTimeoutError::Timeout) => None,
                // All threads are gone, of which some have panicked without a last word: the scope passes that on.
                Err(RecvTimeoutError::Disconnected) => return,
            };
            let awake_for = suspend_detector.check(Instant::now());
            if !hung && let Some(report) = self.hung(awake_for) {
                hung = true;
                supervisor.send(&report);
            }
            match report {
                Some(report) => supervisor.send(&report),
                None => supervisor.send_alive(),
            }
        }
    }

    /// The report for the first stage that has worked on one message for longer than `stall_timeout`, while the process
    /// was not suspended.
    fn hung(&self, awake_for: Duration) -> Option<ProcessReport> {
        let longest = self.pipeline.stall_timeout.filter(|longest| awake_for > *longest)?;
        let is_hung = |stage: usize| working_for(&self.counters.stage(stage)).is_some_and(|time| time > longest);
        let stage = self.stages.iter().copied().find(|&stage| is_hung(stage))?;
        let failure = Failure::Hung { seconds: longest.as_secs_f64() };
        Some(ProcessReport::Failed { stage: self.name(stage), failure })
    }

    fn name(&self, stage: usize) -> String {
        self.pipeline.stages[stage].name.clone()
    }
}

/// Ends this process if a stage goes on working. The supervisor closes what it was writing.
fn end_if_stuck() {
    let end = || {
        wait_for_long_call();
        std::process::exit(1);
    };
    // Without a thread, the supervisor ends this process.
    let _ = thread::Builder::new().name("stopping".to_owned()).spawn(end);
}

/// Reads the commands of the supervisor in a separate thread. The end of the supervisor is a reason to stop.
fn read_commands(events: Sender<Event>) -> io::Result<()> {
    let read = move || {
        for line in io::stdin().lock().lines() {
            let Ok(line) = line else { break };
            let event = match serde_json::from_str(&line) {
                Ok(SupervisorCommand::Stop { reason }) => Event::Stop { reason },
                Ok(SupervisorCommand::Drain) => Event::Drain,
                Err(error) => Event::Stop { reason: format!("cannot read a command of the supervisor: {error}") },
            };
            send_event(&events, event);
        }
        send_event(&events, Event::Stop { reason: RunError::of_run(Failure::Orphaned).to_string() });
        // So that the end of all threads of stages is noticed.
        drop(events);
        thread::sleep(ORPHAN_GRACE);
        std::process::exit(1);
    };
    thread::Builder::new().name("commands".to_owned()).spawn(read).map(drop)
}
