//! The provenance recorded in a log: the pipeline, and the files that the run read.

use crate::names::Input;
use crate::reader::log_files;
use gridweave_runtime::input_file;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};

/// Name of the metadata record about the run: the `version` of Gridweave, and the `pipeline` with all its parameters as
/// the text of a pipeline file.
pub(crate) const RUN_RECORD: &str = "gridweave_run";
/// Name of the metadata record about the input files: each an [`InputFile`] as JSON, numbered from 1.
pub(crate) const INPUTS_RECORD: &str = "gridweave_inputs";

/// The size of the pieces in which a file is read.
const PART: usize = 1 << 18;

/// A file that a run has read.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct InputFile {
    /// Its name, with that of its folder in front if the folder was the input.
    pub name: String,
    /// Its size in bytes.
    pub bytes: u64,
    /// Its SHA-256 in hexadecimal digits, as `sha256sum` prints it.
    pub sha256: String,
}

/// The entries of [`RUN_RECORD`].
pub(super) fn run_record(pipeline: &str) -> BTreeMap<String, String> {
    let version = env!("CARGO_PKG_VERSION");
    [("version", version), ("pipeline", pipeline)].map(|(key, value)| (key.to_owned(), value.to_owned())).into()
}

/// The hashes of a run's input files, computed in a thread during the run.
pub(super) struct InputHashes {
    worker: io::Result<JoinHandle<Vec<InputFile>>>,
    stop: Arc<AtomicBool>,
}

impl InputHashes {
    /// Starts the computation for the files of the inputs `typed`.
    pub(super) fn start(typed: Vec<PathBuf>) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let is_stopped = Arc::clone(&stop);
        // Unreadable files are reported by the stage that reads them.
        let work = move || named_files(&typed).filter_map(|file| hash(file, &is_stopped).ok()).collect();
        let worker = thread::Builder::new().name("hashes".to_owned()).spawn(work);
        Self { worker, stop }
    }

    /// The entries of [`INPUTS_RECORD`]; none if the thread could not be started. Waits until all are known.
    pub(super) fn record(self) -> BTreeMap<String, String> {
        let files = self.worker.ok().and_then(|worker| worker.join().ok()).unwrap_or_default();
        let digits = files.len().to_string().len();
        let entry = |(index, file): (usize, &InputFile)| {
            let number = index + 1;
            (format!("{number:0digits$}"), serde_json::to_string(file).unwrap_or_default())
        };
        files.iter().enumerate().map(entry).collect()
    }

    /// Stops the computation.
    pub(super) fn stop(self) {
        self.stop.store(true, Ordering::Relaxed);
        drop(self.worker.map(JoinHandle::join));
    }
}

/// The files of the inputs, with the names that they are recorded under.
fn named_files(typed: &[PathBuf]) -> impl Iterator<Item = (String, PathBuf)> {
    typed.iter().flat_map(|typed| {
        let path = Input::new(typed).path;
        let files = match path.is_dir() {
            true => log_files(std::slice::from_ref(&path)).unwrap_or_default(),
            false => vec![(0, path.clone())],
        };
        let folder = if path.is_dir() { last_part(&path) + "/" } else { String::new() };
        files.into_iter().map(move |(_, file)| (format!("{folder}{}", last_part(&file)), file))
    })
}

/// The name of a file or folder without its parents.
fn last_part(path: &Path) -> String {
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned());
    // `.` and `..` have no name.
    name.or_else(|| Some(path.canonicalize().ok()?.file_name()?.to_string_lossy().into_owned())).unwrap_or_default()
}

fn hash((name, path): (String, PathBuf), stop: &AtomicBool) -> io::Result<InputFile> {
    let mut file = input_file::open(&path)?;
    let (mut hash, mut part, mut bytes) = (Sha256::new(), vec![0; PART], 0);
    while !stop.load(Ordering::Relaxed) {
        match file.read(&mut part) {
            Ok(0) => break,
            Ok(length) => {
                hash.update(&part[..length]);
                bytes += length as u64;
            }
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    let sha256 = hash.finalize().iter().fold(String::new(), |mut text, byte| {
        // Writing to a string cannot fail.
        let _ = write!(text, "{byte:02x}");
        text
    });
    Ok(InputFile { name, bytes, sha256 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn files_are_recorded_by_name_with_the_hash_that_sha256sum_prints() {
        let folder = tempfile::tempdir().unwrap();
        let bag = folder.path().join("bag");
        fs::create_dir(&bag).unwrap();
        fs::write(bag.join("b.mcap"), "").unwrap();
        fs::write(bag.join("a.mcap"), "abc").unwrap();
        fs::write(folder.path().join("map.yaml"), "abc").unwrap();
        let robot = PathBuf::from(format!("robot1={}", folder.path().join("map.yaml").display()));
        let record = InputHashes::start(vec![bag, robot, folder.path().join("none")]).record();
        let files: Vec<InputFile> = record.values().map(|value| serde_json::from_str(value).unwrap()).collect();
        let names: Vec<&str> = files.iter().map(|file| file.name.as_str()).collect();
        assert_eq!(names, ["bag/a.mcap", "bag/b.mcap", "map.yaml"]);
        assert_eq!(record.keys().collect::<Vec<_>>(), ["1", "2", "3"]);
        assert_eq!(files[0].sha256, "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
        assert_eq!(files[1].sha256, "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
        assert_eq!((files[0].bytes, files[1].bytes), (3, 0));
        assert_eq!(files[2], InputFile { name: "map.yaml".into(), ..files[0].clone() });
    }
}
