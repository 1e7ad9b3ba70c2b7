//! The parameters of a stage kind.

use schemars::{JsonSchema, Schema, schema_for};
use serde::Deserialize;
use serde::de::DeserializeOwned;

/// A value of a parameter that its type allows and its meaning does not.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{field}` {problem}")]
pub struct ParameterError {
    /// The parameter's name, as in the pipeline file.
    pub field: &'static str,
    /// What is wrong with its value, such as "must be above 0 m".
    pub problem: String,
}

impl ParameterError {
    /// See the fields.
    pub fn new(field: &'static str, problem: impl Into<String>) -> Self {
        Self { field, problem: problem.into() }
    }
}

/// The parameters of a stage kind: a struct with `#[serde(default, deny_unknown_fields)]`, whose doc comments are the
/// reference that `gridweave kinds` prints; or `()` for none. Lengths are metres, angles radians, times seconds.
pub trait Parameters: DeserializeOwned + JsonSchema + Default + 'static {
    /// Every value that is out of its range.
    fn check(&self) -> Vec<ParameterError> {
        Vec::new()
    }

    /// The parameters as a pipeline file has them.
    ///
    /// # Errors
    /// A value has another type, or there is no parameter of that name.
    fn read(table: toml::Table) -> Result<Self, toml::de::Error> {
        Self::deserialize(table)
    }

    /// The JSON schema of the parameters.
    fn schema() -> Schema {
        schema_for!(Self)
    }
}

impl Parameters for () {
    fn read(table: toml::Table) -> Result<Self, toml::de::Error> {
        NoParameters::deserialize(table).map(drop)
    }

    fn schema() -> Schema {
        schema_for!(NoParameters)
    }
}

/// A table without entries.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct NoParameters {}
