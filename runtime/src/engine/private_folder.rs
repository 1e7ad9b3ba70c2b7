//! A folder for the small files of a command, beside those of runs.

use super::run_folder::{RunFolder, RunFolderError};
use std::path::Path;

/// A folder that only this user can read, removed on drop. If the command is killed, the cleanup of runs removes it, as
/// it does the folder of a killed run.
#[derive(Debug)]
pub struct PrivateFolder(Option<RunFolder>);

impl PrivateFolder {
    /// Creates a folder.
    ///
    /// # Errors
    /// As [`RunFolder::create`].
    pub fn create() -> Result<Self, RunFolderError> {
        RunFolder::create().map(|folder| Self(Some(folder)))
    }

    /// The path of the folder.
    pub fn path(&self) -> &Path {
        self.0.as_ref().map_or(Path::new(""), RunFolder::path)
    }
}

impl Drop for PrivateFolder {
    fn drop(&mut self) {
        // What cannot be removed is removed by the next cleanup.
        drop(self.0.take().map(RunFolder::remove));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::os::unix::fs::PermissionsExt;

    #[test]
    fn a_folder_is_private_and_removed_with_its_files() {
        let folder = PrivateFolder::create().unwrap();
        let path = folder.path().to_owned();
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o700);
        fs::write(path.join("file"), "contents").unwrap();
        drop(folder);
        assert!(!path.exists());
    }
}
