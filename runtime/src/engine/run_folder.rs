//! The folder of a run whose shared memory other processes can see, and what is left of runs that were killed.
//!
//! A run has a folder of its own below `/tmp/gridweave-UID/`, called by its prefix. The folder holds iceoryx2's files,
//! what the processes of the run must know, and a file that every process of the run keeps locked for as long as it
//! lives. The system takes such a lock back when a process dies, in whatever way. So a folder that nobody has locked
//! is left over, and so is all that bears its prefix in `/dev/shm`.

use super::links::board_shape;
use crate::link::Board;
use crate::link::RunNames;
use crate::pipeline::Pipeline;
use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, SystemTime};

/// The file that the processes of a run keep locked.
const LOCK: &str = "lock";
/// The pipeline of the run.
const PIPELINE: &str = "pipeline.toml";
/// Folders that begin so are being made.
const UNFINISHED: &str = "new-";
/// A folder that has been in the making for so long was given up.
const GIVEN_UP: Duration = Duration::from_secs(60);
const SHARED_MEMORY: &str = "/dev/shm";

/// The folder of a run, kept from being taken for left over while this value lives.
#[derive(Debug)]
pub struct RunFolder {
    prefix: String,
    path: PathBuf,
    _lock: File,
}

/// What is wrong with the folder of a run.
#[derive(Debug, thiserror::Error)]
#[error("cannot {doing} {}: {cause}", path.display())]
pub struct RunFolderError {
    doing: &'static str,
    path: PathBuf,
    cause: io::Error,
}

fn failed(doing: &'static str, path: &Path) -> impl FnOnce(io::Error) -> RunFolderError {
    let path = path.to_owned();
    move |cause| RunFolderError { doing, path, cause }
}

impl RunFolder {
    /// Makes a folder for a run of this process. Its prefix is the run's own on this machine.
    pub fn create() -> Result<Self, RunFolderError> {
        static COUNTER: AtomicU64 = AtomicU64::new(0);
        let number = COUNTER.fetch_add(1, Ordering::Relaxed);
        let prefix = format!("gw{}_{number}_", std::process::id());
        let parent = parent();
        let (unfinished, path) = (parent.join(format!("{UNFINISHED}{prefix}")), parent.join(&prefix));
        // An earlier process may have had this number, and have been killed.
        remove(&path, &prefix).map_err(failed("remove the folder", &path))?;
        fs::create_dir_all(&unfinished).map_err(failed("make the folder", &unfinished))?;
        let lock = File::create(unfinished.join(LOCK)).map_err(failed("write to the folder", &unfinished))?;
        lock.lock_shared().map_err(failed("lock a file in the folder", &unfinished))?;
        fs::rename(&unfinished, &path).map_err(failed("make the folder", &path))?;
        Ok(Self { prefix, path, _lock: lock })
    }

    /// Joins a run that another process has started.
    pub fn join(path: &Path) -> Result<Self, RunFolderError> {
        let lock = File::open(path.join(LOCK)).map_err(failed("open the run's folder", path))?;
        lock.lock_shared().map_err(failed("lock a file in the folder", path))?;
        let prefix = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        Ok(Self { prefix, path: path.to_owned(), _lock: lock })
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What the run's services and files begin with.
    pub fn prefix(&self) -> &str {
        &self.prefix
    }

    /// Where the pipeline of the run stands.
    pub fn pipeline(&self) -> PathBuf {
        self.path.join(PIPELINE)
    }

    /// The names of the run's services.
    pub fn names(&self) -> RunNames {
        RunNames::shared(self.prefix.clone(), self.path.to_string_lossy())
    }

    /// Writes the pipeline of the run.
    pub fn write_pipeline(&self, text: &str) -> Result<(), RunFolderError> {
        let path = self.pipeline();
        fs::write(&path, text).map_err(failed("write", &path))
    }

    /// Makes the board of the run.
    pub(super) fn create_board(&self, pipeline: &Pipeline) -> Result<Arc<Board>, RunFolderError> {
        let path = board_path(&self.prefix);
        Board::create(&path, &board_shape(pipeline)).map_err(failed("make the board of the run", &path))
    }

    /// The board of the run.
    pub(super) fn board(&self, pipeline: &Pipeline) -> Result<Arc<Board>, RunFolderError> {
        open_board(&self.prefix, pipeline)
    }

    /// Removes all that the run has left. Only for the last process of a run.
    pub fn remove(self) -> Result<(), RunFolderError> {
        remove(&self.path, &self.prefix).map_err(failed("remove the folder", &self.path))
    }
}

/// The board of the run with the given prefix.
pub(super) fn open_board(prefix: &str, pipeline: &Pipeline) -> Result<Arc<Board>, RunFolderError> {
    let path = board_path(prefix);
    Board::open(&path, &board_shape(pipeline)).map_err(failed("open the board of the run", &path))
}

/// The board lies in shared memory, and goes with the rest of the run that lies there.
fn board_path(prefix: &str) -> PathBuf {
    Path::new(SHARED_MEMORY).join(format!("{prefix}board"))
}

/// A run of processes that is going on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunningRun {
    /// What its services and files begin with.
    pub prefix: String,
    /// Its folder.
    pub folder: PathBuf,
}

impl RunningRun {
    /// The names of its services.
    pub fn names(&self) -> RunNames {
        RunNames::shared(self.prefix.clone(), self.folder.to_string_lossy())
    }

    /// Where its pipeline stands.
    pub fn pipeline(&self) -> PathBuf {
        self.folder.join(PIPELINE)
    }

    /// Removes what a program outside of the run may have left in shared memory that was still there when the run ended.
    /// Does nothing while the run goes on.
    pub fn remove_traces(&self) {
        if !self.is_running() {
            // What cannot be removed harms nobody but takes memory, until the machine is started again.
            let _ = remove(&self.folder, &self.prefix);
        }
    }

    /// Whether it still goes on.
    pub fn is_running(&self) -> bool {
        is_locked(&self.folder).unwrap_or(false)
    }
}

/// The runs of this user on the engine `processes` that are going on, by prefix.
pub fn running_runs() -> Vec<RunningRun> {
    let entries = fs::read_dir(parent()).into_iter().flatten().flatten();
    let mut folders: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
    folders.sort();
    let run = |folder: PathBuf| {
        let prefix = folder.file_name()?.to_str()?.to_owned();
        let run = RunningRun { prefix, folder };
        (!run.prefix.starts_with(UNFINISHED) && run.pipeline().exists() && run.is_running()).then_some(run)
    };
    folders.into_iter().filter_map(run).collect()
}

/// What is left of one run of which no process lives.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LeftOver {
    /// The run's folder.
    pub folder: PathBuf,
    /// Files in `/dev/shm`.
    pub files: usize,
    /// How much of the memory of the machine they held, bytes.
    pub bytes: u64,
}

/// Removes what runs of this user have left behind that were killed. A run of which a process lives is not touched.
pub fn clean() -> Result<Vec<LeftOver>, RunFolderError> {
    let parent = parent();
    let mut cleaned = Vec::new();
    let entries = match fs::read_dir(&parent) {
        Ok(entries) => entries,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(cleaned),
        Err(error) => return Err(failed("look into the folder", &parent)(error)),
    };
    let mut folders: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    folders.sort();
    for folder in folders {
        let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let prefix = name.strip_prefix(UNFINISHED).unwrap_or(&name);
        if !is_left_over(&folder, name != prefix) {
            continue;
        }
        let files = shared_memory(prefix);
        let bytes = files.iter().filter_map(|file| allocated(file)).sum();
        remove(&folder, prefix).map_err(failed("remove the folder", &folder))?;
        cleaned.push(LeftOver { folder, files: files.len(), bytes });
    }
    Ok(cleaned)
}

/// Whether no process has the folder locked.
fn is_left_over(folder: &Path, unfinished: bool) -> bool {
    if unfinished {
        let age = fs::metadata(folder).and_then(|metadata| metadata.modified()).ok();
        let age = age.and_then(|modified| SystemTime::now().duration_since(modified).ok());
        return age.is_some_and(|age| age > GIVEN_UP);
    }
    match is_locked(folder) {
        Ok(locked) => !locked,
        Err(error) => error.kind() == io::ErrorKind::NotFound && folder.is_dir(),
    }
}

/// Whether a process keeps the folder of a run locked.
fn is_locked(folder: &Path) -> io::Result<bool> {
    Ok(matches!(File::open(folder.join(LOCK))?.try_lock(), Err(TryLockError::WouldBlock)))
}

fn remove(folder: &Path, prefix: &str) -> io::Result<()> {
    for file in shared_memory(prefix) {
        ignore_missing(fs::remove_file(file))?;
    }
    ignore_missing(fs::remove_dir_all(folder))
}

fn ignore_missing(result: io::Result<()>) -> io::Result<()> {
    match result {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

/// The files in shared memory that bear a run's prefix.
fn shared_memory(prefix: &str) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(SHARED_MEMORY) else { return Vec::new() };
    let files = entries.flatten().filter(|entry| entry.file_name().to_string_lossy().starts_with(prefix));
    files.map(|entry| entry.path()).collect()
}

/// The bytes that a sparse file really takes.
fn allocated(file: &Path) -> Option<u64> {
    use std::os::unix::fs::MetadataExt;
    Some(fs::metadata(file).ok()?.blocks() * 512)
}

/// The folder that holds those of all runs of this user. The path is short, because sockets lie in it, whose paths may
/// not be longer than 108 bytes.
fn parent() -> PathBuf {
    use std::os::unix::fs::MetadataExt;
    let user = fs::metadata("/proc/self").map_or(0, |metadata| metadata.uid());
    PathBuf::from(format!("/tmp/gridweave-{user}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_living_run_is_not_touched_and_a_dead_one_is_removed() {
        let alive = RunFolder::create().unwrap();
        let dead = RunFolder::create().unwrap();
        let (dead_path, dead_prefix) = (dead.path.clone(), dead.prefix.clone());
        let file = Path::new(SHARED_MEMORY).join(format!("{dead_prefix}segment"));
        fs::write(&file, [1; 5000]).unwrap();
        drop(dead);
        let joined = RunFolder::join(&alive.path).unwrap();
        drop(alive);
        // Other tests clean at the same time; whoever is first removes it.
        let cleaned = clean().unwrap();
        assert!(cleaned.iter().all(|left| left.folder != joined.path));
        assert!(joined.path.exists() && !dead_path.exists() && !file.exists());
        joined.remove().unwrap();
    }

    #[test]
    fn a_run_that_is_not_there_cannot_be_joined() {
        let error = RunFolder::join(Path::new("/nonexistent/gw1_0_")).unwrap_err();
        assert!(error.to_string().contains("cannot open the run's folder /nonexistent/gw1_0_"), "{error}");
    }
}
