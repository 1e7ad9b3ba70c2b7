//! `gridweave info`.

use crate::Outcome;
use crate::args::InfoArgs;
use crate::pipelines;
use anyhow::Result;
use gridweave_logs::info;
use gridweave_runtime::pipeline::Overrides;
use gridweave_runtime::stage::RobotTopics;

/// Shows what is in logs.
pub(crate) fn info(args: &InfoArgs) -> Result<Outcome> {
    let robots = match &args.pipeline {
        None => RobotTopics::default(),
        Some(path) => match pipelines::load(path, &Overrides::default())? {
            Some(pipeline) => pipeline.robots,
            None => return Ok(Outcome::BadUse),
        },
    };
    let found = info::inspect(&args.logs, &robots)?;
    match args.json {
        true => println!("{}", serde_json::to_string_pretty(&found)?),
        false => print!("{}", found.to_text()),
    }
    Ok(Outcome::Done)
}
