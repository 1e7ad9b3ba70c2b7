//! Stages in Python: as right, as deterministic and as plain in their failures as any other.

mod own_types;
mod sources;

use crate::support::{Ended, LogBuilder, SMALL_BUILDING, TestMap, gridweave_with, outcome, read, simulate};
use std::ffi::OsStr;
use std::fs;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use tempfile::TempDir;

const ENGINES: [&str; 4] = ["single", "threads", "threads-ipc", "processes"];

const PIPELINE: &str = r#"
[pipeline]
name = "python_stages"
stall_timeout = 8.0
memory_limit = 600_000_000

[stages.log]
kind = "mcap_source"

[stages.invert]
kind = "python"
module = "invert.py"
inputs = ["log.map"]
level = 65

[stages.troubled]
kind = "python"
module = "troubled.py"
inputs = ["log.map", "log.pose"]

[stages.out]
kind = "mcap_sink"
inputs = ["log.*", "invert", "troubled"]
"#;

/// Arguments of `simulate` where the building does not matter.
const TWO_ROBOTS: [&str; 4] = ["--robots", "2", "--set", "beams=90"];

/// An environment with the package, and a folder with a pipeline and its modules.
struct Python {
    folder: TempDir,
    path: String,
    /// The folder for the folders of runs.
    runs: String,
}

fn repository() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap()
}

/// Runs a program to its end.
#[track_caller]
fn call(program: &Path, args: &[&OsStr]) {
    let ended = Command::new(program).args(args).stdin(Stdio::null()).current_dir(repository()).output().unwrap();
    let errors = String::from_utf8_lossy(&ended.stderr);
    assert!(ended.status.success(), "{} {args:?} failed: {errors}", program.display());
}

impl Python {
    /// With the package as a wheel installs it, but built as the tests are, and these packages besides.
    fn new(more: &[&str]) -> Self {
        let folder = TempDir::new().unwrap();
        let environment = folder.path().join("python");
        call(Path::new("python3"), &["-m".as_ref(), "venv".as_ref(), environment.as_ref()]);
        let python = environment.join("bin/python");
        let package = repository().join("pipelines/python");
        let project: toml::Table = fs::read_to_string(package.join("pyproject.toml")).unwrap().parse().unwrap();
        let needed =
            project["project"]["dependencies"].as_array().unwrap().iter().map(|needed| needed.as_str().unwrap());
        let install = ["-m", "pip", "install", "--quiet"].into_iter().chain(needed).chain(more.iter().copied());
        call(&python, &install.map(OsStr::new).collect::<Vec<_>>());
        let asked = Command::new(&python)
            .args(["-c", "import sysconfig; print(sysconfig.get_path('platlib'), end='')"])
            .output();
        let installed = Path::new(OsStr::from_bytes(&asked.unwrap().stdout)).join("gridweave");
        copy(&package.join("gridweave"), &installed);
        let native = std::env::current_exe().unwrap().with_file_name("lib_native.so");
        fs::copy(native, installed.join("_native.abi3.so")).unwrap();
        fs::write(folder.path().join("python.toml"), PIPELINE).unwrap();
        let modules = [
            "pipelines/python/examples/circle.py",
            "pipelines/python/examples/invert.py",
            "tests/end_to_end/python_stages/rooms.py",
            "tests/end_to_end/python_stages/troubled.py",
            "tests/end_to_end/python_stages/troubled_source.py",
        ];
        for module in modules.map(|module| repository().join(module)) {
            fs::copy(&module, folder.path().join(module.file_name().unwrap())).unwrap();
        }
        let path = format!("{}:{}", environment.join("bin").display(), std::env::var("PATH").unwrap());
        let runs = folder.path().join("runs");
        fs::create_dir(&runs).unwrap();
        let runs = runs.to_str().unwrap().to_owned();
        Self { folder, path, runs }
    }

    fn variables(&self) -> [(&str, &str); 3] {
        [("PATH", &self.path), ("PYTHONDONTWRITEBYTECODE", "1"), ("XDG_RUNTIME_DIR", &self.runs)]
    }

    /// What runs have left: their folders, with which goes what they have in shared memory, and processes.
    fn left_over(&self) -> Vec<String> {
        let folders = fs::read_dir(Path::new(&self.runs).join("gridweave")).into_iter().flatten();
        let folders = folders.map(|entry| entry.unwrap().path().display().to_string());
        let all = fs::read_dir("/proc").unwrap();
        let commands = all.filter_map(|entry| fs::read(entry.ok()?.path().join("cmdline")).ok());
        let commands = commands.map(|command| String::from_utf8_lossy(&command).replace('\0', " "));
        folders.chain(commands.filter(|command| command.contains(&self.runs))).collect()
    }

    fn gridweave(&self, args: &[&str]) -> Ended {
        gridweave_with(self.folder.path(), args, &self.variables())
    }

    fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Runs the pipeline on a log.
    fn run(&self, log: &str, engine: &str, settings: &[&str]) -> Ended {
        self.run_pipeline("python.toml", log, engine, settings)
    }

    fn run_pipeline(&self, pipeline: &str, log: &str, engine: &str, settings: &[&str]) -> Ended {
        let mut args = vec!["run", pipeline, "--input", log, "-o", "out.mcap", "--engine", engine];
        args.extend(["--summary", "summary.json"]);
        settings.iter().for_each(|setting| args.extend(["--set", setting]));
        self.gridweave(&args)
    }

    fn unit_tests_pass(&self) {
        let tests = repository().join("pipelines/python/tests");
        let args = ["-B", "-m", "unittest", "discover"].map(OsStr::new);
        call(&self.file("python/bin/python"), &args.into_iter().chain([tests.as_ref()]).collect::<Vec<_>>());
    }

    fn every_engine_gives_the_same_bytes_twice(&self) {
        let mut first = None;
        for engine in ENGINES.iter().chain(&ENGINES) {
            self.run("robots.mcap", engine, &[]).assert(0, &[]);
            let bytes = fs::read(self.file("out.mcap")).unwrap();
            assert!(*first.get_or_insert_with(|| bytes.clone()) == bytes, "{engine}");
        }
        assert_eq!(self.left_over(), Vec::<String>::new());
        let messages = read(&self.file("out.mcap"));
        let on = |topic: &str| messages[topic].len();
        let maps = on("/robot1/map");
        assert!(maps > 2);
        assert_eq!((on("/robot1/invert/inverted"), on("/robot1/troubled/seen"), on("/troubled/seen")), (maps, maps, 1));
    }

    fn failures_of_a_stage_are_reported_and_nothing_is_left(&self) {
        let cases: [(&str, &[&str]); 5] = [
            ("raise", &["ValueError: it was told so", "Traceback", "troubled.py\", line", "in do_raise", "of robot"]),
            ("exit", &["ended with status 7"]),
            ("kill", &["signal 9 (SIGKILL)"]),
            ("segfault", &["signal 11 (SIGSEGV)"]),
            ("hang", &["hangs", "stall_timeout"]),
        ];
        for engine in ["single", "threads", "processes"] {
            for (what, words) in cases {
                let output = self.file("out.mcap");
                let _ = fs::remove_file(&output);
                let ended = self.run("robots.mcap", engine, &[&format!("troubled.what=\"{what}\"")]);
                ended.assert(1, words);
                ended.assert(1, &["`troubled`"]);
                if ["segfault", "hang"].contains(&what) {
                    ended.assert(1, &[&format!("in do_{what}")]);
                }
                assert_eq!(self.left_over(), Vec::<String>::new(), "{engine} {what}");
                // A run that fails before its sink has begun leaves none.
                if output.exists() {
                    let (reason, _) = outcome(&output);
                    assert!(reason.contains("`troubled`"), "{engine} {what}: {reason}");
                }
            }
        }
        let ended = self.run("robots.mcap", "processes", &["troubled.what=\"eat\""]);
        ended.assert(1, &["`troubled`", "memory_limit", "allows 600 MB"]);
        assert_eq!(self.left_over(), Vec::<String>::new());
    }

    fn a_message_that_cannot_be_decoded_is_left_out_and_counted(&self) {
        let map = TestMap::room();
        let mut log = LogBuilder::new(&self.file("bad.mcap"));
        log.map(1.0, "robot1", &map).pose(1.5, "robot1", 0.5, 0.5);
        log.raw(2.0, "/robot1/map", "nav_msgs/msg/OccupancyGrid", b"\0\x01\0\0nonsense").map(3.0, "robot1", &map);
        log.finish();
        for engine in ["single", "processes"] {
            self.run("bad.mcap", engine, &[]).assert(0, &[]);
            let summary = fs::read_to_string(self.file("summary.json")).unwrap();
            assert!(summary.contains("messages on the input `map` that cannot be read are left out"), "{summary}");
            assert_eq!(read(&self.file("out.mcap"))["/robot1/invert/inverted"].len(), 2);
        }
    }

    fn what_is_wrong_is_underlined_before_anything_runs(&self) {
        let cases = [
            ("level = 65", "levle = 65", "did you mean `level`?"),
            ("level = 65", "level = \"65\"", "expected a whole number"),
            ("level = 65", "what = 1", "unknown parameter `what`"),
            ("\"invert.py\"", "\"inverse.py\"", "there is no file"),
            ("\"invert.py\"", "\"os\"", "must have one stage"),
            ("inputs = [\"log.map\", \"log.pose\"]", "inputs = [\"log.map\"]", "`pose`"),
            (
                "inputs = [\"log.map\", \"log.pose\"]",
                "at = 0\ninputs = [\"log.map\", \"log.pose\"]",
                "must be at least 1",
            ),
            ("inputs = [\"log.map\"]", "inputs = [\"log.pose\"]", "nav_msgs/msg/OccupancyGrid"),
            ("module = \"invert.py\"", "module = \"invert.py\"\npython = \"/bin/sh\"", "unknown parameter `python`"),
            ("module = \"invert.py\"", "", "must name the module of the stage"),
        ];
        for (from, to, says) in cases {
            fs::write(self.file("wrong.toml"), PIPELINE.replacen(from, to, 1)).unwrap();
            self.gridweave(&["check", "wrong.toml"]).assert(2, &["wrong.toml", says]);
        }
        fs::write(self.file("broken.py"), "import gridweave\n\nx = 1 / 0\n").unwrap();
        fs::write(self.file("wrong.toml"), PIPELINE.replacen("invert.py", "broken.py", 1)).unwrap();
        self.gridweave(&["check", "wrong.toml"]).assert(2, &["ZeroDivisionError", "broken.py\", line 3"]);
        self.gridweave(&["check", "python.toml"]).assert(0, &["4 stages, no errors"]);
        let help = ["Makes free what is occupied", "nav_msgs/msg/OccupancyGrid", "level = 50"];
        self.gridweave(&["kinds", "invert.py"]).assert(0, &help);
        let without = [("PATH", "/usr/bin:/bin")];
        let ended = gridweave_with(self.folder.path(), &["check", "python.toml"], &without);
        ended.assert(2, &["needs the package `gridweave`", "pip install pipelines/python"]);
        let interpreter = self.file("python/bin/python");
        let named = [without[0], ("GRIDWEAVE_PYTHON", interpreter.to_str().unwrap())];
        gridweave_with(self.folder.path(), &["check", "python.toml"], &named).assert(0, &[]);
        let wrong = [("GRIDWEAVE_PYTHON", "/nonexistent/python")];
        let ended = gridweave_with(self.folder.path(), &["check", "python.toml"], &wrong);
        ended.assert(2, &["`/nonexistent/python` cannot be started"]);
    }

    fn golden_cases_pass_and_a_difference_is_shown(&self) {
        let cases = repository().join("pipelines/python/examples/golden");
        let args = ["golden", "--partial", "--cases", cases.to_str().unwrap()];
        self.gridweave(&args).assert(0, &["python/invert"]);
    }

    fn walls_by_opencv_are_as_good_for_a_merge(&self) {
        simulate(self.folder.path(), "small.mcap", &SMALL_BUILDING);
        let pipeline = repository().join("pipelines/python/examples/tag_merge_opencv.toml");
        let shipped = fs::read_to_string(repository().join("pipelines/tag_merge.toml")).unwrap();
        let (swapped, body) =
            (fs::read_to_string(&pipeline).unwrap(), |text: &str| text[text.find("[robots]").unwrap()..].to_owned());
        let swap = "kind = \"python\"\nmodule = \"opencv_lines.py\"             # beside this file";
        assert_eq!(body(&shipped).replacen("kind = \"line_extractor\"", swap, 1), body(&swapped));
        let args =
            ["compare", "--pipelines", "tag_merge", pipeline.to_str().unwrap(), "--inputs", "small.mcap", "--json"];
        let ended = self.gridweave(&args);
        ended.assert(0, &[]);
        let output: serde_json::Value = serde_json::from_str(&ended.stdout).unwrap();
        let rows = output["rows"].as_array().unwrap();
        assert_eq!(rows.len(), 2, "{output:#}");
        assert!(rows.iter().all(|row| row["right"] == rows[0]["right"] && row["wrong"] == 0), "{output:#}");
    }
}

/// Copies a folder but for what was built in it.
fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap();
        let is_built = name == "__pycache__" || name.as_encoded_bytes().starts_with(b"_native");
        match path.is_dir() {
            _ if is_built => {}
            true => copy(&path, &to.join(name)),
            false => drop(fs::copy(&path, to.join(name)).unwrap()),
        }
    }
}

#[test]
#[ignore = "needs python3 with venv, and the network"]
fn python_stages_are_stages_as_any_other() {
    let python = Python::new(&["matplotlib", "tqdm"]);
    simulate(python.folder.path(), "robots.mcap", &TWO_ROBOTS);
    python.unit_tests_pass();
    python.what_is_wrong_is_underlined_before_anything_runs();
    python.every_engine_gives_the_same_bytes_twice();
    python.a_message_that_cannot_be_decoded_is_left_out_and_counted();
    python.failures_of_a_stage_are_reported_and_nothing_is_left();
    python.golden_cases_pass_and_a_difference_is_shown();
}

#[test]
#[ignore = "needs python3 with venv, and the network"]
fn python_stages_may_use_other_peoples_libraries() {
    Python::new(&["opencv-python-headless"]).walls_by_opencv_are_as_good_for_a_merge();
}
