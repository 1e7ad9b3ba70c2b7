//! What an experiment leaves behind: tables and plots in one folder.

use super::plot::Plot;
use anyhow::{Context, Result};
use gridweave::table::Table;
use gridweave_logs::map_file::{GridMap, save};
use std::path::{Path, PathBuf};

/// The folder that an experiment writes to.
pub(super) struct Results {
    folder: PathBuf,
    written: Vec<PathBuf>,
}

impl Results {
    /// Results in a folder, which is made if it is not there.
    pub(super) fn new(folder: &Path) -> Result<Self> {
        std::fs::create_dir_all(folder).with_context(|| format!("cannot make the folder {}", folder.display()))?;
        Ok(Self { folder: folder.to_owned(), written: Vec::new() })
    }

    /// Prints a table under a title, on a terminal as wide as that and as Markdown elsewhere, and writes it as
    /// NAME.csv.
    pub(super) fn table(&mut self, name: &str, title: &str, table: &Table) -> Result<()> {
        println!("{title}\n\n{}", table.to_terminal().unwrap_or_else(|| table.to_markdown()));
        self.data(name, table)
    }

    /// Writes a table as NAME.csv, without printing it.
    pub(super) fn data(&mut self, name: &str, table: &Table) -> Result<()> {
        self.file(&format!("{name}.csv"), table.to_csv().as_bytes())
    }

    /// Writes a plot as NAME.svg.
    pub(super) fn plot(&mut self, name: &str, plot: &Plot) -> Result<()> {
        let svg = plot.to_svg().with_context(|| format!("cannot draw the plot {name}"))?;
        self.file(&format!("{name}.svg"), svg.as_bytes())
    }

    /// Writes a map as NAME.yaml and NAME.pgm.
    pub(super) fn map(&mut self, name: &str, map: &GridMap) -> Result<()> {
        let path = self.folder.join(format!("{name}.yaml"));
        save(&path, map).with_context(|| format!("cannot write {}", path.display()))?;
        self.written.push(path);
        Ok(())
    }

    /// Prints the names of the files.
    pub(super) fn say_where(&self) {
        let names: Vec<String> = self.written.iter().map(|path| path.display().to_string()).collect();
        println!("wrote {}", names.join(", "));
    }

    /// Writes a file of any kind.
    pub(super) fn file(&mut self, name: &str, bytes: &[u8]) -> Result<()> {
        let path = self.folder.join(name);
        std::fs::write(&path, bytes).with_context(|| format!("cannot write {}", path.display()))?;
        self.written.push(path);
        Ok(())
    }
}
