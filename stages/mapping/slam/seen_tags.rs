//! The tags that a robot has seen.

use std::collections::BTreeMap;

/// A tag that was seen.
#[derive(Clone, Copy, Debug)]
struct SeenTag {
    /// Number of the landmark in the graph.
    landmark: usize,
    /// The first and the last scan from which it was seen.
    scans: [usize; 2],
    /// Whether it was seen again since the poses were last optimised for it.
    is_new: bool,
}

/// The tags that a robot has seen, by name.
#[derive(Clone, Debug, Default)]
pub(super) struct SeenTags(BTreeMap<String, SeenTag>);

impl SeenTags {
    /// The tags, each with the number of its landmark in the graph.
    pub(super) fn landmarks(&self) -> impl ExactSizeIterator<Item = (&str, usize)> {
        self.0.iter().map(|(tag, seen)| (tag.as_str(), seen.landmark))
    }

    /// Adds that a tag was seen from a scan. Returns the number of its landmark; `None` if it was seen from that scan, or a
    /// later one, before.
    pub(super) fn see(&mut self, tag: &str, scan: usize) -> Option<usize> {
        let landmark = self.0.len();
        let Some(seen) = self.0.get_mut(tag) else {
            self.0.insert(tag.to_owned(), SeenTag { landmark, scans: [scan; 2], is_new: false });
            return Some(landmark);
        };
        if seen.scans[1] >= scan {
            return None;
        }
        (seen.scans[1], seen.is_new) = (scan, true);
        Some(seen.landmark)
    }

    /// Whether a tag was seen again since the last call, that was first seen before the scan `recent`.
    pub(super) fn take_seen_again(&mut self, recent: usize) -> bool {
        let is_again = |tag: &SeenTag| tag.is_new && tag.scans[0] < recent;
        let is_seen_again = self.0.values().any(is_again);
        self.0.values_mut().for_each(|tag| tag.is_new = false);
        is_seen_again
    }
}
