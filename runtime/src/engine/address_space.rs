//! The address space that an engine reserves, and the limit of the program (`ulimit -v`).
//!
//! A thread reserves address space for its stack and for the memory that it will allocate, of which it uses little.
//! Where the address space ends within that, no error can be returned: the program ends with a signal. Therefore a
//! limit that cannot be enough is refused before the run. What shared memory reserves beyond it depends on the sizes of
//! messages, and fails with an error.

use super::{EngineKind, Failure};
use crate::pipeline::Pipeline;
use rustix::process::{Resource, getrlimit};

/// What the program itself reserves, and a run in one thread at the least, bytes.
const PROGRAM: u64 = 128 << 20;
/// What the thread of a stage reserves, bytes: its stack, and what the allocator of the C library sets aside for it.
const STAGE: u64 = 64 << 20;

/// A limit below which a run in one thread may end without an error, bytes.
const LITTLE: u64 = 512 << 20;

/// Checks that an engine can run the stages of a pipeline within the limit of this program, and warns if that is not
/// certain.
///
/// # Errors
/// The limit is too low.
pub(super) fn check(engine: EngineKind, pipeline: &Pipeline) -> Result<(), Failure> {
    let limit = getrlimit(Resource::As).current;
    within(engine, pipeline.stages.len(), limit)?;
    if let Some(limit) = limit.filter(|limit| engine == EngineKind::Single && *limit < LITTLE) {
        tracing::warn!(
            "the address space of this program is limited to {} MB (`ulimit -v`); if that is not enough, the program will end with \
             \"memory allocation failed\": raise the limit then",
            limit >> 20
        );
    }
    Ok(())
}

fn within(engine: EngineKind, stages: usize, limit: Option<u64>) -> Result<(), Failure> {
    let threads = if engine == EngineKind::Single { 0 } else { stages as u64 };
    let needed = PROGRAM + STAGE * threads;
    match limit.filter(|limit| *limit < needed) {
        Some(limit) => Err(Failure::AddressSpace { engine: engine.to_string(), needed, limit }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_limit_that_threads_cannot_keep_is_refused() {
        assert_eq!(within(EngineKind::Threads, 17, None), Ok(()));
        assert_eq!(within(EngineKind::Threads, 17, Some(1300 << 20)), Ok(()));
        assert_eq!(within(EngineKind::Single, 17, Some(128 << 20)), Ok(()));
        let error = within(EngineKind::Single, 17, Some(100 << 20)).unwrap_err().to_string();
        assert!(error.contains("128 MB") && error.ends_with("(`ulimit -v`): raise that limit"), "{error}");
        let error = within(EngineKind::Processes, 17, Some(800 << 20)).unwrap_err().to_string();
        assert!(error.contains("1216 MB") && error.contains("800 MB (`ulimit -v`)"), "{error}");
    }
}
