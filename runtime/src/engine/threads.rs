//! The engine `threads`: one thread per stage, with links over shared memory.

use super::links::{Links, counters_shape};
use super::stage_thread::{Event, StageThread, send_event};
use super::{Failure, Observer, RunError, RunReport, StageReport};
use crate::link::{Control, LinkError, RunNames};
use crate::link::{SharedCounters, StageState};
use crate::pipeline::Pipeline;
use iceoryx2::service::Service;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, OnceLock};
use std::thread;
use std::time::Duration;

/// The maximum time between two checks whether the run should stop.
const STOP_INTERVAL: Duration = Duration::from_millis(50);

/// Runs a pipeline, with its services under the given names.
pub(super) fn run<S: Service + 'static>(
    pipeline: &Pipeline,
    names: &RunNames,
    observer: &dyn Observer,
) -> Result<RunReport, RunError> {
    let counters = SharedCounters::new(&counters_shape(pipeline));
    (0..pipeline.stages.len()).for_each(|stage| counters.stage(stage).set_state(StageState::Starting));
    let links = Links::new(pipeline, names, &counters);
    let (control, stop_reason) = (Arc::new(Control::default()), OnceLock::new());
    let (sender, receiver) = channel();
    thread::scope(|scope| {
        for stage in 0..pipeline.stages.len() {
            let (sender, links, stop_reason) = (sender.clone(), &links, &stop_reason);
            let control = Arc::clone(&control);
            let (name, events) = (pipeline.stages[stage].name.clone(), sender.clone());
            let work = move || StageThread::<S>::start(links, stage, control, stop_reason, &sender);
            if let Err(error) = thread::Builder::new().name(name).spawn_scoped(scope, work) {
                send_event(&events, Event::Stop { reason: format!("cannot start a thread: {error}") });
            }
        }
        drop(sender);
        let stop = |error: &RunError| {
            stop_reason.get_or_init(|| error.to_string());
            control.stop(&counters);
        };
        supervise(pipeline, &receiver, &stop, observer)
    })
}

/// Waits for all stages. When one fails, stops the others.
fn supervise(
    pipeline: &Pipeline,
    events: &Receiver<Event>,
    stop_others: &dyn Fn(&RunError),
    observer: &dyn Observer,
) -> Result<RunReport, RunError> {
    let name = |stage: usize| pipeline.stages[stage].name.clone();
    let mut reports: Vec<StageReport> = vec![StageReport::default(); pipeline.stages.len()];
    let mut first_error: Option<RunError> = None;
    let stop = |first_error: &mut Option<RunError>, error: RunError| stop_others(first_error.get_or_insert(error));
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
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => break,
        }
        // After every event: a fast source reports its progress without a pause.
        if first_error.is_none() && observer.should_stop() {
            stop(&mut first_error, RunError::of_run(Failure::Interrupted));
        }
    }
    match first_error {
        Some(error) => Err(error),
        None => Ok(RunReport { stages: reports }),
    }
}
