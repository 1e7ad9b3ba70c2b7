//! What is promised of a run, whatever happens to it.

use crate::processes::{Ended, with_text};
use crate::trouble::Trouble;
use anyhow::{Context as _, Result, bail, ensure};
use gridweave_logs::reader::{Damage, LogFile, LogReader};
use std::fs;
use std::path::Path;

/// What lies in the place of an output, and what was there before.
pub(crate) struct Outcome<'a> {
    /// The output.
    pub(crate) path: &'a Path,
    /// What it must hold when it is whole.
    pub(crate) whole: &'a [u8],
    /// Whether an earlier run had left it whole.
    pub(crate) was_there: bool,
}

impl Outcome<'_> {
    /// The output is whole, or absent, or says why it is not; a good one stays in its place.
    pub(crate) fn check(&self, trouble: Trouble, ended: &Ended) -> Result<()> {
        self.check_file(trouble, ended)
            .with_context(|| with_text(&format!("it ended with {:?}", ended.status), &ended.text))
    }

    fn check_file(&self, trouble: Trouble, ended: &Ended) -> Result<()> {
        ensure!(!ended.text.contains("panicked"), "it panicked");
        // What of a run that leads it ended by a signal is not told by itself.
        ensure!(ended.status.is_some() || trouble.may_leave() || trouble == Trouble::KillStage, "it ended by a signal");
        ensure!(ended.status == Some(0) || !trouble.is_harmless(), "it failed of what is harmless");
        let found = fs::read(self.path);
        if found.as_ref().is_ok_and(|bytes| bytes == self.whole) {
            return Ok(());
        }
        ensure!(ended.status != Some(0), "it ended well, and its output is not what it should be");
        ensure!(!self.was_there, "the output of the run before is no longer there");
        match found {
            Ok(_) => says_why(self.path),
            Err(_) => Ok(()),
        }
    }
}

/// A log that is not whole says so, and the reason.
fn says_why(path: &Path) -> Result<()> {
    let file = LogFile::open(path)?;
    let reason = file.damage().iter().find_map(|damage| match damage {
        Damage::Incomplete { reason } => Some(reason.clone()),
        _ => None,
    });
    ensure!(reason.is_some_and(|reason| !reason.is_empty()), "the output is not whole, and does not say why");
    let mut reader = LogReader::new(vec![file]);
    while reader.next_message().is_some() {}
    let damage = reader.take_damage();
    if !damage.is_empty() {
        bail!("the output is damaged: {damage:?}");
    }
    Ok(())
}
