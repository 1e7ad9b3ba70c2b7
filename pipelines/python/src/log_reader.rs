//! Iteration over the messages of logs.

use crate::errors::GridweaveError;
use gridweave_logs::names::{self, Input, NameRules, Names, TopicNaming};
use gridweave_logs::reader::{LogFile, LogReader};
use gridweave_runtime::stage::RobotTopics;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::path::PathBuf;

/// The messages of logs in log time order: topic, type, encoding, definition, log time and publish time (nanoseconds),
/// and bytes.
#[pyclass]
pub(crate) struct LogMessages {
    reader: LogReader,
    names: Names,
}

/// One message, see [`LogMessages`].
type LoggedMessage<'py> = (String, String, String, String, u64, u64, Bound<'py, PyBytes>);

#[pymethods]
impl LogMessages {
    #[new]
    fn new(py: Python<'_>, files: Vec<PathBuf>) -> PyResult<Self> {
        let inputs: Vec<Input> = files.iter().map(|file| Input::new(file)).collect();
        let rules = NameRules { convention: TopicNaming::AsLogged, ..NameRules::default() };
        let opened = py.detach(|| names::open(&inputs, &rules, &RobotTopics::default()));
        let (reader, names) = opened.map_err(|error| GridweaveError::new_err(error.to_string()))?;
        Ok(Self { reader, names })
    }

    fn __iter__(slf: PyRef<'_, Self>) -> PyRef<'_, Self> {
        slf
    }

    fn __next__<'py>(&mut self, py: Python<'py>) -> Option<LoggedMessage<'py>> {
        let mut renamed = Vec::new();
        while let Some(message) = self.reader.next_message() {
            let Some(channel) = self.names.channel(message.file, message.channel) else { continue };
            if !self.names.wants(message.file, message.channel) {
                continue;
            }
            let data = PyBytes::new(py, self.names.named(&message, &mut renamed));
            return Some((
                channel.topic.clone(),
                channel.schema_name.clone(),
                channel.message_encoding.clone(),
                String::from_utf8_lossy(&channel.schema).into_owned(),
                message.log_time.0,
                message.publish_time,
                data,
            ));
        }
        None
    }

    /// What is damaged in the logs, as far as they were read.
    fn damage(&mut self) -> Vec<String> {
        let files = self.reader.files().clone();
        let mut all = Vec::new();
        for file in files.iter() {
            all.extend(file.damage().iter().map(|damage| format!("{}: {damage}", file.path().display())));
        }
        for (file, damage) in self.reader.take_damage() {
            let path = files.get(file).map(LogFile::path).unwrap_or(std::path::Path::new(""));
            all.push(format!("{}: {damage}", path.display()));
        }
        all
    }
}
