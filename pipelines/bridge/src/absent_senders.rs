//! The senders that have disconnected without an end.

use super::presence::Presence;
use std::collections::VecDeque;

/// The maximum number of remembered senders.
const MAX_SENDERS: usize = 64;

/// The senders that have disconnected without an end. The receiver keeps a limited number of their states, including
/// their last maps, for their reconnection.
#[derive(Debug, Default)]
pub(super) struct AbsentSenders(VecDeque<Presence>);

impl AbsentSenders {
    /// Adds a disconnected sender. Returns the session to be forgotten if there are too many: the one disconnected
    /// longest.
    pub(super) fn add(&mut self, sender: Presence) -> Option<u64> {
        self.0.push_back(sender);
        let oldest = if self.0.len() > MAX_SENDERS { self.0.pop_front() } else { None };
        oldest.map(|oldest| oldest.number)
    }

    /// Removes a connected sender. Returns the sessions to be forgotten: older ones of the same name, which a restarted
    /// sender replaces.
    pub(super) fn remove(&mut self, sender: &Presence) -> Vec<u64> {
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
    fn a_reconnected_sender_is_remembered_and_a_replaced_one_is_forgotten() {
        let mut absent = AbsentSenders::default();
        assert_eq!(absent.add(sender("robot1", 1)), None);
        assert_eq!(absent.add(sender("robot2", 2)), None);
        // The link was broken for a while.
        assert_eq!(absent.remove(&sender("robot1", 1)), [0; 0]);
        assert_eq!(absent.add(sender("robot1", 1)), None);
        // The robot was started again.
        assert_eq!(absent.remove(&sender("robot1", 3)), [1]);
        assert_eq!(absent.remove(&sender("robot1", 3)), [0; 0]);
        assert_eq!(absent.remove(&sender("robot2", 2)), [0; 0]);
    }

    #[test]
    fn a_limited_number_of_senders_is_remembered() {
        let mut absent = AbsentSenders::default();
        let forgotten: Vec<u64> =
            (0..100).filter_map(|number| absent.add(sender(&format!("robot{number}"), number))).collect();
        assert_eq!(forgotten, (0..100 - MAX_SENDERS as u64).collect::<Vec<_>>());
    }
}
