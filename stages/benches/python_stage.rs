//! What a call of a stage in Python takes: a map goes in, and the same map comes out.
//!
//!     cargo bench -p gridweave-stages --bench python_stage
//!
//! `python3` in PATH must have the package of `stages/python`.

#![allow(clippy::unwrap_used, clippy::print_stdout)]

use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::{MapMetaData, OccupancyGrid};
use gridweave_runtime::stage::LoneStage;
use std::path::Path;
use std::time::{Duration, Instant};

const MODULE: &str = "
from gridweave import stage
from gridweave.msg.nav_msgs import OccupancyGrid

@stage
def same(map: OccupancyGrid) -> OccupancyGrid:
    return map

@stage
def nothing(map: OccupancyGrid) -> OccupancyGrid | None:
    return None
";
/// The cells of the maps.
const CELLS: [usize; 4] = [64, 64 << 10, 1 << 20, 16 << 20];
/// For so long each is measured.
const TIME: Duration = Duration::from_secs(3);

fn main() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("bench.py");
    std::fs::write(&file, MODULE).unwrap();
    println!("| cells | stage | calls/s | p50, us | p99, us |\n| --- | --- | --- | --- | --- |");
    for (cells, name) in CELLS.iter().flat_map(|cells| [(*cells, "nothing"), (*cells, "same")]) {
        let module = format!("{}:{name}", file.display());
        let given = [("module".to_owned(), module.into())].into_iter().collect();
        let asked = gridweave_stages::python_stage::kind().ask(&given, Path::new("")).unwrap().unwrap();
        let mut stage = LoneStage::new(asked.kind, &asked.parameters.to_string()).unwrap();
        let data = vec![0; cells];
        let info = MapMetaData { width: cells as u32, height: 1, resolution: 0.05, ..Default::default() };
        let map = OccupancyGrid { header: Default::default(), info, data: &data };
        let bytes = gridweave_runtime::ros::encode(&map).unwrap();
        let mut times = Vec::new();
        let (begin, warm_up) = (Instant::now(), 20);
        for number in 0.. {
            // What a message costs before it is given is not that of the call.
            let message = bytes.clone();
            let start = Instant::now();
            stage.give_bytes("map", "robot1", LogTime(number), message).unwrap();
            if number >= warm_up {
                times.push(start.elapsed());
            }
            assert_eq!(stage.take_messages("out").len(), usize::from(name == "same"));
            if begin.elapsed() > TIME && times.len() > 10 {
                break;
            }
        }
        times.sort();
        let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize].as_secs_f64() * 1e6;
        let per_second = times.len() as f64 / times.iter().sum::<Duration>().as_secs_f64();
        println!("| {cells} | {name} | {per_second:.0} | {:.0} | {:.0} |", at(0.5), at(0.99));
    }
}
