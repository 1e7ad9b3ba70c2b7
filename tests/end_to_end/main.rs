//! Tests of the command as a user runs it, from its arguments to the files and the shared memory that it leaves.
//!
//! All tests run one program: the command with the shipped stages, and with `troubled_stages` that fail when they are
//! configured to.

#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stdout)]

mod address_space;
mod bad_input;
mod changing_maps;
mod closed_output;
mod compare;
mod containers;
mod engines_agree;
mod failing_calls;
mod failing_writes;
mod far_from_the_origin;
mod foxglove_view;
mod full_shared_memory;
mod golden;
mod golden_errors;
mod golden_runner;
mod group_mapping;
mod interrupted;
mod large_buildings;
mod live;
mod live_restarts;
mod log_output;
mod log_tools;
mod logging;
mod looking_on;
mod map_file_robots;
mod map_merge;
mod merge_map_files;
mod merge_output;
mod methods;
mod mirrored_tag;
mod names;
mod one_map;
mod output_files;
mod parameter_ranges;
mod processes;
mod python_libraries;
mod python_stages;
mod real_logs;
mod render;
mod report;
mod scans;
mod support;
mod tags_as_they_come;

mod topological;
mod torture;
mod two_tags;
mod user_knowledge;
mod walkthrough;
