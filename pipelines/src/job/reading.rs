//! What is read of logs, and under which names.

use crate::status::BadUse;
use clap::Args;
use gridweave_logs::names::{Convention, NameRules};
use gridweave_runtime::pipeline::Overrides;

/// The kind of stage that reads logs.
const LOG_SOURCE: &str = "mcap_source";

/// Under which names logs are read, and which of their topics.
#[derive(Clone, Debug, Default, Args)]
pub(crate) struct NamingOptions {
    /// Give a topic of the logs another name, before or behind that of its robot; `{robot}` stands for one part of both.
    #[arg(long, value_name = "OLD=NEW")]
    pub(crate) rename: Vec<String>,
    /// Read these robots alone, and what is no robot's.
    #[arg(long, value_name = "ROBOT", value_delimiter = ',')]
    pub(crate) robots: Vec<String>,
    /// Read these topics alone; `{robot}` stands for any one part.
    #[arg(long, visible_alias = "topic", value_name = "TOPIC", value_delimiter = ',')]
    pub(crate) topics: Vec<String>,
    /// Set the clocks of all logs, and the stamps in their messages, so that they begin together, when the first one does: for
    /// robots whose clocks have nothing in common.
    #[arg(long)]
    pub(crate) align_start: bool,
}

/// What is read of logs, and under which names.
#[derive(Clone, Debug, Default, Args)]
pub(crate) struct ReadingOptions {
    #[command(flatten)]
    pub(crate) names: NamingOptions,
    /// Seconds from the first message at which to begin. The last maps, and other latched messages, are taken from before.
    #[arg(long, value_name = "SECONDS")]
    pub(crate) start: Option<f64>,
    /// Seconds from the first message at which to end.
    #[arg(long, value_name = "SECONDS")]
    pub(crate) end: Option<f64>,
}

impl ReadingOptions {
    /// Tells the source of a pipeline.
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
    /// The same for a command that reads logs itself.
    ///
    /// # Errors
    /// An entry of `--rename` is none.
    pub(crate) fn rules(&self, convention: Convention) -> Result<NameRules, BadUse> {
        let renames = self.rename.iter().map(|text| text.parse()).collect::<Result<_, _>>().map_err(BadUse)?;
        let (robots, topics) = (self.robots.clone(), self.topics.clone());
        Ok(NameRules { convention, renames, robots, topics, align_start: self.align_start, ..Default::default() })
    }
}
