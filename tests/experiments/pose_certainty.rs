//! Whether the poses of SLAM are as certain as its pose graph says, and the share of the yaw by the local map that makes them so.
//!
//! Robots with different lidars drive through simulated buildings. On the way the graph is asked for the covariances of earlier
//! scans relative to the last one, which decide where loop closures are looked for, and these are compared with the true
//! errors. The share is varied in the graph; where it is right, the errors are likeliest.

use super::results::Results;
use super::statistics::{mean, quantile};
use anyhow::{Context, Result};
use clap::Args;
use gridweave::table::Table;
use gridweave_stages::mapping::scan_mapper::ScanMapperParameters;
use gridweave_stages::mapping::slam::{Constraint, PoseGraph, Trajectory, YAW_OF_MAP_SHARE, scan_points};
use gridweave_stages::simulator::{RobotLog, SimulatorParameters, simulate};
use nalgebra::{Isometry2, Matrix3, Point2, Vector3};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// Arguments of the experiment `pose-certainty`.
#[derive(Debug, Args)]
pub(super) struct PoseCertaintyArgs {
    /// How many buildings, in each of which a robot with each lidar drives: at least two, as each is left out once.
    #[arg(long, default_value_t = 6, value_parser = clap::value_parser!(u64).range(2..))]
    seeds: u64,
    /// The first seed.
    #[arg(long, default_value_t = 1)]
    first_seed: u64,
}

/// Lidars: beams, range in metres, field of view in radians.
const LIDARS: [(u32, f64, f64); 4] = [(360, 12.0, TAU), (120, 5.6, TAU), (181, 8.0, PI), (60, 8.0, TAU)];
/// Shares that are tried.
const SHARES: [f64; 6] = [0.0, 0.003, 0.01, 0.03, 0.1, 0.3];
/// Scans between the poses that are compared.
const APART: [usize; 4] = [20, 50, 100, 200];
/// Scans after which the graph is asked again.
const EVERY: usize = 30;
/// Squared error in variances above which an error counts no more: it is a failure, which no share explains.
const LARGEST: f64 = 30.0;

/// The error of a relative pose.
struct Sample {
    apart: usize,
    /// Errors of the position and of the yaw, in their standard deviations.
    ratios: [f64; 2],
    log_likelihood: f64,
}

/// The errors on the drives through one building, by share.
type Samples = [Vec<Sample>; SHARES.len()];

/// Does the experiment.
pub(super) fn run(args: &PoseCertaintyArgs, results: &mut Results) -> Result<()> {
    let seeds: Vec<u64> = (args.first_seed..args.first_seed.saturating_add(args.seeds)).collect();
    let buildings: Vec<Samples> = seeds.par_iter().map(|&seed| building(seed)).collect::<Result<_>>()?;
    let mut table = Table::new(["share", "scans apart", "position, rms", "90 % below", "yaw, rms", "90 % below"]);
    for (share, of_share) in SHARES.iter().enumerate() {
        for apart in APART {
            let errors = |axis: usize| -> Vec<f64> {
                let samples = buildings.iter().flat_map(|building| &building[share]);
                samples.filter(|sample| sample.apart == apart).map(|sample| sample.ratios[axis]).collect()
            };
            let numbers = [0, 1].map(errors).map(|errors| {
                let squares: Vec<f64> = errors.iter().map(|error| error * error).collect();
                [mean(&squares).sqrt(), quantile(&errors, 0.9)]
            });
            let numbers = numbers.as_flattened().iter().map(|number| format!("{number:.2}"));
            table.row([of_share.to_string(), apart.to_string()].into_iter().chain(numbers));
        }
    }
    results.table("pose_certainty", "## Errors of poses, in their standard deviations", &table)?;
    let all: Vec<usize> = (0..buildings.len()).collect();
    let without = |left_out: usize| all.iter().copied().filter(move |building| *building != left_out);
    let fitted: Vec<f64> = all.iter().map(|&left_out| likeliest(&buildings, without(left_out))).collect();
    println!("The errors are likeliest with a share of {}.", likeliest(&buildings, all.iter().copied()));
    println!("Each building left out in turn: {fitted:?}. The mapper has {YAW_OF_MAP_SHARE}.");
    Ok(())
}

/// The share with which the errors in these buildings are likeliest.
fn likeliest(buildings: &[Samples], chosen: impl Iterator<Item = usize> + Clone) -> f64 {
    let likelihood = |share: usize| -> f64 {
        let samples = chosen.clone().flat_map(|building| &buildings[building][share]);
        samples.map(|sample| sample.log_likelihood).sum()
    };
    let shares = 0..SHARES.len();
    let best = shares.max_by(|a, b| likelihood(*a).total_cmp(&likelihood(*b)));
    best.map_or(f64::NAN, |share| SHARES[share])
}

/// The errors of a robot with each of the lidars in one building.
fn building(seed: u64) -> Result<Samples> {
    let mut samples = Samples::default();
    for (beams, lidar_range, field_of_view) in LIDARS {
        let parameters = SimulatorParameters {
            robots: 1,
            width: 30.0,
            height: 24.0,
            scans: true,
            odometry: true,
            drift: 0.0,
            beams,
            lidar_range,
            field_of_view,
            ..Default::default()
        };
        let simulation = simulate(&parameters, seed).with_context(|| format!("cannot simulate building {seed}"))?;
        simulation.robots.iter().for_each(|robot| drive(robot, &mut samples));
    }
    Ok(samples)
}

/// Registers the scans of a robot as the mapper does, and compares the poses with the truth on the way.
fn drive(robot: &RobotLog, samples: &mut Samples) {
    let ScanMapperParameters { step, step_yaw, odometry_deviation, .. } = ScanMapperParameters::default();
    let mut trajectory = Trajectory::new(odometry_deviation);
    let mut added: Vec<usize> = Vec::new();
    for (tick, odometry) in robot.odometry.iter().enumerate() {
        let moved = added.last().map_or_else(Isometry2::identity, |last| robot.odometry[*last].inv_mul(odometry));
        let is_far = moved.translation.vector.norm() >= step || moved.rotation.angle().abs() >= step_yaw;
        if !is_far && !added.is_empty() {
            continue;
        }
        let lidar = Point2::origin();
        trajectory.add(&moved, scan_points(&robot.hits(tick), &lidar), lidar);
        added.push(tick);
        if added.len().is_multiple_of(EVERY) {
            let truth: Vec<Isometry2<f64>> = added.iter().map(|tick| robot.true_poses[*tick]).collect();
            compare(&trajectory, &truth, samples);
        }
    }
}

/// Compares the poses of earlier scans relative to the last one with the truth.
fn compare(trajectory: &Trajectory, truth: &[Isometry2<f64>], samples: &mut Samples) {
    let poses = trajectory.poses();
    let last = poses.len() - 1;
    for (share, samples) in SHARES.iter().zip(samples) {
        let with_share = |own: &Constraint| Constraint {
            information: own.information * if own.is_of_yaw_alone() { share / YAW_OF_MAP_SHARE } else { 1.0 },
            ..*own
        };
        let constraints = trajectory.constraints().iter().map(with_share).collect();
        let graph = PoseGraph { poses: poses.to_vec(), constraints, ..Default::default() };
        let Some(covariances) = graph.covariances_from(last) else { continue };
        for apart in APART.into_iter().filter(|apart| *apart <= last) {
            let relative = |poses: &[Isometry2<f64>]| poses[last].inv_mul(&poses[last - apart]);
            let (found, true_pose) = (relative(poses), relative(truth));
            let off = found.translation.vector - true_pose.translation.vector;
            let turned = (found.rotation / true_pose.rotation).angle();
            samples.extend(sample(apart, &Vector3::new(off.x, off.y, turned), &covariances[last - apart]));
        }
    }
}

/// An error with its covariance. `None` if that has no inverse.
fn sample(apart: usize, error: &Vector3<f64>, covariance: &Matrix3<f64>) -> Option<Sample> {
    let squared = error.dot(&(covariance.try_inverse()? * error));
    let position = error.xy().norm() / (covariance.m11 + covariance.m22).sqrt();
    Some(Sample {
        apart,
        ratios: [position, error.z.abs() / covariance.m33.sqrt()],
        log_likelihood: -0.5 * (squared.min(LARGEST) + covariance.determinant().ln()),
    })
}
