//! Drawings as pixels.

use super::{Drawing, DrawingError, Paint, Path, Step};
use image::{ImageFormat, RgbImage, Rgba, RgbaImage};
use std::io::Cursor;
use tiny_skia::{FillRule, LineCap, LineJoin, Mask, PathBuilder, Pixmap, Rect, Stroke, Transform};

impl Drawing {
    /// Renders the drawing to pixels.
    ///
    /// # Errors
    /// The drawing is too large.
    pub fn pixels(&self) -> Result<RgbImage, DrawingError> {
        let too_large = || DrawingError::new("PNG", format!("{} x {} pixels are too many", self.width, self.height));
        let mut pixmap = Pixmap::new(self.width, self.height).ok_or_else(too_large)?;
        pixmap.fill(tiny_skia::Color::WHITE);
        let (left, top) = (self.image_at.0 as usize, self.image_at.1 as usize);
        let (row, width) = (self.width as usize, self.image.width() as usize);
        for (v, pixels) in self.image.as_raw().chunks_exact((width * 3).max(1)).enumerate() {
            let start = (((top + v) * row) + left) * 4;
            let target = pixmap.data_mut().get_mut(start..start + width * 4).ok_or_else(too_large)?;
            for (target, pixel) in target.chunks_exact_mut(4).zip(pixels.chunks_exact(3)) {
                target[..3].copy_from_slice(pixel);
            }
        }
        let mut mask = Mask::new(self.width, self.height).ok_or_else(too_large)?;
        let (width, height) = (self.image.width() as f32, self.image.height() as f32);
        if let Some(area) = Rect::from_xywh(left as f32, top as f32, width, height) {
            mask.fill_path(&PathBuilder::from_rect(area), FillRule::Winding, false, Transform::identity());
        }
        for group in &self.groups {
            let mask = group.is_on_image.then_some(&mask);
            group.paths.iter().for_each(|path| draw(&mut pixmap, path, mask));
        }
        let rgba = RgbaImage::from_raw(self.width, self.height, pixmap.take()).ok_or_else(too_large)?;
        // With white paper below everything, the result is opaque.
        let rgb = |Rgba([red, green, blue, _]): &Rgba<u8>| [*red, *green, *blue];
        RgbImage::from_raw(self.width, self.height, rgba.pixels().flat_map(rgb).collect()).ok_or_else(too_large)
    }

    /// Encodes the drawing as a PNG file.
    ///
    /// # Errors
    /// The drawing is too large.
    pub fn png(&self) -> Result<Vec<u8>, DrawingError> {
        encode_png(&self.pixels()?)
    }
}

/// Encodes an image as a PNG file.
///
/// # Errors
/// The image is too large.
pub fn encode_png(image: &RgbImage) -> Result<Vec<u8>, DrawingError> {
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, ImageFormat::Png).map_err(|error| DrawingError::new("PNG", error))?;
    Ok(bytes.into_inner())
}

fn draw(pixmap: &mut Pixmap, path: &Path, mask: Option<&Mask>) {
    let Some(outline) = outline(&path.steps) else { return };
    if let Some(fill) = path.fill {
        pixmap.fill_path(&outline, &paint(fill), FillRule::Winding, Transform::identity(), mask);
    }
    if let Some((along, width)) = path.stroke {
        let stroke =
            Stroke { width: width as f32, line_cap: LineCap::Round, line_join: LineJoin::Round, ..Stroke::default() };
        pixmap.stroke_path(&outline, &paint(along), &stroke, Transform::identity(), mask);
    }
}

fn paint(paint: Paint) -> tiny_skia::Paint<'static> {
    let mut made = tiny_skia::Paint::default();
    let [red, green, blue] = paint.colour;
    made.set_color_rgba8(red, green, blue, (paint.opacity.clamp(0.0, 1.0) * 255.0).round() as u8);
    made
}

/// `None` for a path without length.
fn outline(steps: &[Step]) -> Option<tiny_skia::Path> {
    let mut builder = PathBuilder::new();
    for step in steps {
        match *step {
            Step::Move(to) => builder.move_to(to.x as f32, to.y as f32),
            Step::Line(to) => builder.line_to(to.x as f32, to.y as f32),
            Step::Curve(a, b, to) => {
                builder.cubic_to(a.x as f32, a.y as f32, b.x as f32, b.y as f32, to.x as f32, to.y as f32);
            }
            Step::Close => builder.close(),
        }
    }
    builder.finish()
}
