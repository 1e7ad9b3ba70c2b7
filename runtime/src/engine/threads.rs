//! The engine `threads`: a thread a stage, with links over shared memory.

use super::plan::Plan;
use super::stage_thread::{Event, StageThread, tell};
use super::{Failure, Observer, RunError, RunReport, StageReport};
use crate::link::shared::{Activity, LinkError, RunNames, WakeEvents, Waker};
use crate::pipeline::Pipeline;
use iceoryx2::service::Service;
use std::sync::OnceLock;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

/// At least so often the run asks its observer whether it should stop.
const STOP_INTERVAL: Duration = Duration::from_millis(50);

/// Runs a pipeline with services of the given names.
pub(super) fn run<S: Service + 'static>(
    pipeline: &Pipeline,
    names: &RunNames,
    observer: &dyn Observer,
) -> Result<RunReport, RunError> {
    let plan = Plan::new(pipeline);
    let stop_reason = OnceLock::new();
    let node = names.node::<S>().map_err(RunError::of_run)?;
    // Made before the stages, so that a stage that fails at once finds the others stoppable.
    let wakers: Vec<Waker<S>> = (0..pipeline.stages.len())
        .map(|stage| plan.waker(&node, names, pipeline, stage))
        .collect::<Result<_, LinkError>>()
        .map_err(RunError::of_run)?;
    let (sender, receiver) = channel();
    thread::scope(|scope| {
        for stage in 0..pipeline.stages.len() {
            let (sender, names, plan, stop_reason) = (sender.clone(), names, &plan, &stop_reason);
            scope.spawn(move || {
                match StageThread::<S>::connect(pipeline, plan, names, stage, Activity::default(), None, &sender) {
                    Ok(thread) => thread.run(stop_reason),
                    Err(failure) => tell(&sender, Event::Ended { stage, result: Err(failure) }),
                }
            });
        }
        drop(sender);
        supervise(pipeline, &wakers, &receiver, &stop_reason, observer)
    })
}

/// Waits for all stages. When one fails, stops the others.
fn supervise<S: Service>(
    pipeline: &Pipeline,
    wakers: &[Waker<S>],
    events: &Receiver<Event>,
    stop_reason: &OnceLock<String>,
    observer: &dyn Observer,
) -> Result<RunReport, RunError> {
    let name = |stage: usize| pipeline.stages[stage].name.clone();
    let mut reports: Vec<StageReport> = vec![StageReport::default(); pipeline.stages.len()];
    let mut first_error: Option<RunError> = None;
    let stop = |first_error: &mut Option<RunError>, error: RunError| {
        let error = first_error.get_or_insert(error);
        stop_reason.get_or_init(|| error.to_string());
        // A stage that has ended cannot be woken and need not be.
        wakers.iter().for_each(|waker| drop(waker.wake(WakeEvents::STOP)));
    };
    loop {
        match events.recv_timeout(STOP_INTERVAL) {
            Ok(Event::Progress { stage, share, log_time }) => observer.progress(&name(stage), share, log_time),
            Ok(Event::Drain) => {}
            Ok(Event::Stop { reason }) => stop(&mut first_error, RunError::of_run(Failure::Process(reason))),
            Ok(Event::Ended { stage, result: Ok(report) }) => reports[stage] = report,
            Ok(Event::Ended { result: Err(Failure::Link(LinkError::Stopped)), .. }) => {}
            Ok(Event::Ended { stage, result: Err(failure) }) => {
                stop(&mut first_error, RunError::of_stage(&name(stage), failure));
            }
            Err(RecvTimeoutError::Timeout) => {
                if first_error.is_some() {
                    // A stage that was not listening yet when the stop was sent gets it again.
                    wakers.iter().for_each(|waker| drop(waker.wake(WakeEvents::STOP)));
                }
            }
            Err(RecvTimeoutError::Disconnected) => break,
        }
        // After every event, as a fast source tells of its progress without a pause.
        if first_error.is_none() && observer.should_stop() {
            stop(&mut first_error, RunError::of_run(Failure::Interrupted));
        }
    }
    match first_error {
        Some(error) => Err(error),
        None => Ok(RunReport { stages: reports }),
    }
}
