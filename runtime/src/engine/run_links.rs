//! The links of a run, for stages that forward their messages and for programs outside of the run.

use super::run_folder::RunningRun;
use super::runner::readers;
use super::watch::WatchedLink;
use crate::message::Message;
use crate::pipeline::Pipeline;
use crate::stage::{LinkView, RunLink, RunLinks, StageError};

/// The links of a running pipeline, for a stage that forwards their messages.
pub fn watch_links(run: &RunningRun, pipeline: &Pipeline) -> RunLinks {
    let ports: Vec<(usize, usize)> = readers(pipeline).into_keys().collect();
    let link = |&(stage, port): &(usize, usize)| {
        let spec = &pipeline.stages[stage];
        let output = &spec.kind.outputs[port];
        let ros_type = output.port_type.name().to_owned();
        let definition = spec.kind.definition(&ros_type).unwrap_or_default().to_owned();
        RunLink { stage: spec.name.clone(), output: output.name.to_owned(), ros_type, definition }
    };
    let links: Vec<RunLink> = ports.iter().map(link).collect();
    let (run, pipeline) = (run.clone(), pipeline.clone());
    RunLinks::new(links, move |link| {
        let Some(&(stage, port)) = ports.get(link) else {
            return Err(StageError::new("observe a link", format!("the run has no link {link}")));
        };
        let opened = WatchedLink::open_now(&run, &pipeline, stage, port);
        let opened = opened.map_err(|error| StageError::new("observe a link", error))?;
        Ok(opened.map(|link| Box::new(link) as Box<dyn LinkView>))
    })
}

impl LinkView for WatchedLink {
    fn take(&mut self, take: &mut dyn FnMut(Message)) -> Result<(), StageError> {
        let taken = Self::take(self, |_, message| take(message));
        taken.map_err(|error| StageError::new("observe a link", error))
    }

    fn missed(&self) -> u64 {
        Self::missed(self)
    }
}
