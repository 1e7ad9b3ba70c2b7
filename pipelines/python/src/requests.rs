//! Merges and other pipelines.

use crate::errors::exception;
use crate::grid::{self, Grid};
use crate::python_stage;
use crate::watched::{is_forked, watched};
use gridweave::merging::{self, MergeRequest, Merged};
use gridweave_runtime::engine::EngineKind;
use numpy::PyReadonlyArray2;
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;

/// The settings of a run, as on the command line.
#[pyclass(frozen)]
pub(crate) struct Request(MergeRequest);

#[pymethods]
impl Request {
    #[new]
    #[pyo3(signature = (*, reference, initial, accept, rename, lidar, literal_thresholds, settings, seed, output))]
    #[expect(clippy::too_many_arguments, reason = "each has its name in Python")]
    fn new(
        reference: Option<String>,
        initial: Vec<String>,
        accept: Vec<String>,
        rename: Vec<String>,
        lidar: Vec<String>,
        literal_thresholds: bool,
        settings: Vec<String>,
        seed: Option<u64>,
        output: Option<PathBuf>,
    ) -> Self {
        let engine = is_forked().then_some(EngineKind::Single);
        let set = settings;
        Self(MergeRequest { reference, initial, accept, rename, lidar, literal_thresholds, set, seed, engine, output })
    }
}

/// The summary as JSON, and the merged map.
type Answer<'py> = (String, Option<Grid<'py>>);

fn answer(py: Python<'_>, merged: anyhow::Result<Merged>) -> PyResult<Answer<'_>> {
    let Merged { summary, map } = merged.map_err(|error| exception(&error))?;
    Ok((summary.to_json(), map.map(|map| grid::into_array(py, map)).transpose()?))
}

/// Merges the maps in logs or map files.
#[pyfunction]
pub(crate) fn merge_files<'py>(
    py: Python<'py>,
    files: Vec<PathBuf>,
    request: &Request,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<Answer<'py>> {
    let merged = watched(py, progress, |observer| merging::merge_files(&files, &request.0, observer))?;
    answer(py, merged)
}

/// A map with the name of its robot: name, cells, resolution, origin.
type NamedGrid<'py> = (String, PyReadonlyArray2<'py, i8>, f64, (f64, f64, f64));

/// Merges maps, each with the name of its robot.
#[pyfunction]
pub(crate) fn merge_maps<'py>(
    py: Python<'py>,
    maps: Vec<NamedGrid<'py>>,
    request: &Request,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<Answer<'py>> {
    let named = |(name, cells, resolution, origin): NamedGrid<'py>| {
        Ok((name, Arc::new(grid::from_array(&cells, resolution, origin)?)))
    };
    let maps = maps.into_iter().map(named).collect::<PyResult<Vec<_>>>()?;
    let merged = watched(py, progress, |observer| merging::merge_maps(maps, &request.0, observer))?;
    answer(py, merged)
}

/// Runs a pipeline on files, with stages in this interpreter: the name of each kind, its interface as JSON, and a
/// function that makes one.
#[pyfunction]
pub(crate) fn run_pipeline<'py>(
    py: Python<'py>,
    pipeline: PathBuf,
    files: Vec<PathBuf>,
    request: &Request,
    stages: Vec<(String, String, Py<PyAny>)>,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<Answer<'py>> {
    let kinds = stages.into_iter().map(|(name, interface, make)| python_stage::kind(name, &interface, make));
    let kinds = kinds.collect::<PyResult<Vec<_>>>()?;
    let merged =
        watched(py, progress, |observer| merging::run_pipeline(&pipeline, &files, &request.0, kinds, observer))?;
    answer(py, merged)
}
