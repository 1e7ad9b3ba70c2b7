//! Folders for the temporary files of a command, in the folder that `TMPDIR` names.

use anyhow::{Context, Result};
use std::fs::Permissions;
use std::io::ErrorKind;
use std::os::unix::fs::PermissionsExt;
use tempfile::TempDir;

/// Creates a folder that only this user can read, removed on drop. `use_of_it` is for the error.
///
/// # Errors
/// It cannot be created, such as in a folder that does not exist.
pub(crate) fn folder(use_of_it: &str) -> Result<TempDir> {
    let private = Permissions::from_mode(0o700);
    let made = tempfile::Builder::new().prefix("gridweave-").permissions(private).tempdir();
    made.map_err(|error| match error.kind() {
        ErrorKind::NotFound => anyhow::anyhow!(
            "the folder for temporary files, {}, does not exist; TMPDIR names another one",
            std::env::temp_dir().display()
        ),
        _ => error.into(),
    })
    .with_context(|| format!("cannot make a folder for {use_of_it}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_private() {
        let folder = folder("a test").unwrap();
        assert_eq!(folder.path().metadata().unwrap().permissions().mode() & 0o777, 0o700);
    }
}
