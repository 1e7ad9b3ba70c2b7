//! The supervisor: starts the processes of a run, hears how they go, stops them, and removes what they leave.

use super::Launch;
use super::words::{Said, Told, say};
use crate::engine::run_folder::RunFolder;
use crate::engine::{Failure, Observer, RunError, RunReport, StageReport};
use crate::link::shared::LinkError;
use crate::pipeline::Pipeline;
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::{Child, ChildStdin, ChildStdout, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::{Duration, Instant};

/// At least so often the observer is asked whether the run should stop.
const STOP_INTERVAL: Duration = Duration::from_millis(50);
/// So long may a process take to close its outputs before it is killed.
const STOP_TIMEOUT: Duration = Duration::from_secs(10);
/// A process that dies takes the links of others with it, and their complaints may come before the news of its death.
/// So long the supervisor waits for a better reason.
const CAUSE_TIMEOUT: Duration = Duration::from_millis(1500);

/// What happens to a process.
enum Event {
    Said {
        process: usize,
        words: Said,
    },
    /// It printed something that is no word for the supervisor.
    Printed {
        line: String,
    },
    /// Its output has ended: it has died, or is about to.
    Silent {
        process: usize,
    },
}

/// A process, as the supervisor knows it.
struct Process {
    name: String,
    child: Child,
    stdin: Option<ChildStdin>,
    /// The stages that have not ended.
    running: Vec<String>,
    heard: Instant,
    ended: bool,
}

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
    folder.write_pipeline(&pipeline.to_toml()).map_err(of_run)?;
    let (sender, receiver) = channel();
    let mut supervisor = Supervisor {
        pipeline,
        observer,
        processes: Vec::new(),
        reports: BTreeMap::new(),
        stopping: None,
        readers: Vec::new(),
    };
    supervisor.start_all(launch, &folder, &sender);
    drop(sender);
    supervisor.wait_for_all(&receiver);
    let result = supervisor.result();
    let removed = folder.remove().map_err(of_run);
    result.and_then(|report| removed.map(|()| report))
}

struct Supervisor<'a> {
    pipeline: &'a Pipeline,
    observer: &'a dyn Observer,
    processes: Vec<Process>,
    reports: BTreeMap<String, StageReport>,
    stopping: Option<Stopping>,
    readers: Vec<thread::JoinHandle<()>>,
}

impl Supervisor<'_> {
    fn start_all(&mut self, launch: &Launch, folder: &RunFolder, events: &Sender<Event>) {
        for name in self.pipeline.processes() {
            let stages = self.pipeline.stages_of(&name);
            let running: Vec<String> = stages.iter().map(|&stage| self.pipeline.stages[stage].name.clone()).collect();
            let child = Command::new(&launch.program)
                .args(&launch.arguments)
                .arg(folder.path())
                .arg(&name)
                .stdin(Stdio::piped())
                .stdout(Stdio::piped())
                // An interrupt from the terminal is the supervisor's: it tells the others.
                .process_group(0)
                .spawn();
            match child {
                Ok(mut child) => {
                    let process = self.processes.len();
                    if let Some(stdout) = child.stdout.take() {
                        let events = events.clone();
                        self.readers.push(thread::spawn(move || listen(process, stdout, &events)));
                    }
                    let stdin = child.stdin.take();
                    let heard = Instant::now();
                    self.processes.push(Process { name, child, stdin, running, heard, ended: false });
                }
                Err(error) => {
                    let text = format!("cannot start {}: {error}", launch.program.display());
                    let stage = running.first().cloned().unwrap_or(name);
                    return self.fail(RunError::of_stage(&stage, Failure::Process(text)));
                }
            }
        }
    }

    /// Waits until every process has ended. When one fails, stops the others.
    fn wait_for_all(&mut self, events: &Receiver<Event>) {
        while self.processes.iter().any(|process| !process.ended) {
            match events.recv_timeout(STOP_INTERVAL) {
                Ok(event) => self.note(event),
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => {}
            }
            if self.stopping.is_none() && self.observer.should_stop() {
                self.fail(RunError::of_run(Failure::Interrupted));
            }
            self.look_at_processes();
            self.stop();
        }
    }

    fn note(&mut self, event: Event) {
        match event {
            Event::Printed { line } => eprintln!("{line}"),
            Event::Said { process, words } => {
                self.processes[process].heard = Instant::now();
                self.note_words(process, words);
            }
            Event::Silent { process } => {
                let process = &mut self.processes[process];
                // Nobody closes standard output and goes on; if one did, it would be killed by the stop.
                let status = process.child.wait();
                process.ended = true;
                if let Some(stage) = process.running.first() {
                    let how = status.map_or_else(|error| error.to_string(), describe);
                    let together = match process.running.as_slice() {
                        [_, others @ ..] if !others.is_empty() => format!(" (it ran {} as well)", others.join(", ")),
                        _ => String::new(),
                    };
                    let error = RunError::of_stage(&stage.clone(), Failure::Ended(how + &together));
                    self.fail(error);
                }
            }
        }
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
                if matches!(failure, Failure::Hung { .. }) {
                    // It hears nothing any more.
                    let _ = self.processes[process].child.kill();
                }
                self.fail(RunError::of_stage(&stage, failure));
            }
        }
    }

    /// Kills a process that does not say that it is alive, as one does that was stopped as a whole, or that has taken
    /// more memory than it may.
    fn look_at_processes(&mut self) {
        if self.stopping.is_some() {
            return;
        }
        let Pipeline { stall_timeout, memory_limit, .. } = *self.pipeline;
        let trouble = |process: &Process| {
            if let Some(longest) = stall_timeout.filter(|longest| process.heard.elapsed() > *longest) {
                return Some(Failure::Hung { seconds: longest.as_secs_f64() });
            }
            let limit = memory_limit?;
            let taken = memory_of(process.child.id()).filter(|taken| *taken > limit)?;
            Some(Failure::Memory { taken, limit })
        };
        let living = self.processes.iter_mut().filter(|process| !process.ended);
        let troubled = living.filter_map(|process| Some((trouble(process)?, process))).next();
        if let Some((failure, process)) = troubled {
            let _ = process.child.kill();
            let stage = process.running.first().unwrap_or(&process.name).clone();
            self.fail(RunError::of_stage(&stage, failure));
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
            for process in self.processes.iter_mut().filter(|process| !process.ended) {
                // One that cannot be told has died, which is heard in another way.
                let _ = process.stdin.as_mut().map(|stdin| say(stdin, &words));
            }
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

/// Hears what a process says until it is silent.
fn listen(process: usize, stdout: ChildStdout, events: &Sender<Event>) {
    for line in BufReader::new(stdout).lines() {
        let Ok(line) = line else { break };
        let event = match serde_json::from_str(&line) {
            Ok(words) => Event::Said { process, words },
            Err(_) => Event::Printed { line },
        };
        let _ = events.send(event);
    }
    let _ = events.send(Event::Silent { process });
}

/// The memory that a process has for itself alone, bytes: that of its links is not counted.
fn memory_of(process: u32) -> Option<u64> {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let kilobytes = |name: &str| {
        let line = status.lines().find_map(|line| line.strip_prefix(name))?;
        line.trim_start_matches(':').split_whitespace().next()?.parse::<u64>().ok()
    };
    Some(1024 * (kilobytes("RssAnon")? + kilobytes("VmSwap").unwrap_or(0)))
}

/// How a process ended, to follow "which".
fn describe(status: ExitStatus) -> String {
    match (status.signal(), status.code()) {
        (Some(signal), _) => {
            let (name, hint) = match signal {
                4 => (" (SIGILL)", ""),
                6 => (" (SIGABRT)", "; it gave up, as programs do that get no memory"),
                7 => (" (SIGBUS)", "; is /dev/shm full?"),
                8 => (" (SIGFPE)", ""),
                9 => (" (SIGKILL)", "; the system does so when memory runs out"),
                11 => (" (SIGSEGV)", ""),
                15 => (" (SIGTERM)", ""),
                25 => (" (SIGXFSZ)", "; a file has become larger than it may"),
                _ => ("", ""),
            };
            format!("was ended by signal {signal}{name}{hint}")
        }
        (None, Some(code)) => format!("ended with status {code}; what it said stands above"),
        (None, None) => "ended".to_owned(),
    }
}
