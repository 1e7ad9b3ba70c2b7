//! Verbs that a program adds to the command line.

use crate::commands::live::settings;
use anyhow::Result;
use std::time::Duration;

/// A verb that a program adds to the command line: it takes the parameters of a stage, observes something for a while,
/// and prints what it has found.
#[derive(Clone, Copy, Debug)]
pub struct Verb {
    /// Its name.
    pub name: &'static str,
    /// What it does, in a sentence.
    pub about: &'static str,
    /// Observes for the given time with these parameters. Returns the text to print.
    pub look: fn(toml::Table, Duration) -> Result<String>,
}

/// The arguments of a verb.
#[derive(Debug, clap::Args)]
struct VerbArgs {
    /// A parameter, as in a pipeline
    #[arg(long, value_name = "PARAMETER=VALUE")]
    set: Vec<String>,
    /// Time to listen, seconds
    #[arg(long, value_name = "SECONDS", default_value_t = 5.0)]
    seconds: f64,
}

impl Verb {
    /// The verb with its arguments, for the command line.
    pub(crate) fn command(&self) -> clap::Command {
        // After the arguments, whose own description it would otherwise have.
        <VerbArgs as clap::Args>::augment_args(clap::Command::new(self.name)).about(self.about)
    }

    /// Parses the arguments and runs the verb. Returns the text to print.
    ///
    /// # Errors
    /// The parameters are wrong, or the network cannot be joined.
    pub(crate) fn execute(&self, matches: &clap::ArgMatches) -> Result<String> {
        let args = <VerbArgs as clap::FromArgMatches>::from_arg_matches(matches)?;
        let longest = Duration::try_from_secs_f64(args.seconds)?;
        (self.look)(settings(&args.set)?, longest)
    }
}
