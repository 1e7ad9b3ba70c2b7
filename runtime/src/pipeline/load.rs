//! Loading of a pipeline file: parsing and checking.

use super::binding::{Input, Mention};
use super::diagnostic::{Diagnostic, PipelineErrors, Problems};
use super::document::{self, Entry, Value};
use super::nearest::did_you_mean;
use super::order::order;
use super::overrides::Overrides;
use super::settings::Settings;
use super::stage_section::{Draft, read_stage};
use super::values::entries;
use super::wiring::{Wiring, check_readers, check_topics_differ, check_used};
use super::{Pipeline, StageSpec, Wire};
use crate::input_file;
use crate::stage::Registry;
use std::collections::BTreeSet;
use std::path::Path;

/// The maximum size of a pipeline file, bytes: errors in longer ones, with names and lines of any length, would take long to describe.
const LONGEST_PIPELINE: u64 = 1 << 20;

impl Pipeline {
    /// Reads and checks a pipeline file.
    ///
    /// # Errors
    ///
    /// The file cannot be read, or it has errors, all of which are returned.
    pub fn load(path: &Path, registry: &Registry, overrides: &Overrides) -> Result<Self, PipelineErrors> {
        let name = path.display().to_string();
        match input_file::read_text(path, LONGEST_PIPELINE) {
            Ok(text) => Self::parse(&name, &text, registry, overrides),
            Err(error) => Err(PipelineErrors::of_whole(&name, format!("cannot read the pipeline `{name}`: {error}"))),
        }
    }

    /// Parses and checks the text of a pipeline file; errors call it `source_name`.
    ///
    /// # Errors
    ///
    /// The text has errors, all of which are returned.
    pub fn parse(
        source_name: &str,
        text: &str,
        registry: &Registry,
        overrides: &Overrides,
    ) -> Result<Self, PipelineErrors> {
        let mut problems = Problems::new(source_name, text);
        let Some(sections) = document::parse(text, &mut problems) else { return Err(problems.into_errors()) };

        let name = Path::new(source_name).file_stem().map_or(source_name.into(), |stem| stem.to_string_lossy());
        let mut settings = Settings::new(&name);
        let mut stages = Vec::new();
        read_sections(&sections, &mut settings, &mut stages, &mut problems);
        settings.override_with(overrides, &mut problems);
        overrides.apply(&mut stages, &mut problems);

        let folder = folder_of(source_name);
        let drafts: Vec<Draft<'_>> =
            stages.iter().map(|stage| read_stage(stage, &settings, folder, registry, &mut problems)).collect();
        let wiring = Wiring::new(&drafts, registry, &mut problems);
        check_used(&drafts, &wiring, &mut problems);
        check_readers(&drafts, &wiring, &mut problems);
        check_topics_differ(&drafts, &wiring, &mut problems);
        let order = check_order(&drafts, &wiring.mentions, &mut problems);

        if problems.is_empty() { Ok(assemble(settings, drafts, &wiring, &order)) } else { Err(problems.into_errors()) }
    }
}

/// The folder of a file.
pub(super) fn folder_of(file: &str) -> &Path {
    Path::new(file).parent().unwrap_or(Path::new(""))
}

/// Reads the sections. The stages are sorted by name.
fn read_sections(sections: &[Entry], settings: &mut Settings, stages: &mut Vec<Entry>, problems: &mut Problems) {
    const SECTIONS: [&str; 3] = ["pipeline", "robots", "stages"];
    for Entry { key, key_at, item } in sections {
        match key.as_str() {
            "pipeline" => settings.read_pipeline(item, problems),
            "robots" => settings.read_robots(item, problems),
            "stages" => stages.extend_from_slice(entries(item, "stages", problems)),
            _ => {
                let problem = Diagnostic::new(format!("unknown section `{key}`"));
                let label = "expected `pipeline`, `robots` or `stages`";
                problems.push(problem.at(key_at, label).help(did_you_mean(key, SECTIONS)));
            }
        }
    }
    stages.sort_by(|a, b| a.key.cmp(&b.key));
    // A misspelt section or one that is no table has been reported already.
    let reported = |section: &Entry| {
        section.key.starts_with("stage") && !matches!(&section.item.value, Value::Table(entries) if entries.is_empty())
    };
    if stages.is_empty() && !sections.iter().any(reported) {
        let problem = Diagnostic::new("this pipeline has no stages");
        problems.push(problem.help("add one as a section `[stages.NAME]` with `kind = \"...\"`".to_owned()));
    }
}

/// The topological order of the stages, each after those that feed it. Cycles are reported.
fn check_order(drafts: &[Draft<'_>], mentions: &[Mention], problems: &mut Problems) -> Vec<usize> {
    let certain = mentions.iter().filter(|mention| !mention.guessed);
    let edges: BTreeSet<(usize, usize)> = certain.map(|mention| (mention.from, mention.to)).collect();
    order(drafts.len(), &edges).unwrap_or_else(|cycles| {
        for cycle in cycles {
            problems.push(describe_cycle(&cycle, drafts, mentions));
        }
        Vec::new()
    })
}

fn describe_cycle(cycle: &[usize], drafts: &[Draft<'_>], mentions: &[Mention]) -> Diagnostic {
    let closed: Vec<usize> = cycle.iter().chain(cycle.first()).copied().collect();
    let path: Vec<&str> = closed.iter().map(|&stage| drafts[stage].name).collect();
    let mut problem = Diagnostic::new(format!("these stages feed each other in a cycle: {}", path.join(" -> ")));
    let mut marked = false;
    for step in closed.windows(2) {
        let [from, to] = *step else { continue };
        let Some(mention) = mentions.iter().find(|mention| mention.from == from && mention.to == to) else { continue };
        let label = format!("`{}` reads `{}`", drafts[to].name, drafts[from].name);
        problem = if marked { problem.context(&mention.at, label) } else { problem.at(&mention.at, label) };
        marked = true;
    }
    problem
}

/// Builds a pipeline without errors. `order` lists the indexes of the drafts.
fn assemble(settings: Settings, drafts: Vec<Draft<'_>>, wiring: &Wiring, order: &[usize]) -> Pipeline {
    let mut new_index = vec![0; drafts.len()];
    order.iter().enumerate().for_each(|(new, &old)| new_index[old] = new);
    let mut stages: Vec<(usize, StageSpec)> = Vec::with_capacity(drafts.len());
    for (index, draft) in drafts.into_iter().enumerate() {
        let Some(kind) = draft.kind else { continue };
        let wire = |input: &Input| Wire {
            port: input.port,
            from_stage: new_index[input.from.stage],
            from_port: input.from.port,
        };
        let spec = StageSpec {
            name: draft.name.to_owned(),
            kind: kind.clone(),
            parameters: draft.parameters,
            inputs: wiring.inputs[index].iter().map(wire).collect(),
            topics: draft.topics.into_iter().map(|topic| topic.template).collect(),
            depth: draft.depth,
            process: draft.process.to_owned(),
            overflow: draft.overflow,
            restart: draft.restart,
        };
        stages.push((new_index[index], spec));
    }
    stages.sort_by_key(|(index, _)| *index);
    let stages = stages.into_iter().map(|(_, spec)| spec).collect();
    Pipeline {
        name: settings.name,
        mode: settings.mode,
        reference: settings.reference,
        seed: settings.seed,
        batch: settings.batch,
        stall_timeout: settings.stall_timeout,
        memory_limit: settings.memory_limit,
        same_time_limit: settings.same_time_limit,
        robots: settings.robots,
        initial_poses: settings.initial_poses,
        stages,
    }
}
