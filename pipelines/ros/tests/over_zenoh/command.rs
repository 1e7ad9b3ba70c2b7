//! The command, run as users run it.

use std::ffi::OsStr;
use std::fs::{File, read_to_string};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

/// The command under test.
pub(crate) const GRIDWEAVE: &str = env!("CARGO_BIN_EXE_gridweave-ros");
/// What takes longer hangs: messages are built for minutes, beside other tests.
const LONGEST: Duration = Duration::from_secs(900);
/// So often it is looked whether something has happened.
const LOOK_INTERVAL: Duration = Duration::from_millis(20);

/// A program that is killed where the test ends before it.
pub(crate) struct Running {
    child: Child,
    log: PathBuf,
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Running {
    /// Starts a program in a folder. What it writes to standard error goes to the file `log` there.
    #[track_caller]
    pub(crate) fn start(program: impl AsRef<OsStr>, args: &[impl AsRef<OsStr>], folder: &Path, log: &str) -> Self {
        let (program, log) = (program.as_ref(), folder.join(log));
        let command = Command::new(program)
            .args(args)
            .current_dir(folder)
            .env_remove("ROS_DOMAIN_ID")
            .env_remove("ZENOH_SESSION_CONFIG_URI")
            .env("PYTHONDONTWRITEBYTECODE", "1")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(File::create(&log).unwrap())
            .spawn();
        let child = command.unwrap_or_else(|error| panic!("cannot start {}: {error}", program.display()));
        Self { child, log }
    }

    /// What to call the run that it is.
    pub(crate) fn run_name(&self) -> String {
        format!("gw{}_", self.child.id())
    }

    /// What it prints to standard output.
    pub(crate) fn stdout(&mut self) -> &mut impl Read {
        self.child.stdout.as_mut().unwrap()
    }

    /// What it has written to standard error.
    pub(crate) fn errors(&self) -> String {
        read_to_string(&self.log).unwrap_or_default()
    }

    /// Waits until it has written something to standard error.
    #[track_caller]
    pub(crate) fn wait_for(&self, words: &str) {
        wait_until(words, || self.errors().contains(words), || self.errors());
    }

    /// Sends it a signal.
    #[track_caller]
    pub(crate) fn signal(&self, name: &str) {
        let status = Command::new("kill").args([&format!("-{name}"), &self.child.id().to_string()]).status();
        assert!(status.unwrap().success(), "kill -{name}");
    }

    /// What it prints to standard output, to be read beside this.
    pub(crate) fn take_stdout(&mut self) -> ChildStdout {
        self.child.stdout.take().unwrap()
    }

    /// Waits for its end, and gives the status and what it has printed.
    #[track_caller]
    pub(crate) fn end(&mut self) -> (i32, String) {
        let mut stdout = self.take_stdout();
        let reader = thread::spawn(move || {
            let mut text = String::new();
            stdout.read_to_string(&mut text).unwrap();
            text
        });
        let mut status = None;
        let has_ended = || {
            status = self.child.try_wait().unwrap();
            status.is_some()
        };
        wait_until("end", has_ended, || read_to_string(&self.log).unwrap_or_default());
        (status.unwrap().code().unwrap_or(-1), reader.join().unwrap())
    }

    /// The same of one that is to end with the given status.
    #[track_caller]
    pub(crate) fn end_with(&mut self, expected: i32) -> String {
        let (status, printed) = self.end();
        assert_eq!(status, expected, "{printed}{}", self.errors());
        printed
    }
}

/// Waits until this is so. If it hangs, the test fails with what `text` has to say.
#[track_caller]
pub(crate) fn wait_until(what: &str, mut is_so: impl FnMut() -> bool, text: impl Fn() -> String) {
    let until = Instant::now() + LONGEST;
    while !is_so() {
        assert!(Instant::now() < until, "waited in vain for `{what}`: {}", text());
        thread::sleep(LOOK_INTERVAL);
    }
}

/// Runs a program to its end, which is to be a good one. Gives what it has printed.
#[track_caller]
pub(crate) fn run(program: impl AsRef<OsStr>, args: &[&str], folder: &Path) -> String {
    let mut running = Running::start(program.as_ref(), args, folder, "run.log");
    let (status, printed) = running.end();
    assert_eq!(status, 0, "{} {args:?}: {printed}{}", program.as_ref().display(), running.errors());
    printed
}
