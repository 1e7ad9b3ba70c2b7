//! The supervisor: starts the processes of a run, hears how they go, stops them, and removes what they leave.

use super::Launch;
use super::suspend_detector::SuspendDetector;
use super::backoff::Backoff;
use super::drain::{Drain, STUCK_AFTER};
use super::event::{Event, listen};
use super::process::Process;
use super::system::describe_exit;
use super::protocol::{Said, Told};
use crate::engine::run_folder::{RunFolder, clean_after};
use crate::engine::{Failure, Observer, RunError, RunReport, StageReport};
use crate::link::{LinkError, RunNames};
use crate::link::{StageCounters, StageCounter, StageState, WireCounter};
use crate::pipeline::{Mode, Pipeline, Restart};
use iceoryx2::service::ipc;
use std::collections::BTreeMap;
use std::env;
use std::io::{self, Write};
use std::os::unix::process::CommandExt;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::{Duration, Instant};
use tracing::{Level, event_enabled};

/// The variable of the environment that says what is told.
const LOG_FILTER: &str = "RUST_LOG";
/// At least so often the observer is asked whether the run should stop.
const STOP_INTERVAL: Duration = Duration::from_millis(50);
/// So long may a process take to close its outputs before it is killed.
const STOP_TIMEOUT: Duration = Duration::from_secs(10);
/// A process that dies takes the links of others with it, and their complaints may come before the news of its death.
/// So long the supervisor waits for a better reason.
const CAUSE_TIMEOUT: Duration = Duration::from_millis(1500);

/// A run that has failed.
struct Stopping {
    error: RunError,
    since: Instant,
    /// Whether the processes were told.
    told: bool,
}

pub(super) fn run(pipeline: &Pipeline, launch: &Launch, observer: &dyn Observer) -> Result<RunReport, RunError> {
    let of_run = |error| RunError::of_run(Failure::from(error));
    let folder = RunFolder::create().map_err(of_run)?;
    let result = run_in(&folder, pipeline, launch, observer);
    let removed = folder.remove().map_err(of_run);
    result.and_then(|report| removed.map(|()| report))
}

fn run_in(
    folder: &RunFolder,
    pipeline: &Pipeline,
    launch: &Launch,
    observer: &dyn Observer,
) -> Result<RunReport, RunError> {
    let of_run = |error| RunError::of_run(Failure::from(error));
    let counters = folder.create_counters(pipeline).map_err(of_run)?;
    let counters: Vec<StageCounters> = (0..pipeline.stages.len()).map(|stage| counters.stage(stage)).collect();
    // Senders wait for the stages that are still to come.
    counters.iter().for_each(|counters| counters.set_state(StageState::Starting));
    folder.write_pipeline(&pipeline.to_toml()).map_err(of_run)?;
    let (sender, receiver) = channel();
    let mut supervisor = Supervisor {
        pipeline,
        observer,
        launch,
        folder,
        counters,
        events: sender,
        processes: Vec::new(),
        draining: None,
        awake: SuspendDetector::new(Instant::now()),
        awake_for: Duration::ZERO,
        reports: BTreeMap::new(),
        stopping: None,
        readers: Vec::new(),
    };
    supervisor.start_all();
    supervisor.wait_for_all(&receiver);
    supervisor.result()
}

struct Supervisor<'a> {
    pipeline: &'a Pipeline,
    observer: &'a dyn Observer,
    launch: &'a Launch,
    folder: &'a RunFolder,
    counters: Vec<StageCounters>,
    events: Sender<Event>,
    processes: Vec<Process>,
    /// Of a live run that comes to its end.
    draining: Option<Drain>,
    awake: SuspendDetector,
    /// For how long this process had been awake when it last looked.
    awake_for: Duration,
    reports: BTreeMap<String, StageReport>,
    stopping: Option<Stopping>,
    readers: Vec<thread::JoinHandle<()>>,
}

impl Supervisor<'_> {
    fn start_all(&mut self) {
        for name in self.pipeline.processes() {
            let stages = self.pipeline.stages_of(&name);
            let started = self.start(&name, self.processes.len());
            let (child, stdin) = match started {
                Ok(started) => started,
                Err(failure) => {
                    let stage = stages.first().map_or(name, |&stage| self.pipeline.stages[stage].name.clone());
                    return self.fail(RunError::of_stage(&stage, failure));
                }
            };
            let is_restarted = |stage: &usize| self.pipeline.stages[*stage].restart == Restart::OnFailure;
            self.processes.push(Process {
                child,
                stdin,
                running: stages.iter().map(|&stage| self.pipeline.stages[stage].name.clone()).collect(),
                heard: Instant::now(),
                ended: false,
                restarts: self.pipeline.mode == Mode::Live && stages.iter().all(is_restarted),
                backoff: Backoff::new(),
                failure: None,
                start_at: None,
                name,
                stages,
            });
        }
        self.observer.started(self.folder.prefix());
    }

    /// Starts the process called `name`, whose number is `process`, and listens to it.
    fn start(&mut self, name: &str, process: usize) -> Result<(Child, Option<ChildStdin>), Failure> {
        let mut command = Command::new(&self.launch.program);
        // What this process tells beyond warnings, others are to tell as well.
        if let Some(level) = told_beyond_warnings().filter(|_| env::var_os(LOG_FILTER).is_none()) {
            command.env(LOG_FILTER, level);
        }
        let mut child = command
            .args(&self.launch.arguments)
            .arg(self.folder.path())
            .arg(name)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            // An interrupt from the terminal is the supervisor's: it tells the others.
            .process_group(0)
            .spawn()
            .map_err(|error| Failure::Process(format!("cannot start {}: {error}", self.launch.program.display())))?;
        if let Some(stdout) = child.stdout.take() {
            let events = self.events.clone();
            self.readers.push(thread::spawn(move || listen(process, stdout, &events)));
        }
        let stdin = child.stdin.take();
        Ok((child, stdin))
    }

    /// Waits until every process has ended. When one fails, stops the others.
    fn wait_for_all(&mut self, events: &Receiver<Event>) {
        while !self.processes.iter().all(Process::is_over) {
            match events.recv_timeout(STOP_INTERVAL) {
                Ok(event) => self.note(event),
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => {}
            }
            self.awake_for = self.awake.look(Instant::now());
            if self.stopping.is_none() && self.observer.should_stop() {
                match self.pipeline.mode {
                    Mode::Replay => self.fail(RunError::of_run(Failure::Interrupted)),
                    Mode::Live => self.drain(),
                }
            }
            self.look_at_processes();
            self.start_again();
            self.stop();
        }
    }

    fn note(&mut self, event: Event) {
        match event {
            // A closed standard error is no reason to end the run.
            Event::Printed { line } => drop(writeln!(io::stderr(), "{line}")),
            Event::Said { process, words } => {
                self.processes[process].heard = Instant::now();
                self.note_words(process, words);
            }
            Event::Silent { process } => self.note_end(process),
        }
    }

    /// A process has ended, or is about to.
    fn note_end(&mut self, place: usize) {
        let process = &mut self.processes[place];
        // Nobody closes standard output and goes on; if one did, it would be killed by the stop.
        let status = process.child.wait();
        process.ended = true;
        let lost = || {
            let (stage, others) = process.running.split_first()?;
            let how = status.map_or_else(|error| error.to_string(), describe_exit);
            let together = match others {
                [] => String::new(),
                others => format!(" (it ran {} as well)", others.join(", ")),
            };
            Some((stage.clone(), Failure::Ended(how + &together)))
        };
        let Some((stage, failure)) = process.failure.take().or_else(lost) else { return };
        // What cannot be removed waits for `clean`.
        let _ = clean_after(self.processes[place].child.id());
        match self.is_restarted(place) {
            true => self.start_later(place, &stage, &failure),
            false => self.fail(RunError::of_stage(&stage, failure)),
        }
    }

    /// Whether a process that fails is started again.
    fn is_restarted(&self, place: usize) -> bool {
        self.processes[place].restarts && self.stopping.is_none() && self.draining.is_none()
    }

    /// A process of which a stage has failed, or that has to be ended: it is started again, or the run fails.
    fn note_failure(&mut self, place: usize, stage: String, failure: Failure, is_deaf: bool) {
        let is_restarted = self.is_restarted(place);
        let process = &mut self.processes[place];
        if is_restarted || is_deaf {
            let _ = process.child.kill();
        }
        match is_restarted {
            true => drop(process.failure.get_or_insert((stage, failure))),
            false => self.fail(RunError::of_stage(&stage, failure)),
        }
    }

    /// Removes what a process has left, and has it started again after a while.
    fn start_later(&mut self, place: usize, stage: &str, failure: &Failure) {
        let process = &mut self.processes[place];
        let wait = process.backoff.fail();
        process.start_at = Some(Instant::now() + wait);
        for &stage in &process.stages {
            self.counters[stage].clear();
            self.counters[stage].add(StageCounter::Restarts, 1);
        }
        remove_dead_nodes(&self.folder.names());
        self.observer.restarting(stage, &failure.to_string(), wait);
    }

    /// Starts the processes whose time has come.
    fn start_again(&mut self) {
        for place in 0..self.processes.len() {
            let process = &mut self.processes[place];
            if self.stopping.is_some() {
                process.start_at = None;
            }
            if process.start_at.is_none_or(|start| start > Instant::now() && self.draining.is_none()) {
                continue;
            }
            process.start_at = None;
            let name = process.name.clone();
            // What was in use when it died may be free by now.
            remove_dead_nodes(&self.folder.names());
            match self.start(&name, place) {
                Ok((child, stdin)) => {
                    let process = &mut self.processes[place];
                    (process.child, process.stdin) = (child, stdin);
                    (process.heard, process.ended) = (Instant::now(), false);
                    process.running =
                        process.stages.iter().map(|&stage| self.pipeline.stages[stage].name.clone()).collect();
                    process.backoff.start();
                    if self.draining.is_some() {
                        process.tell(&Told::Drain);
                    }
                }
                Err(failure) => self.fail(RunError::of_stage(&name, failure)),
            }
        }
    }

    /// Brings a live run to its end.
    fn drain(&mut self) {
        match &mut self.draining {
            None => {
                self.draining = Some(Drain::new(Instant::now()));
                self.processes
                    .iter_mut()
                    .filter(|process| !process.ended)
                    .for_each(|process| process.tell(&Told::Drain));
            }
            Some(drain) => {
                if drain.is_stuck(&self.counters, self.awake_for, Instant::now()) {
                    let stages = self.not_ended();
                    self.fail(RunError::of_run(Failure::Stuck { seconds: STUCK_AFTER.as_secs_f64(), stages }));
                }
            }
        }
    }

    /// The stages that have not ended, each with how many messages wait in it.
    fn not_ended(&self) -> Vec<String> {
        let stages = self.pipeline.stages.iter().zip(&self.counters);
        let running = stages.filter(|(_, counters)| counters.state() != StageState::Ended);
        let waiting = |counters: &StageCounters| -> u64 {
            (0..counters.wires()).map(|wire| counters.get_wire(wire, WireCounter::Waiting)).sum()
        };
        running.map(|(stage, counters)| format!("`{}` ({} messages wait)", stage.name, waiting(counters))).collect()
    }

    fn note_words(&mut self, process: usize, words: Said) {
        let mut ended = |stage: &str| self.processes[process].running.retain(|running| running != stage);
        match words {
            Said::Alive => {}
            Said::Progress { stage, share, log_time } => self.observer.progress(&stage, share, log_time),
            Said::Done { report } => {
                ended(&report.name);
                self.reports.insert(report.name.clone(), report);
            }
            Said::Stopped { stage } => ended(&stage),
            Said::Failed { stage, failure } => {
                ended(&stage);
                // One that hangs hears nothing any more.
                let is_deaf = matches!(failure, Failure::Hung { .. });
                self.note_failure(process, stage, failure, is_deaf);
            }
        }
    }

    /// Kills a process that does not say that it is alive, as one does that was stopped as a whole, or that has taken
    /// more memory than it may.
    fn look_at_processes(&mut self) {
        let awake_for = self.awake_for;
        if self.stopping.is_some() {
            return;
        }
        let living =
            self.processes.iter().enumerate().filter(|(_, process)| !process.ended && process.failure.is_none());
        let troubled =
            living.filter_map(|(place, process)| Some((place, process.trouble(self.pipeline, awake_for)?))).next();
        if let Some((place, failure)) = troubled {
            let process = &self.processes[place];
            let stage = process.running.first().unwrap_or(&process.name).clone();
            self.note_failure(place, stage, failure, true);
        }
    }

    /// Notes why the run fails: the first reason, but for a lost link, which is the trace that a better one leaves.
    fn fail(&mut self, error: RunError) {
        let is_trace = |failure: &Failure| matches!(failure, Failure::Link(link) if *link != LinkError::Stopped);
        match &mut self.stopping {
            None => self.stopping = Some(Stopping { error, since: Instant::now(), told: false }),
            Some(stopping) if !stopping.told && is_trace(&stopping.error.failure) && !is_trace(&error.failure) => {
                stopping.error = error;
            }
            Some(_) => {}
        }
    }

    /// Tells the processes to stop once the reason is known, and kills those that do not.
    fn stop(&mut self) {
        let Some(stopping) = &mut self.stopping else { return };
        let is_link = matches!(stopping.error.failure, Failure::Link(_));
        if !stopping.told && (!is_link || stopping.since.elapsed() > CAUSE_TIMEOUT) {
            stopping.told = true;
            stopping.since = Instant::now();
            let words = Told::Stop { reason: stopping.error.to_string() };
            self.processes.iter_mut().filter(|process| !process.ended).for_each(|process| process.tell(&words));
        }
        if stopping.told && stopping.since.elapsed() > STOP_TIMEOUT {
            for process in self.processes.iter_mut().filter(|process| !process.ended) {
                let _ = process.child.kill();
            }
        }
    }

    fn result(self) -> Result<RunReport, RunError> {
        // They end with the outputs of the processes.
        self.readers.into_iter().for_each(|reader| drop(reader.join()));
        if let Some(stopping) = self.stopping {
            return Err(stopping.error);
        }
        let mut reports = self.reports;
        let stages = self.pipeline.stages.iter().map(|stage| reports.remove(&stage.name).unwrap_or_default());
        Ok(RunReport { stages: stages.collect() })
    }
}

/// Removes what killed processes of a run hold in shared memory, so that others can take their place. Should it fail, the
/// process that takes the place says what is in its way.
fn remove_dead_nodes(names: &RunNames) {
    if let Ok(node) = names.node::<ipc::Service>() {
        node.try_cleanup_dead_nodes();
    }
}

/// The finest level of events that somebody listens to, if it is finer than that of warnings.
fn told_beyond_warnings() -> Option<&'static str> {
    let levels = [
        ("trace", event_enabled!(Level::TRACE)),
        ("debug", event_enabled!(Level::DEBUG)),
        ("info", event_enabled!(Level::INFO)),
    ];
    levels.into_iter().find_map(|(level, is_told)| is_told.then_some(level))
}
