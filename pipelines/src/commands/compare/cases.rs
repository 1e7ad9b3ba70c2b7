//! What is merged: logs with their truth, and pairs of map files.

use super::score::{PairTruth, Truth};
use crate::evaluate::check_truth;
use crate::shipped;
use crate::status::BadUse;
use anyhow::{Context, Result, bail};
use gridweave_logs::source::map_file::robot_names;
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
/// What makes a folder a rosbag2.
const BAG: &str = "metadata.yaml";
/// The pipeline that writes map files as a log.
const MAPS_AS_LOG: &str = "map_files_to_log";

/// A log, and what is true of it.
#[derive(Debug)]
pub(super) struct Case {
    /// What the table calls it.
    pub(super) name: String,
    /// The input that it came with, as it was given.
    pub(super) input: String,
    /// What is read.
    pub(super) log: PathBuf,
    /// The robot whose frame is the world, if that is not for the pipeline to say.
    pub(super) reference: Option<String>,
    pub(super) truth: Truth,
}

/// A pair of map files, as a folder lists it.
#[derive(Debug, Deserialize)]
struct ListedPair {
    pair: String,
    /// The name of a map file in the folder, without its ending.
    a: String,
    b: String,
    #[serde(flatten)]
    truth: PairTruth,
}

/// The cases of all inputs, in their order. What is made for them is put into `folder`.
///
/// # Errors
/// There is no such input, nothing in it, or a truth is missing or cannot be read.
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
    tell_apart(&mut cases);
    Ok(cases)
}

/// Cases of one name are called by their input, too.
fn tell_apart(cases: &mut [Case]) {
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
    /// The cases of an input; there are so many already.
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
            return Err(BadUse(format!("the folder {} holds no log (*.mcap) and no {PAIRS}", input.display())).into());
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
                "the log {} has no truth: there is no {}; give --unrelated if its robots have nothing to do with each other",
                log.display(),
                truth.display()
            ),
        };
        check_truth(&truth)?;
        let name = log.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        Ok(Case { name, input, log: log.to_owned(), reference: None, truth: Truth::Frames(truth) })
    }

    /// The pairs that a folder lists, each written as a log.
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
                (input.display().to_string(), Truth::Places { robots: robots.clone(), places: pair.truth });
            let [a, _] = robots;
            Ok(Case { name: pair.pair, input, log, reference: Some(a), truth })
        };
        listed.into_iter().enumerate().map(case).collect()
    }

    /// Writes map files as a log. The names of their robots.
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
        names.try_into().map_err(|_| anyhow::anyhow!("two files have not two names"))
    }
}

/// The logs of a folder, by name.
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
