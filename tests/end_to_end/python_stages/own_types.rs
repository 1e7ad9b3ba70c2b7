//! Stages in Python with message types of their own.

use super::{ENGINES, Python};
use crate::support::{LogBuilder, TestMap};
use std::fs;

/// Two stages in Python that exchange messages of a type that one of their modules defines.
const OWN_TYPES: &str = r#"
[pipeline]
name = "own_types"

[stages.log]
kind = "mcap_source"

[stages.finder]
kind = "python"
module = "rooms.py:Finder"
inputs = ["log.map"]

[stages.gatherer]
kind = "python"
module = "rooms.py:Gatherer"
inputs = ["finder"]

[stages.out]
kind = "mcap_sink"
inputs = ["finder", "gatherer"]
"#;

impl Python {
    fn types_of_ones_own_go_from_stage_to_stage_and_into_the_log_with_their_definition(&self) {
        let mut log = LogBuilder::new(&self.file("few.mcap"));
        for at in 0..3 {
            log.map(f64::from(at), "robot1", &TestMap::room());
        }
        log.finish();
        let mut first = None;
        for engine in ENGINES {
            self.run_pipeline("types.toml", "few.mcap", engine, &[]).assert(0, &[]);
            let bytes = fs::read(self.file("out.mcap")).unwrap();
            assert!(*first.get_or_insert_with(|| bytes.clone()) == bytes, "{engine}");
        }
        let summary = fs::read_to_string(self.file("summary.json")).unwrap();
        assert!(!summary.contains("has no definition"), "{summary}");
        let ended = self.gridweave(&["cat", "out.mcap", "--topics", "/rooms"]);
        ended.assert(0, &["\"rooms_msgs/msg/Rooms\"", "\"hall 1\"", "\"hall 3\"", "\"corners\""]);
        self.gridweave(&["cat", "out.mcap", "--topics", "/{robot}/finder/room"]).assert(0, &["\"hall\"", "\"size\""]);
        assert_eq!(self.left_over(), Vec::<String>::new());
    }

    fn a_type_that_two_stages_define_differently_is_underlined(&self) {
        let other = fs::read_to_string(self.file("rooms.py")).unwrap().replace("string name\\n", "string title\\n");
        fs::write(self.file("other_rooms.py"), other).unwrap();
        fs::write(self.file("wrong.toml"), OWN_TYPES.replacen("rooms.py:Gatherer", "other_rooms.py:Gatherer", 1))
            .unwrap();
        let words = ["wrong.toml", "have two types of the same name", "which `gatherer` defines differently"];
        self.gridweave(&["check", "wrong.toml"]).assert(2, &words);
        fs::write(self.file("bad.py"), "from gridweave.msg import define\n\ndefine(\"a/msg/B\", \"c/D e\")\n").unwrap();
        fs::write(self.file("wrong.toml"), OWN_TYPES.replacen("rooms.py:Gatherer", "bad.py", 1)).unwrap();
        self.gridweave(&["check", "wrong.toml"]).assert(2, &["a/msg/B uses c/msg/D, which is not known", "bad.py"]);
    }
}

#[test]
#[ignore = "needs python3 with venv, and the network"]
fn python_stages_may_have_message_types_of_their_own() {
    let python = Python::new(&[]);
    fs::write(python.file("types.toml"), OWN_TYPES).unwrap();
    python.types_of_ones_own_go_from_stage_to_stage_and_into_the_log_with_their_definition();
    python.a_type_that_two_stages_define_differently_is_underlined();
}
