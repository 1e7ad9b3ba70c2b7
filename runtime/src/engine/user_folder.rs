//! The folder with the folders of all runs of this user.
//!
//! It is `gridweave` in the folder `XDG_RUNTIME_DIR` if that belongs to this user, and `/tmp/gridweave-UID` otherwise.
//! In `/tmp` anybody can create a folder or a link of that name: only a folder that this user alone can write to is
//! trusted.

use rustix::process::geteuid;
use std::fs::{self, DirBuilder, Metadata, Permissions};
use std::io::{self, ErrorKind};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};

/// The mode of folders: accessible to this user only.
pub(super) const OWN_FOLDER: u32 = 0o700;
/// The mode of files: accessible to this user only.
pub(super) const OWN_FILE: u32 = 0o600;
/// The mode bits that make a folder writable for other users, and so not trusted.
const OTHERS_WRITE: u32 = 0o022;

/// The path of the folder, which may not exist.
pub(super) fn path() -> PathBuf {
    let user = geteuid().as_raw();
    let is_own = |folder: &PathBuf| {
        folder.is_absolute() && fs::metadata(folder).is_ok_and(|folder| folder.is_dir() && folder.uid() == user)
    };
    match std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from).filter(is_own) {
        Some(folder) => folder.join("gridweave"),
        None => PathBuf::from(format!("/tmp/gridweave-{user}")),
    }
}

/// Creates the folder if it does not exist.
///
/// # Errors
/// It cannot be created, or what exists is not trusted.
pub(super) fn make(path: &Path) -> io::Result<()> {
    match DirBuilder::new().mode(OWN_FOLDER).create(path) {
        Err(error) if error.kind() == ErrorKind::AlreadyExists => check(path),
        made => made,
    }
}

/// Checks that a folder belongs to this user alone.
///
/// # Errors
/// It does not exist, it is a link or no folder, it belongs to another user, or other users can write to it.
pub(super) fn check(path: &Path) -> io::Result<()> {
    // The metadata of a symbolic link itself, not of its target.
    let metadata = fs::symlink_metadata(path)?;
    let refused = |what: &str| {
        let text = format!("{what}; remove it, or set XDG_RUNTIME_DIR to a folder of your own");
        Err(io::Error::new(ErrorKind::PermissionDenied, text))
    };
    match &metadata {
        metadata if metadata.is_symlink() => refused("it is a symbolic link"),
        metadata if !metadata.is_dir() => refused("it is not a folder"),
        metadata if !is_own(metadata) => refused(&format!("it belongs to the user {}", metadata.uid())),
        metadata if metadata.mode() & OTHERS_WRITE != 0 => refused("other users can write to it"),
        metadata if metadata.mode() & 0o777 != OWN_FOLDER => {
            fs::set_permissions(path, Permissions::from_mode(OWN_FOLDER))
        }
        _ => Ok(()),
    }
}

/// Whether a file or folder belongs to this user.
pub(super) fn is_own(metadata: &Metadata) -> bool {
    metadata.uid() == geteuid().as_raw()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::symlink;

    #[test]
    fn only_a_folder_that_belongs_to_this_user_alone_is_trusted() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        make(&at("own")).unwrap();
        assert_eq!(fs::metadata(at("own")).unwrap().mode() & 0o777, OWN_FOLDER);
        make(&at("own")).unwrap();

        symlink(at("own"), at("link")).unwrap();
        fs::write(at("file"), "").unwrap();
        fs::create_dir(at("open")).unwrap();
        fs::set_permissions(at("open"), Permissions::from_mode(0o777)).unwrap();
        for (name, what) in [("link", "symbolic link"), ("file", "not a folder"), ("open", "other users can write")] {
            let error = make(&at(name)).unwrap_err().to_string();
            assert!(error.contains(what) && error.contains("XDG_RUNTIME_DIR"), "{error}");
        }
        fs::set_permissions(at("own"), Permissions::from_mode(0o755)).unwrap();
        make(&at("own")).unwrap();
        assert_eq!(fs::metadata(at("own")).unwrap().mode() & 0o777, OWN_FOLDER);
    }
}
