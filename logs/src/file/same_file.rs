//! Paths that lead to one file.

use std::fs;
use std::io::{self, ErrorKind};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// The canonical path of a file: the same for all links and paths to it. The file need not exist, but its folder must.
///
/// # Errors
/// The folder does not exist, or `path` is a dangling link.
pub fn resolve(path: &Path) -> io::Result<PathBuf> {
    if fs::symlink_metadata(path).is_ok_and(|metadata| metadata.is_symlink()) {
        return path.canonicalize();
    }
    let name = path.file_name().ok_or(ErrorKind::IsADirectory)?;
    Ok(folder_of(path).canonicalize()?.join(name))
}

/// Whether two paths name the same file, which may not exist.
pub fn is_same_name(one: &Path, other: &Path) -> bool {
    matches!((resolve(one), resolve(other)), (Ok(one), Ok(other)) if one == other || is_same_file(&one, &other))
}

/// Whether two paths lead to the same file.
pub fn is_same_file(one: &Path, other: &Path) -> bool {
    let (Ok(one), Ok(other)) = (one.metadata(), other.metadata()) else { return false };
    (one.dev(), one.ino()) == (other.dev(), other.ino())
}

/// The folder of a file.
pub(crate) fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}
