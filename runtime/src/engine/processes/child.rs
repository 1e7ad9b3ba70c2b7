//! One process of a run: its stages in threads, and its words with the supervisor.

use super::words::{Said, Told, say};
use crate::engine::live_links::LiveLinks;
use crate::engine::live_stage::LiveStage;
use crate::engine::plan::Plan;
use crate::engine::run_folder::RunFolder;
use crate::engine::stage_thread::{Event, StageThread, tell};
use crate::engine::{Failure, RunError};
use crate::link::board::StageBoard;
use crate::link::shared::{Activity, LinkError, WakeEvents, Waker};
use crate::pipeline::{Mode, Pipeline};
use crate::stage::Registry;
use iceoryx2::service::ipc::Service;
use std::io::{self, BufRead, Write};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
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
    let board = folder.board(&pipeline).map_err(|error| error.to_string())?;
    let boards: Vec<StageBoard> = (0..pipeline.stages.len()).map(|stage| board.stage(stage)).collect();
    let drain = Arc::new(AtomicBool::new(false));
    Process { pipeline: &pipeline, folder: &folder, stages: &stages, boards: &boards, drain }.run(supervisor);
    Ok(())
}

/// The way to the supervisor: standard output, locked for a line at a time, as stages may print. That it is gone is seen at standard input, so a failure to write is no news.
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
    /// What each stage of the run shows of itself.
    boards: &'a [StageBoard],
    /// Set when a live run is to come to its end.
    drain: Arc<AtomicBool>,
}

impl Process<'_> {
    fn run(&self, mut supervisor: Supervisor<'_>) {
        let (plan, names) = (Plan::new(self.pipeline), self.folder.names());
        let stop_reason = OnceLock::new();
        let (sender, receiver) = channel();
        let wakers = names.node::<Service>().and_then(|node| {
            let wakers = self.stages.iter().map(|&stage| plan.waker(&node, &names, self.pipeline, stage));
            Ok((wakers.collect::<Result<Vec<_>, LinkError>>()?, node))
        });
        let (wakers, _node) = match wakers {
            Ok(wakers) => wakers,
            Err(error) => {
                let stage = self.name(self.stages[0]);
                return supervisor.tell(&Said::Failed { stage, failure: error.into() });
            }
        };
        let activities: Vec<Activity> = self.stages.iter().map(|_| Activity::default()).collect();
        listen(sender.clone());
        thread::scope(|scope| {
            for (&stage, activity) in self.stages.iter().zip(&activities) {
                let (sender, names, plan, stop_reason) = (sender.clone(), &names, &plan, &stop_reason);
                let (pipeline, boards, drain) = (self.pipeline, self.boards, Arc::clone(&self.drain));
                let activity = activity.clone();
                scope.spawn(move || {
                    let connected = match pipeline.mode {
                        Mode::Replay => {
                            let board = Some(boards[stage].clone());
                            StageThread::<Service>::connect(pipeline, plan, names, stage, activity, board, &sender)
                                .map(|thread| thread.run(stop_reason))
                        }
                        Mode::Live => {
                            let links = LiveLinks { pipeline, plan, names, boards };
                            LiveStage::<Service>::connect(&links, stage, activity, drain, &sender)
                                .map(|thread| thread.run(stop_reason))
                        }
                    };
                    if let Err(failure) = connected {
                        tell(&sender, Event::Ended { stage, result: Err(failure) });
                    }
                });
            }
            drop(sender);
            self.report(&mut supervisor, &wakers, &activities, &receiver, &stop_reason);
        });
    }

    /// Tells the supervisor how the stages go until all have ended.
    fn report(
        &self,
        supervisor: &mut Supervisor<'_>,
        wakers: &[Waker<Service>],
        activities: &[Activity],
        events: &Receiver<Event>,
        stop_reason: &OnceLock<String>,
    ) {
        let mut running = self.stages.len();
        let mut hung = false;
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
                    self.drain.store(true, Ordering::Relaxed);
                    wakers.iter().for_each(|waker| drop(waker.wake(WakeEvents::DATA)));
                    None
                }
                Ok(Event::Stop { reason }) => {
                    stop_reason.get_or_init(|| reason);
                    None
                }
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => None,
            };
            if stop_reason.get().is_some() {
                // Again and again, for a stage that was not listening yet. One that has ended need not be woken.
                wakers.iter().for_each(|waker| drop(waker.wake(WakeEvents::STOP)));
            }
            if !hung && let Some(words) = self.hung(activities) {
                hung = true;
                supervisor.tell(&words);
            }
            match words {
                Some(words) => supervisor.tell(&words),
                None => supervisor.tell_alive(),
            }
        }
    }

    /// The first stage that has worked on one message for longer than the pipeline allows.
    fn hung(&self, activities: &[Activity]) -> Option<Said> {
        let longest = self.pipeline.stall_timeout?;
        let is_hung = |activity: &Activity| activity.working_for().is_some_and(|time| time > longest);
        let place = activities.iter().position(is_hung)?;
        let failure = Failure::Hung { seconds: longest.as_secs_f64() };
        Some(Said::Failed { stage: self.name(self.stages[place]), failure })
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
