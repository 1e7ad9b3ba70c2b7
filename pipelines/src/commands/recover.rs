//! `gridweave recover`: writes what can be read of a damaged log.

use crate::job::{check_is_no_input, check_mcap_ending};
use crate::status::Status;
use crate::terminal::print;
use anyhow::Result;
use clap::Args;
use gridweave_logs::bag::Bag;
use gridweave_logs::sink;
use std::fmt::Write;
use std::path::PathBuf;

/// Arguments of `gridweave recover`.
#[derive(Debug, Args)]
pub(crate) struct RecoverArgs {
    /// A cut or damaged log: MCAP, SQLite of rosbag2, a rosbag2 folder, a ROS 1 bag, or the NAME.part of a killed run.
    /// It is not changed.
    #[arg(value_name = "LOG")]
    pub(crate) input: PathBuf,
    /// The output: an MCAP file, or FOLDER/, with a slash at the end, for a rosbag2 folder.
    #[arg(short, long, value_name = "OUT")]
    pub(crate) output: PathBuf,
}

/// Writes what can be read of a log.
pub(crate) fn recover(args: &RecoverArgs) -> Result<Status> {
    let RecoverArgs { input, output } = args;
    check_mcap_ending(output)?;
    let bag = if Bag::is_meant(output) { Some(Bag::create(output)?) } else { None };
    let file = bag.as_ref().map_or_else(|| output.clone(), Bag::log);
    check_is_no_input([input], &file)?;
    let recovery = sink::recover(input, &file)?;
    if let Some(bag) = bag {
        bag.describe()?;
    }
    let seconds = recovery.times.map_or(0.0, |(first, last)| last.seconds_since(first));
    let (messages, topics) = (recovery.messages, recovery.topics.len());
    let mut text =
        format!("wrote {messages} messages on {topics} topics over {seconds:.1} s to {}\n", output.display());
    text.push_str(if recovery.losses.is_empty() {
        "nothing was lost: the log is complete\n"
    } else {
        "damage of the log:\n"
    });
    for (loss, times) in &recovery.losses {
        // Writing to a string cannot fail.
        let _ = match times {
            1 => writeln!(text, "  - {loss}"),
            times => writeln!(text, "  - {loss} ({times} times)"),
        };
    }
    print(text)?;
    Ok(Status::Done)
}
