//! A limit for the contents of all chunks of a file together.
//!
//! Each chunk is limited, and so is the memory that they take; but a small file may have so many chunks of zeros that
//! unpacking them takes hours. No log of a robot is packed to a thousandth, not even one of maps that are mostly unknown.

use super::block::Block;
use super::damage::{ChunkFault, Damage, LARGEST, MOST_REPORTS};

/// The maximum size of the contents of all chunks of a file, bytes: this, or so many times the size of the file.
const LARGEST_ANYWAY: u64 = 16 << 30;
const LARGEST_RATIO: u64 = 1024;

/// Drops the blocks at the end of a file of `length` bytes whose contents are too much together with those before.
/// Returns the damage that is reported for them.
pub(crate) fn drop_excess(blocks: &mut Vec<Block>, length: usize) -> impl Iterator<Item = Damage> {
    let most = most_contents(length as u64);
    let mut size = 0_u64;
    let fits = |block: &&Block| {
        // A chunk that claims more than one may have is not unpacked.
        size = size.saturating_add(Some(block.most_memory()).filter(|size| *size <= LARGEST).unwrap_or(0));
        size <= most
    };
    let kept = blocks.iter().take_while(fits).count();
    let dropped = blocks.len() - kept;
    blocks.truncate(kept);
    std::iter::repeat_n(Damage::BadChunk { fault: ChunkFault::Expansion }, dropped.min(MOST_REPORTS))
}

/// The maximum size of the contents of a file of `length` bytes.
pub(crate) fn most_contents(length: u64) -> u64 {
    LARGEST_ANYWAY.max(LARGEST_RATIO.saturating_mul(length))
}

/// The limit in words.
pub(super) fn limit() -> String {
    format!("{} GiB and {LARGEST_RATIO} times the size of the file", LARGEST_ANYWAY >> 30)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reader::block::Records;

    /// Blocks of a GiB each.
    fn blocks(count: usize) -> Vec<Block> {
        vec![Block { first_time: 0, last_time: 0, records: Records::Bare(0..1 << 30) }; count]
    }

    #[test]
    fn chunks_that_unpack_to_far_more_than_the_file_are_dropped_and_reported() {
        for (count, length, kept) in [(16, 1, 16), (20, 1, 16), (3000, 20 << 20, 20), (3000, 1 << 32, 3000)] {
            let mut all = blocks(count);
            let damage: Vec<Damage> = drop_excess(&mut all, length).collect();
            assert_eq!((all.len(), damage.len()), (kept, (count - kept).min(MOST_REPORTS)), "{count} {length}");
        }
        let damaged = Block { first_time: 0, last_time: 0, records: Records::Bare(0..1 << 60) };
        let mut all = [vec![damaged], blocks(16)].concat();
        assert_eq!(drop_excess(&mut all, 0).count(), 0, "a wrong size does not hide the rest");
        let mut all = blocks(17);
        let text = drop_excess(&mut all, 0).next().unwrap().to_string();
        let expected = "with those of the chunks before it take more than 16 GiB and 1024 times the size of the file";
        assert!(text.contains(expected), "{text}");
    }
}
