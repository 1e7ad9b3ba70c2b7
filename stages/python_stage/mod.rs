//! `python`: a stage that is written in Python.
//!
//! The package `gridweave` in [`stages/python`](../python/README.md) is the other side: asked by `python -m gridweave.describe
//! MODULE`, it says what the stage takes and gives, and `python -m gridweave.run MODULE FOLDER` is its program. What goes on
//! between the two is that of every [`program`].

mod describe;

use gridweave_runtime::program::{self, Interface, Launch};
use gridweave_runtime::stage::{ParameterError, Parameters, ResolvedStage, StageKind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// What every stage in Python has beside the parameters of its own.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct PythonParameters {
    /// What has the stage: a file beside the pipeline file, or else in the current folder, such as `lines.py`; or a module that
    /// Python can import such as `my_stages.lines`; with `:NAME` behind it where it has several.
    module: String,
    /// What the module says of its ports and parameters, in JSON. It is asked for when left out, which is what you want.
    interface: Option<String>,
}

impl Parameters for PythonParameters {}

/// Those of a parameter's name that every stage in Python has.
const OWN: [&str; 2] = ["module", "interface"];

/// The variable of the environment that names the interpreter, where it is not the `python3` of PATH. A pipeline file cannot: it
/// may come from anywhere.
const INTERPRETER: &str = "GRIDWEAVE_PYTHON";

/// `python`: what the module that it names says.
pub fn kind() -> StageKind {
    StageKind::dynamic::<PythonParameters>(
        "python",
        "A stage in Python, in a process of its own: the module says what it takes, gives and does. `gridweave kinds FILE.py` shows \
         that.",
        ask,
    )
}

/// By module and given interface: the kinds that were asked for, each with its interface.
static ASKED: Mutex<BTreeMap<[String; 2], (&'static StageKind, String)>> = Mutex::new(BTreeMap::new());

fn ask(given: &toml::Table, folder: &Path) -> Result<ResolvedStage, ParameterError> {
    let module = text(given, "module")?.filter(|module| !module.is_empty());
    let module =
        module.ok_or_else(|| ParameterError::new("module", "must say what has the stage, such as \"lines.py\""))?;
    // The same wherever it is run from.
    let shown = module.rsplit_once('/').map_or(module, |(_, file)| file);
    let module = match file_of(module) {
        Some(file) => format!("{}{}", absolute(folder, file)?, &module[file.len()..]),
        None => module.to_owned(),
    };
    let told = text(given, "interface")?;
    let key = [module.clone(), told.unwrap_or_default().to_owned()];
    // What a thread that has panicked has asked for is right all the same.
    let mut asked = ASKED.lock().unwrap_or_else(PoisonError::into_inner);
    let (kind, interface) = match asked.get(&key) {
        Some(known) => known.clone(),
        None => {
            let python = std::env::var_os(INTERPRETER).filter(|python| !python.is_empty()).unwrap_or("python3".into());
            let said = told.map_or_else(|| describe::describe(&python, &module), |told| Ok(told.to_owned()))?;
            let interface = read(&said)?;
            let arguments = ["-m", "gridweave.run", &module].map(Into::into).to_vec();
            let launch = Launch { program: PathBuf::from(python), arguments };
            let kind = program::kind_of("python", shown, interface, launch);
            asked.insert(key, (kind, said.clone()));
            (kind, said)
        }
    };
    let parameters = [("module", module), ("interface", interface)];
    Ok(ResolvedStage {
        kind,
        parameters: parameters.map(|(key, value)| (key.to_owned(), value.into())).into_iter().collect(),
    })
}

/// What a module says, with the parameters that all stages in Python have before its own.
fn read(said: &str) -> Result<Interface, ParameterError> {
    let wrong =
        |problem: String| ParameterError::new("module", format!("says of its stage what none can be: {problem}"));
    let mut interface = Interface::read(said).map_err(wrong)?;
    let schema = interface.parameters.ensure_object();
    let own = PythonParameters::schema();
    let mut properties = own.get("properties").and_then(|all| all.as_object()).cloned().unwrap_or_default();
    for (name, property) in schema.get("properties").and_then(|all| all.as_object()).into_iter().flatten() {
        if OWN.contains(&name.as_str()) {
            return Err(wrong(format!("it has a parameter `{name}`, which every stage in Python has")));
        }
        properties.insert(name.clone(), property.clone());
    }
    schema.insert("properties".to_owned(), properties.into());
    Ok(interface)
}

/// A parameter that is a text.
fn text<'a>(given: &'a toml::Table, name: &'static str) -> Result<Option<&'a str>, ParameterError> {
    let Some(value) = given.get(name) else { return Ok(None) };
    value.as_str().map(Some).ok_or_else(|| ParameterError::new(name, "must be a text"))
}

/// The file that a module is, without the name of a stage behind it.
fn file_of(module: &str) -> Option<&str> {
    let place = module.split_once(':').map_or(module, |(place, _)| place);
    place.ends_with(".py").then_some(place)
}

/// The path from the root of a file that is in a folder or, where it is not, in the current one.
fn absolute(folder: &Path, path: &str) -> Result<String, ParameterError> {
    let beside = folder.join(path);
    let place = if beside.exists() || !Path::new(path).exists() { beside } else { PathBuf::from(path) };
    let found = std::path::absolute(place).ok().and_then(|path| path.to_str().map(str::to_owned));
    found.ok_or_else(|| ParameterError::new("module", format!("has a path that cannot be used: {path}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SAID: &str = r#"{ "protocol": 1, "inputs": [{ "name": "map", "type": "nav_msgs/msg/OccupancyGrid" }], "outputs": [],
        "parameters": { "properties": { "level": { "type": "number", "minimum": 0, "default": 1.0 } }, "additionalProperties": false } }"#;

    fn given(more: &str) -> toml::Table {
        let mut table: toml::Table = more.parse().unwrap();
        table.insert("interface".to_owned(), SAID.into());
        table
    }

    #[test]
    fn a_stage_has_the_ports_and_parameters_that_its_module_says_and_paths_begin_at_the_file() {
        let asked = ask(&given("module = \"a.py:Lines\""), Path::new("/pipelines")).unwrap();
        assert_eq!(asked.kind.inputs[0].name, "map");
        assert_eq!(asked.parameters["module"].as_str(), Some("/pipelines/a.py:Lines"));
        let again = ask(&given("module = \"a.py:Lines\""), Path::new("/pipelines")).unwrap();
        assert_eq!(again.parameters, asked.parameters);
        let wrong = |text: &str| asked.kind.check_parameters(&text.parse().unwrap());
        assert!(wrong("level = \"a\"").is_err());
        assert_eq!(wrong("level = -1").unwrap()[0].to_string(), "`level` must be at least 0, not -1");
        assert_eq!(wrong("level = 2\nmodule = \"a.py\"").unwrap(), []);
    }

    #[test]
    fn what_cannot_be_asked_is_told_with_the_parameter_that_is_wrong() {
        let empty = Path::new("");
        let problem = |text: &str| ask(&text.parse().unwrap(), empty).unwrap_err().to_string();
        assert!(problem("").contains("`module` must say what has the stage"));
        assert!(problem("module = 1").contains("`module` must be a text"));
        assert!(problem("module = \"a.py\"\ninterface = \"{}\"").contains("says of its stage what none can be"));
    }
}
