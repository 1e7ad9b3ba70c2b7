//! What the system knows of a process: its memory, and how it ended.

use std::os::unix::process::ExitStatusExt;
use std::process::ExitStatus;

/// The memory that a process has for itself alone, bytes: that of its links is not counted.
pub fn memory_of_process(process: u32) -> Option<u64> {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let kilobytes = |name: &str| {
        let line = status.lines().find_map(|line| line.strip_prefix(name))?;
        line.trim_start_matches(':').split_whitespace().next()?.parse::<u64>().ok()
    };
    Some(1024 * (kilobytes("RssAnon")? + kilobytes("VmSwap").unwrap_or(0)))
}

/// How a process ended, to follow "which".
pub fn describe_exit(status: ExitStatus) -> String {
    match (status.signal(), status.code()) {
        (Some(signal), _) => {
            let (name, hint) = match signal {
                4 => (" (SIGILL)", ""),
                6 => (" (SIGABRT)", "; it gave up, as programs do that get no memory"),
                7 => (" (SIGBUS)", "; is /dev/shm full?"),
                8 => (" (SIGFPE)", ""),
                9 => (" (SIGKILL)", "; the system does so when memory runs out"),
                11 => (" (SIGSEGV)", ""),
                15 => (" (SIGTERM)", ""),
                25 => (" (SIGXFSZ)", "; a file has become larger than it may"),
                _ => ("", ""),
            };
            format!("was ended by signal {signal}{name}{hint}")
        }
        (None, Some(code)) => format!("ended with status {code}; what it said stands above"),
        (None, None) => "ended".to_owned(),
    }
}
