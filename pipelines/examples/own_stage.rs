//! A user-defined stage: the command `gridweave` with one more stage kind, `map_inflater`.
//!
//!     cargo run --example own_stage -- kinds map_inflater
//!     cargo run --example own_stage -- golden --partial --cases pipelines/examples/own_stage_golden

use gridweave_runtime::ros::cell::is_occupied;
use gridweave_runtime::ros::{GridPrefix, OccupancyGrid};
use gridweave_runtime::stage::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

fn main() -> std::process::ExitCode {
    gridweave::command([kind()])
}

/// Parameters; `kinds` shows their doc comments and ranges.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct InflaterParameters {
    /// Cells nearer to an obstacle than this become occupied, metres: the radius of the robot.
    #[schemars(range(min = 0.01, max = 10.0))]
    radius: f64,
}

impl Default for InflaterParameters {
    fn default() -> Self {
        Self { radius: 0.2 }
    }
}

impl Parameters for InflaterParameters {}

/// Grows the obstacles of maps by the radius of a robot, so that its centre can be planned for as a point.
struct Inflater(InflaterParameters);

struct Inflated(Out<OccupancyGrid<'static>>);

impl Outputs for Inflated {
    fn declare(ports: &mut OutputPorts) -> Self {
        Self(ports.output("inflated", "the maps with grown obstacles"))
    }
}

impl Inflater {
    fn receive(&mut self, map: Received<'_, OccupancyGrid<'_>>, output: &Output<Inflated>) -> Result<(), StageError> {
        let (width, height) = (map.info.width as usize, map.info.height as usize);
        let resolution = f64::from(map.info.resolution);
        if width.checked_mul(height) != Some(map.cells().len()) || resolution.is_nan() || resolution <= 0.0 {
            output.warn("maps without width x height cells or without a resolution are left out");
            return Ok(());
        }
        let reach = ((self.0.radius / resolution) as usize).min(width.max(height)) as isize;
        let within = |x: isize, y: isize| ((x * x + y * y) as f64).sqrt() * resolution <= self.0.radius;
        let disc: Vec<(isize, isize)> = (-reach..=reach)
            .flat_map(|y| (-reach..=reach).map(move |x| (x, y)))
            .filter(|&(x, y)| within(x, y))
            .collect();
        let prefix = GridPrefix { header: map.header.clone(), info: map.info };
        output.0.send_grid(map.robot(), &prefix, |blank| {
            let mut filled = blank.copy_cells(map.cells())?;
            let cells = filled.cells_mut();
            for (at, _) in map.cells().iter().enumerate().filter(|(_, cell)| is_occupied(**cell)) {
                for (x, y) in &disc {
                    let (column, row) = ((at % width).checked_add_signed(*x), (at / width).checked_add_signed(*y));
                    if let (Some(column), Some(row)) = (column.filter(|&c| c < width), row.filter(|&r| r < height)) {
                        cells[row * width + column] = 100;
                    }
                }
            }
            Ok(filled)
        })
    }
}

fn kind() -> StageKind {
    let make = |parameters: InflaterParameters, _: &Context| Ok(Inflater(parameters));
    StageKind::stage("map_inflater", "Grows the obstacles of maps by the radius of a robot.", make)
        .input("map", "the robots' maps", Inflater::receive)
        .build()
}
