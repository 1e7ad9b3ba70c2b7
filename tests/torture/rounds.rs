//! Rounds: a small pipeline is run, something happens to it, and every promise is looked at.

use crate::fault::Fault;
use crate::processes::{Ended, Started, stages, wait_for};
use crate::promises::Outcome;
use crate::world::{World, print_line};
use anyhow::{Context as _, Result, ensure};
use gridweave_tests::run_files::part;
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::Write as _;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

/// A source, two stages beside each other, one that joins them, and a log.
const PIPELINE: &str = r#"
[pipeline]
name = "torture"
depth = 4

[stages.source]
kind = "troubled_source"
count = 1000
pause = 100
size = 200

[stages.middle]
kind = "troubled_stage"
inputs = ["source"]

[stages.other]
kind = "troubled_stage"
inputs = ["source"]

[stages.join]
kind = "troubled_stage"
inputs = { in = ["middle", "other"] }

[stages.output]
kind = "mcap_sink"
inputs = ["join"]
"#;

const OUTPUT: &str = "out.mcap";
const ENGINES: [&str; 4] = ["processes", "processes", "threads-ipc", "threads"];
/// Progress is printed after so many rounds.
const PROGRESS: u32 = 50;
/// Processes that lose the one that leads them end within this.
const END: Duration = Duration::from_secs(30);

/// Runs so many rounds.
pub(crate) fn torture(program: &Path, rounds: u32, seed: u64, kills: bool) -> Result<()> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut world = World::new(program)?;
    fs::write(world.path("torture.toml"), PIPELINE)?;
    let start = Instant::now();
    world.run(&run_args("processes", OUTPUT))?;
    // At any moment of a run, and a little after it.
    let longest = start.elapsed().mul_f64(1.1);
    let whole = fs::read(world.path(OUTPUT))?;
    ensure!(world.left_over()?.is_empty(), "a run that ended well has left {:?}", world.left_over()?);
    let (mut done, mut ends): (BTreeMap<Fault, u32>, BTreeMap<Option<i32>, u32>) = Default::default();
    for number in 0..rounds {
        let fault = Fault::draw(number, kills, &mut random);
        if matches!(fault, Fault::FullDisk | Fault::FullSharedMemory) && !world.is_isolated {
            continue;
        }
        let engines = if fault == Fault::KillStage { &ENGINES[..1] } else { &ENGINES };
        let round = Round {
            fault,
            engine: engines.choose(&mut random).copied().unwrap_or_default(),
            contained: random.random(),
            was_there: random.random(),
            at: longest.mul_f64(random.random()),
        };
        match round.run(&mut world, &whole, &mut random) {
            Ok(status) => *ends.entry(status).or_default() += 1,
            Err(error) => {
                let folder = world.keep();
                return Err(error.context(format!("round {number} of seed {seed}, {round:?}, in {}", folder.display())));
            }
        }
        *done.entry(round.fault).or_default() += 1;
        if (number + 1) % PROGRESS == 0 {
            print_line(&format!(
                "{} rounds in {:.0} s, every promise held so far",
                number + 1,
                start.elapsed().as_secs_f64()
            ));
        }
    }
    let seconds = start.elapsed().as_secs_f64();
    let rounds: u32 = done.values().sum();
    print_line(&format!("{rounds} rounds in {seconds:.0} s, every promise held: {done:?}; ended with {ends:?}"));
    Ok(())
}

fn run_args(engine: &'static str, output: &'static str) -> [&'static str; 6] {
    ["run", "torture.toml", "-o", output, "--engine", engine]
}

/// A run, and what happens to it.
#[derive(Debug)]
struct Round {
    fault: Fault,
    engine: &'static str,
    /// Whether it has a separate process namespace, as in a container.
    contained: bool,
    /// Whether there is an output of an earlier run.
    was_there: bool,
    /// When it happens.
    at: Duration,
}

impl Round {
    /// Gives how the run ended.
    fn run(&self, world: &mut World, whole: &[u8], random: &mut ChaCha8Rng) -> Result<Option<i32>> {
        let output = world.path(OUTPUT);
        match self.was_there {
            true => fs::write(&output, whole)?,
            false => drop(fs::remove_file(&output)),
        }
        let status = match self.fault {
            Fault::FullDisk => self.on_a_full_disk(world)?,
            _ => {
                let ended = self.with_fault(world, random)?;
                Outcome { path: &output, whole, was_there: self.was_there }.check(self.fault, &ended)?;
                ended.status
            }
        };
        ensure!(wait_for(END, || stages(&world.runs()).is_empty()), "its processes have not ended");
        if !self.fault.may_leave() {
            ensure!(world.left_over()?.is_empty(), "it has left {:?}", world.left_over()?);
        }
        clean(world)?;
        world.run(&run_args("processes", OUTPUT)).context("the next run does not work")?;
        ensure!(fs::read(&output)? == whole, "the next run gives something else");
        ensure!(!part(&output).exists(), "the next run leaves a part of an output");
        ensure!(world.left_over()?.is_empty(), "the next run has left {:?}", world.left_over()?);
        world.check_strangers()?;
        Ok(status)
    }

    /// Starts the run, does to it what is to happen, and gives how it ended.
    fn with_fault(&self, world: &mut World, random: &mut ChaCha8Rng) -> Result<Ended> {
        let mut run = world.start(&run_args(self.engine, OUTPUT), self.contained)?;
        wait_for(self.at, || run.has_ended());
        let leader = run.leader();
        let stages: Vec<u32> = run.stages().into_iter().filter(|stage| Some(*stage) != leader).collect();
        let all = || stages.iter().copied().chain(leader);
        match self.fault {
            Fault::KillStage => stages.choose(random).into_iter().for_each(|stage| Started::signal(*stage, "KILL")),
            Fault::KillLeader => leader.into_iter().for_each(|leader| Started::signal(leader, "KILL")),
            Fault::KillAll => all().for_each(|process| Started::signal(process, "KILL")),
            Fault::Signal(name) => leader.into_iter().for_each(|leader| Started::signal(leader, name)),
            Fault::HaltAll | Fault::HaltOne => {
                let halted: Vec<u32> = match self.fault {
                    Fault::HaltAll => all().collect(),
                    _ => all().collect::<Vec<_>>().choose(random).copied().into_iter().collect(),
                };
                halted.iter().for_each(|process| Started::signal(*process, "STOP"));
                wait_for(self.at, || false);
                halted.iter().for_each(|process| Started::signal(*process, "CONT"));
            }
            Fault::Twice => return self.twice(run, world),
            Fault::FullSharedMemory => return full_shared_memory(run),
            Fault::FullDisk => {}
        }
        run.wait()
    }

    /// Starts another run with the same output. Gives how the first ended.
    fn twice(&self, run: Started, world: &mut World) -> Result<Ended> {
        let is_refused = |ended: &Ended| ended.status == Some(1) && ended.text.contains("is being written by");
        let second = world.start(&run_args(self.engine, OUTPUT), !self.contained)?.wait()?;
        ensure!(is_refused(&second) || second.status == Some(0), "the second run ended with {second:?}");
        let first = run.wait()?;
        // Of two that begin together either may be refused.
        Ok(if is_refused(&first) && second.status == Some(0) { second } else { first })
    }

    /// Runs on a separate file system that is too small.
    fn on_a_full_disk(&self, world: &mut World) -> Result<Option<i32>> {
        let disk = world.path("disk");
        fs::create_dir_all(&disk)?;
        // Rarely enough for all, mostly for a part.
        let size = format!("size={}k", 8 + self.at.subsec_micros() % 80);
        let mount = |command: &mut Command| -> Result<()> {
            ensure!(command.status()?.success(), "{command:?} failed");
            Ok(())
        };
        mount(Command::new("mount").args(["-t", "tmpfs", "-o", &size, "tmpfs"]).arg(&disk))?;
        let ended = world.start(&run_args(self.engine, "disk/out.mcap"), self.contained).and_then(Started::wait);
        let checked = ended.and_then(|ended| {
            let is_reported = ended.status == Some(1) && ended.text.contains("no room left");
            ensure!(ended.status == Some(0) || is_reported, "a full disk is not reported: {ended:?}");
            Ok(ended.status)
        });
        mount(Command::new("umount").arg("-l").arg(&disk))?;
        checked
    }
}

/// Removes what runs have left. A process that was just being started when the others were killed is one that lives,
/// until it finds itself alone.
fn clean(world: &mut World) -> Result<()> {
    let start = Instant::now();
    loop {
        let cleaned = world.run(&["clean"])?;
        if world.left_over()?.is_empty() {
            return Ok(());
        }
        let left = world.left_over()?;
        ensure!(start.elapsed() < END, "what it has left is not cleaned away: {left:?}; clean says: {cleaned}");
        wait_for(Duration::from_millis(100), || false);
    }
}

/// Takes what is left of shared memory while the run lives.
fn full_shared_memory(run: Started) -> Result<Ended> {
    let filling = Path::new("/dev/shm").join("zeros");
    let filled = File::create(&filling).map(|mut file| while file.write_all(&[0; 1 << 16]).is_ok() {});
    let ended = run.wait();
    fs::remove_file(&filling)?;
    filled?;
    let ended = ended?;
    let is_reported =
        ended.status == Some(1) && (ended.text.contains("/dev/shm") || ended.text.contains("No space left"));
    ensure!(ended.status == Some(0) || is_reported, "full shared memory is not reported: {ended:?}");
    Ok(ended)
}
