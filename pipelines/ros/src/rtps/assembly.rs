//! A sample that comes in fragments.

use std::collections::BTreeMap;

/// No sample is larger, bytes.
const LARGEST_SAMPLE: u32 = 1 << 30;

/// The received fragments of a sample. Its memory is that of the fragments, whatever size of the sample they state.
#[derive(Debug)]
pub(crate) struct Assembly {
    sample_size: u32,
    fragment_size: u16,
    /// By number, from 1.
    fragments: BTreeMap<u32, Vec<u8>>,
}

impl Assembly {
    /// `None` for sizes that cannot be.
    pub(crate) fn new(sample_size: u32, fragment_size: u16) -> Option<Self> {
        let is_possible = fragment_size > 0 && (1..=LARGEST_SAMPLE).contains(&sample_size);
        is_possible.then(|| Self { sample_size, fragment_size, fragments: BTreeMap::new() })
    }

    /// Adds consecutive fragments, if they agree with the first ones.
    pub(crate) fn add(&mut self, first: u32, sizes: (u32, u16), payload: &[u8]) {
        if sizes != (self.sample_size, self.fragment_size) {
            return;
        }
        for (number, fragment) in (first..=u32::MAX).zip(payload.chunks(usize::from(self.fragment_size))) {
            let size = self.size_of(number);
            if size > 0 && fragment.len() >= size {
                self.fragments.entry(number).or_insert_with(|| fragment[..size].to_vec());
            }
        }
    }

    fn count(&self) -> u32 {
        self.sample_size.div_ceil(u32::from(self.fragment_size))
    }

    /// The size of a fragment, bytes; 0 if the sample has none of this number.
    fn size_of(&self, number: u32) -> usize {
        let full = u32::from(self.fragment_size);
        match number {
            0 => 0,
            number => self.sample_size.saturating_sub((number - 1).saturating_mul(full)).min(full) as usize,
        }
    }

    /// The whole sample, once all fragments are there.
    pub(crate) fn sample(&self) -> Option<Vec<u8>> {
        let is_whole = self.fragments.len() == self.count() as usize;
        is_whole.then(|| self.fragments.values().flatten().copied().collect())
    }

    /// The first fragment that is missing and those after it.
    pub(crate) fn missing(&self) -> impl Iterator<Item = i64> + '_ {
        (1..=self.count()).filter(|number| !self.fragments.contains_key(number)).map(i64::from)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_is_whole_once_all_fragments_have_come_in_whatever_order() {
        let sample: Vec<u8> = (0..250).collect();
        let mut assembly = Assembly::new(250, 100).unwrap();
        // Padded at its end, as on the wire.
        assembly.add(3, (250, 100), &[&sample[200..], &[0, 0]].concat());
        assembly.add(3, (250, 100), &[1; 50]);
        assert_eq!((assembly.sample(), assembly.missing().collect::<Vec<_>>()), (None, vec![1, 2]));
        assembly.add(1, (250, 100), &sample[..200]);
        assert_eq!(assembly.sample(), Some(sample));
    }

    #[test]
    fn fragments_that_cannot_be_are_not_taken() {
        assert!(
            Assembly::new(10, 0).is_none() && Assembly::new(0, 10).is_none() && Assembly::new(u32::MAX, 1).is_none()
        );
        let mut assembly = Assembly::new(250, 100).unwrap();
        for (first, sizes, length) in [(0, (250, 100), 100), (4, (250, 100), 100), (u32::MAX, (250, 100), 300)] {
            assembly.add(first, sizes, &vec![0; length]);
        }
        assembly.add(1, (250, 50), &[0; 50]);
        assembly.add(1, (250, 100), &[0; 99]);
        assert_eq!(assembly.missing().collect::<Vec<_>>(), [1, 2, 3]);
    }
}
