//! How the links of a pipeline are numbered.

use super::runner::readers;
use crate::link::board::MAX_SENDERS;
use crate::link::live::{LinkShape, MAX_OBSERVERS};
use crate::link::shared::{LinkError, RunNames, Waker};
use crate::pipeline::{Mode, Pipeline};
use iceoryx2::node::Node;
use iceoryx2::service::Service;
use std::collections::BTreeMap;

/// Who reads what, and how many peers each stage has: what both ends of a link must agree on.
pub(super) struct Plan {
    readers: BTreeMap<(usize, usize), Vec<(usize, usize)>>,
    /// For each stage, the number of its readers over all ports.
    pub(super) stage_readers: Vec<usize>,
    /// For each stage, how many may wake it: its readers, those it reads, the run, and programs that send into a live one
    /// from outside or look on at it, each over every link.
    pub(super) peers: Vec<usize>,
}

impl Plan {
    pub(super) fn new(pipeline: &Pipeline) -> Self {
        let readers = readers(pipeline);
        let mut stage_readers = vec![0; pipeline.stages.len()];
        for (&(stage, _), list) in &readers {
            stage_readers[stage] += list.len();
        }
        let outside = |inputs: usize, outputs: usize| match pipeline.mode {
            Mode::Replay => 0,
            Mode::Live => inputs * MAX_SENDERS + outputs * (MAX_SENDERS + MAX_OBSERVERS),
        };
        let peers = pipeline.stages.iter().zip(&stage_readers);
        let peers = peers.map(|(spec, readers)| {
            spec.inputs.len() + readers + 1 + outside(spec.inputs.len(), spec.kind.outputs.len())
        });
        Self { peers: peers.collect(), readers, stage_readers }
    }

    pub(super) fn waker<S: Service>(
        &self,
        node: &Node<S>,
        names: &RunNames,
        pipeline: &Pipeline,
        stage: usize,
    ) -> Result<Waker<S>, LinkError> {
        Waker::new(node, names, &pipeline.stages[stage].name, self.stage_readers[stage], self.peers[stage])
    }

    pub(super) fn readers(&self, stage: usize, port: usize) -> &[(usize, usize)] {
        self.readers.get(&(stage, port)).map_or(&[], Vec::as_slice)
    }

    /// The number of one reader among all readers of a stage: counted port by port.
    pub(super) fn reader_number(&self, stage: usize, port: usize, reader: (usize, usize)) -> usize {
        let before: usize = (0..port).map(|port| self.readers(stage, port).len()).sum();
        before + self.readers(stage, port).iter().position(|other| *other == reader).unwrap_or_default()
    }

    /// What all ends of the live link must agree on that is an output port of a stage.
    pub(super) fn shape<'a>(&self, pipeline: &'a Pipeline, stage: usize, port: usize) -> LinkShape<'a> {
        let spec = &pipeline.stages[stage];
        LinkShape {
            stage: &spec.name,
            port: spec.kind.outputs[port].name,
            readers: self.readers(stage, port).len(),
            depth: self.port_depth(pipeline, stage, port),
            overflow: spec.overflow.get(port).copied().unwrap_or_default(),
        }
    }

    pub(super) fn port_depth(&self, pipeline: &Pipeline, stage: usize, port: usize) -> usize {
        let depths = self.readers(stage, port).iter().map(|(reader, _)| pipeline.stages[*reader].depth);
        depths.max().unwrap_or(1)
    }
}

/// What each stage has on the board of the run: (wires, output ports).
pub(super) fn board_shape(pipeline: &Pipeline) -> Vec<(usize, usize)> {
    pipeline.stages.iter().map(|stage| (stage.inputs.len(), stage.kind.outputs.len())).collect()
}
