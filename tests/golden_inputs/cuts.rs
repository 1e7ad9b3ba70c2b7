//! Inputs of golden cases that are cut out of a merge: what a stage was given in it.

use crate::cases::messages;
use gridweave_runtime::engine::{EngineKind, run};
use gridweave_runtime::pipeline::{Overrides, Pipeline};
use gridweave_runtime::ros::{PoseStamped, PoseWithCovarianceStamped, RosMessage, decode};
use gridweave_runtime::stage::{Registry, match_robot};
use gridweave_tests::LogBuilder;
use std::path::{Path, PathBuf};

/// The input of one case.
#[derive(Clone, Copy)]
pub(crate) struct Cut {
    /// The stage kind, a folder of golden cases.
    pub(crate) kind: &'static str,
    /// The case, a folder in it.
    pub(crate) name: &'static str,
    /// The topics that are kept; `{robot}` is any robot.
    topics: &'static [&'static str],
    /// Messages up to so many seconds after the first are kept.
    seconds: f64,
}

/// All cuts.
pub(crate) const CUTS: [Cut; 9] = [
    Cut { kind: "line_extractor", name: "simulated", topics: &["/{robot}/map"], seconds: f64::INFINITY },
    Cut { kind: "map_aligner", name: "simulated", topics: &["/{robot}/map"], seconds: f64::INFINITY },
    Cut { kind: "tag_localizer", name: "simulated", topics: &["/robot1/pose", "/robot1/tag_ranges"], seconds: 30.0 },
    Cut { kind: "tag_filter", name: "simulated", topics: &["/{robot}/tags/estimates"], seconds: f64::INFINITY },
    Cut {
        kind: "quadrant_classifier",
        name: "simulated",
        topics: &["/{robot}/lines/segments", "/common_tags/common"],
        seconds: f64::INFINITY,
    },
    Cut {
        kind: "icp_refiner",
        name: "simulated",
        topics: &["/{robot}/map", "/quadrants/alignment"],
        seconds: f64::INFINITY,
    },
    Cut {
        kind: "merge_verifier",
        name: "simulated",
        topics: &["/{robot}/map", "/icp/alignment"],
        seconds: f64::INFINITY,
    },
    Cut {
        kind: "frame_solver",
        name: "simulated",
        topics: &["/{robot}/map", "/verifier/alignment"],
        seconds: f64::INFINITY,
    },
    Cut { kind: "grid_fuser", name: "simulated", topics: &["/{robot}/map", "/robot_frames"], seconds: f64::INFINITY },
];

/// The world that is simulated: an office of 14 x 10 m and two robots.
const WORLD: [&str; 8] =
    ["robots=2", "width=14", "height=10", "resolution=[0.1]", "snapshots=2", "tags=20", "overlap=0.9", "lidar_range=8"];
const SEED: u64 = 4;

/// A merge of a simulated log, with all that its stages have sent.
pub(crate) struct Merge {
    log: PathBuf,
}

impl Merge {
    /// Simulates and merges, with files in `folder`.
    pub(crate) fn new(folder: &Path) -> Self {
        let (simulated, merged) = (folder.join("simulated.mcap"), folder.join("merged.mcap"));
        let mut world = Overrides::default();
        world.seed = Some(SEED);
        for setting in WORLD {
            world.set(&format!("simulator.{setting}")).unwrap();
        }
        world.set_for_kind("mcap_sink", "file", simulated.to_str().unwrap());
        run_shipped("simulate", &world);
        let mut merge = Overrides::default();
        merge.set_for_kind("mcap_source", "files", vec![simulated.to_str().unwrap().to_owned()]);
        merge.set_for_kind("mcap_sink", "file", merged.to_str().unwrap());
        run_shipped("tag_merge", &merge);
        Self { log: merged }
    }

    /// Writes what a cut keeps to a file.
    pub(crate) fn write(&self, cut: &Cut, path: &Path) {
        let mut log = LogBuilder::new(path);
        let kept = |topic: &str| cut.topics.iter().any(|kept| *kept == topic || match_robot(kept, topic).is_some());
        let messages = messages(&self.log);
        let start = messages.first().expect("the merge has messages").log_time;
        for message in messages.iter().filter(|message| kept(&message.topic)) {
            let seconds = (message.log_time - start) as f64 * 1e-9;
            if seconds > cut.seconds {
                continue;
            }
            match message.type_name.as_str() {
                // The source makes every pose one with a covariance before it hands it on.
                PoseStamped::NAME => {
                    let pose: PoseStamped = decode(&message.data).unwrap();
                    log.message(seconds, &message.topic, &PoseWithCovarianceStamped::from(pose));
                }
                other => {
                    log.raw(seconds, &message.topic, other, &message.data);
                }
            }
        }
        log.finish();
    }
}

/// Runs a pipeline that ships.
fn run_shipped(name: &str, overrides: &Overrides) {
    let registry = Registry::new(gridweave_logs::kinds().into_iter().chain(gridweave_stages::kinds()));
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../pipelines/{name}.toml"));
    let pipeline = match Pipeline::load(&path, &registry, overrides) {
        Ok(pipeline) => pipeline,
        Err(errors) => panic!("{}", errors.render(false)),
    };
    run(&pipeline, EngineKind::Single, &()).unwrap();
}
