//! The command `gridweave` and its library: the stage kinds of all crates, the shipped pipelines, and the commands.
//!
//! A program with other stages is the same command with more kinds:
//!
//! ```no_run
//! # use gridweave_runtime::stage::StageKind;
//! # fn my_kind() -> StageKind { unimplemented!() }
//! fn main() -> std::process::ExitCode {
//!     gridweave::command([my_kind()])
//! }
//! ```

#![forbid(unsafe_code)]
mod address_space;
mod cli;
mod commands;
pub mod common_places;
pub mod evaluate;
mod interrupt;
mod job;
mod logging;
mod merge_log;
mod merge_text;
pub mod merging;
pub mod shipped;
mod status;
pub mod summary;
pub mod table;
mod terminal;
mod text_wrapping;
mod trace;
mod verb;

pub use verb::Verb;

use clap::{CommandFactory, FromArgMatches};
use gridweave_runtime::pipeline::PipelineErrors;
use gridweave_runtime::stage::{Registry, StageKind};
use status::{BadUse, Status};
use std::ffi::OsString;
use std::io::IsTerminal;
use std::process::ExitCode;

/// Runs the command line with the stage kinds of Gridweave and the given ones; of two kinds with one name the given one
/// counts. The exit status is 0 if all is done, 1 if it failed, 2 for bad use, and 3 if something could not be merged.
pub fn command(kinds: impl IntoIterator<Item = StageKind>) -> ExitCode {
    command_with(kinds, &[], |_, _| {})
}

/// Runs the command line as [`command`] does, with further verbs, and calls `on_warning` for each warning of this
/// process, with its module and its text.
pub fn command_with(
    kinds: impl IntoIterator<Item = StageKind>,
    verbs: &[Verb],
    on_warning: fn(&str, &str),
) -> ExitCode {
    if let Err(error) = address_space::keep_within_limit() {
        terminal::eprint_line(format_args!("error: {error:#}"));
        return ExitCode::FAILURE;
    }
    ExitCode::from(command_line(std::env::args_os(), kinds, verbs, on_warning))
}

/// Runs the command line with the given arguments, the name of the program first, as [`command_with`] does. Returns the
/// exit status.
pub fn command_line(
    arguments: impl IntoIterator<Item = OsString>,
    kinds: impl IntoIterator<Item = StageKind>,
    verbs: &[Verb],
    on_warning: fn(&str, &str),
) -> u8 {
    interrupt::fail_on_large_files();
    let arguments: Vec<OsString> = arguments.into_iter().collect();
    let registry = shipped::registry(kinds);
    if arguments.iter().any(|argument| argument == "--ros-args") {
        terminal::eprint_line(
            "error: `--ros-args` is for ROS programs. Here parameters are `--set STAGE.PARAMETER=VALUE`, topics of robots are named in \
             `[robots]` of the pipeline, those that are published by `--set STAGE.rename='[\"/map=/fleet/map\"]'`, and the node by \
             `--set STAGE.node=NAME`",
        );
        return 2;
    }
    let command = verbs.iter().fold(cli::Cli::command(), |command, verb| command.subcommand(verb.command()));
    match execute(&command, &arguments, &registry, verbs, on_warning) {
        Ok(Status::Done) => 0,
        Ok(Status::BadUse) => 2,
        Ok(Status::Failed) => 1,
        Ok(Status::NotAllMerged) => 3,
        Err(error) => {
            match error.downcast_ref::<PipelineErrors>() {
                Some(errors) => terminal::eprint_styled_line(errors.render(std::io::stderr().is_terminal())),
                None => terminal::eprint_line(format_args!("error: {error:#}")),
            }
            if is_bad_use(&error) { 2 } else { 1 }
        }
    }
}

/// Whether the user has asked for something that cannot be, such as a parameter that does not exist.
pub fn is_bad_use(error: &anyhow::Error) -> bool {
    error.is::<BadUse>() || error.is::<PipelineErrors>()
}

fn execute(
    command: &clap::Command,
    words: &[OsString],
    registry: &Registry,
    verbs: &[Verb],
    on_warning: fn(&str, &str),
) -> anyhow::Result<Status> {
    let matches = match command.clone().try_get_matches_from(words) {
        Ok(matches) => matches,
        Err(answer) => return print_answer(&answer),
    };
    if let Some((name, of_verb)) = matches.subcommand()
        && let Some(verb) = verbs.iter().find(|verb| verb.name == name)
    {
        terminal::print(verb.execute(of_verb)?)?;
        return Ok(Status::Done);
    }
    cli::Cli::from_arg_matches(&matches)?.execute(words, command, registry, on_warning)
}

/// Prints what the parser of the command line answers by itself: help, the version, or an error.
fn print_answer(answer: &clap::Error) -> anyhow::Result<Status> {
    let text = answer.render();
    if answer.use_stderr() {
        terminal::eprint_line(text.to_string().trim_end());
        return Ok(Status::BadUse);
    }
    terminal::print(text)?;
    Ok(Status::Done)
}
