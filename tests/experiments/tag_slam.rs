//! Robots without maps whose odometry drifts, merged by the tags that they read: how exact their frames are, and
//! whether their covariances are true.
//!
//! Two robots drive round a place twice, and read its tags by one sense. The drift of the heading is varied. A frame is
//! right below 0.5 m and 1 degree; what is off by more may still be within its covariance, as the heading of the first
//! pose can be known no better than the drift allows.

use super::results::Results;
use super::statistics::{NORMALISED_95, median, quantile};
use super::trial::World;
use anyhow::{Context, Result};
use clap::Args;
use gridweave::evaluate::{RobotOutcome, RobotResult};
use gridweave::table::Table;
use gridweave_runtime::stage::Registry;
use gridweave_tests::{LogBuilder, Sense, TagDrive};
use nalgebra::{Isometry2, Point2};
use rayon::prelude::*;
use tempfile::TempDir;

/// Arguments of the experiment `tag-slam`.
#[derive(Debug, Args)]
pub(super) struct TagSlamArgs {
    /// How many pairs of drives for each sense and drift.
    #[arg(long, default_value_t = 20)]
    seeds: u64,
    /// The first seed.
    #[arg(long, default_value_t = 1)]
    first_seed: u64,
}

/// Drifts of the heading after a metre, radians.
const DRIFTS: [f64; 5] = [0.0, 0.003, 0.01, 0.03, 0.1];

/// A place with tags, and how they are read.
struct Place {
    name: &'static str,
    /// Metres.
    size: [f64; 2],
    reach: f64,
    sense: Sense,
    tags: Vec<Point2<f64>>,
}

/// A hall like that of UTIAS and a lawn like that of Plaza.
fn places() -> [Place; 3] {
    let landmark = |n: i32| Point2::new(1.0 + 0.9 * f64::from(n), 1.0 + 6.0 * (0.37 * f64::from(n)).fract());
    let landmarks: Vec<Point2<f64>> = (0..15).map(landmark).collect();
    let beacons = [[-1.0, -1.0], [31.0, 1.0], [29.0, 21.0], [2.0, 19.0]].map(|[x, y]| Point2::new(x, y)).to_vec();
    [
        Place {
            name: "15 landmarks that a camera sees, 15 x 8 m",
            size: [15.0, 8.0],
            reach: 4.0,
            sense: Sense::Camera { stddev: 0.05 },
            tags: landmarks.clone(),
        },
        Place {
            name: "their ranges, 2 % outliers",
            size: [15.0, 8.0],
            reach: 4.0,
            sense: Sense::Ranges { stddev: 0.1, outliers: 0.02 },
            tags: landmarks,
        },
        Place {
            name: "ranges to 4 beacons, 10 % outliers, 30 x 20 m",
            size: [30.0, 20.0],
            reach: 40.0,
            sense: Sense::Ranges { stddev: 0.3, outliers: 0.1 },
            tags: beacons,
        },
    ]
}

/// Does the experiment.
pub(super) fn run(args: &TagSlamArgs, registry: &Registry, results: &mut Results) -> Result<()> {
    let heads = [
        "tags",
        "drift, rad",
        "right",
        "wrong",
        "refused",
        "error m, median",
        "largest",
        "error deg, median",
        "largest",
        "within the covariance's 95 %",
    ];
    let mut table = Table::new(heads);
    for place in places() {
        for drift in DRIFTS {
            let seeds: Vec<u64> = (args.first_seed..args.first_seed.saturating_add(args.seeds)).collect();
            let trials = seeds.par_iter().map(|&seed| trial(&place, drift, seed, registry));
            let trials: Vec<RobotResult> = trials.collect::<Result<_>>()?;
            let count = |outcome| trials.iter().filter(|trial| trial.outcome == outcome).count().to_string();
            let known = |value: fn(&RobotResult) -> Option<f64>| trials.iter().filter_map(value).collect::<Vec<f64>>();
            let (metres, degrees) = (known(|trial| trial.error_m), known(|trial| trial.error_deg));
            let normalised = known(|trial| trial.normalised_error_squared);
            let within = normalised.iter().filter(|squared| **squared < NORMALISED_95).count();
            let number = |value: f64| if value.is_finite() { format!("{value:.3}") } else { "-".to_owned() };
            table.row([
                place.name.to_owned(),
                drift.to_string(),
                count(RobotOutcome::Right),
                count(RobotOutcome::Wrong),
                count(RobotOutcome::Refused),
                number(median(&metres)),
                number(quantile(&metres, 1.0)),
                number(median(&degrees)),
                number(quantile(&degrees, 1.0)),
                format!("{within} of {}", normalised.len()),
            ]);
        }
    }
    results.table("tag_slam", "## Tags and odometry that drifts, without maps", &table)
}

/// Writes two drives that begin at opposite corners, and merges them. Returns what became of the second robot.
fn trial(place: &Place, drift: f64, seed: u64, registry: &Registry) -> Result<RobotResult> {
    let folder = TempDir::new().context("cannot make a folder for a log")?;
    let [width, height] = place.size;
    let corner = |x: f64, y: f64| Point2::new(x * width, y * height);
    let corners = [corner(0.1, 0.1), corner(0.9, 0.1), corner(0.9, 0.9), corner(0.1, 0.9)];
    let starts = [Isometry2::new(corners[0].coords, 0.3), Isometry2::new(corners[2].coords, 2.0)];
    let path = folder.path().join("drives.mcap");
    let mut log = LogBuilder::new(&path);
    for (number, robot) in ["robot1", "robot2"].into_iter().enumerate() {
        let mut corners = corners.to_vec();
        corners.rotate_left(2 * number);
        let (start, seed) = (starts[number], 2 * seed + number as u64);
        TagDrive { robot, start, corners, drift, reach: place.reach, sense: place.sense, seed }
            .write(&mut log, &place.tags);
    }
    log.finish();
    let of = |pose: Isometry2<f64>| {
        let (x, y, yaw) = (pose.translation.x, pose.translation.y, pose.rotation.angle());
        serde_json::json!({ "x": x, "y": y, "yaw": yaw })
    };
    let truth = folder.path().join("truth.json");
    let frames = serde_json::json!({ "frames": { "robot1": of(starts[0]), "robot2": of(starts[1]) } });
    std::fs::write(&truth, frames.to_string()).with_context(|| format!("cannot write {}", truth.display()))?;
    let merge = World::recorded(&path, &truth)?.merge("tag_frames", &[], registry)?;
    merge.evaluation.robots.into_iter().next().context("the evaluation lacks robot2")
}
