//! What a log records of the run that writes it, so that its results explain themselves.

use super::LOG_SINK;
use super::outputs::inputs;
use gridweave_logs::names::Input;
use gridweave_runtime::pipeline::{Pipeline, StageSpec};
use std::path::Path;
use toml::Value;

/// Tells the sinks of logs by what pipeline and from what files they write. Neither the place of a file nor anything of the
/// machine is told: the same run elsewhere gives the same log.
pub(super) fn record(pipeline: &mut Pipeline) {
    let mut recorded = pipeline.clone();
    recorded.stages.iter_mut().for_each(leave_places_out);
    let text = recorded.to_toml();
    let files: Vec<Value> = inputs(pipeline).iter().filter_map(|file| file.to_str()).map(Value::from).collect();
    for stage in pipeline.stages.iter_mut().filter(|stage| stage.kind.name == LOG_SINK) {
        stage.parameters.insert("recorded_pipeline".to_owned(), text.clone().into());
        stage.parameters.insert("recorded_files".to_owned(), files.clone().into());
    }
}

/// Of the files that a stage reads the names alone are kept, and of those that it writes nothing.
fn leave_places_out(stage: &mut StageSpec) {
    stage.parameters.remove("file");
    if let Some(Value::Array(files)) = stage.parameters.get_mut("files") {
        for file in files {
            let Some(Input { robot, path }) = file.as_str().map(|typed| Input::new(Path::new(typed))) else { continue };
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            *file = robot.map_or_else(|| name.to_string(), |robot| format!("{robot}={name}")).into();
        }
    }
}
