//! Which frames are connected by transforms, in whatever direction.
//!
//! Of thousands of robots, a transform moves one: the others need not be looked up.

use std::collections::BTreeMap;

/// Sets of frames. Frames that were connected once stay so, also where one gets another parent: that two frames are in
/// different sets is certain, and that they are connected is not.
#[derive(Clone, Debug, Default)]
pub(super) struct Components {
    numbers: BTreeMap<String, usize>,
    /// For each frame another one of its set, or itself; and how many frames lead to it.
    leads_to: Vec<(usize, usize)>,
}

impl Components {
    /// The number of a frame, which may be in no transform yet.
    pub(super) fn number(&mut self, frame: &str) -> usize {
        if let Some(number) = self.numbers.get(frame) {
            return *number;
        }
        let number = self.leads_to.len();
        self.numbers.insert(frame.to_owned(), number);
        self.leads_to.push((number, 1));
        number
    }

    /// Records a transform between two frames.
    pub(super) fn connect(&mut self, one: &str, other: &str) {
        let [one, other] = [one, other].map(|frame| self.number(frame));
        let (one, other) = (self.set_of(one), self.set_of(other));
        if one == other {
            return;
        }
        // The smaller set gets the longer way.
        let sizes = [one, other].map(|set| self.leads_to[set].1);
        let (small, large) = if sizes[0] < sizes[1] { (one, other) } else { (other, one) };
        self.leads_to[small].0 = large;
        self.leads_to[large].1 = sizes[0] + sizes[1];
    }

    /// Whether the frame with this number is connected to any other.
    pub(super) fn is_connected(&self, number: usize) -> bool {
        self.leads_to[self.set_of(number)].1 > 1
    }

    /// The set of the frame with this number.
    pub(super) fn set_of(&self, number: usize) -> usize {
        let mut set = number;
        while self.leads_to[set].0 != set {
            set = self.leads_to[set].0;
        }
        set
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_in_one_set_if_transforms_connect_them() {
        let mut components = Components::default();
        for (one, other) in [("a", "b"), ("c", "d"), ("e", "f"), ("d", "b"), ("a", "c")] {
            components.connect(one, other);
        }
        let mut set = |frame: &str| {
            let number = components.number(frame);
            components.set_of(number)
        };
        let sets = ["a", "b", "c", "d", "e", "f", "g"].map(&mut set);
        assert!(sets[..4].iter().all(|set| *set == sets[0]));
        assert!(sets[4] == sets[5] && sets[4] != sets[0] && ![sets[0], sets[4]].contains(&sets[6]));
    }
}
