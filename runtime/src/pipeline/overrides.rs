//! Settings of a pipeline on the command line.

use super::diagnostic::{Diagnostic, Location, Problems};
use super::document::{self, Entry, Item, Value};
use super::nearest::{quoted_list, suggest};

/// The settings of the command line. They take precedence over the pipeline file, and are checked in the same way.
#[derive(Clone, Debug, Default)]
pub struct Overrides {
    /// The robot whose map frame is the world.
    pub reference: Option<String>,
    /// The seed of all randomness.
    pub seed: Option<u64>,
    /// The poses of robots' map frames, as `ROBOT=X,Y,YAW[,STDDEV[,YAW_STDDEV]]`.
    pub initial_poses: Vec<String>,
    settings: Vec<Setting>,
}

/// The value of a parameter of a stage.
#[derive(Clone, Debug)]
struct Setting {
    stage: Target,
    parameter: String,
    /// The setting in errors: `STAGE.PARAMETER=VALUE`.
    text: String,
    /// The offset of the value in the text.
    value: usize,
}

#[derive(Clone, Debug)]
enum Target {
    Named(String),
    OnlyOfKind(String),
}

/// A setting without the form `STAGE.PARAMETER=VALUE`.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SettingError {
    /// No stage, no parameter or no `=`.
    #[error("`{0}` is not a setting: write STAGE.PARAMETER=VALUE, such as lines.min_length=0.6")]
    Form(String),
    /// The value is neither TOML nor a single word.
    #[error("`{value}` is not a TOML value: {problem}; text needs quotes, such as '{setting}=\"...\"'")]
    Value {
        /// The stage and the parameter.
        setting: String,
        /// The text of the value.
        value: String,
        /// The error of the TOML parser.
        problem: String,
    },
}

impl Overrides {
    /// Adds a setting of the form `STAGE.PARAMETER=VALUE`. The value is TOML; a single word needs no quotes.
    ///
    /// # Errors
    /// The setting has another form, or its value is not TOML.
    pub fn set(&mut self, setting: &str) -> Result<(), SettingError> {
        let form = || SettingError::Form(setting.to_owned());
        let (name, value) = setting.split_once('=').ok_or_else(form)?;
        let (stage, parameter) = name.split_once('.').ok_or_else(form)?;
        let (name, stage, parameter, value) = (name.trim(), stage.trim(), parameter.trim(), value.trim());
        if stage.is_empty() || parameter.is_empty() || value.is_empty() {
            return Err(form());
        }
        let value = match toml::de::DeValue::parse(value) {
            Ok(_) => value.to_owned(),
            Err(_) if is_word(value) => toml::Value::from(value).to_string(),
            Err(error) => {
                let (setting, value, problem) = (name.into(), value.into(), error.message().into());
                return Err(SettingError::Value { setting, value, problem });
            }
        };
        self.push(Target::Named(stage.to_owned()), parameter, name, &value);
        Ok(())
    }

    /// Sets a parameter of the only stage of a kind, such as the files of the only source of logs. Loading the pipeline
    /// fails if there is no such stage, or more than one.
    pub fn set_for_kind(&mut self, kind: &str, parameter: &str, value: impl Into<toml::Value>) {
        let stage = Target::OnlyOfKind(kind.to_owned());
        self.push(stage, parameter, parameter, &value.into().to_string());
    }

    fn push(&mut self, stage: Target, parameter: &str, name: &str, value: &str) {
        let text = format!("{name} = {value}");
        let setting = Setting { stage, parameter: parameter.to_owned(), value: text.len() - value.len(), text };
        self.settings.push(setting);
    }

    /// Inserts the settings into the tables of the stages, as if they were in the file.
    pub(super) fn apply(&self, stages: &mut [Entry], problems: &mut Problems) {
        for setting in &self.settings {
            let source = problems.add_source("command line", setting.text.as_str());
            let at = Location::new(source, 0..setting.text.len());
            let Some(stage) = setting.find_stage(stages, &at, problems) else { continue };
            let Value::Table(entries) = &mut stage.item.value else { continue };
            let value = setting.text.get(setting.value..).unwrap_or_default();
            let Some(item) = document::parse_value(value, source, setting.value) else {
                problems.push(Diagnostic::new("this setting is not TOML").at(&at, ""));
                continue;
            };
            let name_end = setting.text.find(" = ").unwrap_or(setting.text.len());
            let key_at = Location::new(source, name_end.saturating_sub(setting.parameter.len())..name_end);
            entries.retain(|entry| entry.key != setting.parameter);
            entries.push(Entry { key: setting.parameter.clone(), key_at, item });
        }
    }
}

/// Whether a value is an unquoted word or path, and not a malformed number.
fn is_word(value: &str) -> bool {
    let starts = value.starts_with(|first: char| first.is_alphabetic() || "/._~".contains(first));
    starts && value.chars().all(|char| char.is_alphanumeric() || "/._~-:".contains(char))
}

impl Setting {
    fn find_stage<'a>(&self, stages: &'a mut [Entry], at: &Location, problems: &mut Problems) -> Option<&'a mut Entry> {
        let found: Vec<usize> = match &self.stage {
            Target::Named(name) => (0..stages.len()).filter(|&index| &stages[index].key == name).collect(),
            Target::OnlyOfKind(kind) => (0..stages.len()).filter(|&index| is_of_kind(&stages[index], kind)).collect(),
        };
        if let [only] = found[..] {
            return stages.get_mut(only);
        }
        let parameter = &self.parameter;
        problems.push(match &self.stage {
            Target::Named(name) => {
                let names: Vec<&str> = stages.iter().map(|stage| stage.key.as_str()).collect();
                Diagnostic::new(format!("there is no stage `{name}` to set `{parameter}` of"))
                    .at(at, "no such stage in this pipeline")
                    .help(suggest(name, &names, "its stages"))
            }
            Target::OnlyOfKind(kind) if found.is_empty() => {
                Diagnostic::new(format!("there is no stage of kind `{kind}` to set `{parameter}` of"))
                    .at(at, "no stage takes this")
                    .help(format!("add a stage with `kind = \"{kind}\"`"))
            }
            Target::OnlyOfKind(kind) => {
                let names: Vec<&str> = found.iter().map(|&index| stages[index].key.as_str()).collect();
                let first = names.first().copied().unwrap_or_default();
                Diagnostic::new(format!("it is ambiguous which `{kind}` gets `{parameter}`"))
                    .at(at, format!("the pipeline has {} of them", names.len()))
                    .note(format!("stages of this kind: {}", quoted_list(&names)))
                    .help(format!("give it in the file, or for each with `--set {first}.{parameter}=...`"))
            }
        });
        None
    }
}

fn is_of_kind(stage: &Entry, kind: &str) -> bool {
    let Value::Table(entries) = &stage.item.value else { return false };
    entries.iter().any(|Entry { key, item, .. }| key == "kind" && Item::as_str(item) == Some(kind))
}
