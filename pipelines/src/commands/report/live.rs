//! The page of a run in progress.

use super::{collect, page};
use crate::merge_log::MergeState;
use anyhow::Result;
use serde_json::{Value, json};

/// Maximum number of cells along a side of a map, since a map is sent whenever it has changed.
const SIDE: usize = 1000;

/// The page of a run in progress, and its changes.
pub(crate) struct LivePage {
    name: String,
}

impl LivePage {
    /// Makes the page of a run with this name.
    pub(crate) fn new(name: String) -> Self {
        Self { name }
    }

    /// Renders the page without data, in HTML.
    ///
    /// # Errors
    /// The page cannot be rendered.
    pub(crate) fn empty(&self) -> Result<String> {
        let report = collect::collect_moment(&self.name, &MergeState::default(), 0.0, SIDE)?;
        page::render_live(&report, &json!({}))
    }

    /// Renders the contents that replace those of the page, as one line of JSON: the state of the merge after `seconds`
    /// of log time, and the statistics of the stages in the form of the summary of a run.
    ///
    /// # Errors
    /// The contents cannot be rendered.
    pub(crate) fn change(&self, state: &MergeState, seconds: f64, summary: &Value) -> Result<String> {
        page::render_change(&collect::collect_moment(&self.name, state, seconds, SIDE)?, summary)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_is_complete_without_data_and_a_change_is_one_line() {
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
