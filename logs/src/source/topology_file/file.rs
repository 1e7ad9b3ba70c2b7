//! A topological map as a JSON file.

use gridweave_runtime::ros::{Point, TopologicalMap, TopologicalNode, TopologicalPath};
use serde::Deserialize;
use std::fs::File;
use std::io::{self, BufReader};
use std::path::{Path, PathBuf};

/// Why a file gives no topological map.
#[derive(Debug, thiserror::Error)]
pub enum TopologyFileError {
    /// It cannot be read.
    #[error("cannot read {path}: {error}", path = path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        error: io::Error,
    },
    /// It is no topological map.
    #[error("{path} is no topological map: {error}", path = path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Where, and what was expected.
        error: serde_json::Error,
    },
    /// A path has no node at one of its ends.
    #[error("path {number} of {path} leads to node {node}, and there are {nodes}, counted from 0", path = path.display())]
    NoSuchNode {
        /// The file.
        path: PathBuf,
        /// The number of the path, from 0.
        number: usize,
        /// The node that it names.
        node: u32,
        /// How many nodes there are.
        nodes: usize,
    },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct DrawnMap {
    nodes: Vec<DrawnNode>,
    paths: Vec<DrawnPath>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct DrawnNode {
    x: f64,
    y: f64,
    #[serde(default)]
    kind: String,
    #[serde(default = "certain")]
    probability: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct DrawnPath {
    start: u32,
    end: u32,
    /// That of the straight connections of its points, if it is not given.
    length: Option<f64>,
    #[serde(default = "certain")]
    probability: f64,
    /// Its two nodes, if none are given.
    #[serde(default)]
    points: Vec<[f64; 2]>,
}

fn certain() -> f64 {
    1.0
}

/// Reads a topological map. Its header and its robot are left empty: files tell neither.
///
/// # Errors
/// The file cannot be read, is no such JSON, or has a path that leads to a node that is not there.
pub fn load(path: &Path) -> Result<TopologicalMap, TopologyFileError> {
    let unreadable = |error| TopologyFileError::Unreadable { path: path.to_owned(), error };
    let file = File::open(path).map_err(unreadable)?;
    let drawn: DrawnMap = serde_json::from_reader(BufReader::new(file))
        .map_err(|error| TopologyFileError::Malformed { path: path.to_owned(), error })?;
    let mut paths = Vec::with_capacity(drawn.paths.len());
    for (number, of) in drawn.paths.iter().enumerate() {
        let node = |node: u32| {
            let nodes = drawn.nodes.len();
            let missing = TopologyFileError::NoSuchNode { path: path.to_owned(), number, node, nodes };
            drawn.nodes.get(node as usize).ok_or(missing)
        };
        let ends = [node(of.start)?, node(of.end)?].map(|node| [node.x, node.y]);
        paths.push(of.between(ends));
    }
    let node =
        |node: DrawnNode| TopologicalNode { x: node.x, y: node.y, kind: node.kind, probability: node.probability };
    Ok(TopologicalMap { nodes: drawn.nodes.into_iter().map(node).collect(), paths, ..Default::default() })
}

impl DrawnPath {
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
