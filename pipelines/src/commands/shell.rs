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

/// Prints completions, or writes manual pages, of a command that the shell knows as `program`.
pub(crate) fn shell(args: &ShellArgs, command: &Command, program: &str) -> Result<Status> {
    match &args.output {
        ShellOutput::Completions { shell } => {
            print(completions(*shell, command, program))?;
        }
        ShellOutput::Man { folder } => {
            std::fs::create_dir_all(folder).with_context(|| format!("cannot make the folder {}", folder.display()))?;
            clap_mangen::generate_to(command.clone().display_name(program).bin_name(program), folder)
                .with_context(|| format!("cannot write manual pages to {}", folder.display()))?;
        }
    }
    Ok(Status::Done)
}

fn completions(shell: Shell, command: &Command, program: &str) -> String {
    let mut text = Vec::new();
    clap_complete::generate(shell, &mut command.clone(), program, &mut text);
    String::from_utf8_lossy(&text).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::Cli;
    use clap::CommandFactory;
    use std::collections::BTreeSet;

    #[test]
    fn completions_and_pages_are_of_the_program_with_all_its_commands() {
        let command = Cli::command().subcommand(Command::new("doctor"));
        let ends =
            [(Shell::Bash, "gridweave-ros"), (Shell::Zsh, "#compdef gridweave-ros"), (Shell::Fish, "-c gridweave-ros")];
        for (shell, name) in ends {
            let text = completions(shell, &command, "gridweave-ros");
            assert!(text.contains(name) && text.contains("doctor"), "{shell}");
        }
        let folder = tempfile::tempdir().unwrap();
        let args = ShellArgs { output: ShellOutput::Man { folder: folder.path().to_owned() } };
        shell(&args, &command, "gridweave-ros").unwrap();
        let entries = std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name());
        let pages: BTreeSet<String> = entries.map(|name| name.into_string().unwrap()).collect();
        assert!(pages.contains("gridweave-ros.1") && pages.contains("gridweave-ros-doctor.1"), "{pages:?}");
        let page = std::fs::read_to_string(folder.path().join("gridweave-ros-merge.1")).unwrap();
        assert!(page.contains("\\fBgridweave\\-ros merge\\fR"), "{page}");
    }
}
