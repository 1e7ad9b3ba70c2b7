//! What a drawing consists of.

use nalgebra::{Point2, Vector2};

/// Red, green and blue.
pub type Colour = [u8; 3];

/// How much of a quarter circle's radius the handles of the curve are long that draws it.
const QUARTER: f64 = 0.552_284_75;

/// A colour that what lies below may shine through.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Paint {
    /// Its colour.
    pub colour: Colour,
    /// From 0, which cannot be seen, to 1, which hides what lies below.
    pub opacity: f64,
}

impl From<Colour> for Paint {
    fn from(colour: Colour) -> Self {
        Self { colour, opacity: 1.0 }
    }
}

/// A step of an outline, to a place in the drawing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Step {
    /// Begins another part of the outline.
    Move(Point2<f64>),
    /// A straight line.
    Line(Point2<f64>),
    /// A Bézier curve: two handles, and its end.
    Curve(Point2<f64>, Point2<f64>, Point2<f64>),
    /// Back to where the part began.
    Close,
}

impl Step {
    /// The places that it names.
    pub(super) fn places(&self) -> Vec<Point2<f64>> {
        match *self {
            Self::Move(place) | Self::Line(place) => vec![place],
            Self::Curve(first, second, end) => vec![first, second, end],
            Self::Close => Vec::new(),
        }
    }
}

/// An outline that is filled, drawn along, or both.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Path {
    /// Its steps.
    pub steps: Vec<Step>,
    /// What fills it.
    pub fill: Option<Paint>,
    /// What is drawn along it with round ends, and how wide that is.
    pub stroke: Option<(Paint, f64)>,
}

impl Path {
    /// Straight lines from place to place.
    pub fn lines(places: impl IntoIterator<Item = Point2<f64>>) -> Self {
        let mut steps: Vec<Step> = places.into_iter().map(Step::Line).collect();
        if let Some(Step::Line(place)) = steps.first().copied() {
            steps[0] = Step::Move(place);
        }
        Self { steps, ..Self::default() }
    }

    /// The same, and back to the first.
    pub fn area(places: impl IntoIterator<Item = Point2<f64>>) -> Self {
        let mut path = Self::lines(places);
        path.steps.push(Step::Close);
        path
    }

    /// An ellipse by its middle and its two half axes, which stand upright on each other.
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

    /// Filled with this.
    pub fn filled(self, fill: impl Into<Paint>) -> Self {
        Self { fill: Some(fill.into()), ..self }
    }

    /// Drawn along with this, so wide.
    pub fn stroked(self, stroke: impl Into<Paint>, width: f64) -> Self {
        Self { stroke: Some((stroke.into(), width)), ..self }
    }
}

/// Paths that belong together.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Group {
    /// What it shows, for programs that list the parts of a drawing.
    pub name: String,
    /// Whether only what lies on the image of the drawing is shown.
    pub is_on_image: bool,
    /// Its paths, one upon the other.
    pub paths: Vec<Path>,
}
