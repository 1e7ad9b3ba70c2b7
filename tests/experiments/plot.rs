//! Curves and histograms as SVG.

use anyhow::{Result, anyhow, bail};
use plotters::coord::ranged1d::{KeyPointHint, Ranged};
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use std::ops::Range;

const WIDTH: u32 = 720;
const HEIGHT: u32 = 440;
/// Colours that can also be distinguished with colour vision deficiency (Okabe and Ito).
const COLOURS: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
];

const GRID: RGBColor = RGBColor(208, 208, 208);

/// How one axis is drawn.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    label: String,
    from: Option<f64>,
    to: Option<f64>,
    logarithmic: bool,
}

impl Axis {
    /// An axis as long as its data, with a label that names the unit.
    pub(super) fn new(label: impl Into<String>) -> Self {
        Self { label: label.into(), from: None, to: None, logarithmic: false }
    }

    /// The same axis from one value to another.
    #[must_use]
    pub(super) fn range(mut self, from: f64, to: f64) -> Self {
        (self.from, self.to) = (Some(from), Some(to));
        self
    }

    /// The same axis in powers of ten. Values of 0 and less are left out.
    #[must_use]
    pub(super) fn logarithmic(mut self) -> Self {
        self.logarithmic = true;
        self
    }

    fn place(&self, value: f64) -> f64 {
        if self.logarithmic { value.log10() } else { value }
    }

    /// The axis that holds all values, as it is drawn.
    fn over(&self, values: impl Iterator<Item = f64> + Clone) -> ScaledAxis {
        let places = values.map(|value| self.place(value)).filter(|place| place.is_finite());
        let low = self.from.map_or_else(|| places.clone().fold(f64::INFINITY, f64::min), |from| self.place(from));
        let high = self.to.map_or_else(|| places.fold(f64::NEG_INFINITY, f64::max), |to| self.place(to));
        let (low, high) = if low.is_finite() && high.is_finite() { (low, high) } else { (0.0, 1.0) };
        let (low, high) = if high > low { (low, high) } else { (low - 0.5, low + 0.5) };
        ScaledAxis { low, high, logarithmic: self.logarithmic }
    }
}

/// An axis from one place to another.
#[derive(Clone, Copy, Debug)]
struct ScaledAxis {
    low: f64,
    high: f64,
    logarithmic: bool,
}

impl ScaledAxis {
    /// The text at a tick.
    fn tick(&self, place: f64) -> String {
        let value = if self.logarithmic { 10f64.powf(place) } else { place };
        let text = match value.abs() {
            size if size == 0.0 || (1e-3..1e5).contains(&size) => format!("{value:.4}"),
            _ => return format!("{value:.0e}"),
        };
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    }
}

impl Ranged for ScaledAxis {
    type FormatOption = plotters::coord::ranged1d::DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        RangedCoordf64::from(self.low..self.high).map(value, limit)
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        if !self.logarithmic {
            return RangedCoordf64::from(self.low..self.high).key_points(hint);
        }
        let decades = (self.low.floor() as i32)..=(self.high.ceil() as i32);
        let steps: &[f64] = if self.high - self.low > 3.0 { &[1.0] } else { &[1.0, 2.0, 5.0] };
        let places = decades.flat_map(|decade| steps.iter().map(move |step| step.log10() + f64::from(decade)));
        places.filter(|place| (self.low - 1e-9..=self.high + 1e-9).contains(place)).collect()
    }

    fn range(&self) -> Range<f64> {
        self.low..self.high
    }
}

/// One curve.
#[derive(Clone, Debug)]
pub(super) struct Series {
    /// What the legend calls it.
    pub(super) name: String,
    /// Its points, in the units of the axes.
    pub(super) points: Vec<(f64, f64)>,
    /// Where each point may lie as well: (x, lowest y, highest y). None draws no band.
    pub(super) band: Vec<(f64, f64, f64)>,
    /// Where a dashed line stands upright in the curve's colour, in the unit of the x axis.
    pub(super) mark: Option<f64>,
}

impl Series {
    /// A curve without a band.
    pub(super) fn new(name: impl Into<String>, points: Vec<(f64, f64)>) -> Self {
        Self { name: name.into(), points, band: Vec::new(), mark: None }
    }

    /// The same curve with a band.
    #[must_use]
    pub(super) fn with_band(mut self, band: Vec<(f64, f64, f64)>) -> Self {
        self.band = band;
        self
    }

    /// The same curve with an upright dashed line.
    #[must_use]
    pub(super) fn with_mark(mut self, x: f64) -> Self {
        self.mark = Some(x);
        self
    }
}

/// What is drawn.
#[derive(Clone, Debug)]
pub(super) enum Shape {
    /// Curves with a mark at each point.
    Lines(Vec<Series>),
    /// How many values fall between neighbouring edges: `edges` has one more than `counts`.
    Histogram {
        /// Rising, in the unit of the x axis.
        edges: Vec<f64>,
        /// How many values.
        counts: Vec<usize>,
    },
}

impl Shape {
    /// A histogram of values, with bins of one width from the least value to the greatest.
    pub(super) fn histogram(values: &[f64], bins: usize) -> Self {
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let bins = bins.max(1);
        let width = if high > low { (high - low) / bins as f64 } else { 1.0 };
        let mut counts = vec![0; bins];
        for value in values.iter().filter(|value| value.is_finite()) {
            counts[(((value - low) / width) as usize).min(bins - 1)] += 1;
        }
        Self::Histogram { edges: (0..=bins).map(|bin| low + bin as f64 * width).collect(), counts }
    }
}

/// A plot.
#[derive(Clone, Debug)]
pub(super) struct Plot {
    /// The heading.
    pub(super) title: String,
    /// The horizontal axis.
    pub(super) x: Axis,
    /// The vertical axis.
    pub(super) y: Axis,
    /// What is drawn.
    pub(super) shape: Shape,
}

impl Plot {
    /// The plot as the text of an SVG file.
    pub(super) fn to_svg(&self) -> Result<String> {
        let mut svg = String::new();
        {
            let area = SVGBackend::with_string(&mut svg, (WIDTH, HEIGHT)).into_drawing_area();
            area.fill(&WHITE).map_err(plain)?;
            self.draw(&area)?;
            area.present().map_err(plain)?;
        }
        Ok(svg)
    }

    fn draw<B: DrawingBackend>(&self, area: &DrawingArea<B, plotters::coord::Shift>) -> Result<()> {
        let (x, y) = self.axes()?;
        let mut chart = ChartBuilder::on(area)
            .caption(&self.title, ("sans-serif", 18))
            .margin(12)
            .x_label_area_size(44)
            .y_label_area_size(64)
            .build_cartesian_2d(x, y)
            .map_err(plain)?;
        chart
            .configure_mesh()
            .x_desc(&self.x.label)
            .y_desc(&self.y.label)
            .x_label_formatter(&|place| x.tick(*place))
            .y_label_formatter(&|place| y.tick(*place))
            .label_style(("sans-serif", 13))
            .light_line_style(TRANSPARENT)
            .bold_line_style(GRID)
            .draw()
            .map_err(plain)?;
        match &self.shape {
            Shape::Histogram { edges, counts } => {
                let bars = edges.windows(2).zip(counts).map(|(edge, count)| {
                    Rectangle::new([(edge[0], 0.0), (edge[1], *count as f64)], COLOURS[0].mix(0.8).filled())
                });
                chart.draw_series(bars).map_err(plain)?;
            }
            Shape::Lines(series) => {
                // The curves' points as shares of the width and the height of the plot.
                let mut drawn: Vec<(f64, f64)> = Vec::new();
                let share = |range: Range<f64>| move |place: f64| (place - range.start) / (range.end - range.start);
                let (x_place, y_place) = (share(chart.x_range()), share(chart.y_range()));
                for (series, colour) in series.iter().zip(COLOURS.iter().cycle().copied()) {
                    let place = |(x, y): (f64, f64)| (self.x.place(x), self.y.place(y));
                    let is_drawn = |(x, y): &(f64, f64)| x.is_finite() && y.is_finite();
                    let points: Vec<_> = series.points.iter().copied().map(place).filter(is_drawn).collect();
                    if !series.band.is_empty() {
                        let upper = series.band.iter().map(|&(x, _, high)| (x, high));
                        let lower = series.band.iter().rev().map(|&(x, low, _)| (x, low));
                        let outline: Vec<_> = upper.chain(lower).map(place).filter(is_drawn).collect();
                        chart.draw_series([Polygon::new(outline, colour.mix(0.15))]).map_err(plain)?;
                    }
                    if let Some(mark) = series.mark.map(|mark| self.x.place(mark)) {
                        let Range { start, end } = chart.y_range();
                        let upright = [(mark, start), (mark, end)];
                        let dashed = DashedLineSeries::new(upright, 6, 4, colour.stroke_width(1));
                        chart.draw_series(dashed).map_err(plain)?;
                    }
                    drawn.extend(points.iter().map(|&(x, y)| (x_place(x), y_place(y))));
                    chart
                        .draw_series(LineSeries::new(points.iter().copied(), colour.stroke_width(2)))
                        .map_err(plain)?
                        .label(&series.name)
                        .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], colour.stroke_width(2)));
                    let marks = points.iter().map(|point| Circle::new(*point, 3, colour.filled()));
                    chart.draw_series(marks).map_err(plain)?;
                }
                if series.len() > 1 {
                    chart
                        .configure_series_labels()
                        .position(emptiest_corner(&drawn))
                        .background_style(WHITE.mix(0.85))
                        .border_style(GRID)
                        .label_font(("sans-serif", 13))
                        .draw()
                        .map_err(plain)?;
                }
            }
        }
        Ok(())
    }

    fn axes(&self) -> Result<(ScaledAxis, ScaledAxis)> {
        match &self.shape {
            Shape::Histogram { edges, counts } => {
                if edges.len() != counts.len() + 1 {
                    bail!("a histogram needs one edge more than counts");
                }
                let tallest = counts.iter().copied().max().unwrap_or(1) as f64;
                let y = Axis { from: Some(0.0), ..self.y.clone() };
                Ok((self.x.over(edges.iter().copied()), y.over([0.0, 1.05 * tallest].into_iter())))
            }
            Shape::Lines(series) => {
                let points = series.iter().flat_map(|series| {
                    let band = series.band.iter().flat_map(|&(x, low, high)| [(x, low), (x, high)]);
                    series.points.iter().copied().chain(band)
                });
                let marks = series.iter().filter_map(|series| series.mark);
                let x = points.clone().map(|(x, _)| x).chain(marks);
                Ok((self.x.over(x), self.y.over(points.map(|(_, y)| y))))
            }
        }
    }
}

/// The corner of the plot that holds fewest of the points, which are shares of its width and height; of several the
/// first here.
fn emptiest_corner(points: &[(f64, f64)]) -> SeriesLabelPosition {
    let corners = [
        (SeriesLabelPosition::UpperRight, 0.75, 0.75),
        (SeriesLabelPosition::UpperLeft, 0.25, 0.75),
        (SeriesLabelPosition::LowerRight, 0.75, 0.25),
        (SeriesLabelPosition::LowerLeft, 0.25, 0.25),
    ];
    let near =
        |x: f64, y: f64| points.iter().filter(|point| (point.0 - x).abs() < 0.25 && (point.1 - y).abs() < 0.25).count();
    let emptiest = corners.into_iter().min_by_key(|&(_, x, y)| near(x, y));
    emptiest.map_or(SeriesLabelPosition::UpperRight, |(position, ..)| position)
}

fn plain<E: std::fmt::Display>(error: E) -> anyhow::Error {
    anyhow!("{error}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plot(shape: Shape, y: Axis) -> String {
        Plot { title: "a title".into(), x: Axis::new("way, m"), y, shape }.to_svg().unwrap()
    }

    #[test]
    fn curves_have_labels_and_a_legend() {
        let series = [("one", 1.0), ("two", 10.0)].map(|(name, factor)| {
            let points = (1..5).map(|x| (f64::from(x), factor * f64::from(x))).collect();
            Series::new(name, points).with_band(vec![(1.0, 0.5, 2.0), (4.0, 3.0, 6.0)])
        });
        let svg = plot(Shape::Lines(series.to_vec()), Axis::new("error, m").logarithmic());
        for part in ["<svg", "a title", "way, m", "error, m", "one", "two", "</svg>"] {
            assert!(svg.contains(part), "no {part} in {svg}");
        }
    }

    #[test]
    fn a_mark_beyond_the_curve_is_on_the_axis() {
        let series = |mark: fn(Series) -> Series| mark(Series::new("one", vec![(1.0, 1.0), (2.0, 2.0)]));
        let svg = |series| plot(Shape::Lines(vec![series]), Axis::new("error, m"));
        let (with, without) = (svg(series(|one| one.with_mark(100.0))), svg(series(|one| one)));
        assert!(with.contains(">\n80\n") && !without.contains(">\n80\n"), "{with}");
        assert!(with.len() > without.len() + 1000, "it is dashed");
    }

    #[test]
    fn the_legend_takes_the_emptiest_corner() {
        let at = |points: &[(f64, f64)]| emptiest_corner(points);
        assert!(matches!(at(&[]), SeriesLabelPosition::UpperRight));
        assert!(matches!(at(&[(0.9, 0.9), (0.6, 0.9), (0.1, 0.9)]), SeriesLabelPosition::LowerRight));
        assert!(matches!(at(&[(0.9, 0.9), (0.1, 0.9), (0.8, 0.1)]), SeriesLabelPosition::LowerLeft));
    }

    #[test]
    fn every_value_is_counted_once() {
        let Shape::Histogram { edges, counts } = Shape::histogram(&[0.0, 0.1, 0.5, 1.0, 1.0], 4) else { panic!() };
        assert_eq!((edges.len(), counts), (5, vec![2, 0, 1, 2]));
    }

    #[test]
    fn what_cannot_be_drawn_is_left_out() {
        for values in [vec![], vec![(f64::NAN, 1.0), (1.0, f64::INFINITY)], vec![(1.0, 0.0)]] {
            let shape = Shape::Lines(vec![Series::new("a", values)]);
            assert!(plot(shape, Axis::new("y").logarithmic()).contains("</svg>"));
        }
        assert!(plot(Shape::histogram(&[], 3), Axis::new("n")).contains("</svg>"));
    }
}
