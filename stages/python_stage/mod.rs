//! `python`: a stage that is written in Python.
//!
//! The package `gridweave` in [`pipelines/python`](../../pipelines/python/STAGES.md) is the other side: asked by
//! `python -m gridweave.describe MODULE`, it prints the ports and parameters of the stage, and `python -m
//! gridweave.program MODULE FOLDER` is its program. The protocol between the two is that of every [`program`].

mod describe;

use gridweave_runtime::program::{self, Interface, Launch};
use gridweave_runtime::stage::{ParameterError, Parameters, ResolvedStage, StageKind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Parameters of every stage in Python, besides its own.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct PythonParameters {
    /// Module with the stage: a file beside the pipeline file, or else in the current folder, such as `lines.py`; or a
    /// module that Python can import such as `my_stages.lines`; followed by `:NAME` if it has several stages.
    module: String,
    /// Ports and parameters of the module, in JSON. By default the module is asked for them.
    interface: Option<String>,
}

impl Parameters for PythonParameters {}

/// Names of the parameters of every stage in Python.
const OWN: [&str; 2] = ["module", "interface"];

/// Environment variable with the interpreter, if it is not the `python3` of PATH. A pipeline file cannot set it, as it
/// may be untrusted.
const INTERPRETER: &str = "GRIDWEAVE_PYTHON";

/// The kind `python`, whose ports and parameters are those of its module.
pub fn kind() -> StageKind {
    StageKind::dynamic::<PythonParameters>(
        "python",
        "A stage in Python, in a process of its own, with the ports and parameters of the module. `gridweave kinds FILE.py` shows \
         them.",
        ask,
    )
}

/// Cache of kinds with their interfaces, by module and given interface.
static ASKED: Mutex<BTreeMap<[String; 2], (&'static StageKind, String)>> = Mutex::new(BTreeMap::new());

fn ask(given: &toml::Table, folder: &Path) -> Result<ResolvedStage, ParameterError> {
    let module = text(given, "module")?.filter(|module| !module.is_empty());
    let module = module
        .ok_or_else(|| ParameterError::new("module", "must name the module of the stage, such as \"lines.py\""))?;
    // The same wherever it is run from.
    let shown = module.rsplit_once('/').map_or(module, |(_, file)| file);
    let module = match file_of(module) {
        Some(file) => format!("{}{}", absolute(folder, file)?, &module[file.len()..]),
        None => module.to_owned(),
    };
    let given_interface = text(given, "interface")?;
    let key = [module.clone(), given_interface.unwrap_or_default().to_owned()];
    // The cache is valid even if a thread has panicked.
    let mut asked = ASKED.lock().unwrap_or_else(PoisonError::into_inner);
    let (kind, json) = match asked.get(&key) {
        Some(known) => known.clone(),
        None => {
            let python = std::env::var_os(INTERPRETER).filter(|python| !python.is_empty()).unwrap_or("python3".into());
            let json = given_interface.map_or_else(
                || describe::describe(&python, &module),
                |given_interface| Ok(given_interface.to_owned()),
            )?;
            let interface = read(&json)?;
            let arguments = ["-m", "gridweave.program", &module].map(Into::into).to_vec();
            let launch = Launch { program: PathBuf::from(python), arguments };
            let kind = program::kind_of("python", shown, interface, launch);
            asked.insert(key, (kind, json.clone()));
            (kind, json)
        }
    };
    let parameters = [("module", module), ("interface", json)];
    Ok(ResolvedStage {
        kind,
        parameters: parameters.map(|(key, value)| (key.to_owned(), value.into())).into_iter().collect(),
    })
}

/// Reads the interface of a module, and adds the parameters of every stage in Python before its own.
fn read(json: &str) -> Result<Interface, ParameterError> {
    let wrong = |problem: String| ParameterError::new("module", format!("describes an invalid stage: {problem}"));
    let mut interface = Interface::read(json).map_err(wrong)?;
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

/// The file of a module, without the name of a stage; none if it is no file.
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
        assert!(problem("").contains("`module` must name the module of the stage"));
        assert!(problem("module = 1").contains("`module` must be a text"));
        assert!(problem("module = \"a.py\"\ninterface = \"{}\"").contains("describes an invalid stage"));
    }
}
