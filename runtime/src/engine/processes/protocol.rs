//! What a supervisor and its processes say to each other: one JSON object a line.

use crate::engine::{Failure, StageReport};
use crate::message::LogTime;
use serde::{Deserialize, Serialize};
use std::io::{self, Write};

/// What a process says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "said", rename_all = "snake_case")]
pub(super) enum Said {
    /// It is alive. Said at least every [`ALIVE_INTERVAL`](super::child::ALIVE_INTERVAL).
    Alive,
    /// A source has done a share of its work.
    Progress {
        /// Which stage.
        stage: String,
        /// 0 to 1.
        share: f64,
        /// Where it stands.
        log_time: LogTime,
    },
    /// A stage is done.
    Done {
        /// What it has done; it bears the stage's name.
        report: StageReport,
    },
    /// A stage has failed.
    Failed {
        /// Which stage.
        stage: String,
        /// Why.
        failure: Failure,
    },
    /// A stage has ended because the run is being stopped.
    Stopped {
        /// Which stage.
        stage: String,
    },
}

/// What a supervisor says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "told", rename_all = "snake_case")]
pub(super) enum Told {
    /// Come to the end of a live run: sources send no more, and what is on its way is handled.
    Drain,
    /// The run has failed: stop, and leave what was made in a state that can be used.
    Stop {
        /// Why.
        reason: String,
    },
}

/// Writes one line.
pub(super) fn say(mut to: impl Write, words: &impl Serialize) -> io::Result<()> {
    let mut line = serde_json::to_vec(words)?;
    line.push(b'\n');
    to.write_all(&line)?;
    to.flush()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stage::StageError;

    #[test]
    fn whatever_is_said_is_understood() {
        let report =
            StageReport { name: "lines".into(), counts: [("searches".to_owned(), 3)].into(), ..Default::default() };
        let all = [
            Said::Alive,
            Said::Progress { stage: "log".into(), share: 0.1, log_time: LogTime(u64::MAX) },
            Said::Done { report },
            Said::Failed { stage: "a".into(), failure: StageError::new("b\n", "c").with_help("d").into() },
            Said::Failed { stage: "a".into(), failure: Failure::Hung { seconds: 1.5 } },
            Said::Stopped { stage: "a".into() },
        ];
        for words in all {
            let mut line = Vec::new();
            say(&mut line, &words).unwrap();
            assert_eq!(line.iter().filter(|byte| **byte == b'\n').count(), 1);
            assert_eq!(serde_json::from_slice::<Said>(&line).unwrap(), words);
        }
    }
}
