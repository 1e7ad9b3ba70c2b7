//! The parameters of a stage kind.

use super::range::out_of_range;
use schemars::{JsonSchema, Schema, schema_for};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

/// An invalid value of a parameter.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{field}` {problem}")]
pub struct ParameterError {
    /// The parameter's name, as in the pipeline file.
    pub field: String,
    /// What is wrong with its value, such as "must be above 0 m".
    pub problem: String,
}

impl ParameterError {
    /// See the fields.
    pub fn new(field: impl Into<String>, problem: impl Into<String>) -> Self {
        Self { field: field.into(), problem: problem.into() }
    }
}

/// The parameters of a stage kind: a struct with `#[serde(default, deny_unknown_fields)]`, whose doc comments are the
/// reference that `gridweave kinds` prints; or `()` for none. Lengths are in metres, angles in radians, times in
/// seconds. The range of a field is an attribute: `#[schemars(range(min = 0.0, max = 1.0))]`, or
/// `#[schemars(extend("exclusiveMinimum" = 0.0))]` if the limit itself is not allowed. Without a range, a number must
/// be finite.
pub trait Parameters: Serialize + DeserializeOwned + JsonSchema + Default + 'static {
    /// Errors that involve several parameters, such as a minimum above the maximum.
    fn check_together(&self) -> Vec<ParameterError> {
        Vec::new()
    }

    /// All errors: values out of their ranges, and those of [`check_together`](Self::check_together).
    fn check(&self) -> Vec<ParameterError> {
        let mut errors = match toml::Table::try_from(self) {
            Ok(table) => out_of_range(Self::schema().as_value(), &table),
            Err(error) => vec![ParameterError::new("", format!("a value does not fit in TOML: {error}"))],
        };
        let is_new = |error: &ParameterError| errors.iter().all(|other| other.field != error.field);
        let together: Vec<ParameterError> = self.check_together().into_iter().filter(is_new).collect();
        errors.extend(together);
        errors
    }

    /// Reads the parameters of a pipeline file.
    ///
    /// # Errors
    /// A value has the wrong type, or a parameter does not exist.
    fn read(table: toml::Table) -> Result<Self, toml::de::Error> {
        Self::deserialize(table)
    }

    /// The JSON schema of the parameters.
    fn schema() -> Schema {
        schema_for!(Self)
    }
}

impl Parameters for () {
    fn check(&self) -> Vec<ParameterError> {
        Vec::new()
    }

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
