//! Definitions of message types: those built into Gridweave, and those of installed ROS packages.

use super::key_expression::Topic;
use gridweave_logs::dynamic::Schema;
use gridweave_logs::schemas::schema_text;
use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;

/// The environment variable with the folders of installed ROS packages.
const PREFIXES_VARIABLE: &str = "AMENT_PREFIX_PATH";
/// The separator between a definition and those of the types that it uses.
const SEPARATOR: &str = "================================================================================";
const RANGE: &str = "sensor_msgs/msg/Range";
/// The definition since Iron; the built-in one, for older logs without definitions, lacks the last field.
const LATER_RANGE: &str = "\
std_msgs/Header header
uint8 ULTRASOUND=0
uint8 INFRARED=1
uint8 radiation_type
float32 field_of_view
float32 min_range
float32 max_range
float32 range
float32 variance
";
/// The maximum size of a definition, bytes.
const MAX_SIZE: u64 = 1 << 20;

/// The sources of definitions.
#[derive(Clone, Debug, Default)]
pub(crate) struct Definitions {
    /// Folders of packages.
    folders: Vec<PathBuf>,
}

impl Definitions {
    /// Definitions in these folders of packages or, if there are none, in those of the environment.
    pub(crate) fn new(folders: &[PathBuf]) -> Self {
        if !folders.is_empty() {
            return Self { folders: folders.to_vec() };
        }
        let prefixes = std::env::var_os(PREFIXES_VARIABLE).unwrap_or_default();
        Self { folders: std::env::split_paths(&prefixes).map(|prefix| prefix.join("share")).collect() }
    }

    /// The definition of a topic's type and of all types that it uses, as in a log (`ros2msg`): of several the one with
    /// the topic's hash, if there is one.
    pub(crate) fn text(&self, topic: &Topic) -> Option<String> {
        let candidates: Vec<String> = match topic.ros_type.as_str() {
            RANGE => schema_text(RANGE).into_iter().chain([self.with_used(RANGE, LATER_RANGE)]).collect(),
            known => schema_text(known)
                .or_else(|| Some(self.with_used(known, &self.installed(known)?)))
                .into_iter()
                .collect(),
        };
        let has_hash = |text: &&String| hash(&topic.ros_type, text).as_ref() == Some(&topic.type_hash);
        candidates.iter().find(has_hash).or(candidates.first()).cloned()
    }

    /// The hash of a topic's type, computed from its definition.
    pub(crate) fn hash(&self, topic: &Topic) -> Option<String> {
        hash(&topic.ros_type, &self.text(topic)?)
    }

    /// The definition of a type, followed by those of all types that it uses.
    fn with_used(&self, ros_type: &str, text: &str) -> String {
        let mut text = text.to_owned();
        let mut seen = BTreeSet::from([ros_type.to_owned()]);
        let mut to_do = used_types(ros_type, &text);
        while let Some(used) = to_do.pop().filter(|_| text.len() as u64 <= MAX_SIZE) {
            if !seen.insert(used.clone()) {
                continue;
            }
            // A built-in definition includes all types that it uses.
            let of_used = schema_text(&used).or_else(|| {
                let of_used = self.installed(&used)?;
                to_do.extend(used_types(&used, &of_used));
                Some(of_used)
            });
            if let Some(of_used) = of_used {
                text.push_str(&format!("\n{SEPARATOR}\nMSG: {}\n{of_used}", used.replacen("/msg/", "/", 1)));
            }
        }
        text
    }

    fn installed(&self, ros_type: &str) -> Option<String> {
        let (package, name) = ros_type.split_once("/msg/")?;
        // The name comes from the network.
        let is_name = |text: &str| !text.is_empty() && text.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
        if !(is_name(package) && is_name(name)) {
            return None;
        }
        let file = format!("{package}/msg/{name}.msg");
        let files = self.folders.iter().map(|folder| folder.join(&file));
        let is_small =
            |file: &PathBuf| fs::metadata(file).is_ok_and(|about| about.is_file() && about.len() <= MAX_SIZE);
        files.filter(is_small).find_map(|file| fs::read_to_string(file).ok())
    }
}

fn hash(ros_type: &str, text: &str) -> Option<String> {
    Some(Schema::parse(ros_type, text).ok()?.type_hash())
}

/// The types that the definition of `user` may use, with their full names.
fn used_types(user: &str, text: &str) -> Vec<String> {
    let package = user.split_once('/').map_or("", |(package, _)| package);
    let first = |line: &str| line.split('#').next()?.split_whitespace().next().map(str::to_owned);
    let full = |name: String| {
        let name = name.split(['[', '<']).next().unwrap_or_default();
        match name.split_once('/') {
            Some((package, name)) => format!("{package}/msg/{}", name.trim_start_matches("msg/")),
            None if name == "Header" => "std_msgs/msg/Header".to_owned(),
            None => format!("{package}/msg/{name}"),
        }
    };
    text.lines().filter_map(first).map(full).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tempfile::TempDir;

    fn topic(ros_type: &str, type_hash: &str) -> Topic {
        Topic { name: "/a".into(), ros_type: ros_type.into(), type_hash: type_hash.into() }
    }

    #[test]
    fn the_definition_of_an_installed_type_includes_all_types_that_it_uses() {
        let folder = TempDir::new().unwrap();
        let package = folder.path().join("tags_msgs/msg");
        fs::create_dir_all(&package).unwrap();
        fs::write(package.join("Tags.msg"), "std_msgs/Header header\nTag[<=4] tags # seen\n").unwrap();
        fs::write(package.join("Tag.msg"), "int32 UNKNOWN=0\nint32 id\ngeometry_msgs/msg/Pose pose\n").unwrap();
        let definitions = Definitions::new(&[folder.path().to_owned()]);
        let text = |ros_type: &str| definitions.text(&topic(ros_type, ""));
        let tags = text("tags_msgs/msg/Tags").unwrap();
        assert!(Schema::parse("tags_msgs/msg/Tags", &tags).is_ok(), "{tags}");
        assert!(definitions.hash(&topic("tags_msgs/msg/Tags", "")).unwrap().starts_with("RIHS01_"));
        for unknown in
            ["tags_msgs/msg/Other", "tags_msgs/Tags", "../tags_msgs/msg/Tags", "tags_msgs/msg/../msg/Tag", ""]
        {
            assert_eq!(text(unknown), None, "{unknown}");
        }
        assert_eq!(text("std_msgs/msg/String"), schema_text("std_msgs/msg/String"));
    }

    #[test]
    fn of_two_versions_of_a_type_the_one_with_the_topics_hash_is_used() {
        let definitions = Definitions::default();
        let later = "RIHS01_b42b62562e93cbfe9d42b82fe5994dfa3d63d7d5c90a317981703f7388adff3a";
        assert!(definitions.text(&topic(RANGE, later)).unwrap().contains("variance"));
        assert_eq!(definitions.hash(&topic(RANGE, later)).as_deref(), Some(later));
        let before = hash(RANGE, &schema_text(RANGE).unwrap()).unwrap();
        assert_eq!(definitions.hash(&topic(RANGE, &before)), Some(before.clone()));
        assert_eq!(definitions.hash(&topic(RANGE, "other")), Some(before));
    }
}
