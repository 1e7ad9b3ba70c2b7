//! The file of a trace of the work of the stages. It is written as a part beside it, which takes its name when the
//! command has ended.

use crate::status::BadUse;
use crate::terminal::eprint_line;
use anyhow::{Context, Result};
use gridweave_logs::file::{OutputFile, is_same_name};
use std::ffi::{OsStr, OsString};
use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};
use tracing_chrome::FlushGuard;

/// The length of a trace without anything in it: its brackets and line ends.
const EMPTY: u64 = 4;

/// The file of the trace of this program.
static FILE: OnceLock<PathBuf> = OnceLock::new();

/// The file of the trace, if this program writes one.
pub(crate) fn file() -> Option<&'static PathBuf> {
    FILE.get()
}

/// A trace that is being written.
pub(crate) struct Trace {
    path: PathBuf,
    output: OutputFile,
    progress: Arc<Progress>,
    writing: Option<FlushGuard>,
}

/// The written part of a trace.
#[derive(Default)]
struct Progress {
    bytes: AtomicU64,
    has_failed: AtomicBool,
}

/// Writes the part of a trace. The first error is reported; after it the trace is dropped and the run goes on.
pub(crate) struct TraceWriter {
    path: PathBuf,
    file: File,
    progress: Arc<Progress>,
}

impl Trace {
    /// Creates the part of the trace at `path` for a command line of these words.
    ///
    /// # Errors
    /// Its name does not end in .json, as another kind of file could be named in error; another word names the same
    /// file; or it cannot be written.
    pub(crate) fn create(path: &Path, words: &[OsString]) -> Result<(Self, TraceWriter)> {
        if path.extension().is_none_or(|ending| ending != "json") {
            let text = format!("cannot write the trace {}: its name must end in .json", path.display());
            return Err(BadUse(text).into());
        }
        if is_named(path, words) {
            let text = format!(
                "{} is another file of this command, and the trace would overwrite it: choose another file for --trace",
                path.display()
            );
            return Err(BadUse(text).into());
        }
        let output = OutputFile::create(path).context("cannot write the trace")?;
        let file = output.file().try_clone().with_context(|| format!("cannot write the trace {}", path.display()))?;
        let progress = Arc::new(Progress::default());
        let writer = TraceWriter { path: path.to_owned(), file, progress: Arc::clone(&progress) };
        Ok((Self { path: path.to_owned(), output, progress, writing: None }, writer))
    }

    /// The same trace as that of this program. Its writing ends when the guard is dropped.
    pub(crate) fn written_by(self, guard: FlushGuard) -> Self {
        // A program has one command line.
        let _ = FILE.set(self.path.clone());
        Self { writing: Some(guard), ..self }
    }

    /// Ends the trace. It replaces an earlier file only if the command `is_done`; that of a command that failed stays
    /// as a part where there is such a file, and is removed if there is nothing in it.
    pub(crate) fn end(self, is_done: bool) {
        let Self { output, progress, writing, .. } = self;
        drop(writing);
        if progress.has_failed.load(Ordering::Relaxed) {
            return;
        }
        let place = match is_done {
            true => output.put_in_place().map(|_| None),
            false if progress.bytes.load(Ordering::Relaxed) <= EMPTY => return,
            false => output.put_in_free_place().map(Some),
        };
        match place {
            Ok(Some(place)) => eprint_line(format_args!("the trace of the command that failed is {}", place.display())),
            Ok(None) => {}
            Err(error) => eprint_line(format_args!("the trace is lost: {error}")),
        }
    }
}

/// Whether a word of a command line, or what follows `=` in it, names the file `trace`, apart from that of the option
/// `--trace`.
fn is_named(trace: &Path, words: &[OsString]) -> bool {
    let is_it = |word: &OsStr| is_same_name(trace, Path::new(word));
    let mut words = words.iter().skip(1);
    while let Some(word) = words.next() {
        let text = word.to_string_lossy();
        if text == "--trace" {
            words.next();
        } else if !text.starts_with("--trace=")
            && (is_it(word) || text.split_once('=').is_some_and(|(_, value)| is_it(value.as_ref())))
        {
            return true;
        }
    }
    false
}

impl TraceWriter {
    fn note(&mut self, written: io::Result<()>) {
        if let Err(error) = written {
            self.progress.has_failed.store(true, Ordering::Relaxed);
            eprint_line(format_args!("the trace {} is not written: {error}", self.path.display()));
        }
    }
}

impl Write for TraceWriter {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if !self.progress.has_failed.load(Ordering::Relaxed) {
            let written = self.file.write_all(bytes);
            self.progress.bytes.fetch_add(bytes.len() as u64, Ordering::Relaxed);
            self.note(written);
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn a_trace_that_fails_on_a_full_disk_leaves_the_earlier_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("trace.json");
        fs::write(&path, "before").unwrap();
        let (trace, mut writer) = Trace::create(&path, &[]).unwrap();
        writer.file = File::options().write(true).open("/dev/full").unwrap();
        for _ in 0..2 {
            assert_eq!(writer.write(b"[\n").unwrap(), 2);
        }
        trace.end(true);
        assert_eq!(fs::read_to_string(&path).unwrap(), "before");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn the_trace_of_a_command_that_failed_replaces_no_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("trace.json");
        let end = |text: &str, is_done: bool| {
            let (trace, mut writer) = Trace::create(&path, &[]).unwrap();
            writer.write_all(text.as_bytes()).unwrap();
            trace.end(is_done);
            fs::read_to_string(&path).ok()
        };
        assert_eq!(end("[\n\n]", false), None);
        assert_eq!(end("[failed]", false).unwrap(), "[failed]");
        assert_eq!(end("[done]", true).unwrap(), "[done]");
        assert_eq!(end("[failed again]", false).unwrap(), "[done]");
        assert_eq!(fs::read_to_string(folder.path().join("trace.json.part")).unwrap(), "[failed again]");
        assert_eq!(end("[\n\n]", false).unwrap(), "[done]");
        assert!(!folder.path().join("trace.json.part").exists());
    }
}
