//! Adding stages to a pipeline, and removing them, after it was loaded.

use super::binding::accepts;
use super::topics::default_topics;
use super::{DEFAULT_DEPTH, Overflow, Pipeline, Restart, StageSpec, Wire};
use crate::stage::{InputPort, OutputPort, StageKind};

impl Pipeline {
    /// Adds a stage in the process `process`. Each of its inputs is wired to all outputs of a matching type for which `takes`
    /// returns true. Its outputs can only be read by stages that are attached later. Does nothing, and returns `false`, if a
    /// required input would remain without a wire.
    pub fn attach(
        &mut self,
        kind: &StageKind,
        parameters: toml::Table,
        process: &str,
        takes: impl Fn(&InputPort, &StageSpec, &OutputPort) -> bool,
    ) -> bool {
        let mut inputs = Vec::new();
        for (port, input) in kind.inputs.iter().enumerate() {
            let before = inputs.len();
            for (from_stage, from) in self.stages.iter().enumerate() {
                let outputs = from.kind.outputs.iter().enumerate();
                let taken =
                    outputs.filter(|(_, output)| accepts(input, output.port_type) && takes(input, from, output));
                inputs.extend(taken.map(|(from_port, _)| Wire { port, from_stage, from_port }));
            }
            if inputs.len() == before && !input.optional {
                return false;
            }
        }
        let is_used = |name: &str| self.stages.iter().any(|stage| stage.name == name);
        let mut name = kind.name.to_owned();
        while is_used(&name) {
            name.push('_');
        }
        self.stages.push(StageSpec {
            topics: default_topics(kind, &name),
            name,
            kind: kind.clone(),
            parameters,
            inputs,
            depth: DEFAULT_DEPTH,
            process: process.to_owned(),
            overflow: Vec::<Overflow>::new(),
            restart: Restart::default(),
        });
        true
    }

    /// Removes all stages of a kind that has no outputs.
    pub fn remove_sinks(&mut self, kind: &str) {
        let is_removed = |stage: &StageSpec| stage.kind.name == kind && stage.kind.outputs.is_empty();
        let mut count = 0;
        let new_indexes: Vec<usize> = self
            .stages
            .iter()
            .map(|stage| {
                count += usize::from(!is_removed(stage));
                count.saturating_sub(1)
            })
            .collect();
        self.stages.retain(|stage| !is_removed(stage));
        for wire in self.stages.iter_mut().flat_map(|stage| &mut stage.inputs) {
            wire.from_stage = new_indexes[wire.from_stage];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_kinds::{VALID, registry};
    use super::super::{Overrides, Pipeline};

    fn valid() -> Pipeline {
        Pipeline::parse("walls.toml", VALID, &registry(), &Overrides::default()).unwrap()
    }

    #[test]
    fn an_attached_stage_reads_the_chosen_outputs_of_its_type() {
        let mut pipeline = valid();
        let kind = registry().get("line_extractor").unwrap().clone();
        assert!(pipeline.attach(&kind, toml::Table::new(), "more", |_, _, output| output.topic == Some("/map")));
        let added = pipeline.stages.last().unwrap();
        assert_eq!((added.name.as_str(), added.process.as_str()), ("line_extractor", "more"));
        assert_eq!(added.topics.len(), kind.outputs.len(), "its readers need them");
        let from: Vec<&str> = added.inputs.iter().map(|wire| pipeline.stages[wire.from_stage].name.as_str()).collect();
        assert_eq!(from, ["fuse"]);
        let text = pipeline.to_toml();
        let again = Pipeline::parse("again.toml", &text, &registry(), &Overrides::default());
        assert!(again.is_err(), "the output of the attached stage is not read, which is an error in a file");
        assert!(!pipeline.attach(&kind, toml::Table::new(), "more", |_, _, _| false));
    }

    #[test]
    fn an_attached_stage_that_takes_any_type_reads_the_outputs_of_all_stages() {
        let mut pipeline = valid();
        let outputs: usize = pipeline.stages.iter().map(|stage| stage.kind.outputs.len()).sum();
        let kind = registry().get("mcap_sink").unwrap().clone();
        assert!(pipeline.attach(&kind, toml::Table::new(), "more", |_, _, _| true));
        assert_eq!(pipeline.stages.last().unwrap().inputs.len(), outputs);
    }

    #[test]
    fn removing_a_sink_keeps_the_wires_of_other_stages() {
        let mut pipeline = valid();
        let sink = pipeline.stages.iter().position(|stage| stage.name == "out").unwrap();
        let out = pipeline.stages.remove(sink);
        pipeline.stages.insert(0, out);
        pipeline.stages.iter_mut().flat_map(|stage| &mut stage.inputs).for_each(|wire| wire.from_stage += 1);
        pipeline.remove_sinks("mcap_sink");
        assert_eq!(pipeline.stages.len(), 4);
        for (stage, expected) in pipeline.stages.iter().zip(valid().stages) {
            assert_eq!((&stage.name, &stage.inputs), (&expected.name, &expected.inputs));
        }
    }
}
