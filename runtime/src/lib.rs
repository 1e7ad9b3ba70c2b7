//! How a Gridweave pipeline runs: messages, stages, pipeline files, links and engines.
//!
//! A **stage** takes one message at a time and sends any number of them. A **pipeline** file says which stages there
//! are and which output feeds which input. A **link** is one output with all its readers; it carries ROS 2 messages
//! in CDR through shared memory, without copying them. An **engine** runs the stages, in one thread or in many, and
//! gives every stage its inputs in an order that depends on the log only, never on the machine.
//!
//! This crate knows no file format and no algorithm.

pub mod covariance_ellipse;
pub mod engine;
pub mod input_file;
pub mod left_behind;
pub mod link;
pub mod memory;
pub mod message;
pub mod pipeline;
pub mod program;
pub mod robot_colour;
pub mod ros;
pub mod stage;
pub mod terminal_text;
