//! Why logs cannot be named.

use super::file_names::FileNameError;
use crate::reader::ReadError;
use gridweave_runtime::pipeline::suggest;

/// Logs cannot be opened and named.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NameError {
    /// A log cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// Logs look alike, and so do their names.
    #[error("the logs look alike, and their names do not tell them apart: {0}; or say whose they are: ROBOT=LOG")]
    Alike(#[from] FileNameError),
    /// A robot that was asked for is not there.
    #[error("there is nothing of a robot `{robot}` in the logs: {}", listed(.known))]
    NoSuchRobot {
        /// What was asked for.
        robot: String,
        /// The robots that are there.
        known: Vec<String>,
    },
    /// A topic that was asked for is not there.
    #[error("there is no topic `{topic}` in the logs{}", nearest(.topic, .known))]
    NoSuchTopic {
        /// What was asked for.
        topic: String,
        /// The topics that are there, as they are called here.
        known: Vec<String>,
    },
}

fn nearest(topic: &str, known: &[String]) -> String {
    let known: Vec<&str> = known.iter().map(String::as_str).collect();
    suggest(topic, &known, "the topics in them are").map_or_else(String::new, |meant| format!(": {meant}"))
}

fn listed(robots: &[String]) -> String {
    match robots.is_empty() {
        true => "no robot was recognised in them".to_owned(),
        false => format!("the robots in them are {}", robots.join(", ")),
    }
}
