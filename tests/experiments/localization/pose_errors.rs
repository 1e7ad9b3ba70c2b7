//! Poses that are wrong, with and without a covariance that says so.

use super::super::plot::{Axis, Plot, Series, Shape};
use super::super::results::Results;
use super::drive::Drive;
use super::score::Score;
use super::trial::{Conditions, Likelihood, PoseError, final_outcomes};
use anyhow::Result;
use gridweave::table::Table;
use gridweave_stages::tags::tag_localizer::Readout;

const STDDEVS: [f64; 5] = [0.0, 0.02, 0.05, 0.1, 0.2];

/// Scores whole drives with poses that get worse.
pub(super) fn run(seeds: u64, results: &mut Results) -> Result<()> {
    let heads = ["pose errors", "covariance", "drive", "stddev of poses, m"];
    let mut table = Table::new(heads.into_iter().chain(Score::HEADS));
    let mut curves = Vec::new();
    let parameters = Likelihood::Default.parameters(Readout::Window);
    for pose_error in PoseError::ALL {
        for is_known in [false, true] {
            let known = if is_known { "told" } else { "not told" };
            for drive in [Drive::Curved, Drive::Straight] {
                let mut points = Vec::new();
                for pose_stddev in STDDEVS {
                    let conditions = Conditions { pose_error, pose_stddev, is_known, ..Default::default() };
                    let score = Score::new(&final_outcomes(drive, &conditions, &parameters, seeds));
                    let names = [pose_error.name(), known, drive.name()].map(str::to_owned);
                    table.row(names.into_iter().chain([format!("{pose_stddev:.2}")]).chain(score.cells()));
                    points.push((pose_stddev, score.in_ellipse));
                }
                if drive == Drive::Curved {
                    curves.push(Series::new(format!("{}, {known}", pose_error.name()), points));
                }
            }
        }
    }
    results.table("localization_poses", "300 readings at poses that are wrong:", &table)?;
    results.plot(
        "localization_poses",
        &Plot {
            title: "How often the 95 % ellipse holds the tag: curved drive, wrong poses".into(),
            x: Axis::new("standard deviation of the poses, m").range(0.0, 0.2),
            y: Axis::new("share of tags in the ellipse").range(0.0, 1.0),
            shape: Shape::Lines(curves),
        },
    )
}
