//! Marks on maps, in metres of the world.

use super::view::View;
use crate::drawing::{Colour, Group, Paint, Path, text};
use gridweave_runtime::covariance_ellipse::CovarianceEllipse;
use nalgebra::{Matrix2, Point2, Vector2};

/// Marks farther outside of the picture are not drawn, pixels.
const FARTHEST: f64 = 1e5;
const PAPER: Colour = [255, 255, 255];

/// Marks of one kind.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Marks {
    /// The text in the legend.
    pub name: String,
    /// The colour in the legend; `None` for no entry.
    pub legend: Option<Colour>,
    /// The marks.
    pub marks: Vec<Mark>,
}

/// One mark.
#[derive(Clone, Debug, PartialEq)]
pub struct Mark {
    /// The shape.
    pub shape: Shape,
    /// The colour.
    pub paint: Paint,
}

/// The shape of a mark, in metres of the world. Widths are in units of the picture's size: thin lines have the width 1.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A polyline.
    Line {
        /// The vertices.
        places: Vec<Point2<f64>>,
        /// The width.
        width: f64,
    },
    /// An ellipse of equal standard deviations about a position.
    Ellipse {
        /// The position.
        middle: Point2<f64>,
        /// The covariance, square metres.
        covariance: Matrix2<f64>,
        /// The number of standard deviations.
        deviations: f64,
    },
    /// An arrow.
    Arrow {
        /// The start.
        from: Point2<f64>,
        /// The tip.
        to: Point2<f64>,
    },
    /// A dot.
    Dot {
        /// The centre.
        at: Point2<f64>,
        /// The diameter.
        width: f64,
    },
    /// A text beside a position.
    Label {
        /// The position.
        at: Point2<f64>,
        /// The text.
        words: String,
    },
}

impl Marks {
    /// Converts the marks to shapes of a drawing, on an image whose corner is at `corner`.
    pub(super) fn draw(&self, view: &View, corner: Vector2<f64>) -> Group {
        let canvas = Canvas { view, corner, unit: view.unit() };
        let paths = self.marks.iter().flat_map(|mark| canvas.draw(mark).unwrap_or_default()).collect();
        Group { name: self.name.clone(), is_on_image: true, paths }
    }
}

/// The target of marks.
struct Canvas<'a> {
    view: &'a View,
    corner: Vector2<f64>,
    unit: f64,
}

impl Canvas<'_> {
    /// The pixel of a position; `None` if it is not finite, or far outside of the picture.
    fn pixel(&self, world: &Point2<f64>) -> Option<Point2<f64>> {
        let pixel = self.view.pixel(*world);
        (pixel.x.abs() < FARTHEST && pixel.y.abs() < FARTHEST).then_some(pixel + self.corner)
    }

    fn draw(&self, Mark { shape, paint }: &Mark) -> Option<Vec<Path>> {
        Some(match shape {
            Shape::Line { places, width } => {
                let pixels = places.iter().map(|place| self.pixel(place)).collect::<Vec<_>>();
                // A vertex that cannot be drawn interrupts the line.
                let parts = pixels.split(Option::is_none).filter(|part| part.len() > 1);
                let line = |part: &[Option<Point2<f64>>]| Path::lines(part.iter().copied().flatten());
                parts.map(|part| line(part).stroked(*paint, width * self.unit)).collect()
            }
            Shape::Ellipse { middle, covariance, deviations } => {
                let middle = self.pixel(middle)?;
                let ellipse = CovarianceEllipse::new(covariance, *deviations)?;
                let (sine, cosine) = ellipse.direction.sin_cos();
                let [first, second] = ellipse.half_axes.map(|half| half / self.view.metres_per_pixel);
                // Rows of pixels run downwards.
                let (first, second) = (Vector2::new(cosine, -sine) * first, Vector2::new(-sine, -cosine) * second);
                if first.norm().max(second.norm()) > FARTHEST {
                    return None;
                }
                let fill = Paint { opacity: 0.15 * paint.opacity, ..*paint };
                vec![Path::ellipse(middle, first, second).filled(fill).stroked(*paint, self.unit)]
            }
            Shape::Arrow { from, to } => self.arrow(self.pixel(from)?, self.pixel(to)?, *paint),
            Shape::Dot { at, width } => {
                let radius = width * self.unit / 2.0;
                vec![Path::circle(self.pixel(at)?, radius).filled(*paint).stroked(PAPER, self.unit * 0.4)]
            }
            Shape::Label { at, words } => {
                let size = text_size(self.unit) * 0.85;
                let start = self.pixel(at)? + Vector2::new(0.45, -0.35) * size;
                let letters = text(words, start, size);
                // A pale outline makes letters readable on any map.
                let edge = Paint { colour: PAPER, opacity: 0.8 };
                vec![letters.clone().stroked(edge, size * 0.2), letters.filled(*paint)]
            }
        })
    }

    fn arrow(&self, from: Point2<f64>, to: Point2<f64>, paint: Paint) -> Vec<Path> {
        let (along, width) = (to - from, 0.8 * self.unit);
        let length = along.norm();
        if length < width {
            return vec![Path::circle(from, width / 2.0).filled(paint)];
        }
        let head = (4.0 * self.unit).min(length * 0.6);
        let (back, side) = (along * (head / length), Vector2::new(along.y, -along.x) * (head * 0.4 / length));
        vec![
            Path::lines([from, to - back]).stroked(paint, width),
            Path::area([to, to - back + side, to - back - side]).filled(paint),
        ]
    }
}

/// The font size, pixels.
pub(super) fn text_size(unit: f64) -> f64 {
    (8.0 * unit).max(11.0)
}
