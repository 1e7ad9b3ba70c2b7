//! Errors of the operating system, with what would fix them.

use rustix::io::Errno;
use std::io::{self, ErrorKind};

/// Why a file cannot be written, and what would fix that.
pub(crate) fn of_writing(error: &io::Error) -> String {
    let fix = match error.kind() {
        ErrorKind::NotFound | ErrorKind::NotADirectory => "check that its folder exists",
        ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => "check that it and its folder are writable",
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => {
            "there is no room left: free some, or choose another folder"
        }
        ErrorKind::InvalidFilename => "a file is written as NAME.part first, so its name has at most 250 bytes",
        ErrorKind::FileTooLarge => "it is larger than the file system or `ulimit -f` allows",
        _ => return of_reading(error),
    };
    format!("{error}; {fix}")
}

/// Why a file cannot be read, and what would fix that, if it is known.
pub(crate) fn of_reading(error: &io::Error) -> String {
    match error.raw_os_error().map(Errno::from_raw_os_error) {
        Some(Errno::MFILE) => format!("{error}; this program may open no more: raise the limit with `ulimit -n`"),
        Some(Errno::NFILE) => format!("{error}: those of the machine are used up; end other programs"),
        _ => error.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_error_has_its_own_fix() {
        let of = |errno: Errno| of_writing(&io::Error::from_raw_os_error(errno.raw_os_error()));
        for (errno, fix) in [
            (Errno::MFILE, "ulimit -n"),
            (Errno::NOSPC, "no room left"),
            (Errno::FBIG, "ulimit -f"),
            (Errno::NAMETOOLONG, "at most 250 bytes"),
            (Errno::NOENT, "folder exists"),
            (Errno::ROFS, "writable"),
        ] {
            assert!(of(errno).contains(fix), "{}", of(errno));
        }
        assert_eq!(of_writing(&io::Error::other("another program has removed it")), "another program has removed it");
    }
}
