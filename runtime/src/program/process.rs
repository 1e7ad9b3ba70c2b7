//! The process of a program, and the events by which it and its stage wake each other.

use crate::engine::describe_exit;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use rustix::process::{Pid, Signal, kill_process};
use std::ffi::OsString;
use std::io::{self, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

/// The timeout of a single wait.
const POLL_INTERVAL: Duration = Duration::from_millis(100);
/// The maximum time that a single wait counts: a wait that took longer means that this process was suspended, and
/// probably its program too.
const MAX_COUNTED_WAIT: Duration = Duration::from_secs(1);
/// The time that a program has to exit after its standard input is closed.
const EXIT_TIME: Duration = Duration::from_secs(5);
/// The time that a program has to report where it hangs.
const REPORT_TIME: Duration = Duration::from_millis(500);

/// The command line of a program; the folder of the run is appended to the arguments.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Launch {
    /// The program.
    pub program: PathBuf,
    /// The arguments before the folder.
    pub arguments: Vec<OsString>,
}

/// An error of the process of a program.
#[derive(Debug, thiserror::Error)]
pub(super) enum ProcessError {
    /// Its process has ended.
    #[error("its process {0}")]
    Ended(String),
    /// It exceeded the maximum time of a call.
    #[error(
        "it hangs: it has worked on one message for {seconds} s, and was killed; see its output above for what it was doing; \
         `stall_timeout` in [pipeline] sets how long it may take"
    )]
    Hung {
        /// The timeout.
        seconds: f64,
    },
    /// The system cannot wait for it.
    #[error("its process cannot be watched: {0}")]
    Unwatched(io::Error),
}

/// A running program.
pub(super) struct Process {
    child: Child,
    input: Option<ChildStdin>,
    output: ChildStdout,
    /// Events that were received and not handled yet.
    received: Vec<u8>,
}

impl Process {
    /// Starts a program in the folder of a run.
    pub(super) fn start(launch: &Launch, folder: &Path) -> io::Result<Self> {
        let mut command = Command::new(&launch.program);
        command.args(&launch.arguments).arg(folder).stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = command.spawn()?;
        match (child.stdin.take(), child.stdout.take()) {
            (input @ Some(_), Some(output)) => Ok(Self { child, input, output, received: Vec::new() }),
            _ => Err(io::Error::other("it has no standard input and output")),
        }
    }

    /// Rings the doorbell of the program. A failure is ignored: the end of the program is noticed by
    /// [`wait`](Self::wait).
    pub(super) fn ring(&mut self, byte: u8) {
        let _ = self.input.as_mut().map(|input| input.write_all(&[byte]));
    }

    /// Waits until the program rings, for at most `longest`.
    pub(super) fn wait(&mut self, longest: Option<Duration>) -> Result<u8, ProcessError> {
        let mut waited = Duration::ZERO;
        while self.received.is_empty() {
            let start = Instant::now();
            if self.read_doorbell(POLL_INTERVAL)? {
                continue;
            }
            waited += start.elapsed().min(MAX_COUNTED_WAIT);
            if let Some(longest) = longest.filter(|longest| waited >= *longest) {
                self.kill_hung();
                return Err(ProcessError::Hung { seconds: longest.as_secs_f64() });
            }
        }
        Ok(self.received.remove(0))
    }

    /// Takes in what the program has rung, waiting for so long at the most. `false` if it has not.
    fn read_doorbell(&mut self, longest: Duration) -> Result<bool, ProcessError> {
        let timeout = Timespec { tv_sec: 0, tv_nsec: i64::from(longest.subsec_nanos()) };
        match poll(&mut [PollFd::new(&self.output, PollFlags::IN)], Some(&timeout)) {
            Ok(0) | Err(Errno::INTR) => return Ok(false),
            Ok(_) => {}
            Err(error) => return Err(ProcessError::Unwatched(error.into())),
        }
        let mut bytes = [0; 64];
        match self.output.read(&mut bytes) {
            Ok(0) => Err(self.ended()),
            Ok(count) => {
                self.received.extend_from_slice(&bytes[..count]);
                Ok(true)
            }
            Err(error) if error.kind() == ErrorKind::Interrupted => Ok(false),
            Err(error) => Err(ProcessError::Unwatched(error)),
        }
    }

    /// How it ended, after it has closed its standard output. If it is still alive, it is killed.
    fn ended(&mut self) -> ProcessError {
        match self.exit_within(EXIT_TIME) {
            Some(how) => ProcessError::Ended(how),
            None => {
                self.kill();
                ProcessError::Ended("has closed its standard output, and was killed".to_owned())
            }
        }
    }

    /// Kills a program that hangs, after asking it to report where.
    fn kill_hung(&mut self) {
        if let Some(process) = i32::try_from(self.child.id()).ok().and_then(Pid::from_raw) {
            // The id belongs to the child until it is waited for.
            let _ = kill_process(process, Signal::USR1);
            let _ = self.exit_within(REPORT_TIME);
        }
        self.kill();
    }

    /// Closes its standard input, which asks it to exit, and waits until it has.
    pub(super) fn end(&mut self) {
        self.input = None;
        if self.exit_within(EXIT_TIME).is_none() {
            self.kill();
        }
    }

    fn kill(&mut self) {
        // Killing fails if it has ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }

    /// How it ended, if it does so within this time.
    fn exit_within(&mut self, longest: Duration) -> Option<String> {
        const STEP: Duration = Duration::from_millis(5);
        let mut waited = Duration::ZERO;
        loop {
            match self.child.try_wait() {
                Ok(Some(status)) => return Some(describe_exit(status)),
                Ok(None) if waited < longest => std::thread::sleep(STEP),
                Ok(None) => return None,
                Err(error) => return Some(format!("cannot be waited for: {error}")),
            }
            waited += STEP;
        }
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.end();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A shell script, which gets the folder as `$0`.
    fn shell(script: &str) -> Process {
        let launch = Launch { program: "/bin/sh".into(), arguments: vec!["-c".into(), script.into()] };
        Process::start(&launch, Path::new("/tmp")).unwrap()
    }

    #[test]
    fn each_bell_is_heard_once_and_in_order() {
        let mut process = shell("printf rs; read line; printf s");
        assert_eq!(process.wait(None).unwrap(), b'r');
        assert_eq!(process.wait(None).unwrap(), b's');
        process.ring(b'\n');
        assert_eq!(process.wait(None).unwrap(), b's');
    }

    #[test]
    fn the_error_states_how_a_program_ended() {
        for (script, says) in [
            ("exit 3", "its process ended with status 3"),
            ("kill -9 $$", "its process was ended by signal 9 (SIGKILL)"),
            ("exec >/dev/null; kill -11 $$", "signal 11 (SIGSEGV)"),
        ] {
            let lost = shell(script).wait(None).unwrap_err().to_string();
            assert!(lost.contains(says), "{lost}");
        }
    }

    #[test]
    fn a_program_that_does_not_ring_is_killed() {
        let mut process = shell("trap '' USR1; while :; do sleep 1; done");
        let lost = process.wait(Some(Duration::from_millis(200))).unwrap_err().to_string();
        assert!(lost.contains("it hangs") && lost.contains("0.2 s"), "{lost}");
        assert!(process.child.try_wait().unwrap().is_some());
    }

    #[test]
    fn a_program_that_does_not_exist_cannot_be_started() {
        let launch = Launch { program: "/nonexistent/python3".into(), arguments: Vec::new() };
        assert!(Process::start(&launch, Path::new("/tmp")).is_err());
    }
}
