//! The parameters of a stage kind.

use super::range::out_of_range;
use schemars::{JsonSchema, Schema, schema_for};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

/// A value of a parameter that its type allows and its meaning does not.
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
/// reference that `gridweave kinds` prints; or `()` for none. Lengths are metres, angles radians, times seconds. A field's
/// range stands in its attributes: `#[schemars(range(min = 0.0, max = 1.0))]`, or `#[schemars(extend("exclusiveMinimum" = 0.0))]`
/// where the limit itself is not allowed. Without one, a number must be finite.
pub trait Parameters: Serialize + DeserializeOwned + JsonSchema + Default + 'static {
    /// What is wrong beside ranges, such as a least value above the greatest.
    fn check_together(&self) -> Vec<ParameterError> {
        Vec::new()
    }

    /// Every value that is out of its range, and what is wrong beside.
    fn check(&self) -> Vec<ParameterError> {
        let mut errors = match toml::Table::try_from(self) {
            Ok(table) => out_of_range(Self::schema().as_value(), &table),
            Err(error) => vec![ParameterError::new("", format!("a value does not fit in TOML: {error}"))],
        };
        let is_told = |error: &ParameterError| errors.iter().any(|told| told.field == error.field);
        let together: Vec<ParameterError> = self.check_together().into_iter().filter(|error| !is_told(error)).collect();
        errors.extend(together);
        errors
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
