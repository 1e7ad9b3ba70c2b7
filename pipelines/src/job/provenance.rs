//! Record in a log of the run that has written it, so that its results can be reproduced.

use super::LOG_SINK;
use super::outputs::inputs;
use gridweave_logs::names::Input;
use gridweave_runtime::pipeline::{Pipeline, StageSpec};
use std::path::Path;
use toml::Value;

/// Passes the pipeline and the names of the input files to the log sinks. Paths and properties of the machine are left
/// out, so that the same run elsewhere gives the same log.
pub(super) fn record(pipeline: &mut Pipeline) {
    let mut recorded = pipeline.clone();
    recorded.stages.iter_mut().for_each(remove_paths);
    let text = recorded.to_toml();
    let files: Vec<Value> = inputs(pipeline).iter().filter_map(|file| file.to_str()).map(Value::from).collect();
    for stage in pipeline.stages.iter_mut().filter(|stage| stage.kind.name == LOG_SINK) {
        stage.parameters.insert("recorded_pipeline".to_owned(), text.clone().into());
        stage.parameters.insert("recorded_files".to_owned(), files.clone().into());
    }
}

/// Removes the output file of a stage and the folders of its input files.
fn remove_paths(stage: &mut StageSpec) {
    stage.parameters.remove("file");
    if let Some(Value::Array(files)) = stage.parameters.get_mut("files") {
        for file in files {
            let Some(Input { robot, path }) = file.as_str().map(|typed| Input::new(Path::new(typed))) else { continue };
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            *file = robot.map_or_else(|| name.to_string(), |robot| format!("{robot}={name}")).into();
        }
    }
}
