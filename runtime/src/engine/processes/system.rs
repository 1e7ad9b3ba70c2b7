//! What the system knows of a process: its memory, and how it ended.

use std::os::unix::process::ExitStatusExt;
use std::process::ExitStatus;

/// The memory that a process and the programs that it has started have for themselves alone, bytes: that of links is not
/// counted.
pub fn memory_of_process(process: u32) -> Option<u64> {
    let own = memory_alone(process)?;
    Some(own + children(process).into_iter().filter_map(memory_of_process).sum::<u64>())
}

/// The processes that the threads of a process have started; none where the system does not say.
fn children(process: u32) -> Vec<u32> {
    let threads = std::fs::read_dir(format!("/proc/{process}/task")).into_iter().flatten().flatten();
    let lists = threads.filter_map(|thread| std::fs::read_to_string(thread.path().join("children")).ok());
    lists.flat_map(|list| list.split_whitespace().filter_map(|id| id.parse().ok()).collect::<Vec<_>>()).collect()
}

fn memory_alone(process: u32) -> Option<u64> {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_memory_of_a_program_counts_for_the_process_that_has_started_it() {
        let own = std::process::id();
        let mut child = std::process::Command::new("sleep").arg("100").spawn().unwrap();
        let (children, memory) = (children(own), memory_of_process(child.id()));
        child.kill().unwrap();
        child.wait().unwrap();
        assert!(memory.is_some());
        // Not every system says.
        if std::path::Path::new(&format!("/proc/{own}/task/{own}/children")).exists() {
            assert!(children.contains(&child.id()), "{children:?}");
        }
        assert!(memory_of_process(own).unwrap() > 0);
    }
}
