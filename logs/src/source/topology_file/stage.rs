//! The stage `topology_file_source`.

use super::{FileTopologies, TopologyFileSourceParameters, load};
use crate::names::robot_names;
use crate::source::map_file::INTERVAL;
use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::Header;
use gridweave_runtime::stage::{Context, Output, Source, StageError};
use std::path::PathBuf;

/// Reads topological maps; see the [module](super).
pub struct TopologyFileSource {
    /// Robots and files, sorted by robot name, so that the order of the files does not matter.
    maps: Vec<(String, PathBuf)>,
    sent: usize,
}

impl TopologyFileSource {
    /// Names the robots. Each file is read when its map is sent.
    pub fn new(parameters: TopologyFileSourceParameters, _: &Context) -> Result<Self, StageError> {
        let doing = "read the topological maps";
        if parameters.files.is_empty() {
            let help = "give files = [...], a JSON file for each robot";
            return Err(StageError::new(doing, "no input file").with_help(help));
        }
        let names = robot_names(&parameters.files).map_err(|error| StageError::new(doing, error))?;
        let mut maps: Vec<(String, PathBuf)> = names.into_iter().zip(parameters.files).collect();
        maps.sort();
        Ok(Self { maps, sent: 0 })
    }
}

impl Source for TopologyFileSource {
    type Outputs = FileTopologies;

    fn next(&mut self, output: &Output<FileTopologies>) -> Result<bool, StageError> {
        let Some((robot, file)) = self.maps.get(self.sent) else { return Ok(false) };
        self.sent += 1;
        output.set_log_time(LogTime(self.sent as u64 * INTERVAL));
        let mut map =
            load(file).map_err(|error| StageError::new(format!("read the topological map of {robot}"), error))?;
        map.header = Header::new(output.log_time(), format!("{robot}/map"));
        map.robot.clone_from(robot);
        output.0.send(robot, &map)?;
        Ok(self.sent < self.maps.len())
    }

    fn progress(&self) -> Option<f64> {
        Some(self.sent as f64 / self.maps.len().max(1) as f64)
    }
}
