//! The output of a process, as events for the supervisor.

use super::protocol::ProcessReport;
use crate::terminal_text::escape_all_but_styles;
use std::io::{BufRead, BufReader};
use std::process::ChildStdout;
use std::sync::mpsc::Sender;

/// An event of a process.
pub(super) enum Event {
    Report {
        process: usize,
        report: ProcessReport,
    },
    /// It printed a line that is no report.
    Printed {
        line: String,
    },
    /// Its standard output was closed: it has ended, or is about to.
    Closed {
        process: usize,
    },
}

/// Reads the reports of a process until its standard output is closed.
pub(super) fn read_reports(process: usize, stdout: ChildStdout, events: &Sender<Event>) {
    for line in BufReader::new(stdout).lines() {
        let Ok(line) = line else { break };
        let event = match serde_json::from_str(&line) {
            Ok(report) => Event::Report { process, report },
            Err(_) => Event::Printed { line: escape_all_but_styles(&line).into_owned() },
        };
        let _ = events.send(event);
    }
    let _ = events.send(Event::Closed { process });
}
