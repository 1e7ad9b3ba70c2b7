//! The memory that this process may still take.
//!
//! Linux grants more memory than there is, and ends a process that uses it. Code that allocates a size stated in a file
//! checks this first.

use rustix::process::{Resource, getrlimit};
use std::fs;

/// The number of bytes that this process may still take: of the machine, of its control group, and of its own limit.
/// `None` if the system does not say.
pub fn available() -> Option<u64> {
    let text = |path: &str| fs::read_to_string(path).ok();
    let machine = text("/proc/meminfo").and_then(|text| of_machine(&text));
    [machine, of_group(), of_process()].into_iter().flatten().min()
}

/// The memory of the machine that is free, or can be freed.
fn of_machine(meminfo: &str) -> Option<u64> {
    let line = meminfo.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}

/// What is left of the limit of this process's control group (version 2), if it has one.
fn of_group() -> Option<u64> {
    let groups = fs::read_to_string("/proc/self/cgroup").ok()?;
    let path = groups.lines().find_map(|line| line.strip_prefix("0::"))?;
    let number = |file: &str| -> Option<u64> {
        fs::read_to_string(format!("/sys/fs/cgroup{path}/{file}")).ok()?.trim().parse().ok()
    };
    Some(number("memory.max")?.saturating_sub(number("memory.current")?))
}

/// What is left of the limit of this process's address space (`ulimit -v`), if it has one.
fn of_process() -> Option<u64> {
    let most = getrlimit(Resource::As).current?;
    let pages: u64 = fs::read_to_string("/proc/self/statm").ok()?.split(' ').next()?.parse().ok()?;
    Some(most.saturating_sub(pages.checked_mul(rustix::param::page_size() as u64)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_available_memory_is_read() {
        assert_eq!(of_machine("MemTotal: 9 kB\nMemAvailable:   12 kB\nMemFree: 1 kB\n"), Some(12 << 10));
        assert_eq!(of_machine("MemTotal: 9 kB\n"), None);
        assert!(available().is_some_and(|bytes| bytes > 0));
    }
}
