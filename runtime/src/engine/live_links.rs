//! The ends of live links, as the pipeline of a run has them.

use super::plan::Plan;
use crate::link::board::StageBoard;
use crate::link::live::{LiveReader, LiveReceiver, LiveSender, Pause, PortBoard, ReaderEnd};
use crate::link::shared::{LinkError, RunNames};
use crate::message::MessageHeader;
use crate::pipeline::Pipeline;
use crate::stage::{OutputSink, StageError};
use iceoryx2::node::Node;
use iceoryx2::service::Service;
use std::cell::{RefCell, RefMut};
use std::rc::Rc;

/// What the ends of all links of a run are made from.
pub(super) struct LiveLinks<'a> {
    pub(super) pipeline: &'a Pipeline,
    pub(super) plan: &'a Plan,
    pub(super) names: &'a RunNames,
    /// For each stage.
    pub(super) boards: &'a [StageBoard],
}

impl LiveLinks<'_> {
    /// The wires of a stage.
    pub(super) fn receivers<S: Service + 'static>(
        &self,
        node: &Node<S>,
        stage: usize,
    ) -> Result<Vec<LiveReceiver<S>>, LinkError> {
        let Self { pipeline, plan, names, boards } = *self;
        let spec = &pipeline.stages[stage];
        let receiver = |(wire, input): (usize, &crate::pipeline::Wire)| {
            let (from, port) = (input.from_stage, input.from_port);
            let reader = ReaderEnd {
                board: boards[stage].clone(),
                wire,
                depth: spec.depth,
                number: plan.reader_number(from, port, (stage, wire)),
                owner_readers: plan.stage_readers[from],
            };
            let owner = PortBoard { board: boards[from].clone(), port };
            let waker = plan.waker(node, names, pipeline, from)?;
            LiveReceiver::new(node, names, &plan.shape(pipeline, from, port), reader, owner, waker)
        };
        spec.inputs.iter().enumerate().map(receiver).collect()
    }

    /// A sender for each output port of a stage that others read: of the stage itself if `is_owner`, otherwise of a program
    /// outside of the run.
    pub(super) fn senders<S: Service + 'static>(
        &self,
        node: &Node<S>,
        stage: usize,
        pause: &Pause<S>,
        is_owner: bool,
    ) -> Result<Vec<Option<SharedSender<S>>>, LinkError> {
        let Self { pipeline, plan, names, boards } = *self;
        let sender = |port: usize| {
            let readers = plan.readers(stage, port).iter().map(|&(reader, wire)| {
                Ok(LiveReader {
                    waker: plan.waker(node, names, pipeline, reader)?,
                    board: boards[reader].clone(),
                    wire,
                    depth: pipeline.stages[reader].depth,
                    number: plan.reader_number(stage, port, (reader, wire)),
                })
            });
            let readers = readers.collect::<Result<Vec<_>, LinkError>>()?;
            if readers.is_empty() {
                return Ok(None);
            }
            let owner = if is_owner { None } else { Some(plan.waker(node, names, pipeline, stage)?) };
            let shape = plan.shape(pipeline, stage, port);
            let port = PortBoard { board: boards[stage].clone(), port };
            let sender = LiveSender::new(node, names, &shape, readers, pause.clone(), port, owner)?;
            Ok(Some(SharedSender(Rc::new(RefCell::new(sender)))))
        };
        (0..pipeline.stages[stage].kind.outputs.len()).map(sender).collect()
    }
}

/// A sender that is the output of a stage, or of a program, and at the same time in the hands of who drives it.
pub(super) struct SharedSender<S: Service>(Rc<RefCell<LiveSender<S>>>);

impl<S: Service + 'static> SharedSender<S> {
    /// The sender.
    pub(super) fn get(&self) -> RefMut<'_, LiveSender<S>> {
        self.0.borrow_mut()
    }

    /// The output.
    pub(super) fn sink(&self) -> Box<dyn OutputSink> {
        Box::new(Self(Rc::clone(&self.0)))
    }
}

impl<S: Service + 'static> OutputSink for SharedSender<S> {
    fn send(&mut self, header: MessageHeader, bytes: &[u8]) -> Result<(), StageError> {
        self.get().send(header, bytes)
    }

    fn send_in_place(
        &mut self,
        header: MessageHeader,
        write: &mut dyn FnMut(&mut [u8]) -> Result<(), StageError>,
    ) -> Result<(), StageError> {
        self.get().send_in_place(header, write)
    }
}
