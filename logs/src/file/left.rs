//! Whole files that are left as parts, until those of all stages of a run take their names together.
//!
//! The process that has written a part keeps it locked until then. Where the stages are processes, it is unlocked from
//! the end of its process to the end of the run.

use super::{OutputFile, WriteError};
use std::fs::File;
use std::io::{self, Write};
use std::path::Path;
use std::sync::{Mutex, PoisonError};

/// The parts that this process has left.
static LEFT: Mutex<Vec<OutputFile>> = Mutex::new(Vec::new());

impl OutputFile {
    /// Leaves the part, which is whole, for [`place`].
    pub(crate) fn leave(mut self) {
        self.is_kept = true;
        LEFT.lock().unwrap_or_else(PoisonError::into_inner).push(self);
    }

    /// Opens the part that this process or another one has left for `path`; `None` if there is none.
    fn of_left(path: &Path) -> Result<Option<Self>, WriteError> {
        match taken(path) {
            Some(output) => Ok(Some(output)),
            None => Self::of_killed(path),
        }
    }
}

/// Takes the part for `path` from those that this process has left.
fn taken(path: &Path) -> Option<OutputFile> {
    let mut left = LEFT.lock().unwrap_or_else(PoisonError::into_inner);
    let place = left.iter().position(|output| output.path == path)?;
    Some(left.swap_remove(place))
}

/// Unlocks the part that this process has left for `path`, so that it is closed as that of a killed program.
pub(crate) fn unlock_left(path: &Path) {
    drop(taken(path));
}

/// Writes files that belong together, as [`replace`](super::replace) does, or leaves them as parts for [`place`].
pub(crate) fn replace_or_leave(files: &[(&Path, &[u8])], leave_parts: bool) -> Result<(), WriteError> {
    let write = |(path, bytes): &(&Path, &[u8])| {
        let output = OutputFile::create(path)?;
        output.file().write_all(bytes).map_err(|error| output.error(error))?;
        Ok(output)
    };
    let outputs = files.iter().map(write).collect::<Result<Vec<_>, WriteError>>()?;
    match leave_parts {
        true => outputs.into_iter().for_each(OutputFile::leave),
        false => outputs.into_iter().try_for_each(|output| output.put_in_place().map(drop))?,
    }
    Ok(())
}

/// Writes files as parts, for [`place`].
///
/// # Errors
/// A file cannot be written; then none is left.
pub fn leave(files: &[(&Path, &[u8])]) -> Result<(), WriteError> {
    replace_or_leave(files, true)
}

/// Renames the parts that were left for files, which may replace existing ones. Those of `needed` must be there.
///
/// # Errors
/// A part is missing or is being written by another program; then none is renamed. Or one cannot be renamed.
pub fn place(needed: &[&Path], optional: &[&Path]) -> Result<(), WriteError> {
    let mut outputs = Vec::new();
    for path in optional {
        outputs.extend(OutputFile::of_left(path)?);
    }
    for path in needed {
        let missing = || WriteError::Io {
            path: (*path).to_owned(),
            error: io::Error::other("another program has removed what was written to it; run it again"),
        };
        outputs.push(OutputFile::of_left(path)?.ok_or_else(missing)?);
    }
    outputs.into_iter().try_for_each(|output| output.put_in_place().map(drop))
}

/// Removes the parts that were left for files. Those that other programs write stay.
pub fn remove_left(files: &[&Path]) {
    for mut output in files.iter().filter_map(|path| OutputFile::of_left(path).ok().flatten()) {
        output.keep(false);
    }
}

/// Warns that the part of an earlier run is removed, as it may hold a log of which there is nothing else.
pub(super) fn warn_of_removal(file: &File, part: &Path) {
    let bytes = file.metadata().map_or(0, |metadata| metadata.len());
    if bytes > 0 {
        let name = part.file_stem().map(Path::new).unwrap_or(part);
        let is_log =
            name.extension().is_some_and(|ending| ["mcap", "bag"].iter().any(|log| ending.eq_ignore_ascii_case(log)));
        let advice =
            if is_log { "; `gridweave recover` can read such a log before its name is used again" } else { "" };
        tracing::warn!("removed {} ({bytes} bytes), which an earlier run has left{advice}", part.display());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn files_that_are_left_take_their_names_together_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let paths = ["a", "b", "c"].map(|name| folder.path().join(name));
        let [a, b, c] = [&*paths[0], &*paths[1], &*paths[2]];
        fs::write(a, "before").unwrap();
        let read = |path: &Path| fs::read_to_string(path).unwrap();
        leave(&[(a, b"after")]).unwrap();
        assert!(matches!(OutputFile::create(a), Err(WriteError::InUse { .. })), "it is locked");
        let error = place(&[a, b], &[]).unwrap_err().to_string();
        assert!(error.contains("b: another program has removed"), "{error}");
        assert_eq!(read(a), "before");
        leave(&[(a, b"after"), (b, b"new")]).unwrap();
        place(&[a, b], &[c]).unwrap();
        assert_eq!((read(a), read(b), c.exists()), ("after".to_owned(), "new".to_owned(), false));
        leave(&[(a, b"again"), (c, b"more")]).unwrap();
        remove_left(&[a, b, c]);
        assert_eq!(read(a), "after");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
    }
}
