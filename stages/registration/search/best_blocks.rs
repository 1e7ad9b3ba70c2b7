//! The best squares of a plane of scores.

use std::cmp::Ordering;

/// A square of the plane of scores.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Block {
    /// Best score in it.
    pub(super) score: i32,
    /// First row.
    pub(super) row: usize,
    /// First column.
    pub(super) column: usize,
}

impl Block {
    /// Sort order: the better one first, and of equals the first, so that the order does not depend on the sort.
    fn best_first(&self, other: &Self) -> Ordering {
        (other.score, self.row, self.column).cmp(&(self.score, other.row, other.column))
    }
}

/// The best blocks of those so far, which come row by row, and maybe as many others.
pub(super) struct BestBlocks {
    blocks: Vec<Block>,
    most: usize,
    /// Largest score that is not among the best, as there are `most` others that are no worse.
    pub(super) too_little: i32,
}

impl BestBlocks {
    /// No blocks, of which `most` will be taken.
    pub(super) fn new(most: usize) -> Self {
        Self { blocks: Vec::new(), most, too_little: 0 }
    }

    /// Adds a block with a score above [`too_little`](Self::too_little).
    pub(super) fn add(&mut self, block: Block) {
        self.blocks.push(block);
        if self.blocks.len() >= self.most.saturating_mul(2) {
            self.drop_others();
        }
    }

    fn drop_others(&mut self) {
        let (_, worst, _) = self.blocks.select_nth_unstable_by(self.most.saturating_sub(1), Block::best_first);
        self.too_little = worst.score;
        self.blocks.truncate(self.most);
    }

    /// The best blocks, the best first.
    pub(super) fn sorted(mut self) -> Vec<Block> {
        if self.blocks.len() > self.most {
            self.drop_others();
        }
        self.blocks.sort_unstable_by(Block::best_first);
        self.blocks
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_are_those_of_a_sort_of_all_and_of_equals_the_first() {
        // Scores rise and fall, and many are equal.
        let all: Vec<Block> = (0..500)
            .map(|at: usize| Block { score: (at * 7 % 50 + at % 90) as i32, row: at / 20, column: at % 20 })
            .collect();
        for most in [1, 3, 64, 499, 600, usize::MAX] {
            let mut best = BestBlocks::new(most);
            for block in &all {
                if block.score > best.too_little {
                    best.add(*block);
                }
            }
            let mut expected: Vec<Block> = all.iter().copied().filter(|block| block.score > 0).collect();
            expected.sort_by(Block::best_first);
            expected.truncate(most);
            assert_eq!(best.sorted(), expected, "{most}");
        }
    }
}
