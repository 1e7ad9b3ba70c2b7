//! The inputs of a comparison: logs with their truth, and pairs of map files.

use super::score::{CaseTruth, PairTruth};
use crate::evaluate::check_truth;
use crate::shipped;
use crate::status::BadUse;
use anyhow::{Context, Result, bail};
use gridweave_logs::names::robot_names;
use gridweave_runtime::engine::{self, EngineKind};
use gridweave_runtime::input_file;
use gridweave_runtime::pipeline::Overrides;
use gridweave_runtime::stage::Registry;
use serde::Deserialize;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};

/// The list of pairs in a folder of map files.
const PAIRS: &str = "pairs.json";
/// The file that marks a folder as a rosbag2.
const BAG: &str = "metadata.yaml";
/// The pipeline that writes map files as a log.
const MAPS_AS_LOG: &str = "map_files_to_log";

/// A log and its truth.
#[derive(Debug)]
pub(super) struct Case {
    /// Its name in the table.
    pub(super) name: String,
    /// The input on the command line that it belongs to.
    pub(super) input: String,
    /// The log that is read.
    pub(super) log: PathBuf,
    /// The robot whose frame is the world; `None` leaves the choice to the pipeline.
    pub(super) reference: Option<String>,
    pub(super) truth: CaseTruth,
    /// The files of the user that it is made of.
    pub(super) files: Vec<PathBuf>,
}

/// An entry of `pairs.json`.
#[derive(Debug, Deserialize)]
struct ListedPair {
    pair: String,
    /// The name of a map file in the folder, without its ending.
    a: String,
    b: String,
    #[serde(flatten)]
    truth: PairTruth,
}

/// Finds the cases of all inputs, in their order. Logs that are made of map files are written to `folder`.
///
/// # Errors
/// An input does not exist or is empty, or a truth is missing or cannot be read.
pub(super) fn of(inputs: &[PathBuf], unrelated: bool, folder: &Path, registry: &Registry) -> Result<Vec<Case>> {
    let finder = Finder { unrelated, folder, registry };
    let mut cases: Vec<Case> = Vec::new();
    for (place, input) in inputs.iter().enumerate() {
        if inputs[..place].contains(input) {
            return Err(BadUse(format!("the input {} is given twice", input.display())).into());
        }
        let found = finder.find(input, cases.len())?;
        cases.extend(found);
    }
    make_names_unique(&mut cases);
    Ok(cases)
}

/// Puts the input before names that several cases have.
fn make_names_unique(cases: &mut [Case]) {
    let names: Vec<String> = cases.iter().map(|case| case.name.clone()).collect();
    for case in cases {
        if names.iter().filter(|name| **name == case.name).count() > 1 && case.input != case.name {
            case.name = format!("{}: {}", case.input, case.name);
        }
    }
}

struct Finder<'a> {
    unrelated: bool,
    folder: &'a Path,
    registry: &'a Registry,
}

impl Finder<'_> {
    /// Finds the cases of an input; `before` is the number of cases so far.
    fn find(&self, input: &Path, before: usize) -> Result<Vec<Case>> {
        let here = || input.display().to_string();
        if !input.exists() {
            return Err(BadUse(format!("there is no log or folder {}", input.display())).into());
        }
        if !input.is_dir() || input.join(BAG).exists() {
            return Ok(vec![self.log(input, here())?]);
        }
        if input.join(PAIRS).exists() {
            return self.pairs(input, before);
        }
        let logs = logs_in(input)?;
        if logs.is_empty() {
            return Err(
                BadUse(format!("the folder {} contains no log (*.mcap) and no {PAIRS}", input.display())).into()
            );
        }
        logs.iter().map(|log| self.log(log, here())).collect()
    }

    fn log(&self, log: &Path, input: String) -> Result<Case> {
        // A folder may have a dot in its name.
        let truth = match log.is_dir() {
            true => PathBuf::from(format!("{}.truth.json", log.display())),
            false => log.with_extension("truth.json"),
        };
        let truth = match (truth.exists(), self.unrelated) {
            (true, _) => truth,
            (false, true) => {
                let path = self.folder.join("unrelated.truth.json");
                fs::write(&path, r#"{"frames": {}}"#).with_context(|| format!("cannot write {}", path.display()))?;
                path
            }
            (false, false) => bail!(
                "the log {} has no truth: {} does not exist; give --unrelated if its robots must not be merged",
                log.display(),
                truth.display()
            ),
        };
        check_truth(&truth)?;
        let name = log.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let files = vec![log.to_owned(), truth.clone()];
        Ok(Case { name, input, log: log.to_owned(), reference: None, truth: CaseTruth::Frames(truth), files })
    }

    /// Writes each pair of map files that a folder lists as a log.
    fn pairs(&self, input: &Path, before: usize) -> Result<Vec<Case>> {
        let path = input.join(PAIRS);
        let text = input_file::read(&path, input_file::LONGEST_TEXT)
            .with_context(|| format!("cannot read a list of pairs: {}", path.display()))?;
        let listed: Vec<ListedPair> =
            serde_json::from_slice(&text).with_context(|| format!("{} is not a list of pairs", path.display()))?;
        if listed.is_empty() {
            return Err(BadUse(format!("{} lists no pair", path.display())).into());
        }
        let case = |(place, pair): (usize, ListedPair)| {
            let files = [&pair.a, &pair.b].map(|name| input.join(format!("{name}.yaml")));
            let log = self.folder.join(format!("pair{}.mcap", before + place));
            let robots = self.write_log(&files, &log).with_context(|| format!("in the pair {}", pair.pair))?;
            let (input, truth) =
                (input.display().to_string(), CaseTruth::Places { robots: robots.clone(), places: pair.truth });
            let [a, _] = robots;
            let files = files.into_iter().chain([path.clone()]).collect();
            Ok(Case { name: pair.pair, input, log, reference: Some(a), truth, files })
        };
        listed.into_iter().enumerate().map(case).collect()
    }

    /// Writes map files as a log. Returns the names of their robots.
    fn write_log(&self, files: &[PathBuf; 2], log: &Path) -> Result<[String; 2]> {
        let names = robot_names(files)?;
        let text = |path: &Path| {
            let text = path.to_str().ok_or_else(|| BadUse(format!("the path {} is not UTF-8", path.display())));
            text.map(str::to_owned)
        };
        let mut overrides = Overrides::default();
        overrides.set_for_kind("map_file_source", "files", vec![text(&files[0])?, text(&files[1])?]);
        overrides.set_for_kind("mcap_sink", "file", text(log)?);
        let pipeline = shipped::load(Path::new(MAPS_AS_LOG), &overrides, self.registry)?;
        engine::run(&pipeline, EngineKind::Single, &())?;
        names.try_into().map_err(|_| anyhow::anyhow!("two map files do not give two robot names"))
    }
}

/// Lists the logs of a folder, by name.
fn logs_in(folder: &Path) -> Result<Vec<PathBuf>> {
    let doing = || format!("cannot look for logs in {}", folder.display());
    let mut logs = Vec::new();
    for entry in fs::read_dir(folder).with_context(doing)? {
        let path = entry.with_context(doing)?.path();
        if path.extension() == Some(OsStr::new("mcap")) {
            logs.push(path);
        }
    }
    logs.sort();
    Ok(logs)
}
