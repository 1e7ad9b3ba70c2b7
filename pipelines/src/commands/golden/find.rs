//! Search for cases: the folders KIND/CASE.

use crate::status::BadUse;
use anyhow::{Context, Result};
use gridweave_runtime::stage::Registry;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Explanation of the folders for errors.
const FORM: &str = "a case is a folder KIND/CASE with stage.toml, such as line_extractor/room";

/// The folder of one case.
#[derive(Clone, Debug)]
pub(super) struct CaseFolder {
    /// The kind of the stage: the name of its folder.
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

/// Finds all cases in `folder`, by kind and then by name.
///
/// # Errors
///
/// There is no case, or a `stage.toml` is in the wrong folder.
pub(super) fn find(folder: &Path) -> Result<Vec<CaseFolder>> {
    let mut cases = Vec::new();
    for (kind, path) in folders_in(folder)? {
        let misplaced = path.join("stage.toml");
        if misplaced.exists() {
            let text = format!("{} is not in the folder of a case: {FORM}", misplaced.display());
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

/// Finds the kinds of the registry without a case, except for kinds that only take messages from outside of a live run,
/// and kinds whose ports depend on the stage.
pub(super) fn kinds_without_a_case(registry: &Registry, cases: &[CaseFolder]) -> Vec<String> {
    let with: BTreeSet<&str> = cases.iter().map(|case| case.kind.as_str()).collect();
    let kinds = registry.kinds().filter(|kind| !kind.is_external() && !kind.is_dynamic());
    kinds.map(|kind| kind.name).filter(|kind| !with.contains(kind)).map(str::to_owned).collect()
}

/// Lists the folders in a folder, by name, without hidden ones.
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
