//! A soak: a log is played into a live pipeline over and over while stages are killed, and nothing grows or goes
//! missing.

use crate::processes::{Started, stages, wait_for, with_text};
use crate::world::{World, print_line};
use anyhow::{Context as _, Result, ensure};
use gridweave_logs::reader::{LogFile, LogReader};
use gridweave_tests::run_files::run_name;
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

/// Stages of the pipeline that are started again when they fail.
const MORTAL: [&str; 9] =
    ["robots", "common_tags", "lines", "quadrants", "cleaner", "icp", "verifier", "frames", "fuser"];
/// Seconds between two kills, at least and at most.
const PAUSE: (f64, f64) = (3.0, 9.0);
/// Of two means of what is used, the later may be greater by this share, and by so much.
const GROWTH: f64 = 0.1;
const SLACK: Usage = Usage { memory: 8e6, descriptors: 4.0, shared_memory: 4e6 };
const START: Duration = Duration::from_secs(60);

/// What the processes of the run use.
#[derive(Clone, Copy, Debug, Default)]
struct Usage {
    /// Bytes that are resident, without those shared with other processes.
    memory: f64,
    descriptors: f64,
    /// Bytes of shared memory.
    shared_memory: f64,
}

/// Plays and kills for so many minutes.
pub(crate) fn soak(program: &Path, minutes: f64, rate: f64, seed: u64) -> Result<()> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut world = World::new(program)?;
    ensure!(
        world.is_isolated,
        "a soak needs separate namespaces, as the shared memory of other programs must not be counted"
    );
    world.run(&["simulate", "-o", "in.mcap", "--robots", "2"])?;
    let run = world.start(&["run", "live", "-o", "out.mcap", "--summary", "summary.json"], false)?;
    let name = run_name(run.id());
    let player = world
        .start(&["play", "in.mcap", "--loop", "--rate", &rate.to_string(), "--run", &name, "--wait", "60"], false)?;
    ensure!(wait_for(START, || of_stages(&world).len() > MORTAL.len()), "the run does not start");

    let (start, mut kills, mut usages) = (Instant::now(), BTreeMap::<&str, u64>::new(), Vec::new());
    while start.elapsed().as_secs_f64() < 60.0 * minutes {
        wait_for(Duration::from_secs_f64(random.random_range(PAUSE.0..PAUSE.1)), || false);
        usages.push(usage(&world)?);
        let processes = of_stages(&world);
        let living: Vec<&str> = MORTAL.into_iter().filter(|stage| processes.contains_key(*stage)).collect();
        let Some(stage) = living.choose(&mut random) else { continue };
        Started::signal(processes[*stage], "KILL");
        *kills.entry(stage).or_default() += 1;
    }
    Started::signal(player.id(), "INT");
    let played = player.wait()?;
    let sent = played.text.split_once("played ").and_then(|(_, rest)| rest.split(' ').next()?.parse::<u64>().ok());
    let sent = sent.with_context(|| with_text("the player does not say what it has sent", &played.text))?;
    Started::signal(run.id(), "INT");
    let ended = run.wait()?;
    ensure!(ended.status == Some(0), with_text(&format!("the run ended with {:?}", ended.status), &ended.text));
    ensure!(!ended.text.contains("panicked"), with_text("a stage panicked", &ended.text));
    ensure!(stages(&world.runs()).is_empty() && world.left_over()?.is_empty(), "it has left {:?}", world.left_over()?);
    world.check_strangers()?;

    let accounts = Accounts::of(&world)?;
    let seconds = start.elapsed().as_secs_f64();
    print_line(&format!("{seconds:.0} s, kills: {kills:?}"));
    accounts.check(sent, &kills)?;
    check_growth(&usages)
}

/// The stages that have a process, and its number.
fn of_stages(world: &World) -> BTreeMap<String, u32> {
    let of_process = |process: u32| {
        let line = fs::read(format!("/proc/{process}/cmdline")).ok()?;
        let words: Vec<String> =
            line.split(|byte| *byte == 0).map(|word| String::from_utf8_lossy(word).into()).collect();
        let folder = world.runs().to_string_lossy().into_owned();
        let place = words.iter().position(|word| word.contains(&folder))?;
        Some((words.get(place + 1)?.clone(), process))
    };
    stages(&world.runs()).into_iter().filter_map(of_process).collect()
}

fn usage(world: &World) -> Result<Usage> {
    let mut usage = Usage { shared_memory: world.shared_memory()? as f64, ..Usage::default() };
    for process in of_stages(world).into_values() {
        // One that has just ended counts nothing.
        let memory = fs::read_to_string(format!("/proc/{process}/status")).unwrap_or_default();
        let kilobytes =
            memory.lines().find_map(|line| line.strip_prefix("RssAnon:")?.split_whitespace().next()?.parse().ok());
        usage.memory += 1024.0 * kilobytes.unwrap_or(0.0);
        usage.descriptors += fs::read_dir(format!("/proc/{process}/fd")).map_or(0, Iterator::count) as f64;
    }
    Ok(usage)
}

/// What is used is at the end what it was, once all had begun.
fn check_growth(usages: &[Usage]) -> Result<()> {
    type Part = fn(&Usage) -> f64;
    let quarter = usages.len() / 4;
    ensure!(quarter > 0, "it was too short to see what is used");
    let mean = |usages: &[Usage], value: Part| usages.iter().map(value).sum::<f64>() / usages.len() as f64;
    let values: [(&str, Part); 3] = [
        ("bytes of memory", |usage| usage.memory),
        ("descriptors", |usage| usage.descriptors),
        ("bytes of shared memory", |usage| usage.shared_memory),
    ];
    let mut grown = Vec::new();
    for (name, value) in values {
        let (before, after) =
            (mean(&usages[quarter..2 * quarter], value), mean(&usages[usages.len() - quarter..], value));
        print_line(&format!(
            "{name}: {before:.0} in the second quarter, {after:.0} in the last, of {} looks",
            usages.len()
        ));
        if after > before * (1.0 + GROWTH) + value(&SLACK) {
            grown.push(name);
        }
    }
    ensure!(grown.is_empty(), "more and more is used: {grown:?}");
    Ok(())
}

/// What stages say that they have sent, been given and missed, and what the log of it holds.
struct Accounts {
    stages: Value,
    topics: BTreeMap<String, u64>,
}

impl Accounts {
    fn of(world: &World) -> Result<Self> {
        let summary: Value = serde_json::from_slice(&fs::read(world.path("summary.json"))?)?;
        let mut reader = LogReader::new(vec![LogFile::open(world.path("out.mcap"))?]);
        let files = reader.files().clone();
        let names: BTreeMap<u16, String> =
            files[0].channels().map(|(number, channel)| (number, channel.topic)).collect();
        let mut topics = BTreeMap::new();
        while let Some(message) = reader.next_message() {
            let topic = names.get(&message.channel).context("a message has no channel")?;
            *topics.entry(topic.clone()).or_default() += 1;
        }
        let damage: Vec<_> = reader.take_damage();
        ensure!(
            damage.is_empty() && files[0].damage().is_empty(),
            "the output is damaged: {damage:?} {:?}",
            files[0].damage()
        );
        Ok(Self { stages: summary["stages"].clone(), topics })
    }

    fn number(&self, stage: &str, name: &str) -> u64 {
        self.stages[stage][name].as_u64().unwrap_or_default()
    }

    fn written(&self, end: &str) -> u64 {
        let is_of_robot =
            |topic: &&String| topic.starts_with("/robot") && topic.ends_with(end) && topic.matches('/').count() == 2;
        self.topics.iter().filter(|(topic, _)| is_of_robot(topic)).map(|(_, count)| count).sum()
    }

    /// What was sent was given or is counted as dropped.
    fn check(&self, sent: u64, kills: &BTreeMap<&str, u64>) -> Result<()> {
        let maps = self.written("/map");
        let written = maps + self.written("/pose") + self.written("/tag_ranges");
        print_line(&format!("{sent} messages were played, and {written} of them written"));
        let mut wrong = Vec::new();
        if sent != written + self.number("output", "dropped") {
            wrong.push("the output".to_owned());
        }
        for (stage, given) in [("lines", maps), ("cleaner", maps), ("common_tags", self.number("tags", "messages_out"))]
        {
            let (taken, dropped) = (self.number(stage, "messages_in"), self.number(stage, "dropped"));
            let restarts = self.number(stage, "restarts");
            print_line(&format!(
                "{stage}: {given} were sent to it, {taken} given, {dropped} dropped, {restarts} restarts"
            ));
            // What a process had taken off its links dies with it, and the last of each topic is given again.
            let topics = 2 * (1 + kills.get(stage).copied().unwrap_or_default());
            if (taken + dropped).abs_diff(given) > topics {
                wrong.push(stage.to_owned());
            }
        }
        ensure!(wrong.is_empty(), "not every message is accounted for: {wrong:?}");
        Ok(())
    }
}
