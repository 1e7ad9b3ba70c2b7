//! Text as outlines of its letters.

use super::{Path, Step};
use nalgebra::Point2;
use ttf_parser::{Face, OutlineBuilder};

/// DejaVu Sans with its Latin, Greek and Cyrillic letters; see `fonts/README.md`.
const FONT: &[u8] = include_bytes!("../../fonts/DejaVuSans-subset.ttf");
/// The maximum number of letters; longer texts are cut, since texts from a log may have any length.
const MOST_LETTERS: usize = 200;

/// The outlines of a text with its baseline at `start`, with capital letters about 0.7 `size` high. Letters that are
/// missing in the font are boxes.
pub fn text(words: &str, start: Point2<f64>, size: f64) -> Path {
    let mut outline = Outline { steps: Vec::new(), scale: 0.0, start };
    for_each_letter(words, |face, glyph, along, scale| {
        (outline.scale, outline.start.x) = (scale * size, start.x + along * size);
        // A letter without an outline, such as a space, is skipped.
        let _ = face.outline_glyph(glyph, &mut outline);
    });
    Path { steps: outline.steps, ..Path::default() }
}

/// The width of a text.
pub fn text_width(words: &str, size: f64) -> f64 {
    for_each_letter(words, |_, _, _, _| {}) * size
}

/// Calls `each` with each letter, its position along the baseline and the size of a font unit. These and the returned
/// width are for a size of 1.
fn for_each_letter(words: &str, mut each: impl FnMut(&Face<'_>, ttf_parser::GlyphId, f64, f64)) -> f64 {
    // The font is embedded, and a test loads it.
    let Ok(face) = Face::parse(FONT, 0) else { return 0.0 };
    let scale = 1.0 / f64::from(face.units_per_em());
    let mut along = 0.0;
    for letter in words.chars().filter(|letter| !letter.is_control()).take(MOST_LETTERS) {
        let glyph = face.glyph_index(letter).unwrap_or_default();
        each(&face, glyph, along, scale);
        along += f64::from(face.glyph_hor_advance(glyph).unwrap_or_default()) * scale;
    }
    along
}

struct Outline {
    steps: Vec<Step>,
    scale: f64,
    start: Point2<f64>,
}

impl Outline {
    fn place(&self, x: f32, y: f32) -> Point2<f64> {
        Point2::new(self.start.x + f64::from(x) * self.scale, self.start.y - f64::from(y) * self.scale)
    }

    fn last(&self) -> Point2<f64> {
        self.steps.iter().rev().find_map(|step| step.places().last().copied()).unwrap_or(self.start)
    }
}

impl OutlineBuilder for Outline {
    fn move_to(&mut self, x: f32, y: f32) {
        self.steps.push(Step::Move(self.place(x, y)));
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.steps.push(Step::Line(self.place(x, y)));
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        let (from, handle, end) = (self.last(), self.place(x1, y1), self.place(x, y));
        let toward = |place: Point2<f64>| place + (handle - place) * (2.0 / 3.0);
        self.steps.push(Step::Curve(toward(from), toward(end), end));
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        self.steps.push(Step::Curve(self.place(x1, y1), self.place(x2, y2), self.place(x, y)));
    }

    fn close(&mut self) {
        self.steps.push(Step::Close);
    }
}
