//! The stage kinds of a program.

use super::StageKind;
use std::collections::BTreeMap;

/// The stage kinds that a pipeline may name.
#[derive(Clone, Debug, Default)]
pub struct Registry {
    kinds: BTreeMap<&'static str, StageKind>,
}

impl Registry {
    /// A registry of the given kinds. Of two kinds with the same name, the later one is used.
    pub fn new(kinds: impl IntoIterator<Item = StageKind>) -> Self {
        Self { kinds: kinds.into_iter().map(|kind| (kind.name, kind)).collect() }
    }

    /// The parameters of all kinds that no pipeline can set, because their names are reserved keys of a stage's table:
    /// `KIND.PARAMETER`, by name. Any of them is a bug in the program.
    pub fn shadowed_parameters(&self) -> Vec<String> {
        self.kinds
            .values()
            .flat_map(|kind| kind.shadowed_parameters().map(|name| format!("{}.{name}", kind.name)))
            .collect()
    }

    /// The kind of the given name.
    pub fn get(&self, name: &str) -> Option<&StageKind> {
        self.kinds.get(name)
    }

    /// All kinds, by name.
    pub fn kinds(&self) -> impl Iterator<Item = &StageKind> {
        self.kinds.values()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use schemars::json_schema;

    #[test]
    fn parameters_with_reserved_names_are_listed() {
        let kind = |name, properties: serde_json::Value| {
            StageKind::external::<()>(name, "")
                .with_schema(json_schema!({ "type": "object", "properties": properties }))
        };
        let registry = Registry::new([
            kind("good", serde_json::json!({ "depth_of_field": {} })),
            kind("wrong", serde_json::json!({ "topics": {}, "size": {}, "depth": {} })),
        ]);
        assert_eq!(registry.shadowed_parameters(), ["wrong.depth", "wrong.topics"]);
    }
}
