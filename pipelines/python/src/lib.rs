//! The native part of the Python package `gridweave`: what its Python files cannot do themselves.
//!
//! Arrays come in and go out as numpy arrays, everything else as plain Python values and JSON; the Python files give
//! them names and types. The interpreter is not held while a pipeline runs, and an interrupt of the user ends the run
//! in order.

#![forbid(unsafe_code)]

mod deform;
mod errors;
mod grid;
mod log_reader;
mod python_stage;
mod requests;
mod watched;

#[pyo3::pymodule]
mod _native {
    use gridweave_runtime::engine::processes::Launch;
    use pyo3::prelude::*;
    use std::collections::BTreeMap;
    use std::ffi::OsString;

    #[pymodule_export]
    use super::deform::deform;
    #[pymodule_export]
    use super::errors::{GridweaveError, RequestError};
    #[pymodule_export]
    use super::grid::{load_map, save_map};
    #[pymodule_export]
    use super::log_reader::LogMessages;
    #[pymodule_export]
    use super::requests::{Request, merge_files, merge_maps, run_pipeline};

    /// Runs the command `gridweave` with arguments, and returns its exit status. `program` is the command line that
    /// starts it again.
    #[pyfunction]
    fn command(py: Python<'_>, program: Vec<String>, arguments: Vec<OsString>) -> u8 {
        if let Some((python, arguments)) = program.split_first() {
            Launch { program: python.into(), arguments: arguments.to_vec() }.set_this_program();
        }
        let arguments = std::iter::once(OsString::from("gridweave")).chain(arguments);
        py.detach(|| gridweave::command_line(arguments, [], &[], |_, _| {}))
    }

    /// The `.msg` texts of the message types that ship, by name.
    #[pyfunction]
    fn message_texts() -> BTreeMap<String, &'static str> {
        gridweave_logs::schemas::message_texts().collect()
    }

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        super::watched::keep_process();
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
