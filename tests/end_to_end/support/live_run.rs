//! Live runs in folders of their own, and what they have found.

use super::{Ended, Running, json, left_over, outcome, processes, run_name, signal, simulate, start, wait_until};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Takes what robots send, and writes it to a log.
pub(crate) const RECEIVE: &str = r#"
[pipeline]
name = "receive"
mode = "live"

[robots]
map = "/{robot}/map"
pose = "/{robot}/pose"
tags = "/{robot}/tag_ranges"

[stages.robots]
kind = "live_source"
topics = { pose = "/{robot}/pose" }

[stages.output]
kind = "mcap_sink"
inputs = ["robots.map", "robots.pose", "robots.tags"]
"#;

/// A source, a stage that may be slow or fail, and a log of what the stage sends.
pub(crate) const TROUBLED: &str = r#"
[pipeline]
name = "troubled"
mode = "live"
depth = 16

[stages.source]
kind = "troubled_source"
count = 1_000_000_000
pause = 1000
overflow = "wait"

[stages.middle]
kind = "troubled_stage"
inputs = ["source"]
restart = "on_failure"

[stages.output]
kind = "mcap_sink"
inputs = ["middle"]
"#;

pub(crate) const OUTPUT: &str = "out.mcap";
pub(crate) const SUMMARY: &str = "summary.json";
pub(crate) const LOG: &str = "in.mcap";
pub(crate) const POSES: &str = "/robot1/pose";

/// A run in a separate folder.
pub(crate) struct Run {
    pub(crate) run: Running,
    pub(crate) folder: TempDir,
}

impl Run {
    /// A run of a pipeline that ships, or of the text of one.
    #[track_caller]
    pub(crate) fn start(pipeline: &str, more: &[&str]) -> Self {
        let folder = TempDir::new().unwrap();
        let is_text = pipeline.contains('\n');
        if is_text {
            fs::write(folder.path().join("pipeline.toml"), pipeline).unwrap();
        }
        let name = if is_text { "pipeline.toml" } else { pipeline };
        let args = [&["run", name, "-o", OUTPUT, "--summary", SUMMARY], more].concat();
        let run = start(folder.path(), &args, &[]);
        Self { run, folder }
    }

    pub(crate) fn id(&self) -> u32 {
        self.run.id()
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Starts a command that is meant for this run.
    #[track_caller]
    pub(crate) fn command(&self, args: &[&str]) -> Running {
        let name = run_name(self.id());
        let args = [args, &["--run", &name, "--wait", "60"]].concat();
        start(self.folder.path(), &args, &[])
    }

    /// A log of two robots, and its truth.
    #[track_caller]
    pub(crate) fn simulate(&self) -> (PathBuf, PathBuf) {
        simulate(self.folder.path(), LOG, &["--robots", "2"])
    }

    /// What `top` shows of the stages.
    #[track_caller]
    pub(crate) fn top(&self) -> Value {
        let ended = self.command(&["top", "--once", "--json", "--interval", "0.05"]).wait();
        assert_eq!(ended.status, 0, "{ended:#?}");
        serde_json::from_str(&ended.stdout).unwrap()
    }

    /// A number that `top` shows of a stage.
    #[track_caller]
    pub(crate) fn number(&self, stage: &str, name: &str) -> u64 {
        let top = self.top();
        let stages = top["stages"].as_array().unwrap();
        stages.iter().find(|entry| entry["name"] == stage).unwrap()[name].as_u64().unwrap()
    }

    /// Lets a troubled stage go on that waits at a gate.
    #[track_caller]
    pub(crate) fn open_gate(&self, number: u64) {
        fs::write(self.path(&format!("gate_{number}")), b"").unwrap();
    }

    /// Kills the process of a stage.
    #[track_caller]
    pub(crate) fn kill(&self, stage: &str) {
        let (process, _) = processes(self.id()).into_iter().find(|(_, name)| name == stage).unwrap();
        signal(process, "KILL");
    }

    /// Ends the run as a user does.
    #[track_caller]
    pub(crate) fn interrupt(self) -> Done {
        signal(self.id(), "INT");
        self.wait()
    }

    /// Waits for the end of the run, which leaves nothing behind.
    #[track_caller]
    pub(crate) fn wait(self) -> Done {
        let id = self.id();
        let ended = self.run.wait();
        assert_eq!(processes(id), [], "{ended:#?}");
        // Programs outside of the run that are still there end a moment later.
        wait_until("end of all that is left", || left_over(id).is_empty());
        Done { ended, folder: self.folder }
    }
}

/// A run that has ended.
pub(crate) struct Done {
    pub(crate) ended: Ended,
    pub(crate) folder: TempDir,
}

impl Done {
    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(crate) fn summary(&self) -> Value {
        json(&self.path(SUMMARY))
    }

    /// Numbers that the summary has of a stage; what it leaves out is 0.
    pub(crate) fn numbers<const N: usize>(&self, stage: &str, names: [&str; N]) -> [u64; N] {
        let summary = self.summary();
        names.map(|name| summary["stages"][stage][name].as_u64().unwrap_or_default())
    }

    pub(crate) fn output(&self) -> Topics {
        read(&self.path(OUTPUT))
    }

    /// It has ended well, and its log is complete.
    #[track_caller]
    pub(crate) fn assert_done(&self) {
        assert_eq!(self.ended.status, 0, "{:#?}", self.ended);
        assert_eq!(outcome(&self.path(OUTPUT)).0, "");
    }

    /// It has found the true frames.
    #[track_caller]
    pub(crate) fn assert_right(&self, truth: &Path) {
        let args = ["evaluate", SUMMARY, "--truth", truth.to_str().unwrap()];
        let evaluated = start(self.folder.path(), &args, &[]).wait();
        evaluated.assert(0, &["right 1, wrong 0, refused 0"]);
    }
}

/// The messages of a log by topic: log time and bytes.
pub(crate) type Topics = BTreeMap<String, Vec<(u64, Vec<u8>)>>;

#[track_caller]
pub(crate) fn read(log: &Path) -> Topics {
    let bytes = fs::read(log).unwrap();
    let mut topics = Topics::new();
    for message in mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap) {
        topics.entry(message.channel.topic.clone()).or_default().push((message.log_time, message.data.to_vec()));
    }
    topics
}

/// How many messages the links of a live source have of a log: maps, poses and tags of two robots.
pub(crate) fn counts(topics: &Topics) -> Vec<(String, usize)> {
    let is_of_robot = |topic: &String| topic.starts_with("/robot") && !topic.ends_with("/map");
    topics
        .iter()
        .filter(|(topic, _)| is_of_robot(topic) && (topic.ends_with("/pose") || topic.ends_with("/tag_ranges")))
        .map(|(topic, messages)| (topic.clone(), messages.len()))
        .collect()
}
