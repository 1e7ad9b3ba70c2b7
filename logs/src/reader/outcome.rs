//! Metadata records, and what a log says in one of the run that wrote it.

use super::damage::Damage;
use super::record::{Fields, Record};
use crate::sink::OUTCOME_RECORD;
use std::collections::BTreeMap;

/// The name of a metadata record, and its entries as far as they can be read.
pub(crate) fn read_metadata(record: &Record<'_>) -> Option<(String, BTreeMap<String, String>)> {
    let mut fields = Fields(record.body);
    let (name, mut pairs) = (fields.text()?, fields.block()?);
    let mut metadata = BTreeMap::new();
    while let (Some(key), Some(value)) = (pairs.text(), pairs.text()) {
        metadata.insert(key, value);
    }
    Some((name, metadata))
}

/// The damage that a metadata record tells of: a run that ended early says so in its log.
pub(crate) fn damage_of(name: &str, metadata: &BTreeMap<String, String>) -> Option<Damage> {
    let incomplete = name == OUTCOME_RECORD && metadata.get("complete").is_some_and(|complete| complete == "false");
    incomplete.then(|| Damage::Incomplete { reason: metadata.get("reason").cloned().unwrap_or_default() })
}
