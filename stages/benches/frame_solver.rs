//! The frame solver, with simulated pose graphs: its results with wrong alignments, and its time when
//! alignments arrive one by one.
//!
//!     cargo bench -p gridweave-stages --bench frame_solver

// An error in a bench ends it.
#![allow(clippy::unwrap_used, clippy::print_stdout, missing_docs, unreachable_pub)]

use gridweave_runtime::message::{LogTime, Message, MessageHeader};
use gridweave_runtime::ros::encode;
use gridweave_runtime::stage::StageHarness;
use gridweave_stages::merge;
use gridweave_stages::shared;
use std::collections::BTreeSet;
use std::time::{Duration, Instant};

#[path = "../merge/frame_solver/simulated_graph.rs"]
mod simulated_graph;
use simulated_graph::SimulatedGraph;

/// How many of the nearest robots each is aligned with, and what that is called.
const GRAPHS: [(usize, &str); 3] = [(3, "3 nearest"), (5, "5 nearest"), (usize::MAX, "all")];

fn main() {
    println!("| robots | aligned with | alignments | wrong | all, ms | one, ms | slowest, ms |");
    println!("| --- | --- | --- | --- | --- | --- | --- |");
    for robots in [4, 8, 16, 32, 64] {
        for (nearest, name) in GRAPHS {
            for share in [0.0, 0.1] {
                time(robots, nearest, name, share);
            }
        }
    }
    println!();
    println!("| robots | aligned with | wrong | graphs | robots placed | connected by right ones | placed wrong |");
    println!("| --- | --- | --- | --- | --- | --- | --- |");
    for agreeing in [false, true] {
        for robots in [4, 8, 16, 32, 64] {
            for (nearest, name) in GRAPHS {
                for share in [0.0, 0.05, 0.1, 0.2] {
                    if agreeing && share == 0.0 {
                        continue;
                    }
                    judge(robots, nearest, name, share, agreeing);
                }
            }
        }
    }
}

fn judge(robots: usize, nearest: usize, name: &str, share: f64, agreeing: bool) {
    let graphs = if nearest > robots { 160 / robots as u64 } else { 800 / robots as u64 };
    let [mut placed, mut connected, mut wrong] = [0; 3];
    for seed in 0..graphs {
        let simulated = SimulatedGraph::new(robots, nearest, seed);
        let simulated = if agreeing { simulated.with_agreeing_outliers(share) } else { simulated.with_outliers(share) };
        let names: BTreeSet<String> = (0..robots).map(SimulatedGraph::name).collect();
        let alignments = (0..simulated.edges.len())
            .filter_map(|index| merge::frame_solver::solution::by_name(simulated.alignment(index)));
        let parameters =
            merge::frame_solver::FrameSolverParameters { position_floor: 1e-6, yaw_floor: 1e-6, ..Default::default() };
        let solution = merge::frame_solver::solve::solve(
            &names,
            &alignments.collect(),
            &SimulatedGraph::name(0),
            &parameters,
            &merge::frame_solver::solution::Solution::default(),
        );
        for robot in 1..robots {
            if let Some(frame) = solution.frames.get(&SimulatedGraph::name(robot)) {
                placed += 1;
                wrong += usize::from(simulated.is_wrong(robot, &frame.pose));
            }
        }
        let right = |index: usize| !simulated.wrong.contains(&index);
        let reached =
            merge::frame_solver::graph::Forest::grow(robots, &simulated.edges, 0, right).poses(&simulated.edges, 0);
        connected += reached.iter().flatten().count() - 1;
    }
    let all = graphs as usize * (robots - 1);
    let percent = |count: usize| format!("{:.2} %", 100.0 * count as f64 / all as f64);
    let kind = if agreeing { " in twos" } else { "" };
    println!(
        "| {robots} | {name} | {:.0} %{kind} | {graphs} | {} | {} | {} |",
        100.0 * share,
        percent(placed),
        percent(connected),
        percent(wrong)
    );
}

fn time(robots: usize, nearest: usize, name: &str, share: f64) {
    let simulated = SimulatedGraph::new(robots, nearest, 1).with_outliers(share);
    let messages: Vec<Message> = (0..simulated.edges.len())
        .map(|index| Message::from_vec(MessageHeader::default(), encode(&simulated.alignment(index)).unwrap()))
        .collect();
    let run = || {
        let mut stage = StageHarness::new(&merge::frame_solver::kind(), "").unwrap();
        let mut slowest = Duration::ZERO;
        let start = Instant::now();
        for message in &messages {
            let before = Instant::now();
            stage.give_message("alignment", message.clone()).unwrap();
            slowest = slowest.max(before.elapsed());
        }
        stage.finish(LogTime(0)).unwrap();
        (start.elapsed(), slowest)
    };
    let repeats = if messages.len() > 500 { 1 } else { 3 };
    let (whole, slowest) = (0..repeats).map(|_| run()).min().unwrap_or_default();
    let ms = |time: Duration| time.as_secs_f64() * 1e3;
    println!(
        "| {robots} | {name} | {} | {:.0} % | {:.1} | {:.2} | {:.1} |",
        messages.len(),
        100.0 * share,
        ms(whole),
        ms(whole) / messages.len() as f64,
        ms(slowest)
    );
}
