//! Tables and plots of what was measured.

use super::measure::Run;
use super::settings::Settings;
use super::{STYLES, Series};
use crate::plot::{Axis, Plot, Series as Curve, Shape};
use crate::results::Results;
use crate::statistics::{mean, quantile, standard_deviation};
use anyhow::Result;
use gridweave::table::Table;

/// The bins of a histogram.
const BINS: usize = 40;

/// The errors of the runs that found walls, degrees.
fn errors(runs: &[Run]) -> Vec<f64> {
    runs.iter().map(|run| run.error).filter(|error| error.is_finite()).collect()
}

/// A number of degrees, or a dash.
fn degrees(value: f64) -> String {
    if value.is_finite() { format!("{value:.4}") } else { "-".into() }
}

/// How exact each style is, under the parameters that ship and under the paper's.
pub(super) fn accuracy(series: &[Series], results: &mut Results) -> Result<()> {
    let mut table = Table::new([
        "walls",
        "maps",
        "mean error, deg",
        "std, deg",
        "max, deg",
        "reported std, deg",
        "not valid",
        "one map: mean error, deg",
        "one map: std, deg",
    ]);
    for Series { style, settings, maps, stage_seeds } in series.iter().filter(|series| !series.stage_seeds.is_empty()) {
        let (errors, one_map) = (errors(maps), errors(stage_seeds));
        let reported: Vec<f64> = maps.iter().map(|run| run.deviation).collect();
        table.row([
            format!("{settings}, {style}"),
            maps.len().to_string(),
            degrees(mean(&errors)),
            degrees(standard_deviation(&errors)),
            degrees(errors.iter().fold(0.0, |most, error| f64::max(most, error.abs()))),
            degrees(mean(&reported)),
            maps.iter().filter(|run| !run.valid).count().to_string(),
            degrees(mean(&one_map)),
            degrees(standard_deviation(&one_map)),
        ]);
    }
    // What section 5.1 says; its mean of the directions is -45.0497 degrees, the true one -45.
    let paper = ["as printed in the paper", "1", "", "", "", "", "", "-0.0497", "0.5598"];
    table.row(paper.map(str::to_owned));
    results.table("direction", "Direction of a map's walls", &table)
}

/// What the parts of the shipped parameters bring.
pub(super) fn ablations(series: &[Series], settings: &[Settings], results: &mut Results) -> Result<()> {
    let heads = std::iter::once("parameters").chain(STYLES.iter().map(|(_, style)| *style));
    let mut table = Table::new(heads);
    for settings in settings {
        let of_style = |style: &str| {
            let series = series.iter().find(|series| series.style == style && series.settings == settings.name);
            series.map_or(f64::NAN, |series| standard_deviation(&errors(&series.maps)))
        };
        let cells = STYLES.iter().map(|(_, style)| degrees(of_style(style)));
        table.row(std::iter::once(settings.name.to_owned()).chain(cells));
    }
    results.table("direction_parameters", "Standard deviation by parameters and walls, degrees", &table)
}

/// How the errors are spread.
pub(super) fn histograms(series: &[Series], results: &mut Results) -> Result<()> {
    const ERROR: &str = "error of the direction, degrees";
    let (shipped, paper) = (Settings::shipped().name, Settings::paper().name);
    let of = |settings: &str| -> Vec<(&str, Vec<f64>)> {
        let series = series.iter().filter(|series| series.settings == settings);
        series.map(|series| (series.style, errors(&series.maps))).collect()
    };
    if let Some((_, scanned)) = of(shipped).last() {
        let plot = Plot {
            title: "Errors of the direction, scanned maps".into(),
            x: Axis::new(ERROR),
            y: Axis::new("runs"),
            shape: Shape::histogram(scanned, BINS),
        };
        results.plot("direction_histogram", &plot)?;
    }
    let plot = outlines("Errors of the direction", ERROR, &of(shipped));
    results.plot("direction_histogram_styles", &plot)?;
    let plot = outlines("Errors of the direction, the paper's parameters", ERROR, &of(paper));
    results.plot("direction_histogram_paper", &plot)
}

/// The outlines of histograms over common bins, which leave out the last thousandth at either end.
fn outlines(title: &str, label: &str, values: &[(&str, Vec<f64>)]) -> Plot {
    let all: Vec<f64> = values.iter().flat_map(|(_, values)| values).copied().collect();
    let (low, high) = (quantile(&all, 0.001), quantile(&all, 0.999));
    let width = if high > low { (high - low) / BINS as f64 } else { 1.0 };
    let curves = values.iter().map(|(name, values)| {
        let mut counts = vec![0.0; BINS];
        for value in values.iter().filter(|value| (low..=high).contains(value)) {
            counts[(((value - low) / width) as usize).min(BINS - 1)] += 1.0;
        }
        let middle = |bin: usize| low + (bin as f64 + 0.5) * width;
        Curve::new(*name, counts.into_iter().enumerate().map(|(bin, count)| (middle(bin), count)).collect())
    });
    Plot { title: title.into(), x: Axis::new(label), y: Axis::new("runs"), shape: Shape::Lines(curves.collect()) }
}

/// All runs, one a row.
pub(super) fn all_runs(series: &[Series], results: &mut Results) -> Result<()> {
    let mut table = Table::new([
        "parameters",
        "walls",
        "runs over",
        "map seed",
        "stage seed",
        "error, deg",
        "reported std, deg",
        "valid",
        "segments",
    ]);
    for series in series {
        for (over, runs) in [("maps", &series.maps), ("stage seeds", &series.stage_seeds)] {
            for run in runs {
                table.row([
                    series.settings.to_owned(),
                    series.style.to_owned(),
                    over.to_owned(),
                    run.map_seed.to_string(),
                    run.stage_seed.to_string(),
                    format!("{:.5}", run.error),
                    format!("{:.5}", run.deviation),
                    run.valid.to_string(),
                    run.segments.to_string(),
                ]);
            }
        }
    }
    results.data("direction_runs", &table)
}

/// Mean error and standard deviation by the angle of the walls; `curves` holds for each style the errors at each angle.
pub(super) fn rotations(angles: &[f64], curves: &[(&str, Vec<Vec<f64>>)], results: &mut Results) -> Result<()> {
    let mut table = Table::new(["walls", "angle, deg", "maps", "mean error, deg", "std, deg"]);
    for (style, by_angle) in curves {
        for (angle, errors) in angles.iter().zip(by_angle) {
            table.row([
                (*style).to_owned(),
                angle.to_string(),
                errors.len().to_string(),
                degrees(mean(errors)),
                degrees(standard_deviation(errors)),
            ]);
        }
    }
    results.data("direction_rotations", &table)?;

    let mut worst =
        Table::new(["walls", "maps", "mean error, deg", "std, deg", "worst mean error, deg", "worst std, deg"]);
    for (style, by_angle) in curves {
        let all: Vec<f64> = by_angle.iter().flatten().copied().collect();
        let most = |statistic: fn(&[f64]) -> f64| by_angle.iter().map(|e| statistic(e).abs()).fold(0.0, f64::max);
        let cells = [mean(&all), standard_deviation(&all), most(mean), most(standard_deviation)].map(degrees);
        worst.row([(*style).to_owned(), all.len().to_string()].into_iter().chain(cells));
    }
    results.table("direction_over_rotations", "Over all angles from 0 to 89 degrees", &worst)?;

    for (name, title, label, statistic) in [
        (
            "direction_rotation_std",
            "Standard deviation by the angle of the walls",
            "standard deviation",
            standard_deviation as fn(&[f64]) -> f64,
        ),
        ("direction_rotation_mean", "Mean error by the angle of the walls", "mean error", mean),
    ] {
        let curve = |(style, by_angle): &(&str, Vec<Vec<f64>>)| {
            let points = angles.iter().zip(by_angle).map(|(&angle, errors)| (angle, statistic(errors)));
            Curve::new(*style, points.collect())
        };
        let plot = Plot {
            title: title.into(),
            x: Axis::new("angle of the walls, degrees"),
            y: Axis::new(format!("{label} of the direction, degrees")),
            shape: Shape::Lines(curves.iter().map(curve).collect()),
        };
        results.plot(name, &plot)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_within_the_bins_is_counted_under_its_own_name() {
        let values = [("one", vec![0.0, 1.0, 1.0, 2.0]), ("two", vec![0.5])];
        let Shape::Lines(curves) = outlines("t", "x", &values).shape else { panic!("curves") };
        let sums: Vec<f64> = curves.iter().map(|curve| curve.points.iter().map(|(_, count)| count).sum()).collect();
        assert_eq!(curves[0].points.len(), BINS);
        assert!(sums[0] >= 2.0 && sums[1] == 1.0, "{sums:?}");
    }

    #[test]
    fn curves_over_angles_hold_mean_and_deviation_of_each() {
        let folder = tempfile::TempDir::new().unwrap();
        let mut results = Results::new(folder.path()).unwrap();
        let curves = [("thin", vec![vec![0.1, 0.3], vec![-0.2, 0.0]])];
        rotations(&[0.0, 1.0], &curves, &mut results).unwrap();
        let csv = std::fs::read_to_string(folder.path().join("direction_rotations.csv")).unwrap();
        assert!(csv.contains("thin,0,2,0.2000,0.1414") && csv.contains("thin,1,2,-0.1000,0.1414"), "{csv}");
        let worst = std::fs::read_to_string(folder.path().join("direction_over_rotations.csv")).unwrap();
        assert!(worst.contains("thin,4,0.0500,0.2082,0.2000,0.1414"), "{worst}");
    }

    #[test]
    fn runs_without_walls_are_left_out_of_the_errors() {
        let run = |error: f64| Run {
            map_seed: 0,
            stage_seed: 0,
            error,
            deviation: 0.1,
            valid: error.is_finite(),
            segments: 3,
        };
        assert_eq!(errors(&[run(0.5), run(f64::NAN)]), [0.5]);
        assert_eq!(degrees(f64::NAN), "-");
    }
}
