//! The frame solver, with simulated teams of robots: what it makes of wrong alignments, and what it costs when
//! alignments arrive one by one.
//!
//!     cargo bench -p gridweave-stages --bench frame_solver

// A bench that cannot go on has nothing better to do than to stop.
#![allow(clippy::unwrap_used, clippy::print_stdout, missing_docs, unreachable_pub)]

use gridweave_runtime::message::{LogTime, Message, MessageHeader};
use gridweave_runtime::ros::encode;
use gridweave_runtime::stage::StageHarness;
use gridweave_stages::merge;
use gridweave_stages::shared;
use std::collections::BTreeSet;
use std::time::{Duration, Instant};

#[path = "../merge/frame_solver/team.rs"]
mod team;
use team::Team;

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
    println!("| robots | aligned with | wrong | teams | robots placed | connected by right ones | placed wrong |");
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
    let teams = if nearest > robots { 160 / robots as u64 } else { 800 / robots as u64 };
    let [mut placed, mut connected, mut wrong] = [0; 3];
    for seed in 0..teams {
        let team = Team::new(robots, nearest, seed);
        let team = if agreeing { team.with_agreeing_mistakes(share) } else { team.with_mistakes(share) };
        let names: BTreeSet<String> = (0..robots).map(Team::name).collect();
        let alignments =
            (0..team.edges.len()).filter_map(|index| merge::frame_solver::solution::by_name(team.alignment(index)));
        let parameters =
            merge::frame_solver::FrameSolverParameters { position_floor: 1e-6, yaw_floor: 1e-6, ..Default::default() };
        let solution = merge::frame_solver::solve::solve(
            &names,
            &alignments.collect(),
            &Team::name(0),
            &parameters,
            &merge::frame_solver::solution::Solution::default(),
        );
        for robot in 1..robots {
            if let Some(frame) = solution.frames.get(&Team::name(robot)) {
                placed += 1;
                wrong += usize::from(team.is_wrong(robot, &frame.pose));
            }
        }
        let right = |index: usize| !team.wrong.contains(&index);
        let reached = merge::frame_solver::graph::Forest::grow(robots, &team.edges, 0, right).poses(&team.edges, 0);
        connected += reached.iter().flatten().count() - 1;
    }
    let all = teams as usize * (robots - 1);
    let percent = |count: usize| format!("{:.2} %", 100.0 * count as f64 / all as f64);
    let kind = if agreeing { " in twos" } else { "" };
    println!(
        "| {robots} | {name} | {:.0} %{kind} | {teams} | {} | {} | {} |",
        100.0 * share,
        percent(placed),
        percent(connected),
        percent(wrong)
    );
}

fn time(robots: usize, nearest: usize, name: &str, share: f64) {
    let team = Team::new(robots, nearest, 1).with_mistakes(share);
    let messages: Vec<Message> = (0..team.edges.len())
        .map(|index| Message::from_vec(MessageHeader::default(), encode(&team.alignment(index)).unwrap()))
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
