//! What a reader has had of a sender, and what it has missed.

use std::collections::BTreeSet;

/// Which samples have come from one sender.
#[derive(Clone, Debug)]
pub(super) struct Heard {
    /// Whether all that it has sent was meant for this reader: not if that was started again.
    is_for_all: bool,
    /// The number of the first sample that was not repeated.
    first: u64,
    /// Which number comes next.
    next: u64,
    /// The numbers of the repeated samples that came in its place: at most as many as are kept.
    repeated: BTreeSet<u64>,
}

impl Heard {
    pub(super) fn new(is_for_all: bool) -> Self {
        Self { is_for_all, first: u64::MAX, next: 0, repeated: BTreeSet::new() }
    }

    /// Which number comes next; none if nothing has come yet but what was repeated.
    pub(super) fn next(&self) -> Option<u64> {
        (self.first != u64::MAX).then_some(self.next)
    }

    /// Notes a sample. Gives whether it has not come before, and how many more are missing: less than 0 if it is one that
    /// was missing.
    pub(super) fn note(&mut self, number: u64, is_repeated: bool) -> (bool, i64) {
        let is_begun = self.first != u64::MAX;
        if is_repeated {
            let is_new = number < self.first && self.repeated.insert(number);
            return (is_new, -i64::from(is_new && is_begun && self.is_for_all));
        }
        let missing = match (is_begun, self.is_for_all) {
            (true, _) => number.saturating_sub(self.next),
            (false, true) => number - self.repeated.range(..number).count() as u64,
            (false, false) => 0,
        };
        let missing = i64::try_from(missing).unwrap_or(i64::MAX);
        self.first = self.first.min(number);
        self.next = number.saturating_add(1);
        // It is sent to one after the other, and the owner may be before this reader.
        (!self.repeated.contains(&number), missing)
    }
}

#[cfg(test)]
mod tests {
    use super::Heard;

    #[test]
    fn what_was_had_already_is_left_out_and_what_is_missing_counted() {
        let mut heard = Heard::new(false);
        assert_eq!(heard.note(5, false), (true, 0), "what came before the reader is not missing");
        assert_eq!(heard.note(6, false), (true, 0));
        assert_eq!(heard.note(9, false), (true, 2));
        assert_eq!(heard.note(6, true), (false, 0));
        assert_eq!(heard.note(2, true), (true, 0), "from before the reader came");
        assert_eq!(heard.note(4, true), (true, 0));
        assert_eq!(heard.note(2, true), (false, 0), "repeated once more");
        assert_eq!(heard.note(10, false), (true, 0));
    }

    #[test]
    fn repeated_messages_may_come_first() {
        let mut heard = Heard::new(false);
        assert_eq!([3, 7, 3].map(|sequence| heard.note(sequence, true).0), [true, true, false]);
        assert_eq!(heard.note(8, false), (true, 0));
    }

    #[test]
    fn announcements_are_repeated_before_the_messages_that_came_before_them() {
        let mut heard = Heard::new(false);
        assert_eq!([0, 2, 1, 3, 1].map(|number| heard.note(number, true).0), [true, true, true, true, false]);
    }

    #[test]
    fn what_was_repeated_already_is_left_out_when_it_comes_itself() {
        let mut heard = Heard::new(true);
        assert_eq!([0, 3].map(|number| heard.note(number, true).0), [true, true]);
        assert_eq!(heard.note(2, false), (true, 1), "1 is missing");
        assert_eq!([3, 4].map(|number| heard.note(number, false)), [(false, 0), (true, 0)]);
    }

    #[test]
    fn a_reader_that_was_there_from_the_beginning_misses_the_first_messages_as_well() {
        let mut heard = Heard::new(true);
        assert_eq!(heard.note(1, true), (true, 0));
        assert_eq!(heard.note(4, false), (true, 3), "0, 2 and 3");
        assert_eq!(heard.note(3, true), (true, -1), "it came after all");
        assert_eq!(heard.note(3, true), (false, 0));
        assert_eq!(heard.note(6, false), (true, 1));
    }
}
