//! Stages in Python without inputs.

use super::{ENGINES, Python};
use crate::support::{LogBuilder, TestMap, read};
use std::fs;

/// Two sources in Python beside a log, and a stage that takes from both.
const SOURCES: &str = r#"
[pipeline]
name = "python_sources"
stall_timeout = 8.0

[stages.log]
kind = "mcap_source"

[stages.circle]
kind = "python"
module = "circle.py"
robot = "robot7"
seconds = 6

[stages.source]
kind = "python"
module = "troubled_source.py"
start = 1_700_000_000               # as the log

[stages.troubled]
kind = "python"
module = "troubled.py"
inputs = ["log.map", "log.pose"]

[stages.out]
kind = "mcap_sink"
inputs = ["log.*", "circle", "source", "troubled"]
"#;

impl Python {
    fn sources_give_the_same_bytes_on_every_engine_and_their_messages_by_log_time(&self) {
        let mut log = LogBuilder::new(&self.file("few.mcap"));
        for at in 0..4 {
            log.map(f64::from(at), "robot1", &TestMap::room());
        }
        log.finish();
        let mut first = None;
        for engine in ENGINES.iter().chain(&ENGINES) {
            self.run_pipeline("sources.toml", "few.mcap", engine, &[]).assert(0, &[]);
            let bytes = fs::read(self.file("out.mcap")).unwrap();
            assert!(*first.get_or_insert_with(|| bytes.clone()) == bytes, "{engine}");
        }
        assert_eq!(self.left_over(), Vec::<String>::new());
        let messages = read(&self.file("out.mcap"));
        let times = |topic: &str| messages[topic].iter().map(|(time, _)| *time).collect::<Vec<_>>();
        let every_tenth = |count: u64| (0..count).map(|tick| tick * 100_000_000).collect::<Vec<_>>();
        assert_eq!(times("/robot7/pose"), every_tenth(60));
        let (source, maps) = (times("/robot1/source/pose"), times("/robot1/map"));
        assert_eq!(source.iter().map(|time| time - source[0]).collect::<Vec<_>>(), every_tenth(80));
        assert_eq!(
            maps,
            [0, 10, 20, 30].map(|tick| source[tick]),
            "its poses and the maps of the log lie between each other"
        );
        let bytes = fs::read(self.file("out.mcap")).unwrap();
        let written: Vec<u64> =
            mcap::MessageStream::new(&bytes).unwrap().map(|message| message.unwrap().log_time).collect();
        assert!(written.is_sorted(), "they come by log time over all sources");
    }

    fn a_pipeline_may_have_no_log(&self) {
        let alone = "[pipeline]\nname = \"alone\"\n[stages.circle]\nkind = \"python\"\nmodule = \"circle.py\"\n\
                     [stages.out]\nkind = \"mcap_sink\"\ninputs = [\"circle\"]\n";
        fs::write(self.file("alone.toml"), alone).unwrap();
        self.gridweave(&["check", "alone.toml"]).assert(0, &["2 stages, no errors"]);
        self.gridweave(&["run", "alone.toml", "-o", "alone.mcap"]).assert(0, &[]);
        assert_eq!(read(&self.file("alone.mcap"))["/robot1/pose"].len(), 600);
        self.gridweave(&["kinds", "circle.py"]).assert(0, &["Sends the poses of a robot", "seconds = 60"]);
    }

    fn failures_of_a_source_are_reported_and_nothing_is_left(&self) {
        let cases: [(&str, &[&str]); 5] = [
            ("raise", &["ValueError: it was told so", "Traceback", "troubled_source.py\", line", "in do_raise"]),
            (
                "fall",
                &["ValueError: the log time 1700000000300000000 ns comes after 1700000003900000000 ns", "in do_fall"],
            ),
            ("exit", &["ended with status 7"]),
            ("kill", &["signal 9 (SIGKILL)"]),
            ("hang", &["hangs", "stall_timeout", "in do_hang"]),
        ];
        for engine in ["single", "threads", "processes"] {
            for (what, words) in cases {
                let ended =
                    self.run_pipeline("sources.toml", "few.mcap", engine, &[&format!("source.what=\"{what}\"")]);
                ended.assert(1, words);
                ended.assert(1, &["`source`", "get the next messages of troubled_source.py"]);
                assert_eq!(self.left_over(), Vec::<String>::new(), "{engine} {what}");
            }
            let endless = ["source.count=1000000000", "troubled.what=\"raise\"", "troubled.at=1"];
            let ended = self.run_pipeline("sources.toml", "few.mcap", engine, &endless);
            ended.assert(1, &["`troubled`", "the source was told: ", "ValueError: it was told so"]);
            assert_eq!(self.left_over(), Vec::<String>::new(), "{engine}");
        }
        fs::write(self.file("hasty.py"), "from gridweave import Stage\n\nclass Hasty(Stage):\n    pass\n").unwrap();
        fs::write(self.file("wrong.toml"), SOURCES.replacen("circle.py", "hasty.py", 1)).unwrap();
        self.gridweave(&["check", "wrong.toml"]).assert(2, &["wrong.toml", "which has a generator messages(self)"]);
        fs::write(self.file("wrong.toml"), SOURCES.replacen("robot = ", "inputs = [\"log.map\"]\nrobot = ", 1))
            .unwrap();
        self.gridweave(&["check", "wrong.toml"]).assert(2, &["wrong.toml", "a source has no inputs"]);
    }
}

#[test]
#[ignore = "needs python3 with venv, and the network"]
fn python_stages_may_be_sources() {
    let python = Python::new(&[]);
    fs::write(python.file("sources.toml"), SOURCES).unwrap();
    python.sources_give_the_same_bytes_on_every_engine_and_their_messages_by_log_time();
    python.a_pipeline_may_have_no_log();
    python.failures_of_a_source_are_reported_and_nothing_is_left();
}
