//! What happens to a run.

use rand::seq::IndexedRandom;
use rand_chacha::ChaCha8Rng;

/// What happens to a run, at a moment that is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Trouble {
    /// One process of a stage is killed.
    KillStage,
    /// The process that leads the run is killed.
    KillLeader,
    /// All processes are killed at once.
    KillAll,
    /// It is told to end.
    Signal(&'static str),
    /// All of its processes are halted for a moment.
    HaltAll,
    /// One of its processes is halted for a moment.
    HaltOne,
    /// Another one is started with the same output.
    Twice,
    /// The disk has too little room for its output.
    FullDisk,
    /// Another program takes all of shared memory.
    FullSharedMemory,
}

const KILLS: [Trouble; 3] = [Trouble::KillStage, Trouble::KillLeader, Trouble::KillAll];
const SIGNALS: [&str; 6] = ["INT", "TERM", "HUP", "QUIT", "USR1", "ALRM"];
const OTHERS: [Trouble; 5] =
    [Trouble::HaltAll, Trouble::HaltOne, Trouble::Twice, Trouble::FullDisk, Trouble::FullSharedMemory];

impl Trouble {
    /// What happens in a round. Each happens as often as the others, but for chance at the end.
    pub(crate) fn draw(round: u32, kills: bool, random: &mut ChaCha8Rng) -> Self {
        let kinds = KILLS.len() + if kills { 0 } else { OTHERS.len() + 1 };
        let number = round as usize % kinds;
        let others = || OTHERS.get(number - KILLS.len()).copied();
        KILLS
            .get(number)
            .copied()
            .or_else(others)
            .unwrap_or_else(|| Self::Signal(SIGNALS.choose(random).copied().unwrap_or_default()))
    }

    /// Whether the run may leave something to `gridweave clean`.
    pub(crate) fn may_leave(self) -> bool {
        matches!(self, Self::KillLeader | Self::KillAll)
    }

    /// Whether it must end well all the same.
    pub(crate) fn is_harmless(self) -> bool {
        matches!(self, Self::HaltAll | Self::HaltOne | Self::Twice)
    }
}
