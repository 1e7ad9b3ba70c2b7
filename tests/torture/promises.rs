//! Promises on the output of a run, whatever fault is injected.

use crate::fault::Fault;
use crate::processes::{Ended, with_text};
use anyhow::{Context as _, Result, bail, ensure};
use gridweave_logs::reader::{Damage, LogFile, LogReader};
use gridweave_tests::run_files::part;
use std::fs;
use std::path::Path;

/// The output of a run, and what was there before.
pub(crate) struct Outcome<'a> {
    /// The output.
    pub(crate) path: &'a Path,
    /// Its contents when it is complete.
    pub(crate) whole: &'a [u8],
    /// Whether an earlier run had left it complete.
    pub(crate) was_there: bool,
}

impl Outcome<'_> {
    /// Checks that the output is complete, or absent, or records why it is not; a complete one is not replaced.
    pub(crate) fn check(&self, fault: Fault, ended: &Ended) -> Result<()> {
        self.check_file(fault, ended)
            .with_context(|| with_text(&format!("it ended with {:?}", ended.status), &ended.text))
    }

    fn check_file(&self, fault: Fault, ended: &Ended) -> Result<()> {
        ensure!(!ended.text.contains("panicked"), "it panicked");
        // A supervisor that was ended by a signal reports no status. One that comes before the program can handle it
        // ends it at once.
        let has_begun = part(self.path).exists() || !self.was_there && self.path.exists();
        let may_end = fault.may_leave() || fault == Fault::KillStage || matches!(fault, Fault::Signal(_)) && !has_begun;
        ensure!(ended.status.is_some() || may_end, "it ended by a signal");
        ensure!(ended.status == Some(0) || !fault.is_harmless(), "it failed on a harmless fault");
        let found = fs::read(self.path);
        if found.as_ref().is_ok_and(|bytes| bytes == self.whole) {
            return Ok(());
        }
        ensure!(ended.status != Some(0), "it succeeded with a wrong output");
        ensure!(!self.was_there, "the output of the run before is gone");
        match found {
            Ok(_) => records_reason(self.path),
            Err(_) => Ok(()),
        }
    }
}

/// Checks that a log that is not complete records so, with the reason.
fn records_reason(path: &Path) -> Result<()> {
    let file = LogFile::open(path)?;
    let reason = file.damage().iter().find_map(|damage| match damage {
        Damage::Incomplete { reason } => Some(reason.clone()),
        _ => None,
    });
    ensure!(reason.is_some_and(|reason| !reason.is_empty()), "the output is not complete, and records no reason");
    let mut reader = LogReader::new(vec![file]);
    while reader.next_message().is_some() {}
    let damage = reader.take_damage();
    if !damage.is_empty() {
        bail!("the output is damaged: {damage:?}");
    }
    Ok(())
}
