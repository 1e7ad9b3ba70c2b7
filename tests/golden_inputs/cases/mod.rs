//! The made-up inputs of golden cases, a file for each stage kind, and one for those of group mapping, which share
//! their maps.
//!
//! Topics are those of the pipeline `tag_merge`, so that the patterns of a case also match a cut of a log.

mod drawing;
mod elastic_refiner;
mod frame_solver;
mod grid_fuser;
mod group_mapping;
mod hough_spectrum_aligner;
mod icp_refiner;
mod line_extractor;
mod logs;
mod map_aligner;
mod map_cleaner;
mod marker_maker;
mod merge_verifier;
mod placers;
mod quadrant_classifier;
mod random_walk_aligner;
mod result_sinks;
mod scan_mapper;
mod tag_filter;
mod tag_localizer;
mod topology;

use gridweave_tests::{LogBuilder, TestMap};
use std::fs;
use std::path::Path;

/// A case with an input.
#[derive(Clone, Copy)]
pub(crate) struct Case {
    /// The stage kind, a folder of golden cases.
    pub(crate) kind: &'static str,
    /// The case, a folder in it.
    pub(crate) name: &'static str,
    write: fn(&mut LogBuilder),
}

impl Case {
    const fn new(kind: &'static str, name: &'static str, write: fn(&mut LogBuilder)) -> Self {
        Self { kind, name, write }
    }

    /// Writes the input to a file.
    pub(crate) fn write(&self, path: &Path) {
        let mut log = LogBuilder::new(path);
        (self.write)(&mut log);
        log.finish();
    }
}

/// The map of each of two robots.
fn pair(log: &mut LogBuilder, of_robot1: &TestMap, of_robot2: &TestMap) {
    log.map(1.0, "robot1", of_robot1);
    log.map(2.0, "robot2", of_robot2);
}

/// All cases whose inputs are made up.
pub(crate) fn made_up() -> Vec<Case> {
    [
        elastic_refiner::cases(),
        frame_solver::cases(),
        grid_fuser::cases(),
        group_mapping::cases(),
        hough_spectrum_aligner::cases(),
        icp_refiner::cases(),
        line_extractor::cases(),
        logs::cases(),
        map_aligner::cases(),
        map_cleaner::cases(),
        marker_maker::cases(),
        merge_verifier::cases(),
        placers::cases(),
        quadrant_classifier::cases(),
        random_walk_aligner::cases(),
        result_sinks::cases(),
        scan_mapper::cases(),
        tag_filter::cases(),
        tag_localizer::cases(),
        topology::cases(),
    ]
    .concat()
}

/// A message as a log holds it.
#[derive(Clone, PartialEq, Eq)]
pub(crate) struct Logged {
    /// Its topic.
    pub(crate) topic: String,
    /// Its ROS 2 type.
    pub(crate) type_name: String,
    /// Nanoseconds.
    pub(crate) log_time: u64,
    /// Its number in the log.
    pub(crate) sequence: u32,
    /// Its bytes.
    pub(crate) data: Vec<u8>,
}

/// All messages of a log, in the order of the file.
pub(crate) fn messages(path: &Path) -> Vec<Logged> {
    let bytes = fs::read(path).unwrap_or_else(|error| panic!("cannot read {}: {error}", path.display()));
    let read = |message: mcap::Message<'_>| Logged {
        topic: message.channel.topic.clone(),
        type_name: message.channel.schema.as_ref().map(|schema| schema.name.clone()).unwrap_or_default(),
        log_time: message.log_time,
        sequence: message.sequence,
        data: message.data.to_vec(),
    };
    mcap::MessageStream::new(&bytes).unwrap().map(|message| read(message.unwrap())).collect()
}
