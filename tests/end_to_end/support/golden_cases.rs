//! Folders of golden cases to run `gridweave golden` on.

use crate::support::{Ended, LogBuilder, TestMap, WITHOUT_TROUBLE, gridweave_with};
use gridweave_runtime::ros::{TagEstimate, TagEstimates};
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Two robots that have located the same four tags.
pub(crate) const TAGS: &str = "[stage]\nkind = \"tag_filter\"\n[inputs]\nestimates = \"/{robot}/tags\"\n";
/// The last part of a log, as it is.
pub(crate) const SOURCE: &str = "[stage]\nkind = \"mcap_source\"\nfiles = [\"{input}\"]\n";

/// A folder with cases.
pub(crate) struct Cases(pub(crate) TempDir);

impl Cases {
    pub(crate) fn new() -> Self {
        Self(TempDir::new().unwrap())
    }

    /// The folder of a case, which is made if need be.
    pub(crate) fn folder(&self, name: &str) -> PathBuf {
        let folder = self.0.path().join("cases").join(name);
        fs::create_dir_all(&folder).unwrap();
        folder
    }

    pub(crate) fn stage(&self, name: &str, text: &str) {
        fs::write(self.folder(name).join("stage.toml"), text).unwrap();
    }

    pub(crate) fn input(&self, name: &str, build: impl FnOnce(&mut LogBuilder)) {
        let mut log = LogBuilder::new(&self.folder(name).join("input.mcap"));
        build(&mut log);
        log.finish();
    }

    /// The case `tag_filter/four_tags`.
    pub(crate) fn four_tags(stage: &str) -> Self {
        let cases = Self::new();
        cases.stage("tag_filter/four_tags", stage);
        cases.input("tag_filter/four_tags", |log| estimates(log, 4));
        cases
    }

    /// The case `mcap_source/map`, whose map has these cells changed.
    pub(crate) fn map(changed: &[usize]) -> Self {
        let cases = Self::new();
        cases.stage("mcap_source/map", SOURCE);
        cases.put_map(changed);
        cases
    }

    pub(crate) fn put_map(&self, changed: &[usize]) {
        let mut map = TestMap::room();
        changed.iter().for_each(|cell| map.cells[*cell] = 100 - map.cells[*cell]);
        self.input("mcap_source/map", |log| {
            log.map(1.0, "robot1", &map);
        });
    }

    pub(crate) fn golden(&self, args: &[&str]) -> Ended {
        gridweave_with(self.0.path(), &[&["golden", "--cases", "cases"], args].concat(), &[WITHOUT_TROUBLE])
    }

    pub(crate) fn bless(&self) -> Ended {
        self.golden(&["--partial", "--bless"])
    }

    /// Checks that the cases fail and that all of `words` are reported.
    #[track_caller]
    pub(crate) fn assert_fails(&self, words: &[&str]) -> Ended {
        let ended = self.golden(&["--partial"]);
        ended.assert(1, words);
        ended
    }

    pub(crate) fn expected(&self, name: &str) -> PathBuf {
        self.folder(name).join("expected.mcap")
    }

    pub(crate) fn differences(&self) -> PathBuf {
        self.0.path().join("golden-differences")
    }
}

pub(crate) fn estimates(log: &mut LogBuilder, tags: usize) {
    for (seconds, robot) in [(1.0, "robot1"), (2.0, "robot2")] {
        let places = [(0.0, 0.0), (5.0, 1.0), (9.0, -2.0), (3.0, 7.0)];
        let tag = |(index, (x, y)): (usize, (f64, f64))| TagEstimate {
            tag_id: format!("tag{index}"),
            x,
            y,
            covariance: [4e-4, 0.0, 0.0, 4e-4],
            certainty: 0.95,
            readings: 50,
        };
        let tags = places.into_iter().take(tags).enumerate().map(tag).collect();
        let message = TagEstimates { robot: robot.into(), tags, ..Default::default() };
        log.message(seconds, &format!("/{robot}/tags"), &message);
    }
}

pub(crate) fn change(path: &Path, change: impl FnOnce(&mut Vec<u8>)) {
    let mut bytes = fs::read(path).unwrap();
    change(&mut bytes);
    fs::write(path, bytes).unwrap();
}
