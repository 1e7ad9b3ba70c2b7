//! Detection of duplicate and missing samples of one sender.

use std::collections::BTreeSet;

/// The samples that a reader has received from one sender, by number.
#[derive(Clone, Debug)]
pub(super) struct SampleTracker {
    /// Whether samples before the first received one count as missing: not for a reader that was restarted.
    counts_from_start: bool,
    /// The number of the first received sample that was not a repeated one; `u64::MAX` before it.
    first: u64,
    /// The expected number of the next sample.
    next: u64,
    /// The numbers of the repeated samples received so far: at most as many as the history holds.
    repeated: BTreeSet<u64>,
}

impl SampleTracker {
    pub(super) fn new(counts_from_start: bool) -> Self {
        Self { counts_from_start, first: u64::MAX, next: 0, repeated: BTreeSet::new() }
    }

    /// The expected number of the next sample; none if only repeated samples have been received.
    pub(super) fn next(&self) -> Option<u64> {
        (self.first != u64::MAX).then_some(self.next)
    }

    /// Records a received sample. Returns whether it is no duplicate, and the change of the number of missing samples:
    /// -1 if it was counted as missing before.
    pub(super) fn record(&mut self, number: u64, is_repeated: bool) -> (bool, i64) {
        let is_begun = self.first != u64::MAX;
        if is_repeated {
            let is_new = number < self.first && self.repeated.insert(number);
            return (is_new, -i64::from(is_new && is_begun && self.counts_from_start));
        }
        let missing = match (is_begun, self.counts_from_start) {
            (true, _) => number.saturating_sub(self.next),
            (false, true) => number - self.repeated.range(..number).count() as u64,
            (false, false) => 0,
        };
        let missing = i64::try_from(missing).unwrap_or(i64::MAX);
        self.first = self.first.min(number);
        self.next = number.saturating_add(1);
        // A sample reaches its subscribers one after the other: the owner may have received and repeated it already.
        (!self.repeated.contains(&number), missing)
    }
}

#[cfg(test)]
mod tests {
    use super::SampleTracker;

    #[test]
    fn duplicates_are_detected_and_missing_samples_counted() {
        let mut tracker = SampleTracker::new(false);
        assert_eq!(tracker.record(5, false), (true, 0), "samples before the reader joined are not missing");
        assert_eq!(tracker.record(6, false), (true, 0));
        assert_eq!(tracker.record(9, false), (true, 2));
        assert_eq!(tracker.record(6, true), (false, 0));
        assert_eq!(tracker.record(2, true), (true, 0), "from before the reader joined");
        assert_eq!(tracker.record(4, true), (true, 0));
        assert_eq!(tracker.record(2, true), (false, 0), "repeated twice");
        assert_eq!(tracker.record(10, false), (true, 0));
    }

    #[test]
    fn repeated_samples_may_arrive_first() {
        let mut tracker = SampleTracker::new(false);
        assert_eq!([3, 7, 3].map(|sequence| tracker.record(sequence, true).0), [true, true, false]);
        assert_eq!(tracker.record(8, false), (true, 0));
    }

    #[test]
    fn repeated_samples_may_arrive_out_of_order() {
        let mut tracker = SampleTracker::new(false);
        assert_eq!([0, 2, 1, 3, 1].map(|number| tracker.record(number, true).0), [true, true, true, true, false]);
    }

    #[test]
    fn a_sample_that_arrives_after_its_repetition_is_a_duplicate() {
        let mut tracker = SampleTracker::new(true);
        assert_eq!([0, 3].map(|number| tracker.record(number, true).0), [true, true]);
        assert_eq!(tracker.record(2, false), (true, 1), "1 is missing");
        assert_eq!([3, 4].map(|number| tracker.record(number, false)), [(false, 0), (true, 0)]);
    }

    #[test]
    fn samples_before_the_first_one_count_as_missing_for_a_reader_that_was_never_restarted() {
        let mut tracker = SampleTracker::new(true);
        assert_eq!(tracker.record(1, true), (true, 0));
        assert_eq!(tracker.record(4, false), (true, 3), "0, 2 and 3");
        assert_eq!(tracker.record(3, true), (true, -1), "it was delayed");
        assert_eq!(tracker.record(3, true), (false, 0));
        assert_eq!(tracker.record(6, false), (true, 1));
    }
}
