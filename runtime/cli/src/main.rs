//! x
#[allow(dead_code)]
mod evaluate;
fn main() {}
