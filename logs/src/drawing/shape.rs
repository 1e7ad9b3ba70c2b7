//! The shapes of a drawing.

use nalgebra::{Point2, Vector2};

/// Red, green and blue.
pub type Colour = [u8; 3];

/// The length of the handles of the Bézier curve that approximates a quarter circle of radius 1.
const QUARTER: f64 = 0.552_284_75;

/// A colour with an opacity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Paint {
    /// The colour.
    pub colour: Colour,
    /// The opacity, from 0 (invisible) to 1 (opaque).
    pub opacity: f64,
}

impl From<Colour> for Paint {
    fn from(colour: Colour) -> Self {
        Self { colour, opacity: 1.0 }
    }
}

/// A segment of a path, to a position in the drawing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Step {
    /// Starts another part of the path.
    Move(Point2<f64>),
    /// A straight line.
    Line(Point2<f64>),
    /// A Bézier curve: two control points, and the end.
    Curve(Point2<f64>, Point2<f64>, Point2<f64>),
    /// Back to the start of the part.
    Close,
}

impl Step {
    /// The positions in the segment.
    pub(super) fn places(&self) -> Vec<Point2<f64>> {
        match *self {
            Self::Move(place) | Self::Line(place) => vec![place],
            Self::Curve(first, second, end) => vec![first, second, end],
            Self::Close => Vec::new(),
        }
    }
}

/// A path that is filled, stroked, or both.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Path {
    /// The segments.
    pub steps: Vec<Step>,
    /// The fill, if any.
    pub fill: Option<Paint>,
    /// The stroke with round ends, and its width, if any.
    pub stroke: Option<(Paint, f64)>,
}

impl Path {
    /// A polyline.
    pub fn lines(places: impl IntoIterator<Item = Point2<f64>>) -> Self {
        let mut steps: Vec<Step> = places.into_iter().map(Step::Line).collect();
        if let Some(Step::Line(place)) = steps.first().copied() {
            steps[0] = Step::Move(place);
        }
        Self { steps, ..Self::default() }
    }

    /// A polygon.
    pub fn area(places: impl IntoIterator<Item = Point2<f64>>) -> Self {
        let mut path = Self::lines(places);
        path.steps.push(Step::Close);
        path
    }

    /// An ellipse, by its centre and its two semi-axes, which are perpendicular.
    pub fn ellipse(middle: Point2<f64>, first: Vector2<f64>, second: Vector2<f64>) -> Self {
        let corner = |along: Vector2<f64>, then: Vector2<f64>| {
            Step::Curve(middle + along + then * QUARTER, middle + then + along * QUARTER, middle + then)
        };
        let start = Step::Move(middle + first);
        let steps = vec![
            start,
            corner(first, second),
            corner(second, -first),
            corner(-first, -second),
            corner(-second, first),
            Step::Close,
        ];
        Self { steps, ..Self::default() }
    }

    /// A circle.
    pub fn circle(middle: Point2<f64>, radius: f64) -> Self {
        Self::ellipse(middle, Vector2::x() * radius, Vector2::y() * radius)
    }

    /// The same path with a fill.
    pub fn filled(self, fill: impl Into<Paint>) -> Self {
        Self { fill: Some(fill.into()), ..self }
    }

    /// The same path with a stroke of the given width.
    pub fn stroked(self, stroke: impl Into<Paint>, width: f64) -> Self {
        Self { stroke: Some((stroke.into(), width)), ..self }
    }
}

/// A group of paths.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Group {
    /// The name, for programs that list the parts of a drawing.
    pub name: String,
    /// Whether the paths are clipped to the image of the drawing.
    pub is_on_image: bool,
    /// The paths, in drawing order.
    pub paths: Vec<Path>,
}
