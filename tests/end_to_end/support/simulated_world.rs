//! Two simulated robots, whose log is merged.

use super::{Ended, gridweave, json, simulate};
use gridweave_logs::summary::{Frame, Summary};
use std::path::PathBuf;
use tempfile::TempDir;

/// Two robots in a simulated building, and the truth.
pub(crate) struct SimulatedWorld {
    pub(crate) folder: TempDir,
    truth: PathBuf,
}

impl SimulatedWorld {
    /// The building of a seed, with the simulator's settings.
    pub(crate) fn new(seed: &str, settings: &[&str]) -> Self {
        let folder = TempDir::new().unwrap();
        let mut args = vec!["--robots", "2", "--seed", seed];
        args.extend(settings.iter().flat_map(|setting| ["--set", setting]));
        let (_, truth) = simulate(folder.path(), "in.mcap", &args);
        Self { folder, truth }
    }

    /// Merges the log, with more arguments.
    pub(crate) fn merge(&self, more: &[&str]) -> Ended {
        let args = [&["merge", "in.mcap", "-o", "out.mcap", "--summary", "summary.json"], more].concat();
        gridweave(self.folder.path(), &args)
    }

    /// Where robot 2 is by the truth.
    pub(crate) fn truth(&self) -> Frame {
        let truth: Summary = json(&self.truth);
        truth.frames["robot2"]
    }

    /// What the last merge has found.
    pub(crate) fn summary(&self) -> Summary {
        json(&self.folder.path().join("summary.json"))
    }

    /// Error of the pose of robot 2, metres.
    pub(crate) fn error(&self) -> f64 {
        let (truth, found) = (self.truth(), self.summary().frames["robot2"]);
        (truth.x - found.x).hypot(truth.y - found.y)
    }
}
