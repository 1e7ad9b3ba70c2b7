//! Whatever bytes come in, a reader gives what they say or an error: it does not panic, does not hang, and takes no
//! memory that the bytes do not warrant.
//!
//! Each target begins with what real encoders write and changes it in a few places; now and then its input is random.
//! Inputs follow from a seed, so that a run can be repeated, and are few enough for every test run. A long search:
//!
//! ```sh
//! PROPTEST_CASES=1000000 PROPTEST_RNG_SEED=7 cargo test --release -p gridweave-tests --test fuzz mcap
//! ```
//!
//! An input that fails is left, as small as it could be made, in `target/tmp/fuzz/TARGET`. It is kept as a folder of
//! `regressions/TARGET`: all of these are read first, and are changed as the others are.

#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stdout)]

mod bags;
mod cdr;
mod databases;
mod definitions;
mod input;
mod map_files;
mod mcap_logs;
mod pipelines;
mod ros1_bags;
mod target;

use peak_alloc::PeakAlloc;

/// Counts what all threads of this program take.
#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;
