//! Limits of the address space (`ulimit -v`): within one, threads reserve less.
//!
//! The allocator of the C library sets aside 64 MB for each thread, of which little is used. Within a limit that leaves
//! nothing for what is needed, and then the program ends with a signal. With one arena for all threads it sets aside
//! nothing.

use anyhow::Context;
use rustix::process::{Resource, getrlimit};
use std::env;
use std::os::unix::process::CommandExt;
use std::process::Command;
use std::thread::available_parallelism;

/// The number of arenas of the allocator, an environment variable of the C library.
const ARENAS: &str = "MALLOC_ARENA_MAX";
/// The number of threads of parallel loops, an environment variable of rayon.
const LOOP_THREADS: &str = "RAYON_NUM_THREADS";

/// The address space of the program itself, bytes.
const PROGRAM: u64 = 128 << 20;
/// The address space that the allocator reserves for a thread, bytes.
const ARENA: u64 = 64 << 20;
/// The address space of a thread of parallel loops for its stack and its data, bytes.
const LOOP_THREAD: u64 = 8 << 20;
/// The number of threads beside those of parallel loops and of prefetching.
const OTHER_THREADS: u64 = 8;

/// Keeps within a limit of the address space, if there is one that threads might reach. The allocator reads its
/// settings at the start of a program, so the program starts once more, in its own place.
///
/// # Errors
/// The threads of parallel loops cannot be started.
pub(crate) fn keep_within_limit() -> anyhow::Result<()> {
    let cores = available_parallelism().map_or(1, usize::from);
    let Some(limit) = getrlimit(Resource::As).current.filter(|limit| is_little(*limit, cores)) else { return Ok(()) };
    if env::var_os(ARENAS).is_none()
        && let Ok(program) = env::current_exe()
    {
        let mut arguments = env::args_os();
        let mut again = Command::new(program);
        if let Some(name) = arguments.next() {
            again.arg0(name);
        }
        // It returns only if it fails; then the limit may be enough all the same.
        let error = again.args(arguments).env(ARENAS, "1").exec();
        tracing::debug!("cannot start the program again with {ARENAS}=1: {error}");
    }
    if env::var_os(LOOP_THREADS).is_some() {
        return Ok(());
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(loop_threads(limit, cores));
    pool.build_global().with_context(|| {
        format!("cannot start threads within {} MB of address space (`ulimit -v`): raise that limit", limit >> 20)
    })
}

/// Whether the arenas of all threads might take so much address space, bytes.
fn is_little(limit: u64, cores: usize) -> bool {
    limit < PROGRAM + ARENA * (2 * cores as u64 + OTHER_THREADS)
}

/// The number of threads of parallel loops within so much address space, bytes.
fn loop_threads(limit: u64, cores: usize) -> usize {
    let fitting = limit.saturating_sub(PROGRAM) / LOOP_THREAD;
    usize::try_from(fitting).unwrap_or(usize::MAX).clamp(1, cores)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn loops_have_as_many_threads_as_fit_and_at_least_one() {
        assert_eq!([64 << 20, 160 << 20, 1 << 30].map(|limit| loop_threads(limit, 64)), [1, 4, 64]);
        assert_eq!(loop_threads(u64::MAX, 2), 2);
    }

    #[test]
    fn a_limit_is_little_if_the_threads_of_all_cores_may_reach_it() {
        assert!(is_little(800 << 20, 2) && !is_little(1 << 30, 2));
        assert!(is_little(8 << 30, 64) && !is_little(u64::MAX, 64));
    }
}
