//! The stages, and the whole command, among programs that speak to each other over Zenoh on this machine.

mod python_robots;
mod stages;
mod wire;
