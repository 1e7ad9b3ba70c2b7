//! Options of commands that read logs: names, topics, robots, and times.

use crate::status::BadUse;
use clap::Args;
use gridweave_logs::names::{NameRules, TopicNaming};
use gridweave_runtime::pipeline::Overrides;

/// The kind of stage that reads logs.
const LOG_SOURCE: &str = "mcap_source";

/// Options for the names in logs, and for the topics and robots that are read.
#[derive(Clone, Debug, Default, Args)]
pub(crate) struct NamingOptions {
    /// Rename a topic of the logs; `{robot}` matches one part of both names.
    #[arg(long, value_name = "OLD=NEW")]
    pub(crate) rename: Vec<String>,
    /// Read only these robots, and topics without a robot.
    #[arg(long, value_name = "ROBOT", value_delimiter = ',')]
    pub(crate) robots: Vec<String>,
    /// Read only these topics; `{robot}` matches any one part.
    #[arg(long, visible_alias = "topic", value_name = "TOPIC", value_delimiter = ',')]
    pub(crate) topics: Vec<String>,
    /// Shift the times of all logs, and the stamps in their messages, so that they begin together with the first one:
    /// for robots with unsynchronised clocks.
    #[arg(long)]
    pub(crate) align_start: bool,
}

/// Options for the names and times of logs.
#[derive(Clone, Debug, Default, Args)]
pub(crate) struct ReadingOptions {
    #[command(flatten)]
    pub(crate) names: NamingOptions,
    /// Seconds from the first message at which to begin. The last maps, and other latched messages, from before are
    /// included.
    #[arg(long, value_name = "SECONDS")]
    pub(crate) start: Option<f64>,
    /// Seconds from the first message at which to end.
    #[arg(long, value_name = "SECONDS")]
    pub(crate) end: Option<f64>,
}

impl ReadingOptions {
    /// Sets the parameters of the log source.
    pub(crate) fn set(&self, overrides: &mut Overrides) {
        let NamingOptions { rename, robots, topics, align_start } = &self.names;
        if *align_start {
            overrides.set_for_kind(LOG_SOURCE, "align_start", true);
        }
        for (parameter, texts) in [("rename", rename), ("only_robots", robots), ("only_topics", topics)] {
            if !texts.is_empty() {
                overrides.set_for_kind(LOG_SOURCE, parameter, texts.clone());
            }
        }
        for (parameter, seconds) in [("start", self.start), ("end", self.end)] {
            if let Some(seconds) = seconds {
                overrides.set_for_kind(LOG_SOURCE, parameter, seconds);
            }
        }
    }
}

impl NamingOptions {
    /// Makes the rules for a command that reads logs itself.
    ///
    /// # Errors
    /// An entry of `--rename` is not of the form OLD=NEW.
    pub(crate) fn rules(&self, convention: TopicNaming) -> Result<NameRules, BadUse> {
        let renames = self.rename.iter().map(|text| text.parse()).collect::<Result<_, _>>().map_err(BadUse)?;
        let (robots, topics) = (self.robots.clone(), self.topics.clone());
        Ok(NameRules { convention, renames, robots, topics, align_start: self.align_start, ..Default::default() })
    }
}
