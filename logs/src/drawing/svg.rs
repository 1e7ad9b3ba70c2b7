//! Drawings as SVG.

use super::{Drawing, DrawingError, Paint, Path, Step, encode_png};
use base64::prelude::{BASE64_STANDARD, Engine};
use nalgebra::Point2;
use std::fmt::Write;

impl Drawing {
    /// Encodes the drawing as an SVG file, with the image embedded as PNG.
    ///
    /// # Errors
    /// The image is too large.
    pub fn svg(&self) -> Result<String, DrawingError> {
        let image = BASE64_STANDARD.encode(encode_png(&self.image)?);
        let mut text = String::with_capacity(image.len() + 4096);
        // Writing to a string cannot fail.
        let _ = self.write(&mut text, &image);
        Ok(text)
    }

    fn write(&self, out: &mut String, image: &str) -> std::fmt::Result {
        let Self { width, height, .. } = self;
        writeln!(
            out,
            r#"<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="0 0 {width} {height}">"#
        )?;
        writeln!(out, r##"<rect width="100%" height="100%" fill="#ffffff"/>"##)?;
        let (left, top) = self.image_at;
        let area = format!(r#"x="{left}" y="{top}" width="{}" height="{}""#, self.image.width(), self.image.height());
        writeln!(out, r#"<clipPath id="image"><rect {area}/></clipPath>"#)?;
        let style = "image-rendering:pixelated";
        writeln!(out, r#"<image {area} style="{style}" href="data:image/png;base64,{image}"/>"#)?;
        for group in &self.groups {
            let clip = if group.is_on_image { r#" clip-path="url(#image)""# } else { "" };
            writeln!(out, "<g{clip}><title>{}</title>", escape(&group.name))?;
            group.paths.iter().try_for_each(|path| write_path(out, path))?;
            writeln!(out, "</g>")?;
        }
        writeln!(out, "</svg>")
    }
}

fn write_path(out: &mut String, path: &Path) -> std::fmt::Result {
    write!(out, r#"<path d=""#)?;
    for step in &path.steps {
        let letter = match step {
            Step::Move(_) => 'M',
            Step::Line(_) => 'L',
            Step::Curve(..) => 'C',
            Step::Close => 'Z',
        };
        out.push(letter);
        for (index, Point2 { coords }) in step.places().iter().enumerate() {
            let gap = if index == 0 { "" } else { " " };
            write!(out, "{gap}{} {}", number(coords.x), number(coords.y))?;
        }
    }
    out.push('"');
    write_paint(out, "fill", path.fill)?;
    if let Some((paint, width)) = path.stroke {
        write_paint(out, "stroke", Some(paint))?;
        write!(out, r#" stroke-width="{}" stroke-linecap="round" stroke-linejoin="round""#, number(width))?;
    }
    writeln!(out, "/>")
}

fn write_paint(out: &mut String, what: &str, paint: Option<Paint>) -> std::fmt::Result {
    match paint {
        None => write!(out, r#" {what}="none""#),
        Some(Paint { colour: [red, green, blue], opacity }) => {
            write!(out, r##" {what}="#{red:02x}{green:02x}{blue:02x}""##)?;
            if opacity < 1.0 { write!(out, r#" {what}-opacity="{}""#, number(opacity)) } else { Ok(()) }
        }
    }
}

/// Rounds to two decimals.
fn number(value: f64) -> f64 {
    // Adding 0.0 turns -0.0 into 0.0.
    (value * 100.0).round() / 100.0 + 0.0
}

/// Escapes text for XML, without control characters, which XML does not allow.
fn escape(text: &str) -> String {
    let allowed = text.chars().filter(|letter| !letter.is_control() && !matches!(letter, '\u{fffe}' | '\u{ffff}'));
    allowed.collect::<String>().replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
