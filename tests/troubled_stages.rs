//! The command `gridweave` with stages that fail when configured to, for tests of runs of several processes.

#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stdout)]

use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::{Header, PoseStamped};
use gridweave_runtime::stage::{
    Context, Out, Output, OutputPorts, Outputs, Parameters, Received, Source, StageError, StageKind,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

/// What happens, and at which message.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct Trouble {
    /// How many messages a source sends.
    count: u64,
    /// The pause after each message, microseconds.
    pause: u64,
    /// Wait up to so many microseconds at random.
    stall: u64,
    /// The message at which it happens; never if 0.
    at: u64,
    /// fail, panic, hang, hold (hang, and make a file `held`), abort, eat, print, nothing_passes.
    what: String,
    /// Wait before these messages, each time for a file `gate_NUMBER` in the folder in which the run was started.
    gates: Vec<u64>,
    /// Fail before the first message.
    at_start: bool,
    /// Bytes of each message beside the pose.
    size: usize,
}

impl Parameters for Trouble {}

impl Trouble {
    fn happen(&self, number: u64) -> Result<(), StageError> {
        if self.pause > 0 {
            std::thread::sleep(Duration::from_micros(self.pause));
        }
        if self.stall > 0 {
            let random = number.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407) >> 33;
            if random.is_multiple_of(16) {
                std::thread::sleep(Duration::from_micros(random % self.stall));
            }
        }
        if self.gates.contains(&number) {
            let gate = PathBuf::from(format!("gate_{number}"));
            while !gate.exists() {
                std::thread::sleep(Duration::from_millis(1));
            }
        }
        if self.at == 0 || number != self.at {
            return Ok(());
        }
        match self.what.as_str() {
            "fail" => Err(StageError::new("go on", "as configured")),
            "panic" => panic!("as configured"),
            "abort" => std::process::abort(),
            "hold" => {
                let _ = std::fs::write("held", "");
                loop {
                    std::thread::sleep(Duration::from_secs(1));
                }
            }
            "hang" => loop {
                std::thread::sleep(Duration::from_secs(1));
            },
            "eat" => {
                let mut meals: Vec<Vec<u8>> = Vec::new();
                loop {
                    meals.push(vec![1; 1 << 24]);
                }
            }
            "print" => {
                println!("a stage prints this");
                Ok(())
            }
            _ => Ok(()),
        }
    }

    fn start(self) -> Result<Self, StageError> {
        match self.at_start {
            true => Err(StageError::new("start", "as configured")),
            false => Ok(self),
        }
    }

    fn pose(&self, log_time: LogTime) -> PoseStamped {
        PoseStamped { header: Header::new(log_time, "x".repeat(self.size)), ..Default::default() }
    }
}

/// The poses that a stage sends.
struct Poses(Out<PoseStamped>);

impl Outputs for Poses {
    fn declare(ports: &mut OutputPorts) -> Self {
        Self(ports.output("out", "poses"))
    }
}

struct TroubledSource(Trouble, u64);

impl Source for TroubledSource {
    type Outputs = Poses;

    fn next(&mut self, output: &Output<Poses>) -> Result<bool, StageError> {
        let Self(trouble, number) = self;
        if *number == trouble.count {
            return Ok(false);
        }
        *number += 1;
        trouble.happen(*number)?;
        let log_time = LogTime(1_000_000_000 + *number * 1_000_000);
        output.set_log_time(log_time);
        output.0.send("robot1", &trouble.pose(log_time))?;
        Ok(true)
    }
}

struct TroubledStage(Trouble, u64);

impl TroubledStage {
    fn receive(&mut self, _: Received<'_, PoseStamped>, output: &Output<Poses>) -> Result<(), StageError> {
        let Self(trouble, number) = self;
        *number += 1;
        trouble.happen(*number)?;
        if trouble.what == "nothing_passes" {
            return Ok(());
        }
        output.0.send("robot1", &trouble.pose(output.log_time()))
    }
}

fn main() -> ExitCode {
    // Tests of what ships are to find nothing else.
    if std::env::var_os("WITHOUT_TROUBLE").is_some() {
        return gridweave::command([]);
    }
    gridweave::command([
        StageKind::source("troubled_source", "Sends poses.", |trouble: Trouble, _: &Context| {
            Ok(TroubledSource(trouble.start()?, 0))
        }),
        StageKind::stage("troubled_stage", "Sends a pose for each message.", |trouble: Trouble, _| {
            Ok(TroubledStage(trouble.start()?, 0))
        })
        .inputs("in", "poses", TroubledStage::receive)
        .build(),
    ])
}
