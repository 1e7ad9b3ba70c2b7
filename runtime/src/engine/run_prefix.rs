//! The prefix of a run, with which all its names begin: those of its services, its folder and its files in `/dev/shm`.
//!
//! It is random, as machines that share these folders (containers) give the same process numbers, and of one exact form, so
//! that what belongs to others is never taken for that of a run.

use super::user_folder::is_own;
use crate::link::SHARED_MEMORY_FOLDER;
use rustix::rand::{GetRandomFlags, getrandom};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// Digits of the random number in a prefix.
const RANDOM_DIGITS: usize = 16;

/// A prefix that no other run has: `gw`, the number of the process for those who look at it, and a random number.
pub(super) fn new_prefix() -> io::Result<String> {
    let mut random = [0; RANDOM_DIGITS / 2];
    // So few bytes come at once, or not at all.
    getrandom(&mut random, GetRandomFlags::empty())?;
    Ok(format!("gw{}_{:016x}_", std::process::id(), u64::from_le_bytes(random)))
}

/// Whether a prefix was made by the process of this number, here or on another machine that shares these folders.
pub(super) fn is_prefix_of(prefix: &str, process: u32) -> bool {
    is_prefix(prefix) && prefix.starts_with(&format!("gw{process}_"))
}

/// Whether a name has exactly the form of a prefix.
pub(super) fn is_prefix(name: &str) -> bool {
    let parts = name.strip_prefix("gw").and_then(|rest| rest.strip_suffix('_')).and_then(|rest| rest.split_once('_'));
    let is_digit = |byte: u8| byte.is_ascii_digit() || (b'a'..=b'f').contains(&byte);
    parts.is_some_and(|(process, random)| {
        (1..=10).contains(&process.len())
            && process.bytes().all(|byte| byte.is_ascii_digit())
            && random.len() == RANDOM_DIGITS
            && random.bytes().all(is_digit)
    })
}

/// The counters lies in shared memory, and goes with the rest of the run that lies there.
pub(super) fn counters_path(prefix: &str) -> PathBuf {
    Path::new(SHARED_MEMORY_FOLDER).join(format!("{prefix}counters"))
}

/// The files of this user in shared memory that bear a run's prefix.
pub(super) fn shared_memory(prefix: &str) -> Vec<PathBuf> {
    if !is_prefix(prefix) {
        return Vec::new();
    }
    let Ok(entries) = fs::read_dir(SHARED_MEMORY_FOLDER) else { return Vec::new() };
    let files = entries.flatten().filter(|entry| entry.file_name().to_string_lossy().starts_with(prefix));
    let is_own_file = |path: &PathBuf| fs::symlink_metadata(path).is_ok_and(|file| file.is_file() && is_own(&file));
    files.map(|entry| entry.path()).filter(is_own_file).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_has_the_exact_form_of_a_prefix_is_one() {
        let made = new_prefix().unwrap();
        assert!(is_prefix(&made), "{made}");
        let digits = "0123456789abcdef";
        let wrong = [
            String::new(),
            "o".into(),
            "new-".into(),
            "gw".into(),
            "gw1_0_".into(),
            format!("gw1_{digits}"),
            format!("gw1_{digits}0_"),
            format!("gw_{digits}_"),
            format!("gwx_{digits}_"),
            format!("gw1_{}_", digits.to_uppercase()),
            format!("new-gw1_{digits}_"),
        ];
        for name in wrong {
            assert!(!is_prefix(&name) && shared_memory(&name).is_empty(), "{name}");
        }
    }

    #[test]
    fn a_prefix_tells_the_process_that_made_it() {
        let made = new_prefix().unwrap();
        let own = std::process::id();
        assert!(is_prefix_of(&made, own) && !is_prefix_of(&made, own + 1) && !is_prefix_of(&made, own / 10));
    }

    #[test]
    fn two_runs_of_one_process_number_have_names_of_their_own() {
        assert_ne!(new_prefix().unwrap(), new_prefix().unwrap());
    }
}
