//! Creation of the ends of all links of a run.

use super::runner::readers;
use crate::link::SharedCounters;
use crate::link::{
    LinkError, LinkReceiver, LinkSender, LinkShape, Order, PortCounters, ReaderEnd, RunNames, SenderRole,
};
use crate::pipeline::Pipeline;
use crate::stage::RunLinks;
use iceoryx2::node::Node;
use iceoryx2::service::Service;
use std::collections::BTreeMap;
use std::sync::Arc;

/// The links of a run: creates their ends such that both ends of a link agree.
pub(super) struct Links<'a> {
    pub(super) pipeline: &'a Pipeline,
    names: &'a RunNames,
    pub(super) counters: &'a Arc<SharedCounters>,
    /// The readers of each output port of each stage: stages and their wires.
    readers: BTreeMap<(usize, usize), Vec<(usize, usize)>>,
    /// For stages that forward messages of other links; none if the links cannot be observed.
    observable: Option<RunLinks>,
}

impl<'a> Links<'a> {
    pub(super) fn new(pipeline: &'a Pipeline, names: &'a RunNames, counters: &'a Arc<SharedCounters>) -> Self {
        Self { pipeline, names, counters, readers: readers(pipeline), observable: None }
    }

    /// The same for a run whose links can be observed.
    pub(super) fn with_observable(self, links: RunLinks) -> Self {
        Self { observable: Some(links), ..self }
    }

    /// The observable links, for stages that forward messages of other links.
    pub(super) fn observable(&self) -> Option<RunLinks> {
        self.observable.clone()
    }

    /// Creates the iceoryx2 node of one thread of the run.
    pub(super) fn node<S: Service>(&self) -> Result<Node<S>, LinkError> {
        self.names.node()
    }

    /// Creates the reading ends of the wires of a stage.
    pub(super) fn receivers<S: Service + 'static>(
        &self,
        node: &Node<S>,
        stage: usize,
    ) -> Result<Vec<LinkReceiver<S>>, LinkError> {
        let inputs = self.pipeline.stages[stage].inputs.iter().enumerate();
        let receiver = |(wire, input): (usize, &crate::pipeline::Wire)| {
            let (from, port) = (input.from_stage, input.from_port);
            let owner = PortCounters { counters: self.counters.stage(from), port };
            LinkReceiver::new(node, self.names, &self.shape(from, port), self.reader_end(stage, wire), owner)
        };
        inputs.map(receiver).collect()
    }

    /// Creates a sender for each output port of a stage that has readers.
    pub(super) fn senders<S: Service + 'static>(
        &self,
        node: &Node<S>,
        stage: usize,
        role: SenderRole,
    ) -> Result<BTreeMap<usize, LinkSender<S>>, LinkError> {
        let ports = (0..self.pipeline.stages[stage].kind.outputs.len()).filter(|&port| self.is_read(stage, port));
        let sender = |port: usize| {
            let readers = self.readers[&(stage, port)].iter().map(|&(stage, wire)| self.reader_end(stage, wire));
            let (shape, counters) =
                (self.shape(stage, port), PortCounters { counters: self.counters.stage(stage), port });
            let batches = self.pipeline.batch;
            let sender = LinkSender::new(node, self.names, &shape, readers.collect(), counters, role, batches)?;
            Ok((port, sender))
        };
        ports.map(sender).collect()
    }

    /// Whether an output port has readers.
    pub(super) fn is_read(&self, stage: usize, port: usize) -> bool {
        self.readers.contains_key(&(stage, port))
    }

    fn reader_end(&self, stage: usize, wire: usize) -> ReaderEnd {
        ReaderEnd { counters: self.counters.stage(stage), wire, depth: self.pipeline.stages[stage].depth }
    }

    fn shape(&self, stage: usize, port: usize) -> LinkShape<'_> {
        let spec = &self.pipeline.stages[stage];
        let readers = self.readers.get(&(stage, port)).map_or(&[][..], Vec::as_slice);
        let depths = readers.iter().map(|(reader, _)| self.pipeline.stages[*reader].depth);
        LinkShape {
            stage: &spec.name,
            port: spec.kind.outputs[port].name,
            readers: readers.len(),
            depth: depths.max().unwrap_or(1),
            order: Order::from(self.pipeline.mode),
            overflow: spec.overflow.get(port).copied().unwrap_or_default(),
        }
    }
}

/// The sizes of the shared counters of each stage: (wires, output ports).
pub(super) fn counters_shape(pipeline: &Pipeline) -> Vec<(usize, usize)> {
    pipeline.stages.iter().map(|stage| (stage.inputs.len(), stage.kind.outputs.len())).collect()
}
