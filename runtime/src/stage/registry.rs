//! All stage kinds that a program knows.

use super::StageKind;
use std::collections::BTreeMap;

/// The stage kinds that a pipeline may name.
#[derive(Clone, Debug, Default)]
pub struct Registry {
    kinds: BTreeMap<&'static str, StageKind>,
}

impl Registry {
    /// A registry of the given kinds. Of two kinds with one name the later one counts.
    pub fn new(kinds: impl IntoIterator<Item = StageKind>) -> Self {
        Self { kinds: kinds.into_iter().map(|kind| (kind.name, kind)).collect() }
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
