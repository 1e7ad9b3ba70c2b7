//! The command `gridweave` with the published methods.

fn main() -> std::process::ExitCode {
    gridweave::command(gridweave_published::kinds())
}
