//! Many robots in one building: time and accuracy.

use super::worlds::{MANY_ROBOTS, Seeds};
use crate::results::Results;
use crate::statistics::{median, quantile};
use crate::trial::World;
use anyhow::Result;
use gridweave::evaluate::RobotOutcome;
use gridweave::table::Table;
use gridweave_runtime::stage::Registry;

/// Metres of the building's width for each robot, up to the most that there are.
const WIDTH_PER_ROBOT: f64 = 5.0;
/// Height of a building with few robots, metres.
const HEIGHT: f64 = 28.0;
/// The building is made higher, not wider, beyond this width, metres.
const WIDEST: f64 = 80.0;

/// Merges the maps of so many robots, in a building that grows with their number, and reports time and accuracy.
pub(super) fn run(
    teams: &[u32],
    seeds: Seeds,
    pipeline: &str,
    registry: &Registry,
    results: &mut Results,
) -> Result<()> {
    if teams.is_empty() {
        return Ok(());
    }
    let mut table = Table::new([
        "robots",
        "building m",
        "right",
        "wrong",
        "refused",
        "error m, median",
        "worst",
        "error deg, median",
        "worst",
        "aligner s",
        "icp s",
        "verifier s",
        "frames s",
        "fuser s",
        "all s",
        "searches",
    ]);
    for &robots in teams {
        let area = WIDTH_PER_ROBOT * HEIGHT * f64::from(robots);
        let width = (area / HEIGHT).clamp(24.0, WIDEST);
        let height = (area / width).max(HEIGHT);
        let settings = [
            format!("robots={robots}"),
            format!("width={width:.0}"),
            format!("height={height:.0}"),
            "tags=0".to_owned(),
            "snapshots=1".to_owned(),
            "overlap=0.8".to_owned(),
        ];
        let world = World::simulate(&settings, seeds.seed(MANY_ROBOTS, u64::from(robots)), registry)?;
        let merge = world.merge(pipeline, &[], registry)?;
        let all = &merge.evaluation.robots;
        let count = |outcome: RobotOutcome| all.iter().filter(|robot| robot.outcome == outcome).count().to_string();
        let metres: Vec<f64> = all.iter().filter_map(|robot| robot.error_m).collect();
        let degrees: Vec<f64> = all.iter().filter_map(|robot| robot.error_deg).collect();
        let seconds = |name: &str| {
            let stages = merge.report.stages.iter().filter(|stage| stage.name == name);
            stages.map(|stage| stage.busy.as_secs_f64()).sum::<f64>()
        };
        let total: f64 = merge.report.stages.iter().map(|stage| stage.busy.as_secs_f64()).sum();
        let searches = merge.report.stages.iter().find_map(|stage| stage.counts.get("searches"));
        let number = |value: f64| if value.is_finite() { format!("{value:.3}") } else { "-".to_owned() };
        let outcomes = [RobotOutcome::Right, RobotOutcome::Wrong, RobotOutcome::Refused].map(count);
        let errors = [median(&metres), quantile(&metres, 1.0), median(&degrees), quantile(&degrees, 1.0)].map(number);
        let times = ["aligner", "icp", "verifier", "frames", "fuser"].map(|stage| format!("{:.2}", seconds(stage)));
        table.row(
            [robots.to_string(), format!("{width:.0} x {height:.0}")]
                .into_iter()
                .chain(outcomes)
                .chain(errors)
                .chain(times)
                .chain([format!("{total:.2}"), searches.map_or_else(String::new, |count| count.to_string())]),
        );
    }
    results.table("align_teams", "Teams: many robots in one building", &table)
}
