//! What the supervisor hears of a process, until that is silent.

use super::protocol::Said;
use std::io::{BufRead, BufReader};
use std::process::ChildStdout;
use std::sync::mpsc::Sender;

/// What happens to a process.
pub(super) enum Event {
    Said {
        process: usize,
        words: Said,
    },
    /// It printed something that is no word for the supervisor.
    Printed {
        line: String,
    },
    /// Its output has ended: it has died, or is about to.
    Silent {
        process: usize,
    },
}

/// Hears what a process says until it is silent.
pub(super) fn listen(process: usize, stdout: ChildStdout, events: &Sender<Event>) {
    for line in BufReader::new(stdout).lines() {
        let Ok(line) = line else { break };
        let event = match serde_json::from_str(&line) {
            Ok(words) => Event::Said { process, words },
            Err(_) => Event::Printed { line },
        };
        let _ = events.send(event);
    }
    let _ = events.send(Event::Silent { process });
}
