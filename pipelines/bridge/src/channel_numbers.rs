//! The local numbers of the channels of all senders.

use gridweave_runtime::message::Channel;
use std::collections::BTreeMap;

/// The maximum number of channels of all senders: as many as a log has at most.
const MAX_CHANNELS: usize = 65_534;
/// The maximum size of their descriptions, bytes, which are kept for readers that come later.
const MAX_DESCRIPTIONS: usize = 64 << 20;

/// A channel by its port here, its sender, its number there, and its topic if it has none.
pub(super) type Key = (usize, u64, u32, String);

/// The local numbers of channels. A channel keeps its number when it is announced again.
#[derive(Debug, Default)]
pub(super) struct ChannelNumbers {
    numbers: BTreeMap<Key, u32>,
    /// The sizes of the descriptions by local number, and of all, bytes.
    descriptions: BTreeMap<u32, usize>,
    described: usize,
}

impl ChannelNumbers {
    /// Whether the channel has a number.
    pub(super) fn has(&self, key: &Key) -> bool {
        self.numbers.contains_key(key)
    }

    /// The number of a channel; `None` if there are too many.
    pub(super) fn number(&mut self, key: Key) -> Option<u32> {
        let count = self.numbers.len();
        if count >= MAX_CHANNELS && !self.has(&key) {
            return None;
        }
        let next = u32::try_from(count).ok()? + 1;
        Some(*self.numbers.entry(key).or_insert(next))
    }

    /// The number of a channel that is announced with this description; `None` if there are too many, or too long ones.
    pub(super) fn describe(&mut self, key: Key, channel: &Channel) -> Option<u32> {
        let number = self.number(key)?;
        let pairs: usize = channel.metadata.iter().map(|(key, value)| key.len() + value.len()).sum();
        let size = channel.schema.len() + channel.schema_name.len() + channel.topic.len() + pairs;
        let before = self.descriptions.get(&number).copied().unwrap_or(0);
        let described = (self.described - before).saturating_add(size);
        if described > MAX_DESCRIPTIONS {
            return None;
        }
        self.described = described;
        self.descriptions.insert(number, size);
        Some(number)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_channel_keeps_its_number_and_all_are_limited_together() {
        let mut channels = ChannelNumbers::default();
        let key = |number: u32| (0, 7, number, String::new());
        let large = Channel { schema: vec![0; MAX_DESCRIPTIONS / 2], ..Default::default() };
        assert_eq!(channels.describe(key(5), &large), Some(1));
        assert_eq!(channels.describe(key(6), &large), Some(2));
        assert_eq!(channels.describe(key(5), &large), Some(1));
        assert_eq!(channels.describe(key(7), &large), None);
        assert_eq!(channels.describe(key(7), &Channel::default()), Some(3));
        for number in 8..MAX_CHANNELS as u32 + 5 {
            assert_eq!(channels.number(key(number)), Some(number - 4));
        }
        assert_eq!(channels.number(key(0)), None);
        assert!(!channels.has(&key(0)) && channels.number(key(6)) == Some(2));
    }
}
