//! `gridweave shell`: completions for shells and manual pages.

use crate::status::Status;
use crate::terminal::print;
use anyhow::{Context, Result};
use clap::{Args, Command, Subcommand};
use clap_complete::Shell;
use std::path::PathBuf;

/// Arguments of `gridweave shell`.
#[derive(Debug, Args)]
pub(crate) struct ShellArgs {
    #[command(subcommand)]
    output: ShellOutput,
}

/// The output for the shell.
#[derive(Debug, Subcommand)]
enum ShellOutput {
    /// Print the completions of the command, for the start file of a shell.
    Completions {
        /// The shell.
        shell: Shell,
    },
    /// Write the manual pages, one for the program and one for each command.
    Man {
        /// The output folder, such as ~/.local/share/man/man1.
        folder: PathBuf,
    },
}

/// Prints completions, or writes manual pages.
pub(crate) fn shell(args: &ShellArgs, command: &Command) -> Result<Status> {
    match &args.output {
        ShellOutput::Completions { shell } => {
            let mut text = Vec::new();
            clap_complete::generate(*shell, &mut command.clone(), command.get_name(), &mut text);
            print(String::from_utf8_lossy(&text))?;
        }
        ShellOutput::Man { folder } => {
            std::fs::create_dir_all(folder).with_context(|| format!("cannot make the folder {}", folder.display()))?;
            clap_mangen::generate_to(command.clone(), folder)
                .with_context(|| format!("cannot write manual pages to {}", folder.display()))?;
        }
    }
    Ok(Status::Done)
}
