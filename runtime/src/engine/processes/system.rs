//! The memory use and the exit status of a process.

use std::os::unix::process::ExitStatusExt;
use std::process::ExitStatus;

/// The private memory of a process and its child processes, bytes. The shared memory of links is not counted.
pub fn memory_of_process(process: u32) -> Option<u64> {
    let own = private_memory(process)?;
    Some(own + children(process).into_iter().filter_map(memory_of_process).sum::<u64>())
}

/// The child processes of all threads of a process; none where the system does not list them.
fn children(process: u32) -> Vec<u32> {
    let threads = std::fs::read_dir(format!("/proc/{process}/task")).into_iter().flatten().flatten();
    let lists = threads.filter_map(|thread| std::fs::read_to_string(thread.path().join("children")).ok());
    lists.flat_map(|list| list.split_whitespace().filter_map(|id| id.parse().ok()).collect::<Vec<_>>()).collect()
}

fn private_memory(process: u32) -> Option<u64> {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let kilobytes = |name: &str| {
        let line = status.lines().find_map(|line| line.strip_prefix(name))?;
        line.trim_start_matches(':').split_whitespace().next()?.parse::<u64>().ok()
    };
    Some(1024 * (kilobytes("RssAnon")? + kilobytes("VmSwap").unwrap_or(0)))
}

/// A description of an exit status, a clause to follow "which".
pub fn describe_exit(status: ExitStatus) -> String {
    match (status.signal(), status.code()) {
        (Some(signal), _) => {
            let (name, hint) = match signal {
                4 => (" (SIGILL)", ""),
                6 => (" (SIGABRT)", "; it aborted, as programs do when they run out of memory"),
                7 => (" (SIGBUS)", "; is /dev/shm full?"),
                8 => (" (SIGFPE)", ""),
                9 => (" (SIGKILL)", "; the system sends it when memory runs out"),
                11 => (" (SIGSEGV)", ""),
                15 => (" (SIGTERM)", ""),
                25 => (" (SIGXFSZ)", "; a file exceeds the size limit"),
                _ => ("", ""),
            };
            format!("was ended by signal {signal}{name}{hint}")
        }
        (None, Some(code)) => format!("ended with status {code}; see its output above"),
        (None, None) => "ended".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_memory_of_a_child_counts_for_its_parent() {
        let own = std::process::id();
        let mut child = std::process::Command::new("sleep").arg("100").spawn().unwrap();
        let (children, memory) = (children(own), memory_of_process(child.id()));
        child.kill().unwrap();
        child.wait().unwrap();
        assert!(memory.is_some());
        // Not every system lists children.
        if std::path::Path::new(&format!("/proc/{own}/task/{own}/children")).exists() {
            assert!(children.contains(&child.id()), "{children:?}");
        }
        assert!(memory_of_process(own).unwrap() > 0);
    }
}
