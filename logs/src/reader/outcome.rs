//! What a log says of the run that wrote it.

use super::damage::Damage;
use super::record::{Fields, Record};
use crate::sink::OUTCOME_RECORD;

/// The damage that a metadata record tells of: a run that ended early says so in its log.
pub(crate) fn damage_of(metadata: &Record<'_>) -> Option<Damage> {
    let mut fields = Fields(metadata.body);
    if fields.text()? != OUTCOME_RECORD {
        return None;
    }
    let mut pairs = fields.block()?;
    let (mut incomplete, mut reason) = (false, String::new());
    while let (Some(key), Some(value)) = (pairs.text(), pairs.text()) {
        match key.as_str() {
            "complete" => incomplete = value == "false",
            "reason" => reason = value,
            _ => {}
        }
    }
    incomplete.then_some(Damage::Incomplete { reason })
}
