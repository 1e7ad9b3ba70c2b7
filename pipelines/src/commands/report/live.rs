//! The page of a run that goes on.

use super::{collect, page};
use crate::merge_log::MergeState;
use anyhow::Result;
use serde_json::{Value, json};

/// The maps of the page have so many cells along a side at most: they are sent whenever one has changed.
const SIDE: usize = 1000;

/// The page of a run that goes on: as it is opened, and what changes on it.
pub(crate) struct LivePage {
    name: String,
}

impl LivePage {
    /// The page of a run of this name.
    pub(crate) fn new(name: String) -> Self {
        Self { name }
    }

    /// The page before anything is known, in HTML.
    ///
    /// # Errors
    /// It cannot be made.
    pub(crate) fn empty(&self) -> Result<String> {
        let report = collect::collect_moment(&self.name, &MergeState::default(), 0.0, SIDE)?;
        page::render_live(&report, &json!({}))
    }

    /// All that is known: what takes the place of what the page shows, as JSON in one line. `seconds` have passed of the log time,
    /// and the stages have done what `summary` says, as the summary of a run does.
    ///
    /// # Errors
    /// It cannot be put together.
    pub(crate) fn change(&self, state: &MergeState, seconds: f64, summary: &Value) -> Result<String> {
        page::render_change(&collect::collect_moment(&self.name, state, seconds, SIDE)?, summary)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_is_whole_before_anything_is_known_and_a_change_is_one_line() {
        let live = LivePage::new("live_merge </script>".to_owned());
        let page = live.empty().unwrap();
        assert!(page.contains("connect-src 'self'") && page.contains("new EventSource"), "{page}");
        assert!(!page.contains("live_merge </script>"));
        let summary = json!({"stages": {"fuser": {"messages_in": 3, "messages_out": 1, "busy_ms": 2.5}}});
        let change = live.change(&MergeState::default(), 12.5, &summary).unwrap();
        assert!(!change.contains('\n'), "{change}");
        let change: Value = serde_json::from_str(&change).unwrap();
        assert_eq!(change["data"]["times"], json!([12.5]));
        assert!(change["findings"].as_str().unwrap().contains("fuser"), "{change}");
    }
}
