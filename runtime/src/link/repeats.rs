//! What is sent to a reader again, while what it repeats may still be on its way.

use super::SampleHeader;
use crate::message::Storage;
use std::rc::Rc;

/// A sample that was sent again.
pub(super) type Repeat = (SampleHeader, Rc<dyn Storage>);

/// Samples that the owner of a link sends again and that wait until their reader has had what their senders sent before them:
/// each sender's samples wait by themselves, so what is repeated may overtake them.
#[derive(Default)]
pub(super) struct Repeats(Vec<Repeat>);

impl Repeats {
    /// Lets one wait.
    pub(super) fn push(&mut self, repeat: Repeat) {
        self.0.push(repeat);
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Those that are due before a sample that comes from its sender itself: what is not so will come itself. None is due
    /// while samples come that were sent before it, other than of its sender.
    pub(super) fn before(&mut self, sample: &SampleHeader) -> Vec<Repeat> {
        let is_due = |(repeat, _): &Repeat| repeat.origin == sample.origin || repeat.sent_at < sample.sent_at;
        if !self.0.iter().any(is_due) {
            return Vec::new();
        }
        self.0.retain(|(repeat, _)| repeat.origin != sample.origin || repeat.number < sample.number);
        self.all()
    }

    /// All of them: nothing else waits.
    pub(super) fn all(&mut self) -> Vec<Repeat> {
        std::mem::take(&mut self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(origin: u64, number: u64, sent_at: u64) -> SampleHeader {
        SampleHeader { origin, number, sent_at, ..Default::default() }
    }

    /// The numbers of those that are due before a sample, where 1, 4 and 6 of the sender 7 were sent again at 100.
    fn due(sample: &SampleHeader) -> Vec<u64> {
        let mut repeats = Repeats::default();
        for number in [1, 4, 6] {
            repeats.push((self::sample(7, number, 100), Rc::new(Vec::new())));
        }
        repeats.before(sample).into_iter().map(|(header, _)| header.number).collect()
    }

    #[test]
    fn what_is_sent_again_comes_after_what_was_sent_before_it_and_not_twice() {
        assert_eq!(due(&sample(7, 5, 50)), [1, 4], "6 will come itself");
        assert_eq!(due(&sample(7, 0, 50)), [0; 0], "all will come");
        assert_eq!(due(&sample(7, 9, 200)), [1, 4, 6]);
        assert_eq!(due(&sample(8, 0, 99)), [0; 0], "of another, which tells nothing");
        assert_eq!(due(&sample(8, 0, 101)), [1, 4, 6], "a stage that is never done with its input gets them as well");
    }
}
