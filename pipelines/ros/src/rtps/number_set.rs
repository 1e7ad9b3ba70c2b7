//! Sets of sequence numbers and of fragment numbers: a first number, and a bit for each of up to 256 numbers from it on
//! (RTPS 2.3, 9.4.2.6 and 9.4.2.8).

use super::cursor::{Cursor, push_sequence};

/// The number of numbers that a set can hold.
pub(crate) const CAPACITY: i64 = 256;

/// A set of numbers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct NumberSet {
    /// The first number that the set is about; of sequence numbers, all before it have come.
    pub(crate) base: i64,
    /// Those that are in it, in ascending order.
    pub(crate) numbers: Vec<i64>,
}

impl NumberSet {
    /// The set of those numbers that it has room for.
    pub(crate) fn new(base: i64, numbers: impl IntoIterator<Item = i64>) -> Self {
        let fits = |number: &i64| (base..base.saturating_add(CAPACITY)).contains(number);
        Self { base, numbers: numbers.into_iter().take_while(fits).collect() }
    }

    pub(crate) fn read_sequences(cursor: &mut Cursor<'_>) -> Option<Self> {
        let base = cursor.sequence()?;
        Self::read_bits(cursor, base)
    }

    pub(crate) fn read_fragments(cursor: &mut Cursor<'_>) -> Option<Self> {
        let base = i64::from(cursor.u32()?);
        Self::read_bits(cursor, base)
    }

    fn read_bits(cursor: &mut Cursor<'_>, base: i64) -> Option<Self> {
        let count = i64::from(cursor.u32()?).min(CAPACITY);
        let words = (0..(count + 31) / 32).map(|_| cursor.u32()).collect::<Option<Vec<u32>>>()?;
        let is_set = |bit: &i64| words.get((bit / 32) as usize).is_some_and(|word| word & (1 << (31 - bit % 32)) != 0);
        let numbers = (0..count).filter(is_set).map(|bit| base.saturating_add(bit)).collect();
        Some(Self { base, numbers })
    }

    pub(crate) fn push_sequences(&self, bytes: &mut Vec<u8>) {
        push_sequence(bytes, self.base);
        self.push_bits(bytes);
    }

    pub(crate) fn push_fragments(&self, bytes: &mut Vec<u8>) {
        bytes.extend((self.base as u32).to_le_bytes());
        self.push_bits(bytes);
    }

    fn push_bits(&self, bytes: &mut Vec<u8>) {
        let count = self.numbers.last().map_or(0, |last| last - self.base + 1);
        let mut words = vec![0_u32; (count + 31) as usize / 32];
        for number in &self.numbers {
            let bit = number - self.base;
            if let Some(word) = words.get_mut((bit / 32) as usize) {
                *word |= 1 << (31 - bit % 32);
            }
        }
        bytes.extend((count as u32).to_le_bytes());
        bytes.extend(words.into_iter().flat_map(u32::to_le_bytes));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The example of RTPS 2.3, 9.4.2.6: `1234:/12:00110`.
    #[test]
    fn the_bits_are_those_of_the_specification() {
        let mut bytes = Vec::new();
        NumberSet::new(1234, [1236, 1237]).push_sequences(&mut bytes);
        assert_eq!(bytes[..12], [0, 0, 0, 0, 0xd2, 4, 0, 0, 4, 0, 0, 0]);
        assert_eq!(u32::from_le_bytes(bytes[12..].try_into().unwrap()), 0b0011 << 28);
    }

    #[test]
    fn a_set_is_read_back_and_holds_as_many_as_it_has_room_for() {
        for numbers in [vec![], vec![7], vec![7, 39, 262], (7..263).collect()] {
            let set = NumberSet::new(7, numbers);
            let mut bytes = Vec::new();
            set.push_fragments(&mut bytes);
            assert_eq!(NumberSet::read_fragments(&mut Cursor::new(&bytes, true)), Some(set));
        }
        assert_eq!(NumberSet::new(7, 7..10_000).numbers.last(), Some(&262));
    }

    #[test]
    fn a_count_that_is_too_large_is_not_believed() {
        let mut bytes = vec![1, 0, 0, 0, 255, 255, 255, 255];
        assert_eq!(NumberSet::read_fragments(&mut Cursor::new(&bytes, true)), None);
        bytes.extend([255; 32]);
        assert_eq!(NumberSet::read_fragments(&mut Cursor::new(&bytes, true)).unwrap().numbers.len(), 256);
    }
}
