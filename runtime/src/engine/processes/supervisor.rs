//! The supervisor: starts, watches and stops the processes of a run, and cleans up after them.

use super::Launch;
use super::backoff::Backoff;
use super::drain::{Drain, STUCK_AFTER};
use super::event::{Event, read_reports};
use super::process::Process;
use super::protocol::{ProcessReport, SupervisorCommand};
use super::spawn::spawn;
use super::suspend_detector::SuspendDetector;
use super::system::describe_exit;
use crate::engine::run_folder::{RunFolder, clean_after};
use crate::engine::{Failure, Observer, RunError, RunReport, StageReport};
use crate::link::{LinkError, RunNames, StageCounter, StageCounters, StageState, WireCounter};
use crate::pipeline::{Mode, Pipeline, Restart};
use iceoryx2::service::ipc;
use std::collections::BTreeMap;
use std::io::{self, Write};
use std::process::{Child, ChildStdin};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::{Duration, Instant};

/// The maximum time between two checks whether the run should stop.
const STOP_INTERVAL: Duration = Duration::from_millis(50);
/// The time that a process has to close its outputs before it is killed.
const STOP_TIMEOUT: Duration = Duration::from_secs(10);
/// The time to wait for the cause of a lost link: a process that dies breaks the links of others, whose errors may be
/// reported before its death is noticed.
const CAUSE_TIMEOUT: Duration = Duration::from_millis(1500);

/// A failed run that is being stopped.
struct Stopping {
    error: RunError,
    since: Instant,
    /// Whether the command to stop was sent.
    was_sent: bool,
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
    // Senders wait for stages that are starting.
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
        suspend_detector: SuspendDetector::new(Instant::now()),
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
    /// The drain of a live run, once its end was requested.
    draining: Option<Drain>,
    suspend_detector: SuspendDetector,
    /// For how long this process has been running without suspension, at the last check.
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
                last_report: Instant::now(),
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

    /// Starts the process called `name`, with the index `process`, and reads its reports.
    fn start(&mut self, name: &str, process: usize) -> Result<(Child, Option<ChildStdin>), Failure> {
        let mut child = spawn(self.launch, self.folder.path(), name)?;
        if let Some(stdout) = child.stdout.take() {
            let events = self.events.clone();
            let reader = thread::Builder::new().spawn(move || read_reports(process, stdout, &events));
            self.readers.push(reader.map_err(|error| {
                // Without a reader of its reports it ends by itself, too.
                let _ = child.kill().and_then(|()| child.wait());
                Failure::Process(format!("cannot start a thread: {error}"))
            })?);
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
            self.awake_for = self.suspend_detector.check(Instant::now());
            if self.stopping.is_none() && self.observer.should_stop() {
                match self.pipeline.mode {
                    Mode::Replay => self.fail(RunError::of_run(Failure::Interrupted)),
                    Mode::Live => self.drain(),
                }
            }
            self.check_processes();
            self.restart_due();
            self.stop();
        }
    }

    fn note(&mut self, event: Event) {
        match event {
            // A closed standard error is no reason to end the run.
            Event::Printed { line } => drop(writeln!(io::stderr(), "{line}")),
            Event::Report { process, report } => {
                self.processes[process].last_report = Instant::now();
                self.note_report(process, report);
            }
            Event::Closed { process } => self.note_end(process),
        }
    }

    /// Handles the end of a process.
    fn note_end(&mut self, index: usize) {
        let process = &mut self.processes[index];
        // A process that closes standard output is about to end; if it went on, it would be killed by the stop.
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
        // What cannot be removed is left to `clean`.
        let _ = clean_after(self.processes[index].child.id());
        match self.is_restarted(index) {
            true => self.schedule_restart(index, &stage, &failure),
            false => self.fail(RunError::of_stage(&stage, failure)),
        }
    }

    /// Whether a process is restarted if it fails.
    fn is_restarted(&self, index: usize) -> bool {
        self.processes[index].restarts && self.stopping.is_none() && self.draining.is_none()
    }

    /// Handles a failed stage, or a process that has to be killed: the process is restarted, or the run fails.
    fn note_failure(&mut self, index: usize, stage: String, failure: Failure, is_unresponsive: bool) {
        let is_restarted = self.is_restarted(index);
        let process = &mut self.processes[index];
        if is_restarted || is_unresponsive {
            let _ = process.child.kill();
        }
        match is_restarted {
            true => drop(process.failure.get_or_insert((stage, failure))),
            false => self.fail(RunError::of_stage(&stage, failure)),
        }
    }

    /// Removes what a process has left, and schedules its restart.
    fn schedule_restart(&mut self, index: usize, stage: &str, failure: &Failure) {
        let process = &mut self.processes[index];
        let wait = process.backoff.fail();
        process.start_at = Some(Instant::now() + wait);
        for &stage in &process.stages {
            self.counters[stage].clear();
            self.counters[stage].add(StageCounter::Restarts, 1);
        }
        remove_dead_nodes(&self.folder.names());
        self.observer.restarting(stage, &failure.to_string(), wait);
    }

    /// Restarts the processes whose delay is over.
    fn restart_due(&mut self) {
        for index in 0..self.processes.len() {
            let process = &mut self.processes[index];
            if self.stopping.is_some() {
                process.start_at = None;
            }
            if process.start_at.is_none_or(|start| start > Instant::now() && self.draining.is_none()) {
                continue;
            }
            process.start_at = None;
            let name = process.name.clone();
            // Resources that were in use when it died may be free by this time.
            remove_dead_nodes(&self.folder.names());
            match self.start(&name, index) {
                Ok((child, stdin)) => {
                    let process = &mut self.processes[index];
                    (process.child, process.stdin) = (child, stdin);
                    (process.last_report, process.ended) = (Instant::now(), false);
                    process.running =
                        process.stages.iter().map(|&stage| self.pipeline.stages[stage].name.clone()).collect();
                    process.backoff.start();
                    if self.draining.is_some() {
                        process.send(&SupervisorCommand::Drain);
                    }
                }
                Err(failure) => self.fail(RunError::of_stage(&name, failure)),
            }
        }
    }

    /// Ends a live run: stops its sources at the first call, and checks for progress afterwards.
    fn drain(&mut self) {
        match &mut self.draining {
            None => {
                self.draining = Some(Drain::new(Instant::now()));
                self.processes
                    .iter_mut()
                    .filter(|process| !process.ended)
                    .for_each(|process| process.send(&SupervisorCommand::Drain));
            }
            Some(drain) => {
                if drain.is_stuck(&self.counters, self.awake_for, Instant::now()) {
                    let stages = self.unfinished_stages();
                    self.fail(RunError::of_run(Failure::Stuck { seconds: STUCK_AFTER.as_secs_f64(), stages }));
                }
            }
        }
    }

    /// The stages that have not ended, each with the number of its pending messages.
    fn unfinished_stages(&self) -> Vec<String> {
        let stages = self.pipeline.stages.iter().zip(&self.counters);
        let running = stages.filter(|(_, counters)| counters.state() != StageState::Ended);
        let waiting = |counters: &StageCounters| -> u64 {
            (0..counters.wires()).map(|wire| counters.get_wire(wire, WireCounter::Waiting)).sum()
        };
        running.map(|(stage, counters)| format!("`{}` ({} pending messages)", stage.name, waiting(counters))).collect()
    }

    fn note_report(&mut self, process: usize, report: ProcessReport) {
        let mut ended = |stage: &str| self.processes[process].running.retain(|running| running != stage);
        match report {
            ProcessReport::Alive => {}
            ProcessReport::Progress { stage, share, log_time } => self.observer.progress(&stage, share, log_time),
            ProcessReport::Done { stage_report: report } => {
                ended(&report.name);
                self.reports.insert(report.name.clone(), report);
            }
            ProcessReport::Stopped { stage } => ended(&stage),
            ProcessReport::Failed { stage, failure } => {
                ended(&stage);
                // A stage that hangs does not react to a command.
                let is_unresponsive = matches!(failure, Failure::Hung { .. });
                self.note_failure(process, stage, failure, is_unresponsive);
            }
        }
    }

    /// Kills a process that sends no reports, for example because it was suspended, or that exceeds its memory limit. Ends the run
    /// if its folder is gone.
    fn check_processes(&mut self) {
        let awake_for = self.awake_for;
        if self.stopping.is_some() {
            return;
        }
        // Without it, processes that are starting would wait for each other for ever.
        if !self.folder.path().exists() {
            self.fail(RunError::of_run(Failure::NoFolder(self.folder.path().display().to_string())));
            return;
        }
        let living =
            self.processes.iter().enumerate().filter(|(_, process)| !process.ended && process.failure.is_none());
        let failed =
            living.filter_map(|(index, process)| Some((index, process.check(self.pipeline, awake_for)?))).next();
        if let Some((index, failure)) = failed {
            let process = &self.processes[index];
            let stage = process.running.first().unwrap_or(&process.name).clone();
            self.note_failure(index, stage, failure, true);
        }
    }

    /// Records the cause of a failed run: the first one, except that a lost link, which is only a symptom, is replaced.
    fn fail(&mut self, error: RunError) {
        let is_symptom = |failure: &Failure| matches!(failure, Failure::Link(link) if *link != LinkError::Stopped);
        match &mut self.stopping {
            None => self.stopping = Some(Stopping { error, since: Instant::now(), was_sent: false }),
            Some(stopping)
                if !stopping.was_sent && is_symptom(&stopping.error.failure) && !is_symptom(&error.failure) =>
            {
                stopping.error = error;
            }
            Some(_) => {}
        }
    }

    /// Sends the command to stop once the cause is known, and kills the processes that do not end in time.
    fn stop(&mut self) {
        let Some(stopping) = &mut self.stopping else { return };
        let is_link = matches!(stopping.error.failure, Failure::Link(_));
        if !stopping.was_sent && (!is_link || stopping.since.elapsed() > CAUSE_TIMEOUT) {
            stopping.was_sent = true;
            stopping.since = Instant::now();
            let command = SupervisorCommand::Stop { reason: stopping.error.to_string() };
            self.processes.iter_mut().filter(|process| !process.ended).for_each(|process| process.send(&command));
        }
        if stopping.was_sent && stopping.since.elapsed() > STOP_TIMEOUT {
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

/// Removes the resources of killed processes in shared memory, so that they can be restarted. A failure is ignored: the
/// restarted process will report what it lacks.
fn remove_dead_nodes(names: &RunNames) {
    if let Ok(node) = names.node::<ipc::Service>() {
        node.try_cleanup_dead_nodes();
    }
}
