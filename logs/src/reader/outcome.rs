//! What a log says in a metadata record of the run that wrote it.

use super::damage::Damage;
use crate::sink::OUTCOME_RECORD;
use std::collections::BTreeMap;

/// The damage that a metadata record tells of: a run that ended early says so in its log.
pub(crate) fn damage_of(name: &str, metadata: &BTreeMap<String, String>) -> Option<Damage> {
    let incomplete = name == OUTCOME_RECORD && metadata.get("complete").is_some_and(|complete| complete == "false");
    incomplete.then(|| Damage::Incomplete { reason: metadata.get("reason").cloned().unwrap_or_default() })
}
