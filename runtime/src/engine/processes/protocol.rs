//! The protocol between a supervisor and its processes: one JSON object per line.

use crate::engine::{Failure, StageReport};
use crate::message::LogTime;
use serde::{Deserialize, Serialize};
use std::io::{self, Write};

/// A report of a process to the supervisor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "report", rename_all = "snake_case")]
pub(super) enum ProcessReport {
    /// The process is alive. Sent at least every [`ALIVE_INTERVAL`](super::child::ALIVE_INTERVAL).
    Alive,
    /// The progress of a source.
    Progress {
        /// The name of the stage.
        stage: String,
        /// The share of its work that is done, 0 to 1.
        share: f64,
        /// The log time that it has reached.
        log_time: LogTime,
    },
    /// A stage has finished.
    Done {
        /// Its report, which includes the name of the stage.
        stage_report: StageReport,
    },
    /// A stage has failed.
    Failed {
        /// The name of the stage.
        stage: String,
        /// The cause.
        failure: Failure,
    },
    /// A stage has ended because the run is being stopped.
    Stopped {
        /// The name of the stage.
        stage: String,
    },
}

/// A command of the supervisor to a process.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "command", rename_all = "snake_case")]
pub(super) enum SupervisorCommand {
    /// End a live run: sources send no more, and pending messages are handled.
    Drain,
    /// The run has failed: stop, and leave the outputs in a usable state.
    Stop {
        /// The cause.
        reason: String,
    },
}

/// Writes a report or a command as one line.
pub(super) fn write_line(mut to: impl Write, content: &impl Serialize) -> io::Result<()> {
    let mut line = serde_json::to_vec(content)?;
    line.push(b'\n');
    to.write_all(&line)?;
    to.flush()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stage::StageError;

    #[test]
    fn every_report_is_read_back_from_one_line() {
        let report =
            StageReport { name: "lines".into(), counts: [("searches".to_owned(), 3)].into(), ..Default::default() };
        let all = [
            ProcessReport::Alive,
            ProcessReport::Progress { stage: "log".into(), share: 0.1, log_time: LogTime(u64::MAX) },
            ProcessReport::Done { stage_report: report },
            ProcessReport::Failed { stage: "a".into(), failure: StageError::new("b\n", "c").with_help("d").into() },
            ProcessReport::Failed { stage: "a".into(), failure: Failure::Hung { seconds: 1.5 } },
            ProcessReport::Stopped { stage: "a".into() },
        ];
        for report in all {
            let mut line = Vec::new();
            write_line(&mut line, &report).unwrap();
            assert_eq!(line.iter().filter(|byte| **byte == b'\n').count(), 1);
            assert_eq!(serde_json::from_slice::<ProcessReport>(&line).unwrap(), report);
        }
    }
}
