//! The error when logs cannot be named.

use super::file_names::FileNameError;
use crate::reader::ReadError;
use gridweave_runtime::pipeline::{list_in_words, suggest};
use std::path::PathBuf;

/// The error when logs cannot be opened or named.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NameError {
    /// A log cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// Logs have equal topics, and their file names do not distinguish them.
    #[error(
        "the logs have equal topics, and their file names do not distinguish the robots: {0}; or set the robots with ROBOT=LOG"
    )]
    SameNames(#[from] FileNameError),
    /// A topic is renamed to that of another one, whose messages would be mixed with its own.
    #[error("`{one}` and `{other}` would both be `{topic}`: rename one of them to another topic")]
    OneTopicForTwo {
        /// The topic after renaming.
        topic: String,
        /// One of the topics in the logs.
        one: String,
        /// The other one.
        other: String,
    },
    /// Two logs of one time have maps or scans of robots with one name, which would be taken for one robot.
    #[error(
        "both {one} and {other} have maps or scans of `{robot}` at the same time: if these are two robots, name them: A={one} \
         B={other}; if they are one, leave its maps out of one of the logs (`gridweave filter --topics`); if the logs do not belong \
         together, merge them one at a time",
        one = .one.display(),
        other = .other.display()
    )]
    OneNameForTwo {
        /// The robot.
        robot: String,
        /// One of the logs.
        one: PathBuf,
        /// The other one.
        other: PathBuf,
    },
    /// A selected robot is not in the logs.
    #[error("there is no robot `{robot}` in the logs: {}", listed(.known))]
    NoSuchRobot {
        /// The selected robot.
        robot: String,
        /// The robots in the logs.
        known: Vec<String>,
    },
    /// A selected topic is not in the logs.
    #[error("there is no topic `{topic}` in the logs{}", nearest(.topic, .renamed, .known))]
    NoSuchTopic {
        /// The selected topic.
        topic: String,
        /// What a renaming makes of it, if one fits.
        renamed: Option<String>,
        /// The topics in the logs, after renaming.
        known: Vec<String>,
    },
}

fn nearest(topic: &str, renamed: &Option<String>, known: &[String]) -> String {
    if let Some(renamed) = renamed.as_ref().filter(|renamed| known.contains(renamed)) {
        return format!(" once topics are renamed: it is `{renamed}`");
    }
    let known: Vec<&str> = known.iter().map(String::as_str).collect();
    suggest(topic, &known, "the topics in them are").map_or_else(String::new, |meant| format!(": {meant}"))
}

fn listed(robots: &[String]) -> String {
    match robots.is_empty() {
        true => "no robot was recognised in them".to_owned(),
        false => format!("the robots in them are {}", list_in_words(robots)),
    }
}
