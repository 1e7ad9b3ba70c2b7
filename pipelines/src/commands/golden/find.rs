//! Which cases there are: the folders KIND/CASE.

use crate::status::BadUse;
use anyhow::{Context, Result};
use gridweave_runtime::stage::Registry;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Where a case lies.
const FORM: &str = "a case is a folder KIND/CASE with stage.toml, such as line_extractor/room";

/// The folder of one case.
#[derive(Clone, Debug)]
pub(super) struct CaseFolder {
    /// The kind of the stage, as its folder says.
    pub(super) kind: String,
    /// The name of the case.
    pub(super) case: String,
    /// The folder.
    pub(super) path: PathBuf,
}

impl CaseFolder {
    /// `KIND/CASE`.
    pub(super) fn name(&self) -> String {
        format!("{}/{}", self.kind, self.case)
    }
}

/// All cases in `folder`, by kind and then by name.
///
/// # Errors
///
/// There is no case, or what looks like one lies elsewhere.
pub(super) fn find(folder: &Path) -> Result<Vec<CaseFolder>> {
    let mut cases = Vec::new();
    for (kind, path) in folders_in(folder)? {
        let misplaced = path.join("stage.toml");
        if misplaced.exists() {
            let text = format!("{} lies among the cases of a kind: {FORM}", misplaced.display());
            return Err(BadUse(text).into());
        }
        for (case, path) in folders_in(&path)? {
            cases.push(CaseFolder { kind: kind.clone(), case, path });
        }
    }
    match cases.is_empty() {
        true => Err(BadUse(format!("there is no case in {}: {FORM}", folder.display())).into()),
        false => Ok(cases),
    }
}

/// The kinds of the registry of which there is no case, but for those that only let messages in from outside of a live
/// run, and those of which each stage has ports of its own.
pub(super) fn kinds_without_a_case(registry: &Registry, cases: &[CaseFolder]) -> Vec<String> {
    let with: BTreeSet<&str> = cases.iter().map(|case| case.kind.as_str()).collect();
    let kinds = registry.kinds().filter(|kind| !kind.is_external() && !kind.is_asked());
    kinds.map(|kind| kind.name).filter(|kind| !with.contains(kind)).map(str::to_owned).collect()
}

/// The folders in a folder, by name. Files, and what is hidden, do not count.
fn folders_in(folder: &Path) -> Result<Vec<(String, PathBuf)>> {
    let doing = || format!("cannot look for cases in {}", folder.display());
    let mut folders = Vec::new();
    for entry in std::fs::read_dir(folder).with_context(doing)? {
        let path = entry.with_context(doing)?.path();
        let Some(name) = path.file_name().map(|name| name.to_string_lossy().into_owned()) else { continue };
        if path.is_dir() && !name.starts_with('.') {
            folders.push((name, path));
        }
    }
    folders.sort();
    Ok(folders)
}
