//! Parameters of the stages of a bridge, from the command line.

use crate::status::BadUse;
use anyhow::{Result, bail};
use gridweave_runtime::stage::{Registry, StageKind};

/// Finds a stage kind of the bridge.
///
/// # Errors
/// The program has no such kind.
pub(super) fn bridge_kind<'a>(name: &str, registry: &'a Registry) -> Result<&'a StageKind> {
    match registry.get(name) {
        Some(kind) => Ok(kind),
        None => bail!("this program has no bridge: `gridweave-ros` has one (cargo install --path pipelines/ros)"),
    }
}

/// Makes the parameters by which a stage connects to endpoints; without any, the stage uses its defaults.
pub(super) fn connect_parameters(endpoints: &[String]) -> toml::Table {
    let mut parameters = toml::Table::new();
    if !endpoints.is_empty() {
        parameters.insert("connect".into(), endpoints.to_vec().into());
    }
    parameters
}

/// Parses settings of the form PARAMETER=VALUE.
///
/// # Errors
/// One has another form.
pub(crate) fn settings(set: &[String]) -> Result<toml::Table> {
    let mut parameters = toml::Table::new();
    for setting in set {
        let wrong = || BadUse(format!("`{setting}` is not a setting: write it as PARAMETER=VALUE"));
        let (name, value) = setting.split_once('=').ok_or_else(wrong)?;
        // A text needs no quotes.
        let read = format!("{name} = {value}").parse::<toml::Table>();
        let read = read.or_else(|_| format!("{name} = {}", toml::Value::from(value)).parse()).map_err(|_| wrong())?;
        parameters.extend(read);
    }
    Ok(parameters)
}

/// Checks the parameters of a stage.
///
/// # Errors
/// A parameter is wrong.
pub(super) fn check(kind: &StageKind, parameters: &toml::Table) -> Result<()> {
    let checked = kind.check_parameters(parameters).map_err(|wrong| BadUse(wrong.message().to_owned()))?;
    match checked.first() {
        Some(wrong) => Err(BadUse(wrong.to_string()).into()),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_are_values_or_texts_without_quotes() {
        let owned = |texts: &[&str]| texts.iter().map(|&text| text.to_owned()).collect::<Vec<_>>();
        let mut read = connect_parameters(&owned(&["tcp/base:7448"]));
        read.extend(settings(&owned(&["insecure=true", "sender=robot1", "linger=2.5"])).unwrap());
        let expected = "connect = [\"tcp/base:7448\"]\ninsecure = true\nsender = \"robot1\"\nlinger = 2.5";
        assert_eq!(read, expected.parse().unwrap());
        assert!(settings(&owned(&["insecure"])).is_err());
        assert!(connect_parameters(&[]).is_empty());
    }
}
