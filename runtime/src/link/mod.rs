//! Links: one output with all its readers.
//!
//! A link keeps three promises, whatever carries it:
//!
//! - **Order.** Messages arrive as they were sent, and never go back in log time.
//! - **Nothing lost.** A reader grants credit, a sender spends it, and a sender without credit waits.
//! - **Progress.** A *watermark* tells a reader that nothing before a log time will follow, so that a stage with
//!   several inputs can go on while one of them is silent. The end of the stream is a message of its own, so a sender
//!   that dies never looks like one that is done.
//!
//! [`direct`] carries messages between stages of one thread, [`shared`] over iceoryx2 between threads or processes.
//! [`InputQueue`] and [`next_input`] are what both have in common: the order in which a stage gets its inputs.

pub mod board;
pub mod direct;
mod histogram;
mod input_queue;
pub mod live;
mod order;
mod sequence;
pub mod shared;

pub use histogram::Histogram;
pub use input_queue::InputQueue;
pub use order::{latest, lower_bound, next_input};
pub(crate) use sequence::Sequence;
