//! A command that was started, and the processes that belong to it.

use anyhow::{Result, bail};
use std::fs;
use std::io::{Read, Seek};
use std::os::unix::process::ExitStatusExt;
use std::path::PathBuf;
use std::process::{Child, Command};
use std::thread;
use std::time::{Duration, Instant};

/// A command that runs for longer hangs.
const WATCHDOG: Duration = Duration::from_secs(60);
const LOOK_INTERVAL: Duration = Duration::from_millis(2);

/// Waits for a condition, or for so long. Whether it holds.
pub(crate) fn wait_for(most: Duration, mut condition: impl FnMut() -> bool) -> bool {
    let start = Instant::now();
    loop {
        if condition() {
            return true;
        }
        if start.elapsed() >= most {
            return false;
        }
        thread::park_timeout(LOOK_INTERVAL);
    }
}

/// A message and what a command has printed.
pub(crate) fn with_text(message: &str, text: &str) -> String {
    format!("{message}; it has printed:\n{text}")
}

/// How a command ended.
#[derive(Debug)]
pub(crate) struct Ended {
    /// None if it was ended by a signal.
    pub(crate) status: Option<i32>,
    /// All that it has printed.
    pub(crate) text: String,
}

/// A command that runs. It does not outlive this.
pub(crate) struct Started {
    child: Child,
    printed: fs::File,
    /// Every process of a run gets this folder.
    runs: PathBuf,
    is_contained: bool,
}

impl Started {
    pub(crate) fn new(mut command: Command, runs: PathBuf, is_contained: bool) -> Result<Self> {
        let printed = tempfile::tempfile()?;
        let child = command.stdout(printed.try_clone()?).stderr(printed.try_clone()?).spawn()?;
        Ok(Self { child, printed, runs, is_contained })
    }

    /// The number of its first process.
    pub(crate) fn id(&self) -> u32 {
        self.child.id()
    }

    /// The process that leads the run; none if it is not there.
    pub(crate) fn leader(&self) -> Option<u32> {
        match self.is_contained {
            true => all().into_iter().find(|process| process.parent == self.id()).map(|process| process.id),
            false => Some(self.id()),
        }
    }

    /// The processes of its stages, and of all others that use the same folder of runs.
    pub(crate) fn stages(&self) -> Vec<u32> {
        stages(&self.runs)
    }

    /// Sends a signal to a process that may have gone.
    pub(crate) fn signal(process: u32, name: &str) {
        if fs::exists(format!("/proc/{process}")).unwrap_or_default() {
            Command::new("kill")
                .args([&format!("-{name}"), &process.to_string()])
                .stderr(std::process::Stdio::null())
                .status()
                .ok();
        }
    }

    /// Whether it has ended.
    pub(crate) fn has_ended(&mut self) -> bool {
        self.child.try_wait().is_ok_and(|status| status.is_some())
    }

    /// Waits for its end. One that hangs is killed, and is an error.
    pub(crate) fn wait(mut self) -> Result<Ended> {
        if !wait_for(WATCHDOG, || self.has_ended()) {
            bail!(with_text("a command hangs", &self.text()?));
        }
        let status = self.child.wait()?;
        // A container ends with 128 and the signal that has ended its first process.
        let code = status.code().filter(|code| status.signal().is_none() && *code < 128);
        Ok(Ended { status: code, text: self.text()? })
    }

    fn text(&mut self) -> Result<String> {
        let mut bytes = Vec::new();
        self.printed.rewind()?;
        self.printed.read_to_end(&mut bytes)?;
        Ok(String::from_utf8_lossy(&bytes).into_owned())
    }
}

impl Drop for Started {
    fn drop(&mut self) {
        if !self.has_ended() {
            self.stages().into_iter().chain([self.id()]).for_each(|process| Self::signal(process, "KILL"));
            self.child.wait().ok();
        }
    }
}

/// A process that runs.
struct Process {
    id: u32,
    parent: u32,
}

/// All processes that can be seen, but those that have ended and were not waited for.
fn all() -> Vec<Process> {
    let ids =
        fs::read_dir("/proc").into_iter().flatten().filter_map(|entry| entry.ok()?.file_name().to_str()?.parse().ok());
    let of_process = |id: u32| {
        let stat = fs::read_to_string(format!("/proc/{id}/stat")).ok()?;
        // The name stands in brackets, and may hold anything.
        let mut fields = stat.rsplit_once(')')?.1.split_whitespace();
        let (state, parent) = (fields.next()?, fields.next()?.parse().ok()?);
        (state != "Z" && state != "X").then_some(Process { id, parent })
    };
    ids.filter_map(of_process).collect()
}

/// Finds the processes that were given a folder of runs.
pub(crate) fn stages(runs: &std::path::Path) -> Vec<u32> {
    let folder = runs.to_string_lossy().into_owned();
    let has_folder = |process: &Process| {
        fs::read(format!("/proc/{}/cmdline", process.id))
            .is_ok_and(|line| String::from_utf8_lossy(&line).contains(&folder))
    };
    all().into_iter().filter(has_folder).map(|process| process.id).collect()
}
