//! Repeated samples, while earlier samples of the same senders may still be pending.

use super::SampleHeader;
use crate::message::Storage;
use std::rc::Rc;

/// A repeated sample.
pub(super) type Repeat = (SampleHeader, Rc<dyn Storage>);

/// Repeated samples that are held back until the reader has received the earlier samples of their senders. Each sender
/// has a queue of its own, so the owner's repetition can overtake the original samples.
#[derive(Default)]
pub(super) struct Repeats(Vec<Repeat>);

impl Repeats {
    /// Adds a repeated sample.
    pub(super) fn push(&mut self, repeat: Repeat) {
        self.0.push(repeat);
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Removes and returns the repeated samples that are due before an original one. Those that the same sender is
    /// about to deliver itself are dropped. None are due before a sample of another sender that was sent earlier than
    /// the repetition.
    pub(super) fn before(&mut self, sample: &SampleHeader) -> Vec<Repeat> {
        let is_due = |(repeat, _): &Repeat| repeat.origin == sample.origin || repeat.sent_at < sample.sent_at;
        if !self.0.iter().any(is_due) {
            return Vec::new();
        }
        self.0.retain(|(repeat, _)| repeat.origin != sample.origin || repeat.number < sample.number);
        self.take_all()
    }

    /// Removes and returns all of them; for when nothing else is pending.
    pub(super) fn take_all(&mut self) -> Vec<Repeat> {
        std::mem::take(&mut self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(origin: u64, number: u64, sent_at: u64) -> SampleHeader {
        SampleHeader { origin, number, sent_at, ..Default::default() }
    }

    /// The numbers that are due before a sample, where 1, 4 and 6 of sender 7 were repeated at time 100.
    fn due(sample: &SampleHeader) -> Vec<u64> {
        let mut repeats = Repeats::default();
        for number in [1, 4, 6] {
            repeats.push((self::sample(7, number, 100), Rc::new(Vec::new())));
        }
        repeats.before(sample).into_iter().map(|(header, _)| header.number).collect()
    }

    #[test]
    fn repeated_samples_come_after_earlier_ones_and_not_twice() {
        assert_eq!(due(&sample(7, 5, 50)), [1, 4], "6 is still to come");
        assert_eq!(due(&sample(7, 0, 50)), [0; 0], "all are still to come");
        assert_eq!(due(&sample(7, 9, 200)), [1, 4, 6]);
        assert_eq!(due(&sample(8, 0, 99)), [0; 0], "another sender's earlier sample decides nothing");
        assert_eq!(due(&sample(8, 0, 101)), [1, 4, 6], "a stage whose input never pauses gets them too");
    }
}
