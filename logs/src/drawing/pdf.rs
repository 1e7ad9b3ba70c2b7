//! Drawings as PDF.

use super::{Drawing, DrawingError, Path, Step};
use flate2::Compression;
use flate2::write::ZlibEncoder;
use nalgebra::Point2;
use pdf_writer::types::{LineCapStyle, LineJoinStyle};
use pdf_writer::{Content, Filter, Finish, Name, Pdf, Rect, Ref};
use std::collections::BTreeMap;
use std::io::Write;

/// The longer side of the page, points: that of A4.
const LONGER_SIDE: f64 = 842.0;
const CATALOG: Ref = Ref::new(1);
const PAGES: Ref = Ref::new(2);
const PAGE: Ref = Ref::new(3);
const CONTENT: Ref = Ref::new(4);
const IMAGE: Ref = Ref::new(5);
/// The first opacity; the others follow.
const OPACITIES: i32 = 6;

impl Drawing {
    /// Encodes the drawing as a PDF file of one page with the drawing's aspect ratio.
    ///
    /// # Errors
    /// The image is too large.
    pub fn pdf(&self) -> Result<Vec<u8>, DrawingError> {
        let points_a_pixel = LONGER_SIDE / f64::from(self.width.max(self.height).max(1));
        let opacities = Opacities::of(self);

        let mut pdf = Pdf::new();
        pdf.catalog(CATALOG).pages(PAGES);
        pdf.pages(PAGES).kids([PAGE]).count(1);
        let mut page = pdf.page(PAGE);
        let side = |pixels: u32| (f64::from(pixels) * points_a_pixel) as f32;
        page.media_box(Rect::new(0.0, 0.0, side(self.width), side(self.height))).parent(PAGES).contents(CONTENT);
        let mut resources = page.resources();
        resources.x_objects().pair(Name(b"image"), IMAGE);
        let mut states = resources.ext_g_states();
        for (name, reference) in opacities.names.values() {
            states.pair(Name(name.as_bytes()), *reference);
        }
        states.finish();
        resources.finish();
        page.finish();

        for (thousandths, (_, reference)) in &opacities.names {
            let opacity = *thousandths as f32 / 1000.0;
            pdf.ext_graphics(*reference).non_stroking_alpha(opacity).stroking_alpha(opacity);
        }
        let pixels = deflate(self.image.as_raw())?;
        let mut image = pdf.image_xobject(IMAGE, &pixels);
        image.width(self.image.width() as i32).height(self.image.height() as i32).bits_per_component(8);
        image.color_space().device_rgb();
        image.filter(Filter::FlateDecode);
        image.finish();
        let content = deflate(&self.content(points_a_pixel as f32, &opacities))?;
        pdf.stream(CONTENT, &content).filter(Filter::FlateDecode);
        Ok(pdf.finish())
    }

    fn content(&self, scale: f32, opacities: &Opacities) -> Vec<u8> {
        let mut content = Content::new();
        // From here on the coordinates are those of the drawing: y down from the upper left corner.
        content.transform([scale, 0.0, 0.0, -scale, 0.0, self.height as f32 * scale]);
        let area = self.image_area();
        let (left, top) = (area.corner.x as f32, area.corner.y as f32);
        let (width, height) = (area.width as f32, area.height as f32);
        content.save_state().transform([width, 0.0, 0.0, -height, left, top + height]);
        content.x_object(Name(b"image")).restore_state();
        content.set_line_cap(LineCapStyle::RoundCap).set_line_join(LineJoinStyle::RoundJoin);
        for group in &self.groups {
            content.save_state();
            if group.is_on_image {
                content.rect(left, top, width, height).clip_nonzero().end_path();
            }
            group.paths.iter().for_each(|path| draw(&mut content, path, opacities));
            content.restore_state();
        }
        content.finish().to_vec()
    }
}

/// The opacities in a drawing, in thousandths, each with its name and its object in the file.
struct Opacities {
    names: BTreeMap<u32, (String, Ref)>,
}

impl Opacities {
    fn of(drawing: &Drawing) -> Self {
        let paths = drawing.groups.iter().flat_map(|group| &group.paths);
        let paints = paths.flat_map(|path| [path.fill, path.stroke.map(|(paint, _)| paint)]).flatten();
        let thousandths: std::collections::BTreeSet<u32> = paints.map(|paint| thousandths(paint.opacity)).collect();
        let named = |(place, thousandths)| (thousandths, (format!("o{thousandths}"), Ref::new(OPACITIES + place)));
        Self { names: (0..).zip(thousandths).map(named).collect() }
    }

    fn set(&self, content: &mut Content, opacity: f64) {
        if let Some((name, _)) = self.names.get(&thousandths(opacity)) {
            content.set_parameters(Name(name.as_bytes()));
        }
    }
}

fn thousandths(opacity: f64) -> u32 {
    (opacity.clamp(0.0, 1.0) * 1000.0).round() as u32
}

fn draw(content: &mut Content, path: &Path, opacities: &Opacities) {
    let channels = |colour: [u8; 3]| colour.map(|channel| f32::from(channel) / 255.0);
    if let Some(fill) = path.fill {
        opacities.set(content, fill.opacity);
        let [red, green, blue] = channels(fill.colour);
        content.set_fill_rgb(red, green, blue);
        outline(content, &path.steps);
        content.fill_nonzero();
    }
    if let Some((stroke, width)) = path.stroke {
        opacities.set(content, stroke.opacity);
        let [red, green, blue] = channels(stroke.colour);
        content.set_stroke_rgb(red, green, blue).set_line_width(width.max(0.0) as f32);
        outline(content, &path.steps);
        content.stroke();
    }
}

fn outline(content: &mut Content, steps: &[Step]) {
    // Two decimals, as in SVG.
    let at = |place: Point2<f64>| [place.x, place.y].map(|value| ((value * 100.0).round() / 100.0) as f32);
    for step in steps {
        match *step {
            Step::Move(to) => {
                let [x, y] = at(to);
                content.move_to(x, y);
            }
            Step::Line(to) => {
                let [x, y] = at(to);
                content.line_to(x, y);
            }
            Step::Curve(first, second, to) => {
                let [[a, b], [c, d], [x, y]] = [first, second, to].map(at);
                content.cubic_to(a, b, c, d, x, y);
            }
            Step::Close => {
                content.close_path();
            }
        }
    }
}

fn deflate(bytes: &[u8]) -> Result<Vec<u8>, DrawingError> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    let written = encoder.write_all(bytes).and_then(|()| encoder.finish());
    written.map_err(|error| DrawingError::new("PDF", error))
}
