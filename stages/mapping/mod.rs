//! The map of one robot: built from its scans, selected from all that it has published, and cleaned.

pub mod map_cleaner;
pub mod map_selector;
pub mod scan_mapper;
pub mod slam;

use gridweave_runtime::stage::StageKind;

/// Stage kinds of this module.
pub fn kinds() -> Vec<StageKind> {
    vec![map_cleaner::kind(), map_selector::kind(), scan_mapper::kind()]
}
