//! The folder of a run whose shared memory is visible to other processes, and the cleanup after killed runs.
//!
//! Each run has a folder in that of its user ([`user_folder`]), named by its prefix. It contains iceoryx2's files, the
//! pipeline, and a file that the processes of the run keep locked ([`run_lock`](super::run_lock)). A folder that nobody
//! has locked is left over from a killed run, and so are all files with its prefix in `/dev/shm`.

use super::links::counters_shape;
use super::run_lock::{LOCK, Removal, lock_for_removal, lock_for_run};
use super::run_prefix::{counters_path, is_prefix, is_prefix_of, new_prefix, shared_memory};
use super::user_folder::{self, OWN_FILE, OWN_FOLDER, is_own};
use crate::left_behind::{self, RegisteredRemoval};
use crate::link::{RunNames, SharedCounters};
use crate::pipeline::Pipeline;
use std::fs::{self, DirBuilder, File, TryLockError};
use std::io::{self, ErrorKind, Write};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The longest path of the folder of a user, bytes. iceoryx2 takes paths of 255 bytes, and 145 of them may be those of
/// a file in the folder of a run: its prefix twice, the number of a node, and the hash of a service.
const LONGEST_PATH: usize = 110;

/// The name of the file with the pipeline of the run.
const PIPELINE: &str = "pipeline.toml";

/// The folder of a run, locked while this value lives.
#[derive(Debug)]
pub struct RunFolder {
    prefix: String,
    path: PathBuf,
    _lock: File,
    /// Only of the process that removes it.
    _registration: Option<RegisteredRemoval>,
}

/// An error with the folder of a run.
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
    /// Creates the folder of a run, with a unique prefix.
    ///
    /// # Errors
    /// The folder of this user cannot be created or is not trusted, or there is no space.
    pub fn create() -> Result<Self, RunFolderError> {
        Self::create_in(&user_folder::path())
    }

    fn create_in(parent: &Path) -> Result<Self, RunFolderError> {
        if parent.as_os_str().len() > LONGEST_PATH {
            let text = format!(
                "its path is longer than {LONGEST_PATH} bytes, so that names of files in it would be too long; set XDG_RUNTIME_DIR \
                 to a folder with a shorter path"
            );
            return Err(failed("use the folder", parent)(io::Error::new(ErrorKind::InvalidFilename, text)));
        }
        user_folder::make(parent).map_err(failed("use the folder", parent))?;
        loop {
            let prefix = new_prefix().map_err(failed("name a run in", parent))?;
            let path = parent.join(&prefix);
            DirBuilder::new().mode(OWN_FOLDER).create(&path).map_err(failed("create the folder", &path))?;
            if let Some(lock) = lock_for_run(&path).map_err(failed("lock a file in the folder", &path))? {
                let (of_prefix, at) = (prefix.clone(), path.clone());
                let registration = left_behind::register(move || drop(remove(&at, &of_prefix)));
                return Ok(Self { prefix, path, _lock: lock, _registration: Some(registration) });
            }
        }
    }

    /// Joins a run that another process has started.
    ///
    /// # Errors
    /// It does not exist, or is being removed.
    pub fn join(path: &Path) -> Result<Self, RunFolderError> {
        let lock = File::open(path.join(LOCK)).map_err(failed("open the run's folder", path))?;
        let locked = lock.try_lock_shared().map_err(|error| match error {
            TryLockError::WouldBlock => io::Error::other("the run has ended, and is being removed"),
            TryLockError::Error(error) => error,
        });
        locked.map_err(failed("lock a file in the folder", path))?;
        let prefix = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        Ok(Self { prefix, path: path.to_owned(), _lock: lock, _registration: None })
    }

    /// The path of the folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The prefix of the services and files of the run.
    pub fn prefix(&self) -> &str {
        &self.prefix
    }

    /// The path of the pipeline of the run.
    pub fn pipeline(&self) -> PathBuf {
        self.path.join(PIPELINE)
    }

    /// The names of the services of the run.
    pub fn names(&self) -> RunNames {
        RunNames::shared(self.prefix.clone(), self.path.to_string_lossy())
    }

    /// The run, for observers.
    pub(super) fn as_running(&self) -> RunningRun {
        RunningRun { prefix: self.prefix.clone(), folder: self.path.clone() }
    }

    /// Writes the pipeline of the run.
    pub fn write_pipeline(&self, text: &str) -> Result<(), RunFolderError> {
        let path = self.pipeline();
        let file = File::options().write(true).create_new(true).mode(OWN_FILE).open(&path);
        file.and_then(|mut file| file.write_all(text.as_bytes())).map_err(failed("write", &path))
    }

    /// Creates the shared counters of the run.
    pub(super) fn create_counters(&self, pipeline: &Pipeline) -> Result<Arc<SharedCounters>, RunFolderError> {
        let path = counters_path(&self.prefix);
        SharedCounters::create(&path, &counters_shape(pipeline))
            .map_err(failed("create the shared counters of the run", &path))
    }

    /// Opens the shared counters of the run.
    pub(super) fn counters(&self, pipeline: &Pipeline) -> Result<Arc<SharedCounters>, RunFolderError> {
        open_counters(&self.prefix, pipeline)
    }

    /// Removes the folder and all shared memory of the run. Only for the last process of a run.
    pub fn remove(self) -> Result<(), RunFolderError> {
        remove(&self.path, &self.prefix).map_err(failed("remove the folder", &self.path))
    }
}

/// Opens the shared counters of the run with the given prefix.
pub(super) fn open_counters(prefix: &str, pipeline: &Pipeline) -> Result<Arc<SharedCounters>, RunFolderError> {
    let path = counters_path(prefix);
    SharedCounters::open(&path, &counters_shape(pipeline)).map_err(failed("open the shared counters of the run", &path))
}

/// A run on the engine `processes` that is in progress.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunningRun {
    /// The prefix of its services and files.
    pub prefix: String,
    /// Its folder.
    pub folder: PathBuf,
}

impl RunningRun {
    /// The names of its services.
    pub fn names(&self) -> RunNames {
        RunNames::shared(self.prefix.clone(), self.folder.to_string_lossy())
    }

    /// The path of its pipeline.
    pub fn pipeline(&self) -> PathBuf {
        self.folder.join(PIPELINE)
    }

    /// Removes what a program outside of the run, still connected when the run ended, has left in shared memory. Does
    /// nothing while the run is in progress.
    pub fn remove_traces(&self) {
        // What cannot be removed is harmless, except that it takes memory until the machine restarts.
        let _ = match lock_for_removal(&self.folder) {
            Ok(Removal::Dead(_lock)) => remove(&self.folder, &self.prefix),
            // It was removed, and no other run has its prefix.
            Ok(Removal::Gone) => remove(&self.folder, &self.prefix),
            Ok(Removal::Alive) | Err(_) => Ok(()),
        };
    }

    /// Whether it is still in progress.
    pub fn is_running(&self) -> bool {
        let lock = File::open(self.folder.join(LOCK));
        lock.is_ok_and(|lock| matches!(lock.try_lock(), Err(TryLockError::WouldBlock)))
    }
}

/// The runs of this user on the engine `processes` that are in progress, by prefix.
///
/// # Errors
/// The folder of this user is not trusted, or cannot be read.
pub fn running_runs() -> Result<Vec<RunningRun>, RunFolderError> {
    let run = |(folder, prefix)| {
        let run = RunningRun { prefix, folder };
        (run.pipeline().exists() && run.is_running()).then_some(run)
    };
    Ok(run_folders(&user_folder::path())?.into_iter().filter_map(run).collect())
}

/// What a run without living processes has left.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LeftOver {
    /// The run's folder.
    pub folder: PathBuf,
    /// The number of files in `/dev/shm`.
    pub files: usize,
    /// The memory that these files took, bytes.
    pub bytes: u64,
}

/// Removes what killed runs of this user have left. A run with a living process is not touched.
///
/// # Errors
/// The folder of this user is not trusted, or something cannot be removed.
pub fn clean() -> Result<Vec<LeftOver>, RunFolderError> {
    clean_in(&user_folder::path())
}

/// Removes the folders that a dead process of this user has created, such as those that it shared with its programs.
pub(super) fn clean_after(process: u32) -> Result<Vec<LeftOver>, RunFolderError> {
    clean_of(&user_folder::path(), |prefix| is_prefix_of(prefix, process))
}

fn clean_in(parent: &Path) -> Result<Vec<LeftOver>, RunFolderError> {
    clean_of(parent, |_| true)
}

fn clean_of(parent: &Path, is_meant: impl Fn(&str) -> bool) -> Result<Vec<LeftOver>, RunFolderError> {
    let mut cleaned = Vec::new();
    for (folder, prefix) in run_folders(parent)?.into_iter().filter(|(_, prefix)| is_meant(prefix)) {
        let locked = lock_for_removal(&folder).map_err(failed("lock a file in the folder", &folder))?;
        let Removal::Dead(_lock) = locked else { continue };
        let files = shared_memory(&prefix);
        let bytes = files.iter().filter_map(|file| allocated(file)).sum();
        remove(&folder, &prefix).map_err(failed("remove the folder", &folder))?;
        cleaned.push(LeftOver { folder, files: files.len(), bytes });
    }
    Ok(cleaned)
}

/// The folders of runs in that of a user, and their prefixes, by name. Other names are skipped.
fn run_folders(parent: &Path) -> Result<Vec<(PathBuf, String)>, RunFolderError> {
    match user_folder::check(parent) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
        checked => checked.map_err(failed("use the folder", parent))?,
    }
    let entries = fs::read_dir(parent).map_err(failed("read the folder", parent))?;
    let folders = entries.flatten().filter_map(|entry| {
        let prefix = entry.file_name().into_string().ok().filter(|name| is_prefix(name))?;
        let metadata = fs::symlink_metadata(entry.path()).ok()?;
        (metadata.is_dir() && is_own(&metadata)).then(|| (entry.path(), prefix))
    });
    let mut folders: Vec<(PathBuf, String)> = folders.collect();
    folders.sort();
    Ok(folders)
}

fn remove(folder: &Path, prefix: &str) -> io::Result<()> {
    for file in shared_memory(prefix) {
        ignore_concurrent_removal(fs::remove_file(file))?;
    }
    ignore_concurrent_removal(fs::remove_dir_all(folder))
}

/// Ignores the errors of a concurrent removal by another program: a missing file, and a folder that is not empty
/// because the other program has created its lock, and removes the folder itself.
fn ignore_concurrent_removal(result: io::Result<()>) -> io::Result<()> {
    match result {
        Err(error) if !matches!(error.kind(), ErrorKind::NotFound | ErrorKind::DirectoryNotEmpty) => Err(error),
        _ => Ok(()),
    }
}

/// The allocated size of a sparse file, bytes.
fn allocated(file: &Path) -> Option<u64> {
    Some(fs::metadata(file).ok()?.blocks() * 512)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    // A folder of its own, separate from the runs of other tests and their cleanup.
    fn user_folder() -> tempfile::TempDir {
        tempfile::Builder::new().permissions(fs::Permissions::from_mode(OWN_FOLDER)).tempdir().unwrap()
    }

    #[test]
    fn a_folder_with_a_path_that_is_too_long_is_refused_with_what_would_fix_it() {
        let folder = tempfile::tempdir().unwrap();
        let long = folder.path().join("x".repeat(LONGEST_PATH));
        let error = RunFolder::create_in(&long).unwrap_err().to_string();
        assert!(error.contains("XDG_RUNTIME_DIR") && error.contains("110 bytes"), "{error}");
        assert!(!long.exists());
    }

    #[test]
    fn only_a_run_without_living_processes_is_removed() {
        let user = user_folder();
        let alive = RunFolder::create_in(user.path()).unwrap();
        let dead = RunFolder::create_in(user.path()).unwrap();
        let (dead_path, file) = (dead.path.clone(), counters_path(&dead.prefix));
        fs::write(&file, [1; 5000]).unwrap();
        drop(dead);
        let joined = RunFolder::join(&alive.path).unwrap();
        drop(alive);
        let bytes = allocated(&file).unwrap();
        assert_eq!(clean_in(user.path()).unwrap(), [LeftOver { folder: dead_path.clone(), files: 1, bytes }]);
        assert!(joined.path.exists() && !dead_path.exists() && !file.exists());
        joined.remove().unwrap();
    }

    #[test]
    fn a_folder_that_is_not_named_like_a_run_is_never_touched() {
        let user = user_folder();
        fs::create_dir(user.path().join("o")).unwrap();
        assert_eq!(clean_in(user.path()).unwrap(), []);
        assert!(user.path().join("o").exists());
    }

    #[test]
    fn a_folder_without_a_lock_is_removed_and_a_run_that_locks_it_too_late_fails() {
        let user = user_folder();
        let folder = user.path().join(new_prefix().unwrap());
        fs::create_dir(&folder).unwrap();
        let Removal::Dead(lock) = lock_for_removal(&folder).unwrap() else { panic!("it is dead") };
        assert!(lock_for_run(&folder).unwrap().is_none());
        drop(lock);
        assert_eq!(clean_in(user.path()).unwrap().len(), 1);
        assert!(!folder.exists());
        assert!(lock_for_run(&folder).unwrap().is_none());
    }

    #[test]
    fn concurrent_cleaners_remove_everything_without_errors() {
        let user = user_folder();
        for _ in 0..100 {
            drop(RunFolder::create_in(user.path()).unwrap());
        }
        std::thread::scope(|scope| {
            let cleaners: Vec<_> = (0..4).map(|_| scope.spawn(|| clean_in(user.path()).unwrap())).collect();
            cleaners.into_iter().for_each(|cleaner| drop(cleaner.join().unwrap()));
        });
        clean_in(user.path()).unwrap();
        assert_eq!(fs::read_dir(user.path()).unwrap().count(), 0);
    }

    #[test]
    fn other_users_can_neither_read_nor_write_the_files_of_a_run() {
        use iceoryx2::service::ipc;
        let folder = RunFolder::create().unwrap();
        folder.write_pipeline("").unwrap();
        SharedCounters::create(&counters_path(&folder.prefix), &[(0, 1)]).unwrap();
        let node = folder.names().node::<ipc::Service>().unwrap();
        let files = shared_memory(&folder.prefix);
        assert!(files.len() > 1, "{files:?}");
        let folders = [folder.path.clone(), folder.path.join(LOCK), folder.pipeline(), user_folder::path()];
        for path in files.iter().chain(&folders) {
            let mode = fs::metadata(path).unwrap().mode();
            assert_eq!(mode & 0o077, 0, "{} {mode:o}", path.display());
        }
        drop(node);
        folder.remove().unwrap();
    }

    #[test]
    fn a_run_that_does_not_exist_cannot_be_joined() {
        let error = RunFolder::join(Path::new("/nonexistent/gw1_0_")).unwrap_err();
        assert!(error.to_string().contains("cannot open the run's folder /nonexistent/gw1_0_"), "{error}");
    }
}
