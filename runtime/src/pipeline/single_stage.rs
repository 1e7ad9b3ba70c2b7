//! The description of a single stage in a file, for running it outside of a pipeline.

use super::diagnostic::{Diagnostic, PipelineErrors, Problems};
use super::document::{self, Entry};
use super::load::folder_of;
use super::nearest::did_you_mean;
use super::overrides::Overrides;
use super::settings::Settings;
use super::stage_section::read_stage;
use crate::stage::{InitialPoses, Registry, RobotTopics, StageKind};

/// A single stage with its settings, checked in the same way as those of a pipeline.
#[derive(Clone, Debug)]
pub struct SingleStage {
    /// Its name: that of its kind, with `_` for characters that are not allowed.
    pub name: String,
    /// Its kind.
    pub kind: StageKind,
    /// The given parameters.
    pub parameters: toml::Table,
    /// The topic of each output port's messages in a log, with `{robot}` for the robot's name.
    pub topics: Vec<String>,
    /// The samples that each input can queue before the sender waits.
    pub depth: usize,
    /// The robot whose map frame is the world; if none, the first by name at the time when the first two maps are
    /// merged.
    pub reference: Option<String>,
    /// The seed of all randomness.
    pub seed: u64,
    /// Whether small messages are sent in batches.
    pub batch: bool,
    /// The topic patterns of the robots.
    pub robots: RobotTopics,
    /// The poses of robots' maps that the user knows.
    pub initial_poses: InitialPoses,
}

impl SingleStage {
    /// Reads the sections `[stage]`, `[pipeline]` and `[robots]` of a TOML text; errors call it `source_name`. Sections
    /// whose names are in `others` are ignored, and any other is an error.
    ///
    /// # Errors
    ///
    /// The sections have errors, all of which are returned.
    pub fn parse(source_name: &str, text: &str, registry: &Registry, others: &[&str]) -> Result<Self, PipelineErrors> {
        let mut problems = Problems::new(source_name, text);
        let Some(sections) = document::parse(text, &mut problems) else { return Err(problems.into_errors()) };
        let mut settings = Settings::new("");
        let mut stage = None;
        for Entry { key, key_at, item } in &sections {
            match key.as_str() {
                "pipeline" => settings.read_pipeline(item, &mut problems),
                "robots" => settings.read_robots(item, &mut problems),
                "stage" => stage = Some(item),
                _ if others.contains(&key.as_str()) => {}
                _ => {
                    let known = || ["stage", "pipeline", "robots"].into_iter().chain(others.iter().copied());
                    let label = format!("expected one of {}", known().collect::<Vec<_>>().join(", "));
                    let problem = Diagnostic::new(format!("unknown section `{key}`")).at(key_at, label);
                    problems.push(problem.help(did_you_mean(key, known())));
                }
            }
        }
        settings.override_with(&Overrides::default(), &mut problems);
        let Some(item) = stage else {
            let problem = Diagnostic::new("there is no section `[stage]`");
            problems.push(problem.help("add one with `kind = \"...\"`".to_owned()));
            return Err(problems.into_errors());
        };
        let kind = match &item.value {
            document::Value::Table(entries) => entries.iter().find(|entry| entry.key == "kind"),
            _ => None,
        };
        let name = stage_name(kind.and_then(|kind| kind.item.as_str()).unwrap_or("stage"));
        let entry = Entry { key: name.clone(), key_at: item.at.clone(), item: item.clone() };
        let draft = read_stage(&entry, &settings, folder_of(source_name), registry, &mut problems);
        if let Some(inputs) = draft.inputs {
            let problem =
                Diagnostic::new("a single stage has no other stages as inputs").at(&inputs.at, "expected no inputs");
            problems.push(problem);
        }
        match draft.kind {
            Some(kind) if problems.is_empty() => Ok(Self {
                name: name.clone(),
                kind: kind.clone(),
                parameters: draft.parameters,
                topics: draft.topics.into_iter().map(|topic| topic.template).collect(),
                depth: draft.depth,
                reference: settings.reference,
                seed: settings.seed,
                batch: settings.batch,
                robots: settings.robots,
                initial_poses: settings.initial_poses,
            }),
            _ => Err(problems.into_errors()),
        }
    }
}

/// The name of a stage that is named after its kind.
fn stage_name(kind: &str) -> String {
    let allowed = |char: char| char.is_ascii_lowercase() || char.is_ascii_digit() || char == '_' || char == '-';
    kind.to_ascii_lowercase().chars().map(|char| if allowed(char) { char } else { '_' }).collect()
}

#[cfg(test)]
mod tests {
    use super::super::test_kinds::registry;
    use super::*;

    const TEXT: &str = "[pipeline]\nseed = 3\n[stage]\nkind = \"line_extractor\"\nmin_length = 0.5\n[inputs]\n";

    fn parse(text: &str) -> Result<SingleStage, PipelineErrors> {
        SingleStage::parse("stage.toml", text, &registry(), &["inputs"])
    }

    #[test]
    fn a_stage_is_read_with_the_settings_of_its_pipeline() {
        let stage = parse(TEXT).unwrap();
        assert_eq!((stage.name.as_str(), stage.kind.name, stage.seed), ("line_extractor", "line_extractor", 3));
        assert_eq!(stage.parameters["min_length"].as_float(), Some(0.5));
        assert!(stage.topics.iter().all(|topic| topic.starts_with("/{robot}/line_extractor/")), "{:?}", stage.topics);
    }

    #[test]
    fn errors_are_shown_at_their_locations() {
        for (from, to, says) in [
            ("min_length", "min_lenght", "did you mean `min_length`?"),
            ("line_extractor", "line_extracter", "did you mean `line_extractor`?"),
            ("[inputs]", "[input]", "did you mean `inputs`?"),
            ("[stage]", "[stages]", "there is no section `[stage]`"),
            ("min_length = 0.5", "inputs = [\"a.b\"]", "has no other stages as inputs"),
            ("seed = 3", "seed = -3", "at least 0"),
        ] {
            let text = parse(&TEXT.replacen(from, to, 1)).unwrap_err().render(false);
            assert!(text.contains(says) && text.contains("stage.toml"), "{text}");
        }
    }

    #[test]
    fn characters_that_are_not_allowed_are_replaced() {
        assert_eq!(stage_name("Corner Finder"), "corner_finder");
    }
}
