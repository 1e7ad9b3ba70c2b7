//! Options that give something of one robot, `ROBOT=VALUE`, as parameters of stages.

use super::Job;
use super::inputs::Inputs;
use crate::status::BadUse;
use gridweave_runtime::stage::InitialPose;
use toml::{Table, Value};

/// The hypotheses that the user accepts, a parameter of the verifier.
pub(super) fn accepted(job: &Job<'_>) -> Result<Table, BadUse> {
    let form =
        "ROBOT=N for a hypothesis that a refusal has listed, from 1, or ROBOT=initial for its initial pose as it is";
    read(job, "accept", &job.options.accept, form, |number| {
        let number = if number == "initial" { 0 } else { number.parse().ok().filter(|number| *number > 0)? };
        Some(Value::Integer(number))
    })
}

/// The resolutions of maps, a parameter of their source.
pub(super) fn resolutions(job: &Job<'_>) -> Result<Table, BadUse> {
    if job.kind == Inputs::TopologyFiles {
        return Err(BadUse("--resolution is for maps, and topological maps have none".to_owned()));
    }
    read(job, "resolution", &job.options.resolution, "ROBOT=METRES for the side of a cell, above 0", |side| {
        let side: f64 = side.parse().ok()?;
        (side.is_finite() && side > 0.0).then_some(Value::Float(side))
    })
}

/// The poses of lidars on their robots, a parameter of the source of logs.
pub(super) fn lidars(job: &Job<'_>) -> Result<Table, BadUse> {
    if !job.inputs.is_empty() && job.kind != Inputs::Logs {
        return Err(BadUse("--lidar is for logs with scans, and the inputs are others".to_owned()));
    }
    let form = "ROBOT=X,Y,YAW or ROBOT=X,Y,YAW,ROLL in metres and radians (90 degrees are 1.5708)";
    read(job, "lidar", &job.options.lidar, form, |pose| {
        let number = |text: &str| text.trim().parse().ok().filter(|value: &f64| value.is_finite()).map(Value::Float);
        let numbers: Vec<Value> = pose.split(',').map(number).collect::<Option<_>>()?;
        let is_angle = |value: &Value| value.as_float().is_some_and(|value| value.abs() <= InitialPose::FULL_TURN);
        (matches!(numbers.len(), 3 | 4) && numbers[2..].iter().all(is_angle)).then_some(Value::Array(numbers))
    })
}

fn read(
    job: &Job<'_>,
    option: &str,
    typed: &[String],
    form: &str,
    value_of: impl Fn(&str) -> Option<Value>,
) -> Result<Table, BadUse> {
    let entry = |typed: &String| {
        let read = typed.rsplit_once('=').and_then(|(robot, value)| Some((job.robot(robot), value_of(value)?)));
        read.ok_or_else(|| BadUse(format!("`--{option} {typed}` is wrong: write {form}")))
    };
    typed.iter().map(entry).collect()
}
