//! Running the command, and logs to run it on.

pub(crate) mod golden_cases;
mod live_run;
mod merged_log;
mod readings;
mod simulated_world;

pub(crate) use gridweave_tests::run_files::{
    DIAMOND, left_over, outcome, part, processes, run_folder, run_name, signal, wait_until,
};
pub(crate) use gridweave_tests::{LogBuilder, TestMap};
pub(crate) use live_run::{LOG, OUTPUT, POSES, RECEIVE, Run, TROUBLED, counts, read};
pub(crate) use merged_log::{MARKUP, merged_folder};
pub(crate) use readings::{change_log, change_readings, moved_reading, place_in_map_2};
pub(crate) use simulated_world::SimulatedWorld;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::sync::mpsc::{self, Receiver};
use std::sync::{Arc, Condvar, Mutex};
use std::thread::{self, JoinHandle};
use std::time::Duration;

/// Arguments of `simulate` for a small building, mapped with exact poses, in which two robots share most of what they
/// see.
pub(crate) const SMALL_BUILDING: [&str; 14] = [
    "--robots",
    "2",
    "--set",
    "width=12",
    "--set",
    "height=10",
    "--set",
    "drift=0",
    "--set",
    "overlap=0.9",
    "--set",
    "tags=24",
    "--set",
    "beams=180",
];

/// A command that runs for longer hangs.
const WATCHDOG: Duration = Duration::from_secs(240);

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
    id: u32,
    command: String,
    /// None once its end was waited for.
    end: Option<Receiver<ExitStatus>>,
    stdout: Printed,
    stderr: Printed,
}

/// Leaves the command with the stages that ship.
pub(crate) const WITHOUT_TROUBLE: (&str, &str) = ("WITHOUT_TROUBLE", "1");

/// The command, with stages that get into trouble beside those that ship.
pub(crate) fn gridweave_program() -> &'static Path {
    Path::new(env!("CARGO_BIN_EXE_troubled_stages"))
}

/// The command with the published methods.
pub(crate) fn published_program() -> &'static Path {
    Path::new(env!("CARGO_BIN_EXE_published"))
}

/// Runs the command with the published methods in `folder`.
#[track_caller]
pub(crate) fn published(folder: &Path, args: &[&str]) -> Ended {
    start_program(published_program(), folder, args, &[]).wait()
}

/// The file of a pipeline of the published methods.
pub(crate) fn published_pipeline(name: &str) -> String {
    format!("{}/../pipelines/examples/published/{name}.toml", env!("CARGO_MANIFEST_DIR"))
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
    let id = child.id();
    let stdout = Printed::read(child.stdout.take().unwrap());
    let stderr = Printed::read(child.stderr.take().unwrap());
    let (ended, end) = mpsc::channel();
    // The test may have gone when it ends.
    thread::spawn(move || ended.send(child.wait().unwrap()).ok());
    Running { id, command: format!("{} {args:?}", program.display()), end: Some(end), stdout, stderr }
}

fn lines_of(text: &[u8]) -> usize {
    text.iter().filter(|byte| **byte == b'\n').count()
}

/// What a program prints, as it prints it.
struct Printed {
    text: Arc<(Mutex<Vec<u8>>, Condvar)>,
    /// Ends when no process prints any more.
    reader: Option<JoinHandle<()>>,
}

impl Printed {
    fn read(mut pipe: impl Read + Send + 'static) -> Self {
        let text = Arc::new((Mutex::new(Vec::new()), Condvar::new()));
        let (shared, mut part) = (Arc::clone(&text), [0; 4096]);
        let reader = thread::spawn(move || {
            while let Ok(count @ 1..) = pipe.read(&mut part) {
                shared.0.lock().unwrap().extend_from_slice(&part[..count]);
                shared.1.notify_all();
            }
        });
        Self { text, reader: Some(reader) }
    }

    /// Waits until there are so many lines. `false` if there are not, for as long as a command may run.
    fn wait_for_lines(&self, count: usize) -> bool {
        let (text, more) = &*self.text;
        let text = text.lock().unwrap();
        !more.wait_timeout_while(text, WATCHDOG, |text| lines_of(text) < count).unwrap().1.timed_out()
    }

    /// All of it, once no process prints any more.
    fn all(&mut self) -> String {
        self.reader.take().unwrap().join().unwrap();
        String::from_utf8_lossy(&self.text.0.lock().unwrap()).into_owned()
    }
}

impl Running {
    /// The number of its process.
    pub(crate) fn id(&self) -> u32 {
        self.id
    }

    /// How many lines it has printed to standard output so far.
    pub(crate) fn lines(&self) -> usize {
        lines_of(&self.stdout.text.0.lock().unwrap())
    }

    /// Waits until it has printed so many lines to standard output.
    #[track_caller]
    pub(crate) fn wait_for_lines(&self, count: usize) {
        assert!(self.stdout.wait_for_lines(count), "{} has not printed {count} lines", self.command);
    }

    /// Waits for its end. A command that hangs is killed and fails the test.
    #[track_caller]
    pub(crate) fn wait(mut self) -> Ended {
        let end = self.end.take().unwrap();
        let Ok(status) = end.recv_timeout(WATCHDOG) else {
            signal(self.id, "KILL");
            panic!("{} hangs", self.command);
        };
        let [stdout, stderr] = [&mut self.stdout, &mut self.stderr].map(Printed::all);
        Ended { status: status.code().unwrap_or(-1), stdout, stderr }
    }
}

impl Drop for Running {
    /// What a test that fails has started does not go on after it.
    fn drop(&mut self) {
        let Some(end) = self.end.take().filter(|end| end.try_recv().is_err()) else { return };
        signal(self.id, "TERM");
        if end.recv_timeout(Duration::from_secs(15)).is_err() {
            signal(self.id, "KILL");
        }
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

/// A JSON file.
#[track_caller]
pub(crate) fn json<T: serde::de::DeserializeOwned>(path: &Path) -> T {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// What `evaluate` says of `summary.json` in `folder`.
#[track_caller]
pub(crate) fn evaluate(folder: &Path, truth: &Path) -> serde_json::Value {
    let args = ["evaluate", "summary.json", "--truth", truth.to_str().unwrap(), "--json"];
    serde_json::from_str(&gridweave(folder, &args).stdout).unwrap()
}

/// The folder with real logs, which the environment must name.
pub(crate) fn real_logs() -> PathBuf {
    let folder = std::env::var_os("GRIDWEAVE_LOGS");
    PathBuf::from(folder.unwrap_or_else(|| panic!("GRIDWEAVE_LOGS names no folder with real logs")))
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
