//! What to write instead of the arguments that programs of ROS take: remappings and parameters, as on the command line
//! of a node, or of a launch file.

use std::fmt::Write;
use std::iter::Peekable;

/// The stages of `live_ros` that take what robots publish, and that publish.
const SOURCE: &str = "robots";
const SINK: &str = "ros";
/// What is published there, as topics begin.
const PUBLISHED: [&str; 7] =
    ["/map", "/map_updates", "/map_conflicts", "/robot_frames", "/tf", "/tf_static", "/markers"];
/// Those of them that a namespace is for.
const IN_A_NAMESPACE: [&str; 3] = ["/map", "/map_conflicts", "/robot_frames"];
/// The parameters that both have.
const OF_BOTH: [&str; 7] =
    ["connect", "discovery_range", "domain", "listen", "middleware", "static_peers", "zenoh_config"];
/// The endings of launch files.
const LAUNCH_FILES: [&str; 3] = [".launch.py", ".launch.xml", ".launch.yaml"];

/// What the command line of a ROS program asks for, in the words of this one.
#[derive(Default)]
struct Instead {
    /// Whether parameters are those of no stage, but of what `doctor` looks with.
    is_doctor: bool,
    /// The topics that are published under other names, as `OLD=NEW`.
    renamed: Vec<String>,
    /// Other arguments.
    arguments: Vec<String>,
    /// What no argument can say.
    notes: Vec<String>,
}

/// What to write instead of these arguments, the name of the program not among them; `None` if they have nothing of
/// ROS.
pub fn advice(arguments: &[String]) -> Option<String> {
    let verb = arguments.iter().find(|argument| !argument.starts_with('-'))?;
    let launch_file = arguments.iter().find(|argument| LAUNCH_FILES.iter().any(|end| argument.ends_with(end)));
    if verb == "launch" || verb == "run" && launch_file.is_some() {
        let file = launch_file.map_or("FILE", String::as_str);
        return Some(format!(
            "launch files are started by ROS: ros2 launch {file}\n\
             In one, ExecuteProcess(cmd=[\"gridweave-ros\", \"run\", \"live_ros\"]) starts a merge"
        ));
    }
    // Other verbs take files, which may have any name.
    let has_ros_args = arguments.iter().any(|argument| argument == "--ros-args");
    if !has_ros_args && !["run", "doctor"].contains(&verb.as_str()) {
        return None;
    }
    let mut instead = Instead { is_doctor: verb == "doctor", ..Instead::default() };
    let mut has_any = has_ros_args;
    let mut rest = arguments.iter().map(String::as_str).peekable();
    let mut is_in_ros_args = false;
    while let Some(argument) = rest.next() {
        match argument {
            "--ros-args" => is_in_ros_args = true,
            "--" => is_in_ros_args = false,
            "-r" | "--remap" if next_is_assignment(&mut rest) => {
                rest.next().and_then(assignment).into_iter().for_each(|(from, to)| instead.remap(from, to));
                has_any = true;
            }
            "-p" | "--param" if next_is_assignment(&mut rest) => {
                rest.next().and_then(assignment).into_iter().for_each(|(name, value)| instead.set(name, value));
                has_any = true;
            }
            "--set" => _ = rest.next(),
            _ if is_in_ros_args => instead.option(argument, &mut rest),
            // As launch files take arguments.
            _ => {
                if let Some((name, value)) = assignment(argument) {
                    instead.set(name, value);
                    has_any = true;
                }
            }
        }
    }
    has_any.then(|| instead.text())
}

fn next_is_assignment<'a>(rest: &mut Peekable<impl Iterator<Item = &'a str>>) -> bool {
    rest.peek().is_some_and(|next| assignment(next).is_some())
}

/// Both sides of `NAME:=VALUE`, where NAME is one that ROS may have.
fn assignment(argument: &str) -> Option<(&str, &str)> {
    let is_of_name = |c: char| c.is_ascii_alphanumeric() || "_/~.:".contains(c);
    argument.split_once(":=").filter(|(name, _)| !name.is_empty() && name.chars().all(is_of_name))
}

/// A topic from the root on.
fn absolute(topic: &str) -> String {
    format!("/{}", topic.trim_start_matches(['~', '/']))
}

impl Instead {
    /// `-r FROM:=TO`, or for one node alone `-r NODE:FROM:=TO`.
    fn remap(&mut self, from: &str, to: &str) {
        let from = from.rsplit_once(':').map_or(from, |(_, from)| from);
        match from {
            "__node" | "__name" => self.arguments.push(format!("--set {SINK}.node={to}")),
            "__ns" => {
                let namespace = absolute(to);
                let of = |topic: &str| format!("{topic}={}{topic}", namespace.trim_end_matches('/'));
                self.renamed.extend(IN_A_NAMESPACE.into_iter().map(of));
                self.notes.push(
                    "markers and paths of robots keep their names, and so do /tf and /tf_static, as in ROS".to_owned(),
                );
            }
            from => {
                let (from, to) = (absolute(from), absolute(to));
                let is_published = PUBLISHED.iter().any(|topic| *topic == from)
                    || from.starts_with("/markers/")
                    || from.ends_with("/merged_path");
                match is_published {
                    true => self.renamed.push(format!("{from}={to}")),
                    false => {
                        self.notes.push(format!("topics of robots, as {to}, are named below [robots] in the pipeline"))
                    }
                }
            }
        }
    }

    /// `-p NAME:=VALUE`, or for one node alone `-p NODE:NAME:=VALUE`.
    fn set(&mut self, name: &str, value: &str) {
        // Without `-r` a remapping looks like a parameter, whose name has no slash.
        if name.contains('/') || name.starts_with("__") {
            return self.remap(name, value);
        }
        let name = name.rsplit_once(':').map_or(name, |(_, name)| name);
        if name == "use_sim_time" {
            self.notes.push("use_sim_time is left out: the stamps of robots are taken as they are".to_owned());
        } else if self.is_doctor || name.contains('.') {
            self.arguments.push(format!("--set {name}={value}"));
        } else if OF_BOTH.contains(&name) {
            self.arguments.extend([SOURCE, SINK].map(|stage| format!("--set {stage}.{name}={value}")));
        } else {
            self.arguments.push(format!("--set STAGE.{name}={value}"));
        }
    }

    /// Another argument after `--ros-args`.
    fn option<'a>(&mut self, argument: &str, rest: &mut impl Iterator<Item = &'a str>) {
        match argument {
            "--params-file" => {
                let file = rest.next().unwrap_or("the file");
                self.notes.push(format!("what is in {file} goes into the pipeline, below [stages.STAGE]"));
            }
            "--log-level" => {
                // Its value.
                rest.next();
                self.arguments.push("-v".to_owned());
            }
            "-e" | "--enclave" => {
                rest.next();
                self.notes.push("DDS Security is not spoken; Zenoh with TLS is, by zenoh_config".to_owned());
            }
            _ => {}
        }
    }

    fn text(mut self) -> String {
        if !self.renamed.is_empty() {
            let topics: Vec<String> = self.renamed.iter().map(|topic| format!("\"{topic}\"")).collect();
            self.arguments.push(format!("--set {SINK}.rename='[{}]'", topics.join(", ")));
        }
        let mut text = String::from("arguments of ROS programs are not taken");
        match self.arguments.is_empty() {
            true => text.push_str(
                "; parameters are --set STAGE.PARAMETER=VALUE, and published topics --set ros.rename='[\"/OLD=/NEW\"]'",
            ),
            // Writing to a text does not fail.
            false => _ = write!(text, "; for the stages of live_ros write instead\n    {}", self.arguments.join(" ")),
        }
        self.notes.dedup();
        if !self.notes.is_empty() {
            _ = write!(text, "\n{}", self.notes.join("; "));
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(line: &str) -> Option<String> {
        advice(&line.split_whitespace().map(str::to_owned).collect::<Vec<_>>())
    }

    #[track_caller]
    fn assert_instead(line: &str, instead: &str) {
        let text = of(line).unwrap();
        assert!(text.contains(instead) && text.lines().count() <= 3, "{text}");
    }

    #[test]
    fn arguments_of_a_node_have_counterparts() {
        for (line, instead) in [
            ("run a.toml --ros-args -r /map:=/fleet/map", "\n    --set ros.rename='[\"/map=/fleet/map\"]'"),
            (
                "run a.toml --ros-args -r map:=fleet -r n:tf_static:=/f/tf_static",
                "'[\"/map=/fleet\", \"/tf_static=/f/tf_static\"]'",
            ),
            ("run a.toml --ros-args --remap __node:=merger", "--set ros.node=merger"),
            (
                "run a.toml --ros-args -r __ns:=/fleet",
                "'[\"/map=/fleet/map\", \"/map_conflicts=/fleet/map_conflicts\", \"/robot_frames=/fleet/robot_frames\"]'\nmarkers",
            ),
            ("run a.toml /map:=/fleet/map", "\n    --set ros.rename='[\"/map=/fleet/map\"]'"),
            ("run a.toml __node:=merger", "--set ros.node=merger"),
            ("run a.toml -p n:/map:=/a", "[\"/map=/a\"]"),
            (
                "run a.toml --ros-args -p domain:=5 -p use_sim_time:=true",
                "--set robots.domain=5 --set ros.domain=5\nuse_sim_time",
            ),
            ("run a.toml -p maps.min_change:=0.2", "--set maps.min_change=0.2"),
            ("run a.toml use_sim_time:=true", "stamps of robots"),
            ("run a.toml --ros-args -r /robot1/map:=/r1/map", "[robots]"),
            (
                "run a.toml --ros-args --params-file p.yaml --log-level debug",
                "write instead\n    -v\nwhat is in p.yaml",
            ),
            ("run a.toml --ros-args", "--set STAGE.PARAMETER=VALUE"),
            ("doctor --ros-args -p domain:=5", "    --set domain=5"),
            ("launch a.launch.py", "ros2 launch a.launch.py"),
            ("run two_robots.launch.py pipeline:=a", "ros2 launch two_robots.launch.py"),
        ] {
            assert_instead(line, instead);
        }
    }

    #[test]
    fn other_arguments_are_left_alone() {
        for line in
            ["run a.toml --set ros.node=b", "run a.toml --set a.b:=c", "info a:=b.mcap", "run a.toml -p", "", "run :=b"]
        {
            assert_eq!(of(line), None, "{line}");
        }
    }
}
