//! What the command line says of the stages of a bridge.

use crate::status::BadUse;
use anyhow::{Result, bail};
use gridweave_runtime::stage::{Registry, StageKind};

/// One of the kinds of stages of a bridge.
///
/// # Errors
/// The program has none.
pub(super) fn bridge_kind<'a>(name: &str, registry: &'a Registry) -> Result<&'a StageKind> {
    match registry.get(name) {
        Some(kind) => Ok(kind),
        None => bail!("this program has no bridge: `gridweave-ros` has one (cargo install --path pipelines/ros)"),
    }
}

/// The parameters by which a stage connects to endpoints; none leave it at what is usual.
pub(super) fn connecting_to(endpoints: &[String]) -> toml::Table {
    let mut parameters = toml::Table::new();
    if !endpoints.is_empty() {
        parameters.insert("connect".into(), endpoints.to_vec().into());
    }
    parameters
}

/// Parameters that are set as PARAMETER=VALUE.
pub(super) fn settings(set: &[String]) -> Result<toml::Table> {
    let mut parameters = toml::Table::new();
    for setting in set {
        let wrong = || BadUse(format!("`{setting}` is no setting: write it as PARAMETER=VALUE"));
        let (name, value) = setting.split_once('=').ok_or_else(wrong)?;
        // A word needs no quotes.
        let read = format!("{name} = {value}").parse::<toml::Table>();
        let read = read.or_else(|_| format!("{name} = {}", toml::Value::from(value)).parse()).map_err(|_| wrong())?;
        parameters.extend(read);
    }
    Ok(parameters)
}

/// Whether a stage can have these parameters.
///
/// # Errors
/// One of them is wrong.
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
    fn settings_are_values_or_words() {
        let owned = |texts: &[&str]| texts.iter().map(|&text| text.to_owned()).collect::<Vec<_>>();
        let mut read = connecting_to(&owned(&["tcp/base:7448"]));
        read.extend(settings(&owned(&["insecure=true", "sender=robot1", "linger=2.5"])).unwrap());
        let expected = "connect = [\"tcp/base:7448\"]\ninsecure = true\nsender = \"robot1\"\nlinger = 2.5";
        assert_eq!(read, expected.parse().unwrap());
        assert!(settings(&owned(&["insecure"])).is_err());
        assert!(connecting_to(&[]).is_empty());
    }
}
