//! The prefix of all names of a run: its services, its folder and its files in `/dev/shm`.
//!
//! It is random, because machines that share these folders (containers) assign the same process ids. It has one exact
//! format, so that files of other programs are never mistaken for those of a run.

use super::user_folder::is_own;
use crate::link::SHARED_MEMORY_FOLDER;
use rustix::rand::{GetRandomFlags, getrandom};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// The digits of the random number in a prefix.
const RANDOM_DIGITS: usize = 16;

/// A unique prefix: `gw`, the process id (for people who look at it), and a random number.
pub(super) fn new_prefix() -> io::Result<String> {
    let mut random = [0; RANDOM_DIGITS / 2];
    // A request of so few bytes is never answered partially.
    getrandom(&mut random, GetRandomFlags::empty())?;
    Ok(format!("gw{}_{:016x}_", std::process::id(), u64::from_le_bytes(random)))
}

/// Whether a prefix was created by a process with this id, on this machine or on another one that shares these folders.
pub(super) fn is_prefix_of(prefix: &str, process: u32) -> bool {
    is_prefix(prefix) && prefix.starts_with(&format!("gw{process}_"))
}

/// Whether a name has the exact format of a prefix.
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

/// The path of the shared counters. It is in shared memory, and is removed together with the other files of the run
/// there.
pub(super) fn counters_path(prefix: &str) -> PathBuf {
    Path::new(SHARED_MEMORY_FOLDER).join(format!("{prefix}counters"))
}

/// The files of this user in shared memory that start with the prefix of a run.
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
    fn only_a_name_with_the_exact_format_is_a_prefix() {
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
    fn a_prefix_contains_the_id_of_its_process() {
        let made = new_prefix().unwrap();
        let own = std::process::id();
        assert!(is_prefix_of(&made, own) && !is_prefix_of(&made, own + 1) && !is_prefix_of(&made, own / 10));
    }

    #[test]
    fn two_runs_of_one_process_have_different_prefixes() {
        assert_ne!(new_prefix().unwrap(), new_prefix().unwrap());
    }
}
