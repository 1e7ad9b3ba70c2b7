//! Running the command, and logs to run it on.

pub(crate) mod golden_cases;
mod live_run;
mod readings;
mod run_files;

pub(crate) use gridweave_tests::{LogBuilder, TestMap};
pub(crate) use live_run::{LOG, OUTPUT, POSES, RECEIVE, Run, TROUBLED, counts, read};
pub(crate) use readings::{change_readings, moved_reading, place_in_map_2};
pub(crate) use run_files::{DIAMOND, left_over, outcome, processes, run_folder, run_name, signal, wait_until};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// How a command ended.
#[derive(Debug)]
pub(crate) struct Ended {
    pub(crate) status: i32,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

impl Ended {
    /// All that it has printed.
    pub(crate) fn text(&self) -> String {
        format!("{}{}", self.stdout, self.stderr)
    }

    /// Fails the test unless the command ended with `status` and printed every one of `words`.
    #[track_caller]
    pub(crate) fn assert(&self, status: i32, words: &[&str]) {
        assert_eq!(self.status, status, "{self:#?}");
        for word in words {
            assert!(self.text().contains(word), "no `{word}` in {self:#?}");
        }
        assert!(!self.text().contains("panicked"), "{self:#?}");
    }
}

/// Runs `gridweave` in `folder`. A command that hangs is killed and fails the test.
#[track_caller]
pub(crate) fn gridweave(folder: &Path, args: &[&str]) -> Ended {
    gridweave_with(folder, args, &[])
}

/// The same, with environment variables.
#[track_caller]
pub(crate) fn gridweave_with(folder: &Path, args: &[&str], variables: &[(&str, &str)]) -> Ended {
    start(folder, args, variables).wait()
}

/// A command that runs.
pub(crate) struct Running {
    child: Child,
    command: String,
    stdout: Option<JoinHandle<String>>,
    stderr: Option<JoinHandle<String>>,
}

/// The command, with stages that get into trouble beside those that ship.
pub(crate) fn gridweave_program() -> &'static Path {
    Path::new(env!("CARGO_BIN_EXE_troubled_stages"))
}

/// Starts `gridweave` in `folder`.
#[track_caller]
pub(crate) fn start(folder: &Path, args: &[&str], variables: &[(&str, &str)]) -> Running {
    start_program(gridweave_program(), folder, args, variables)
}

/// Starts a program in `folder`.
#[track_caller]
pub(crate) fn start_program(program: &Path, folder: &Path, args: &[&str], variables: &[(&str, &str)]) -> Running {
    let mut child = Command::new(program)
        .args(args)
        .envs(variables.iter().copied())
        .current_dir(folder)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let read = |mut pipe: Box<dyn Read + Send>| {
        Some(std::thread::spawn(move || {
            let mut bytes = Vec::new();
            pipe.read_to_end(&mut bytes).unwrap();
            String::from_utf8_lossy(&bytes).into_owned()
        }))
    };
    let stdout = read(Box::new(child.stdout.take().unwrap()));
    let stderr = read(Box::new(child.stderr.take().unwrap()));
    Running { child, command: format!("{} {args:?}", program.display()), stdout, stderr }
}

impl Running {
    /// The number of its process.
    pub(crate) fn id(&self) -> u32 {
        self.child.id()
    }

    /// Waits for its end. A command that hangs is killed and fails the test.
    #[track_caller]
    pub(crate) fn wait(mut self) -> Ended {
        let start = Instant::now();
        let status = loop {
            match self.child.try_wait().unwrap() {
                Some(status) => break status,
                None if start.elapsed() > Duration::from_secs(240) => {
                    self.child.kill().unwrap();
                    panic!("{} hangs", self.command);
                }
                None => std::thread::sleep(Duration::from_millis(5)),
            }
        };
        let [stdout, stderr] =
            [&mut self.stdout, &mut self.stderr].map(|output| output.take().unwrap().join().unwrap());
        Ended { status: status.code().unwrap_or(-1), stdout, stderr }
    }
}

impl Drop for Running {
    /// What a test that fails has started does not go on after it.
    fn drop(&mut self) {
        if !matches!(self.child.try_wait(), Ok(None)) {
            return;
        }
        signal(self.id(), "TERM");
        let start = Instant::now();
        while matches!(self.child.try_wait(), Ok(None)) && start.elapsed() < Duration::from_secs(15) {
            std::thread::sleep(Duration::from_millis(5));
        }
        let _ = self.child.kill();
    }
}

/// A small simulated log and its truth, in `folder`.
#[track_caller]
pub(crate) fn simulate(folder: &Path, name: &str, args: &[&str]) -> (PathBuf, PathBuf) {
    let log = folder.join(name);
    let mut all = vec!["simulate", "-o", log.to_str().unwrap()];
    all.extend(args);
    let ended = gridweave(folder, &all);
    assert_eq!(ended.status, 0, "{ended:#?}");
    let truth = log.with_extension("truth.json");
    (log, truth)
}

/// The folder with real logs that the environment names, if it does.
pub(crate) fn real_logs() -> Option<PathBuf> {
    let folder = std::env::var_os("GRIDWEAVE_LOGS").map(PathBuf::from);
    if folder.is_none() {
        eprintln!("SKIPPED: GRIDWEAVE_LOGS does not name a folder with real logs");
    }
    folder
}

/// The logs of a folder, by name.
pub(crate) fn logs_in(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut logs: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    logs.retain(|path| path.extension().is_some_and(|end| end == "mcap"));
    logs.sort();
    assert!(!logs.is_empty(), "{} holds no logs", folder.display());
    logs
}
