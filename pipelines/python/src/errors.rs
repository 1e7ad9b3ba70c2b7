//! The exceptions of the module.

use pyo3::PyErr;
use pyo3::create_exception;
use pyo3::exceptions::PyException;

create_exception!(
    gridweave,
    GridweaveError,
    PyException,
    "A run of Gridweave has failed; the text says what, and what would fix it."
);
create_exception!(
    gridweave,
    RequestError,
    GridweaveError,
    "The request is wrong, such as a parameter that does not exist or a file that is no map."
);

/// The exception for an error of a run.
pub(crate) fn exception(error: &anyhow::Error) -> PyErr {
    let text = format!("{error:#}");
    if gridweave::is_bad_use(error) { RequestError::new_err(text) } else { GridweaveError::new_err(text) }
}
