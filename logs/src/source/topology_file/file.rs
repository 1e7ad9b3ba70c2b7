//! Reading a topological map from a JSON file.

use gridweave_runtime::input_file;
use gridweave_runtime::ros::{Point, TopologicalMap, TopologicalNode, TopologicalPath, TopologyError};
use serde::Deserialize;
use std::io;
use std::path::{Path, PathBuf};

/// The error when a file cannot be read as a topological map.
#[derive(Debug, thiserror::Error)]
pub enum TopologyFileError {
    /// The file cannot be read.
    #[error("cannot read {path}: {error}", path = path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        error: io::Error,
    },
    /// The file is not a topological map.
    #[error("{path} is not a topological map: {error}", path = path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// The position, and what was expected.
        error: serde_json::Error,
    },
    /// A path starts or ends at a node that does not exist.
    #[error("path {number} of {path} leads to node {node}, and there are {nodes}, counted from 0", path = path.display())]
    NoSuchNode {
        /// The file.
        path: PathBuf,
        /// The number of the path, from 0.
        number: usize,
        /// The index of the node.
        node: u32,
        /// The number of nodes.
        nodes: usize,
    },
    /// A value is out of range.
    #[error("{path} cannot be used: {error}", path = path.display())]
    OutOfRange {
        /// The file.
        path: PathBuf,
        /// Which.
        error: TopologyError,
    },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct JsonMap {
    nodes: Vec<JsonNode>,
    paths: Vec<JsonPath>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct JsonNode {
    x: f64,
    y: f64,
    #[serde(default)]
    kind: String,
    #[serde(default = "certain")]
    probability: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct JsonPath {
    start: u32,
    end: u32,
    /// The length of the polyline through the points, if absent.
    length: Option<f64>,
    #[serde(default = "certain")]
    probability: f64,
    /// The two end nodes, if empty.
    #[serde(default)]
    points: Vec<[f64; 2]>,
}

fn certain() -> f64 {
    1.0
}

/// Reads a topological map. Its header and robot are left empty, since files contain neither.
///
/// # Errors
/// The file cannot be read, is not valid JSON of this form, or has a path to a node that does not exist or a value that
/// is out of range.
pub fn load(path: &Path) -> Result<TopologicalMap, TopologyFileError> {
    let unreadable = |error| TopologyFileError::Unreadable { path: path.to_owned(), error };
    let text = input_file::read_text(path, input_file::LONGEST_TEXT).map_err(unreadable)?;
    let map: JsonMap =
        serde_json::from_str(&text).map_err(|error| TopologyFileError::Malformed { path: path.to_owned(), error })?;
    let mut paths = Vec::with_capacity(map.paths.len());
    for (number, of) in map.paths.iter().enumerate() {
        let node = |node: u32| {
            let nodes = map.nodes.len();
            let missing = TopologyFileError::NoSuchNode { path: path.to_owned(), number, node, nodes };
            map.nodes.get(node as usize).ok_or(missing)
        };
        let ends = [node(of.start)?, node(of.end)?].map(|node| [node.x, node.y]);
        paths.push(of.between(ends));
    }
    let node =
        |node: JsonNode| TopologicalNode { x: node.x, y: node.y, kind: node.kind, probability: node.probability };
    let map = TopologicalMap { nodes: map.nodes.into_iter().map(node).collect(), paths, ..Default::default() };
    map.check().map_err(|error| TopologyFileError::OutOfRange { path: path.to_owned(), error })?;
    Ok(map)
}

impl JsonPath {
    fn between(&self, ends: [[f64; 2]; 2]) -> TopologicalPath {
        let points = if self.points.is_empty() { &ends[..] } else { &self.points[..] };
        let straight = points.windows(2).map(|pair| (pair[0][0] - pair[1][0]).hypot(pair[0][1] - pair[1][1]));
        TopologicalPath {
            start: self.start,
            end: self.end,
            length: self.length.unwrap_or_else(|| straight.sum()),
            probability: self.probability,
            points: points.iter().map(|&[x, y]| Point { x, y, z: 0.0 }).collect(),
        }
    }
}
