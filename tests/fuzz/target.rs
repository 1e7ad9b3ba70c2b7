//! A target: what reads, and what it is given to read.

use super::MEMORY;
use super::input::{Input, inputs};
use proptest::test_runner::{Config, RngSeed, TestCaseError, TestError, TestRunner};
use rustix::process::{Resource, Rlimit, setrlimit};
use std::fs;
use std::io::Write as _;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::Duration;

/// A reader that takes longer over one input hangs.
const WATCHDOG: Duration = Duration::from_secs(60);
/// What a reader may take for any input, bytes...
const MEMORY_ANYWAY: usize = 64 << 20;
/// ...and for each byte of it: what the best of the compressions makes of one.
const MEMORY_A_BYTE: usize = 10_000;
/// No input may take the machine's memory, bytes of address space.
const MEMORY_AT_ALL: u64 = 6 << 30;

/// Targets take turns, as memory is counted for all threads together.
static TURN: Mutex<()> = Mutex::new(());

/// How many inputs were answered.
static ANSWERED: AtomicU64 = AtomicU64::new(0);

/// Ends this program if a reader hangs, until what it gives is dropped. A thread cannot be ended, and what it reads
/// must stay as it is.
fn watch(name: &'static str, folder: PathBuf) -> Sender<()> {
    let (done, end) = mpsc::channel();
    thread::spawn(move || {
        let mut answered = u64::MAX;
        while end.recv_timeout(WATCHDOG) == Err(RecvTimeoutError::Timeout) {
            if answered == ANSWERED.load(Ordering::Relaxed) {
                let _ = writeln!(std::io::stderr(), "{name} hangs on the input in {}", folder.display());
                std::process::abort();
            }
            answered = ANSWERED.load(Ordering::Relaxed);
        }
    });
    done
}

/// Something that reads what others have written.
pub(crate) struct Target {
    /// Its name, and that of its folder of regressions.
    pub(crate) name: &'static str,
    /// The names of the files that an input consists of.
    pub(crate) files: &'static [&'static str],
    /// What real encoders write.
    pub(crate) seeds: Vec<Input>,
    /// What means something in a text of this kind.
    pub(crate) words: &'static [&'static str],
    /// How many inputs are tried in a test run.
    pub(crate) cases: u32,
    /// Reads the files of an input that lie in a folder; panics if what it reads cannot be.
    pub(crate) read: fn(&Path),
}

impl Target {
    /// Fails the test on the first input that is not answered.
    #[track_caller]
    pub(crate) fn check(mut self) {
        let _turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
        let limit = Rlimit { current: Some(MEMORY_AT_ALL), ..rustix::process::getrlimit(Resource::As) };
        setrlimit(Resource::As, limit).unwrap();
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("fuzz").join(self.name);
        fs::create_dir_all(&folder).unwrap();
        let _watch = watch(self.name, folder.clone());
        for regression in self.regressions() {
            let input = Input::read(&regression, self.files);
            self.answer(&input, &folder).unwrap_or_else(|fault| panic!("{}: {fault}", regression.display()));
            self.seeds.push(input);
        }
        for seed in &self.seeds {
            self.answer(seed, &folder).unwrap_or_else(|fault| panic!("what an encoder wrote: {fault}"));
        }
        match TestRunner::new(self.config()).run(&inputs(self.seeds.clone(), self.files.len(), self.words), |input| {
            self.answer(&input, &folder).map_err(TestCaseError::fail)
        }) {
            Ok(()) => fs::remove_dir_all(&folder).unwrap(),
            Err(TestError::Abort(reason)) => panic!("{reason}"),
            Err(TestError::Fail(reason, input)) => {
                input.write(&folder, self.files);
                panic!("{reason}; the input is in {}", folder.display());
            }
        }
    }

    fn config(&self) -> Config {
        let mut config = Config { failure_persistence: None, max_shrink_time: 60_000, ..Config::default() };
        if std::env::var_os("PROPTEST_CASES").is_none() {
            config.cases = self.cases;
        }
        if config.rng_seed == RngSeed::Random {
            config.rng_seed = RngSeed::Fixed(1);
        }
        config
    }

    /// The inputs that were not answered once.
    fn regressions(&self) -> Vec<PathBuf> {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/regressions").join(self.name);
        let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
        let mut folders: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
        folders.sort();
        folders
    }

    /// Reads an input; an error is what is wrong with that.
    fn answer(&self, input: &Input, folder: &Path) -> Result<(), String> {
        input.write(folder, self.files);
        MEMORY.reset_peak_usage();
        let before = MEMORY.current_usage();
        let read = catch_unwind(AssertUnwindSafe(|| (self.read)(folder)));
        ANSWERED.fetch_add(1, Ordering::Relaxed);
        if let Err(panic) = read {
            let text = panic.downcast_ref::<String>().map(String::as_str);
            return Err(format!("panic: {}", text.or(panic.downcast_ref::<&str>().copied()).unwrap_or_default()));
        }
        let taken = MEMORY.peak_usage().saturating_sub(before);
        match taken > MEMORY_ANYWAY + MEMORY_A_BYTE * input.len() {
            true => Err(format!("{} MB of memory for {} bytes", taken >> 20, input.len())),
            false => Ok(()),
        }
    }
}
