//! Faults that are injected in runs.

use rand::seq::IndexedRandom;
use rand_chacha::ChaCha8Rng;

/// A fault, injected at a random moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Fault {
    /// A process of a stage is killed.
    KillStage,
    /// The supervisor of the run is killed.
    KillLeader,
    /// All processes are killed at once.
    KillAll,
    /// The run is sent a signal to end.
    Signal(&'static str),
    /// All its processes are halted for a moment.
    HaltAll,
    /// One of its processes is halted for a moment.
    HaltOne,
    /// Another run is started with the same output.
    Twice,
    /// The disk has too little room for its output.
    FullDisk,
    /// Another program takes all of shared memory.
    FullSharedMemory,
}

const KILLS: [Fault; 3] = [Fault::KillStage, Fault::KillLeader, Fault::KillAll];
const SIGNALS: [&str; 6] = ["INT", "TERM", "HUP", "QUIT", "USR1", "ALRM"];
const OTHERS: [Fault; 5] = [Fault::HaltAll, Fault::HaltOne, Fault::Twice, Fault::FullDisk, Fault::FullSharedMemory];

impl Fault {
    /// The fault of a round. All faults are equally frequent.
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

    /// Whether the run must succeed.
    pub(crate) fn is_harmless(self) -> bool {
        matches!(self, Self::HaltAll | Self::HaltOne | Self::Twice)
    }
}
