//! The senders that have gone without saying that nothing follows.

use super::presence::Presence;
use std::collections::VecDeque;

/// So many of them are remembered.
const MOST: usize = 64;

/// The senders that have gone without an end. What a receiver knows of them is kept for when they come back, which takes the
/// memory of their last maps; but not for ever.
#[derive(Debug, Default)]
pub(super) struct Absent(VecDeque<Presence>);

impl Absent {
    /// A sender has gone. Gives the session that is to be forgotten for it, where there are too many: that of the one that has
    /// been away longest.
    pub(super) fn left(&mut self, sender: Presence) -> Option<u64> {
        self.0.push_back(sender);
        let oldest = if self.0.len() > MOST { self.0.pop_front() } else { None };
        oldest.map(|oldest| oldest.number)
    }

    /// A sender has come. Gives the sessions that are to be forgotten: those of its name that it has taken the place of, as a
    /// robot does that was started again. One that comes back as it was is remembered.
    pub(super) fn came(&mut self, sender: &Presence) -> Vec<u64> {
        self.0.retain(|absent| absent != sender);
        let replaced = self.0.iter().filter(|absent| absent.name == sender.name).map(|absent| absent.number).collect();
        self.0.retain(|absent| absent.name != sender.name);
        replaced
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sender(name: &str, number: u64) -> Presence {
        Presence { name: name.to_owned(), number }
    }

    #[test]
    fn who_comes_back_is_remembered_and_who_is_replaced_is_forgotten() {
        let mut absent = Absent::default();
        assert_eq!(absent.left(sender("robot1", 1)), None);
        assert_eq!(absent.left(sender("robot2", 2)), None);
        // The link was broken for a while.
        assert_eq!(absent.came(&sender("robot1", 1)), [0; 0]);
        assert_eq!(absent.left(sender("robot1", 1)), None);
        // The robot was started again.
        assert_eq!(absent.came(&sender("robot1", 3)), [1]);
        assert_eq!(absent.came(&sender("robot1", 3)), [0; 0]);
        assert_eq!(absent.came(&sender("robot2", 2)), [0; 0]);
    }

    #[test]
    fn of_many_that_never_come_back_the_last_are_remembered() {
        let mut absent = Absent::default();
        let forgotten: Vec<u64> =
            (0..100).filter_map(|number| absent.left(sender(&format!("robot{number}"), number))).collect();
        assert_eq!(forgotten, (0..100 - MOST as u64).collect::<Vec<_>>());
    }
}
