//! `gridweave shell`: what a shell and `man` want to know of the command.

use crate::status::Status;
use crate::terminal::print;
use anyhow::{Context, Result};
use clap::{Args, Command, Subcommand};
use clap_complete::Shell;
use std::path::PathBuf;

/// What `gridweave shell` is told.
#[derive(Debug, Args)]
pub(crate) struct ShellArgs {
    #[command(subcommand)]
    wanted: Wanted,
}

/// What is wanted.
#[derive(Debug, Subcommand)]
enum Wanted {
    /// Print what completes the command's words, for the start file of a shell.
    Completions {
        /// The shell.
        shell: Shell,
    },
    /// Write the manual pages, one for the program and one for each command.
    Man {
        /// The folder that they are written to, such as ~/.local/share/man/man1.
        folder: PathBuf,
    },
}

/// Prints completions, or writes manual pages.
pub(crate) fn shell(args: &ShellArgs, command: &Command) -> Result<Status> {
    match &args.wanted {
        Wanted::Completions { shell } => {
            let mut text = Vec::new();
            clap_complete::generate(*shell, &mut command.clone(), command.get_name(), &mut text);
            print(String::from_utf8_lossy(&text))?;
        }
        Wanted::Man { folder } => {
            std::fs::create_dir_all(folder).with_context(|| format!("cannot make the folder {}", folder.display()))?;
            clap_mangen::generate_to(command.clone(), folder)
                .with_context(|| format!("cannot write manual pages to {}", folder.display()))?;
        }
    }
    Ok(Status::Done)
}
