//! Writing of rosbag2 bags: a folder with one MCAP file, and the metadata in `metadata.yaml`.

use crate::file::{WriteError, replace};
use crate::qos;
use crate::reader::{FileStatistics, LogFile, ReadError};
use gridweave_runtime::message::Channel;
use serde::Serialize;
use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fs;
use std::io;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

/// The version of the metadata format, that of Humble, which all later versions read.
const VERSION: u32 = 5;
const DESCRIPTION: &str = "metadata.yaml";

/// The error when a bag cannot be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BagError {
    /// The folder cannot be created or read.
    #[error("cannot write a bag in {}: {source}; check that its parent folder exists and is writable", folder.display())]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// The folder contains another bag.
    #[error("{} contains {other} of another bag; choose another folder", folder.display())]
    Taken {
        /// The folder.
        folder: PathBuf,
        /// The file of the other bag.
        other: String,
    },
    /// The log cannot be read back.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The metadata cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

/// A bag that is being written.
#[derive(Debug)]
pub struct Bag {
    folder: PathBuf,
    /// Whether the folder was created by this run.
    is_made: bool,
}

impl Bag {
    /// Whether a path denotes a bag: it ends with a slash, or is a folder.
    pub fn is_meant(path: &Path) -> bool {
        path.as_os_str().as_bytes().ends_with(b"/") || path.is_dir()
    }

    /// Creates the folder of a bag if it does not exist.
    ///
    /// # Errors
    /// It cannot be created, or contains files of another bag.
    pub fn create(folder: &Path) -> Result<Self, BagError> {
        let of_folder = |source| BagError::Folder { folder: folder.to_owned(), source };
        let is_made = match fs::create_dir(folder) {
            Ok(()) => true,
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => false,
            Err(error) => return Err(of_folder(error)),
        };
        // The name without a trailing slash, `.` or `..`.
        let bag = Self { folder: folder.canonicalize().map_err(of_folder)?, is_made };
        let log = bag.log();
        for entry in fs::read_dir(&bag.folder).map_err(of_folder)? {
            let path = entry.map_err(of_folder)?.path();
            let is_log =
                path.extension().is_some_and(|ending| ["mcap", "db3", "zstd"].iter().any(|log| ending == *log));
            if is_log && path != log {
                let other = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
                return Err(BagError::Taken { folder: folder.to_owned(), other });
            }
        }
        Ok(bag)
    }

    /// The path of the log in the bag, named as by rosbag2.
    pub fn log(&self) -> PathBuf {
        self.folder.join(log_name(self.folder.file_name().unwrap_or_else(|| OsStr::new("bag"))))
    }

    /// Writes the metadata of the finished log.
    ///
    /// # Errors
    /// The log cannot be read, or the metadata cannot be written.
    pub fn describe(&self) -> Result<(), BagError> {
        let log = self.log();
        let text = description(&LogFile::open(&log)?, &log.file_name().unwrap_or_default().to_string_lossy());
        Ok(replace(&[(&self.folder.join(DESCRIPTION), text.as_bytes())])?)
    }
}

impl Drop for Bag {
    fn drop(&mut self) {
        if self.is_made {
            // Fails if the folder is not empty.
            let _ = fs::remove_dir(&self.folder);
        }
    }
}

fn log_name(folder: &OsStr) -> PathBuf {
    let mut name = folder.to_owned();
    name.push("_0.mcap");
    name.into()
}

#[derive(Serialize)]
struct Description<'a> {
    rosbag2_bagfile_information: Information<'a>,
}

#[derive(Serialize)]
struct Information<'a> {
    version: u32,
    storage_identifier: &'a str,
    #[serde(flatten)]
    span: Span,
    topics_with_message_count: Vec<Topic>,
    compression_format: &'a str,
    compression_mode: &'a str,
    relative_file_paths: [&'a str; 1],
    files: [File<'a>; 1],
}

#[derive(Clone, Copy, Serialize)]
struct Span {
    duration: Duration,
    starting_time: Start,
    message_count: u64,
}

#[derive(Clone, Copy, Serialize)]
struct Duration {
    nanoseconds: u64,
}

#[derive(Clone, Copy, Serialize)]
struct Start {
    nanoseconds_since_epoch: u64,
}

#[derive(Serialize)]
struct File<'a> {
    path: &'a str,
    #[serde(flatten)]
    span: Span,
}

#[derive(Serialize)]
struct Topic {
    topic_metadata: TopicMetadata,
    message_count: u64,
}

#[derive(Serialize)]
struct TopicMetadata {
    name: String,
    r#type: String,
    serialization_format: String,
    offered_qos_profiles: String,
}

/// The text of `metadata.yaml` for a log.
fn description(log: &LogFile, name: &str) -> String {
    let FileStatistics { messages, first, last, by_channel } = log.statistics().cloned().unwrap_or_default();
    let span = Span {
        duration: Duration { nanoseconds: last.saturating_sub(first) },
        starting_time: Start { nanoseconds_since_epoch: first },
        message_count: messages,
    };
    // Channels that differ only in properties that rosbag2 does not have are one topic.
    let mut topics: BTreeMap<String, Topic> = BTreeMap::new();
    for (number, channel) in log.channels() {
        let Channel { topic, schema_name, message_encoding, metadata, .. } = channel;
        let count = by_channel.get(&number).copied().unwrap_or(0);
        let entry = topics.entry(topic.clone()).or_insert_with(|| Topic {
            topic_metadata: TopicMetadata {
                name: topic,
                r#type: schema_name,
                serialization_format: message_encoding,
                offered_qos_profiles: metadata.get(qos::KEY).cloned().unwrap_or_default(),
            },
            message_count: 0,
        });
        entry.message_count += count;
    }
    let information = Information {
        version: VERSION,
        storage_identifier: "mcap",
        span,
        topics_with_message_count: topics.into_values().collect(),
        compression_format: "",
        compression_mode: "",
        relative_file_paths: [name],
        files: [File { path: name, span }],
    };
    // Strings and numbers can always be serialized.
    serde_norway::to_string(&Description { rosbag2_bagfile_information: information }).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reader::log_files;
    use crate::test_log::TestLog;
    use gridweave_runtime::ros::{OccupancyGrid, RosMessage};

    #[test]
    fn a_bag_is_a_folder_with_a_log_and_its_metadata() {
        let folder = tempfile::tempdir().unwrap();
        let bag = Bag::create(&folder.path().join("merged/")).unwrap();
        assert_eq!(bag.log().file_name().unwrap(), "merged_0.mcap");
        let mut log = TestLog::new(mcap::WriteOptions::new());
        let latched = BTreeMap::from([(qos::KEY.to_owned(), qos::LATCHED.to_owned())]);
        log.with_metadata("/map", OccupancyGrid::NAME, 5_000_000_000, b"a", &latched);
        log.raw("/other", "a_msgs/msg/B", 7_000_000_000, b"b").raw("/other", "a_msgs/msg/B", 8_000_000_000, b"b");
        fs::write(bag.log(), log.finish()).unwrap();
        bag.describe().unwrap();
        let text = fs::read_to_string(folder.path().join("merged/metadata.yaml")).unwrap();
        let metadata: serde_json::Value = serde_norway::from_str(&text).unwrap();
        let metadata = &metadata["rosbag2_bagfile_information"];
        assert_eq!(metadata["message_count"], 3);
        assert_eq!(metadata["starting_time"]["nanoseconds_since_epoch"], 5_000_000_000_u64);
        assert_eq!(metadata["duration"]["nanoseconds"], 3_000_000_000_u64);
        let [map, other] = metadata["topics_with_message_count"].as_array().unwrap().as_slice() else {
            panic!("{text}")
        };
        assert_eq!(map["topic_metadata"]["offered_qos_profiles"], qos::LATCHED);
        assert_eq!((&other["topic_metadata"]["type"], &other["message_count"]), (&"a_msgs/msg/B".into(), &2.into()));
        let files = log_files(&[folder.path().join("merged")]).unwrap();
        assert_eq!(files, [(0, folder.path().join("merged/merged_0.mcap"))]);
    }

    #[test]
    fn an_empty_folder_is_removed_if_it_was_created_for_the_bag() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        drop(Bag::create(&path).unwrap());
        assert!(!path.exists());
        fs::create_dir(&path).unwrap();
        drop(Bag::create(&path).unwrap());
        assert!(path.exists());
    }

    #[test]
    fn a_bag_replaces_one_of_its_name_and_no_other() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("other_0.mcap"), "").unwrap();
        let error = Bag::create(folder.path()).unwrap_err().to_string();
        assert!(error.contains("other_0.mcap of another bag"), "{error}");
        let bag = folder.path().join("a");
        fs::create_dir(&bag).unwrap();
        fs::write(bag.join("a_0.mcap"), "").unwrap();
        fs::write(bag.join("notes.txt"), "").unwrap();
        assert!(Bag::create(&bag).is_ok());
        let error = Bag::create(&folder.path().join("none/a/")).unwrap_err().to_string();
        assert!(error.contains("none/a"), "{error}");
    }
}
