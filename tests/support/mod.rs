//! Running the command, and logs to run it on.
#![allow(dead_code, missing_docs, unreachable_pub, clippy::unwrap_used, clippy::panic)]

use gridweave_logs::schemas::schema_text;
use gridweave_logs::sink::{LogOptions, LogWriter, Outcome};
use gridweave_runtime::message::{Channel, LogTime};
use gridweave_runtime::ros::{Header, MapMetaData, OccupancyGrid, Pose, PoseStamped, RosMessage, TagRange, encode};
use mcap::records::MessageHeader;
use nalgebra::{Isometry2, Vector2};
use serde::Serialize;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// How a command ended.
#[derive(Debug)]
pub struct Ended {
    pub status: i32,
    pub stdout: String,
    pub stderr: String,
}

impl Ended {
    /// All that it has printed.
    pub fn text(&self) -> String {
        format!("{}{}", self.stdout, self.stderr)
    }

    /// Fails the test unless the command ended with `status` and printed every one of `words`.
    #[track_caller]
    pub fn assert(&self, status: i32, words: &[&str]) {
        assert_eq!(self.status, status, "{self:#?}");
        for word in words {
            assert!(self.text().contains(word), "no `{word}` in {self:#?}");
        }
        assert!(!self.text().contains("panicked"), "{self:#?}");
    }
}

/// Runs `gridweave` in `folder`. A command that hangs is killed and fails the test.
#[track_caller]
pub fn gridweave(folder: &Path, args: &[&str]) -> Ended {
    gridweave_with(folder, args, &[])
}

/// The same, with environment variables.
#[track_caller]
pub fn gridweave_with(folder: &Path, args: &[&str], variables: &[(&str, &str)]) -> Ended {
    start(folder, args, variables).wait()
}

/// A command that runs.
pub struct Running {
    child: Child,
    command: String,
    stdout: JoinHandle<String>,
    stderr: JoinHandle<String>,
}

/// Starts `gridweave` in `folder`.
#[track_caller]
pub fn start(folder: &Path, args: &[&str], variables: &[(&str, &str)]) -> Running {
    start_program(Path::new(env!("CARGO_BIN_EXE_gridweave")), folder, args, variables)
}

/// An example program, which `cargo test` builds beside the command.
pub fn example(name: &str) -> PathBuf {
    Path::new(env!("CARGO_BIN_EXE_gridweave")).with_file_name("examples").join(name)
}

/// Starts a program in `folder`.
#[track_caller]
pub fn start_program(program: &Path, folder: &Path, args: &[&str], variables: &[(&str, &str)]) -> Running {
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
        std::thread::spawn(move || {
            let mut bytes = Vec::new();
            pipe.read_to_end(&mut bytes).unwrap();
            String::from_utf8_lossy(&bytes).into_owned()
        })
    };
    let stdout = read(Box::new(child.stdout.take().unwrap()));
    let stderr = read(Box::new(child.stderr.take().unwrap()));
    Running { child, command: format!("{} {args:?}", program.display()), stdout, stderr }
}

impl Running {
    /// The number of its process.
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Waits for its end. A command that hangs is killed and fails the test.
    #[track_caller]
    pub fn wait(mut self) -> Ended {
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
        let (stdout, stderr) = (self.stdout.join().unwrap(), self.stderr.join().unwrap());
        Ended { status: status.code().unwrap_or(-1), stdout, stderr }
    }
}

/// Writes a log message by message.
pub struct LogBuilder {
    writer: LogWriter,
    sequence: u32,
}

impl LogBuilder {
    pub fn new(path: &Path) -> Self {
        Self { writer: LogWriter::create(path, LogOptions::default()).unwrap(), sequence: 0 }
    }

    /// A message of any type, its bytes given.
    pub fn raw(&mut self, seconds: f64, topic: &str, type_name: &str, bytes: &[u8]) -> &mut Self {
        let channel = Channel {
            topic: topic.into(),
            message_encoding: "cdr".into(),
            schema_name: type_name.into(),
            schema_encoding: "ros2msg".into(),
            schema: schema_text(type_name).unwrap_or_default().into_bytes(),
            ..Default::default()
        };
        let channel_id = self.writer.channel(&channel).unwrap();
        let time = 1_700_000_000_000_000_000 + (seconds * 1e9) as u64;
        let header = MessageHeader { channel_id, sequence: self.sequence, log_time: time, publish_time: time };
        self.sequence += 1;
        self.writer.write(&header, bytes).unwrap();
        self
    }

    pub fn message<T: RosMessage + Serialize>(&mut self, seconds: f64, topic: &str, message: &T) -> &mut Self {
        self.raw(seconds, topic, T::NAME, &encode(message).unwrap())
    }

    /// A map of `robot`. `change` may spoil it.
    pub fn map(&mut self, seconds: f64, robot: &str, map: &TestMap) -> &mut Self {
        let bytes: Vec<u8> = map.cells.iter().map(|cell| *cell as u8).collect();
        let grid = OccupancyGrid {
            header: Header::new(LogTime((seconds * 1e9) as u64), format!("{robot}/map")),
            info: map.info,
            data: &bytes,
        };
        self.message(seconds, &format!("/{robot}/map"), &grid)
    }

    pub fn pose(&mut self, seconds: f64, robot: &str, x: f64, y: f64) -> &mut Self {
        let pose = PoseStamped {
            header: Header::new(LogTime((seconds * 1e9) as u64), format!("{robot}/map")),
            pose: Pose::from(Isometry2::new(Vector2::new(x, y), 0.0)),
        };
        self.message(seconds, &format!("/{robot}/pose"), &pose)
    }

    pub fn reading(&mut self, seconds: f64, robot: &str, tag: &str, range: f64) -> &mut Self {
        let reading = TagRange {
            header: Header::new(LogTime((seconds * 1e9) as u64), format!("{robot}/base_link")),
            tag_id: tag.into(),
            range,
            range_stddev: 0.05,
            rssi: -50.0,
        };
        self.message(seconds, &format!("/{robot}/tag_ranges"), &reading)
    }

    pub fn finish(self) {
        self.writer.finish(Outcome::Complete).unwrap();
    }
}

/// A map that can be spoilt.
#[derive(Clone)]
pub struct TestMap {
    pub info: MapMetaData,
    pub cells: Vec<i8>,
}

impl TestMap {
    /// A room of 10 x 8 m with an inner wall, at 0.05 m a cell.
    pub fn room() -> Self {
        let (width, height) = (200, 160);
        let mut cells = vec![0; width * height];
        for row in 0..height {
            for column in 0..width {
                let is_wall = row < 2 || column < 2 || row >= height - 2 || column >= width - 2;
                let is_inner = (80..82).contains(&column) && row < 100;
                if is_wall || is_inner {
                    cells[row * width + column] = 100;
                }
            }
        }
        let info = MapMetaData { resolution: 0.05, width: width as u32, height: height as u32, ..Default::default() };
        Self { info, cells }
    }
}

/// A small simulated log and its truth, in `folder`.
#[track_caller]
pub fn simulate(folder: &Path, name: &str, args: &[&str]) -> (PathBuf, PathBuf) {
    let log = folder.join(name);
    let mut all = vec!["simulate", "-o", log.to_str().unwrap()];
    all.extend(args);
    let ended = gridweave(folder, &all);
    assert_eq!(ended.status, 0, "{ended:#?}");
    let truth = log.with_extension("truth.json");
    (log, truth)
}

/// The folder with real logs that the environment names, if it does.
pub fn real_logs() -> Option<PathBuf> {
    let folder = std::env::var_os("GRIDWEAVE_LOGS").map(PathBuf::from);
    if folder.is_none() {
        eprintln!("SKIPPED: GRIDWEAVE_LOGS does not name a folder with real logs");
    }
    folder
}

/// The logs of a folder, by name.
pub fn logs_in(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut logs: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    logs.retain(|path| path.extension().is_some_and(|end| end == "mcap"));
    logs.sort();
    assert!(!logs.is_empty(), "{} holds no logs", folder.display());
    logs
}
