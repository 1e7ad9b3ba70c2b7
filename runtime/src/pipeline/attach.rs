//! Adding stages to a pipeline, and removing them, after it was loaded.

use super::binding::accepts;
use super::order::order;
use super::topics::default_topics;
use super::{DEFAULT_DEPTH, Overflow, Pipeline, Restart, StageSpec, Wire};
use crate::stage::{InputPort, OutputPort, StageKind};

impl Pipeline {
    /// Adds a stage in the process `process`. Each of its inputs is wired to all outputs of a matching type for which
    /// `takes` returns true. Its outputs can only be read by stages that are attached later. Does nothing, and returns
    /// `false`, if a required input would remain without a wire.
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
        self.restore_order();
        true
    }

    /// Puts the stages into the order in which a pipeline file with them is loaded, as processes of a run do.
    fn restore_order(&mut self) {
        let mut by_name: Vec<usize> = (0..self.stages.len()).collect();
        by_name.sort_by(|&a, &b| self.stages[a].name.cmp(&self.stages[b].name));
        let mut rank = vec![0; by_name.len()];
        by_name.iter().enumerate().for_each(|(position, &stage)| rank[stage] = position);
        let wires =
            self.stages.iter().enumerate().flat_map(|(to, stage)| stage.inputs.iter().map(move |wire| (wire, to)));
        let edges = wires.map(|(wire, to)| (rank[wire.from_stage], rank[to])).collect();
        // A stage that nothing reads closes no cycle.
        let Ok(sorted) = order(by_name.len(), &edges) else { return };
        let mut new_indexes = vec![0; by_name.len()];
        sorted.iter().enumerate().for_each(|(new, &rank)| new_indexes[by_name[rank]] = new);
        let mut stages: Vec<(usize, StageSpec)> = new_indexes.iter().copied().zip(self.stages.drain(..)).collect();
        stages.sort_by_key(|(index, _)| *index);
        self.stages.extend(stages.into_iter().map(|(_, stage)| stage));
        for wire in self.stages.iter_mut().flat_map(|stage| &mut stage.inputs) {
            wire.from_stage = new_indexes[wire.from_stage];
        }
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
        let added = pipeline.stages.iter().find(|stage| stage.name == "line_extractor").unwrap();
        assert_eq!(added.process, "more");
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
        let added = pipeline.stages.iter().find(|stage| stage.name == "mcap_sink").unwrap();
        assert_eq!(added.inputs.len(), outputs);
    }

    #[test]
    fn a_pipeline_with_an_attached_stage_is_loaded_in_the_same_order() {
        let mut pipeline = valid();
        let sink = registry().get("mcap_sink").unwrap().clone();
        // It reads the first stage only, so it comes before those that read others, though it was added after them.
        let parameters = toml::Table::from_iter([("file".to_owned(), toml::Value::from("b.mcap"))]);
        assert!(pipeline.attach(&sink, parameters, "more", |_, from, _| from.name == "log"));
        let loaded = Pipeline::parse("again.toml", &pipeline.to_toml(), &registry(), &Overrides::default()).unwrap();
        let stages = |pipeline: &Pipeline| {
            let of = |stage: &crate::pipeline::StageSpec| (stage.name.clone(), stage.inputs.clone());
            pipeline.stages.iter().map(of).collect::<Vec<_>>()
        };
        assert_ne!(pipeline.stages.last().unwrap().name, "mcap_sink");
        assert_eq!(stages(&pipeline), stages(&loaded));
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
