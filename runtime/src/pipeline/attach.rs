//! Stages that are added to a pipeline, or taken out of it, after it was read.

use super::binding::accepts;
use super::topics::standard_topics;
use super::{DEFAULT_DEPTH, Overflow, Pipeline, Restart, StageSpec, Wire};
use crate::stage::{InputPort, OutputPort, StageKind};

impl Pipeline {
    /// Adds a stage that nothing reads but what is attached later: each of its inputs is wired to all outputs of its type, or
    /// of any if it takes any, of which `takes` says that it takes them. It runs in the process `process`. Does nothing, and
    /// gives `false`, if that leaves an input without a wire that needs one.
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
        let is_taken = |name: &str| self.stages.iter().any(|stage| stage.name == name);
        let mut name = kind.name.to_owned();
        while is_taken(&name) {
            name.push('_');
        }
        self.stages.push(StageSpec {
            topics: standard_topics(kind, &name),
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

    /// Takes out all stages of a kind that has no outputs.
    pub fn take_out(&mut self, kind: &str) {
        let is_out = |stage: &StageSpec| stage.kind.name == kind && stage.kind.outputs.is_empty();
        let mut place = 0;
        let places: Vec<usize> = self
            .stages
            .iter()
            .map(|stage| {
                place += usize::from(!is_out(stage));
                place.saturating_sub(1)
            })
            .collect();
        self.stages.retain(|stage| !is_out(stage));
        for wire in self.stages.iter_mut().flat_map(|stage| &mut stage.inputs) {
            wire.from_stage = places[wire.from_stage];
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
    fn an_attached_stage_reads_the_outputs_of_its_type_that_it_takes() {
        let mut pipeline = valid();
        let kind = registry().get("line_extractor").unwrap().clone();
        assert!(pipeline.attach(&kind, toml::Table::new(), "more", |_, _, output| output.topic == Some("/map")));
        let added = pipeline.stages.last().unwrap();
        assert_eq!((added.name.as_str(), added.process.as_str()), ("line_extractor", "more"));
        assert_eq!(added.topics.len(), kind.outputs.len(), "those that read it must find them");
        let from: Vec<&str> = added.inputs.iter().map(|wire| pipeline.stages[wire.from_stage].name.as_str()).collect();
        assert_eq!(from, ["fuse"]);
        let text = pipeline.to_toml();
        let again = Pipeline::parse("again.toml", &text, &registry(), &Overrides::default());
        assert!(
            again.is_err(),
            "an output of the kind that is attached here is not read, which a file must not leave so"
        );
        assert!(!pipeline.attach(&kind, toml::Table::new(), "more", |_, _, _| false));
    }

    #[test]
    fn an_attached_stage_that_takes_any_type_reads_the_outputs_of_all() {
        let mut pipeline = valid();
        let outputs: usize = pipeline.stages.iter().map(|stage| stage.kind.outputs.len()).sum();
        let kind = registry().get("mcap_sink").unwrap().clone();
        assert!(pipeline.attach(&kind, toml::Table::new(), "more", |_, _, _| true));
        assert_eq!(pipeline.stages.last().unwrap().inputs.len(), outputs);
    }

    #[test]
    fn the_wires_of_other_stages_stay_where_they_are_when_a_sink_is_taken_out() {
        let mut pipeline = valid();
        let sink = pipeline.stages.iter().position(|stage| stage.name == "out").unwrap();
        let out = pipeline.stages.remove(sink);
        pipeline.stages.insert(0, out);
        pipeline.stages.iter_mut().flat_map(|stage| &mut stage.inputs).for_each(|wire| wire.from_stage += 1);
        pipeline.take_out("mcap_sink");
        assert_eq!(pipeline.stages.len(), 4);
        for (stage, expected) in pipeline.stages.iter().zip(valid().stages) {
            assert_eq!((&stage.name, &stage.inputs), (&expected.name, &expected.inputs));
        }
    }
}
