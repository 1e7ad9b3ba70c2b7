//! Environment of the test: a folder, a folder for the files of runs, and shared memory, with files of others in them.

use crate::processes::{Started, with_text};
use anyhow::{Context as _, Result, ensure};
use std::collections::BTreeMap;
use std::fs::{self, Permissions};
use std::io::Write as _;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};
use tempfile::TempDir;

/// Set for the program in separate namespaces.
const INSIDE: &str = "GRIDWEAVE_TORTURE_INSIDE";
const SHARED_MEMORY: &str = "/dev/shm";
/// Namespaces whose processes end with the first, with a separate /proc.
const OWN_PROCESSES: [&str; 4] = ["--pid", "--fork", "--kill-child", "--mount-proc"];

/// Writes a line to standard error; a closed one is ignored.
pub(crate) fn print_line(text: &str) {
    writeln!(std::io::stderr(), "{text}").ok();
}

/// Runs this program in separate namespaces, and returns its exit code. `None` if it is in them already, or they are
/// not allowed.
pub(crate) fn isolate() -> Result<Option<ExitCode>> {
    if std::env::var_os(INSIDE).is_some() {
        return Ok(None);
    }
    let unshare = |script: &str| {
        let mut command = Command::new("unshare");
        command.args(["--user", "--map-root-user", "--mount"]).args(OWN_PROCESSES).args(["sh", "-c", script]);
        command
    };
    let mount = "mount -t tmpfs -o size=512m tmpfs /dev/shm";
    let can = unshare(mount).stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok_and(|status| status.success());
    if !can {
        print_line("this machine allows no namespaces: without full disks, full shared memory and containers");
        return Ok(None);
    }
    // The shell stays as the parent of orphaned processes.
    let mut inside = unshare(&format!("{mount} && \"$0\" \"$@\"; exit $?"));
    let status = inside.arg(std::env::current_exe()?).args(std::env::args_os().skip(1)).env(INSIDE, "1").status()?;
    Ok(Some(if status.success() { ExitCode::SUCCESS } else { ExitCode::FAILURE }))
}

/// The environment of the test.
pub(crate) struct World {
    folder: TempDir,
    program: PathBuf,
    /// Whether it has separate namespaces.
    pub(crate) is_isolated: bool,
    /// Files of others, which must not be touched, with their contents.
    strangers: BTreeMap<PathBuf, Vec<u8>>,
    /// The processes that runs were started as.
    runs: Vec<u32>,
}

impl World {
    pub(crate) fn new(program: &Path) -> Result<Self> {
        let folder = TempDir::new()?;
        let program = fs::canonicalize(program).with_context(|| format!("there is no {}", program.display()))?;
        let runs = folder.path().join("runs");
        fs::create_dir(&runs)?;
        fs::set_permissions(&runs, Permissions::from_mode(0o700))?;
        let shared = |name: &str| Path::new(SHARED_MEMORY).join(format!("{name}{}", std::process::id()));
        let near = |name: &str| folder.path().join(name);
        let mut strangers = BTreeMap::new();
        for path in [shared("stranger_"), shared("gw"), shared("gw_1_"), near("out.mcap.parts"), near("other.mcap")] {
            let contents = format!("not to be touched: {}", path.display()).into_bytes();
            fs::write(&path, &contents)?;
            strangers.insert(path, contents);
        }
        let is_isolated = std::env::var_os(INSIDE).is_some();
        Ok(Self { folder, program, is_isolated, strangers, runs: Vec::new() })
    }

    /// A file in the folder.
    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The folder of the files of runs, which every process of a run gets.
    pub(crate) fn runs(&self) -> PathBuf {
        self.path("runs")
    }

    /// Starts `gridweave`, with `contained` as in a separate container where that is possible.
    pub(crate) fn start(&mut self, args: &[&str], contained: bool) -> Result<Started> {
        let is_contained = contained && self.is_isolated;
        let mut command = match is_contained {
            true => {
                let mut unshare = Command::new("unshare");
                unshare.args(OWN_PROCESSES).arg(&self.program);
                unshare
            }
            false => Command::new(&self.program),
        };
        command.args(args).current_dir(self.folder.path()).env("XDG_RUNTIME_DIR", self.runs()).stdin(Stdio::null());
        let started = Started::new(command, self.runs(), is_contained)?;
        self.runs.push(started.id());
        Ok(started)
    }

    /// Runs `gridweave`, which must succeed, and returns its output.
    pub(crate) fn run(&mut self, args: &[&str]) -> Result<String> {
        let ended = self.start(args, false)?.wait()?;
        ensure!(
            ended.status == Some(0),
            "{}",
            with_text(&format!("{args:?} ended with {:?}", ended.status), &ended.text)
        );
        Ok(ended.text)
    }

    /// What runs have left in shared memory and in the folder of their files.
    pub(crate) fn left_over(&self) -> Result<Vec<PathBuf>> {
        let shared = fs::read_dir(SHARED_MEMORY)?.map(|entry| Ok(entry?.path())).collect::<Result<Vec<_>>>()?;
        let is_of_run = |path: &PathBuf| {
            let of_run = |run: &u32| path.to_string_lossy().contains(&format!("/gw{run}_"));
            (self.is_isolated || self.runs.iter().any(of_run)) && !self.strangers.contains_key(path)
        };
        let folder = self.runs().join("gridweave");
        let folders = fs::read_dir(folder).into_iter().flatten().filter_map(|entry| Some(entry.ok()?.path()));
        Ok(shared.into_iter().filter(is_of_run).chain(folders).collect())
    }

    /// How much shared memory is used, bytes.
    pub(crate) fn shared_memory(&self) -> Result<u64> {
        use std::os::unix::fs::MetadataExt;
        let files = fs::read_dir(SHARED_MEMORY)?.filter_map(|entry| entry.ok()?.metadata().ok());
        Ok(files.map(|file| 512 * file.blocks()).sum())
    }

    /// Everybody else's files are as they were.
    pub(crate) fn check_strangers(&self) -> Result<()> {
        for (path, contents) in &self.strangers {
            ensure!(fs::read(path).is_ok_and(|found| found == *contents), "{} was changed", path.display());
        }
        Ok(())
    }

    /// Lets the folder stay, to be looked at.
    pub(crate) fn keep(mut self) -> PathBuf {
        self.folder.disable_cleanup(true);
        self.folder.path().to_owned()
    }
}

impl Drop for World {
    fn drop(&mut self) {
        self.strangers.keys().for_each(|path| drop(fs::remove_file(path)));
    }
}
