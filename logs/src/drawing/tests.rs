use super::*;
use image::Rgb;

const RED: Colour = [200, 30, 30];

/// A black image of 40 x 20 in a margin of 10, with a red square that extends beyond it, and a text.
fn drawing(is_on_image: bool) -> Drawing {
    let corners = [(40.0, 15.0), (70.0, 15.0), (70.0, 25.0), (40.0, 25.0)];
    let square = Path::area(corners.map(|(x, y)| Point2::new(x, y))).filled(RED);
    let line = Path::lines([Point2::new(12.0, 28.0), Point2::new(30.0, 28.0)]);
    let line = line.stroked(Paint { colour: RED, opacity: 0.5 }, 2.0);
    let word = text("<script>&", Point2::new(12.0, 38.0), 8.0).filled([0, 0, 0]);
    Drawing {
        width: 80,
        height: 40,
        image: RgbImage::from_pixel(40, 20, Rgb([0; 3])),
        image_at: (10, 10),
        groups: vec![
            Group { name: "<script>&\u{1}".into(), is_on_image, paths: vec![square, line] },
            Group { name: "word".into(), is_on_image: false, paths: vec![word] },
        ],
    }
}

#[test]
fn shapes_on_the_image_are_clipped_to_it() {
    for (is_on_image, beyond) in [(true, [255; 3]), (false, RED)] {
        let pixels = drawing(is_on_image).pixels().unwrap();
        assert_eq!(pixels.get_pixel(45, 20).0, RED);
        assert_eq!(pixels.get_pixel(60, 20).0, beyond);
        assert_eq!(pixels.get_pixel(5, 5).0, [255; 3], "white paper");
        assert_eq!(pixels.get_pixel(15, 15).0, [0; 3], "the image");
        let [red, green, _] = pixels.get_pixel(20, 28).0;
        assert!((95..105).contains(&red) && green < 20, "half red on black: {red} {green}");
    }
}

#[test]
fn text_is_drawn_as_outlines_and_has_a_width() {
    let pixels = drawing(true).pixels().unwrap();
    let dark = pixels.enumerate_pixels().filter(|(_, v, pixel)| *v > 30 && pixel.0[0] < 128).count();
    assert!(dark > 20, "{dark}");
    assert!((text_width("mm", 10.0) - 2.0 * text_width("m", 10.0)).abs() < 1e-9);
    assert!(text_width("robot1", 10.0) > 25.0 && text_width("", 10.0) == 0.0);
    assert!(text_width("機械\u{7}", 10.0) > 5.0, "missing letters are boxes");
    assert!(text_width(&"m".repeat(100_000), 1.0) < 1000.0);
}

#[test]
fn names_in_an_svg_are_escaped() {
    let svg = drawing(true).svg().unwrap();
    assert!(svg.contains("<title>&lt;script&gt;&amp;</title>") && !svg.contains("<script"), "{svg}");
    assert!(svg.contains(r##"fill="#c81e1e""##) && svg.contains(r#"stroke-opacity="0.5""#));
    assert!(svg.contains(r#"d="M40 15L70 15L70 25L40 25Z""#));
}

#[test]
fn a_pdf_has_one_page_with_the_aspect_ratio_of_the_drawing() {
    let pdf = drawing(true).pdf().unwrap();
    let text = String::from_utf8_lossy(&pdf);
    assert!(text.starts_with("%PDF-") && text.contains("/MediaBox [0 0 842 421]"), "{text}");
    assert!(text.contains("/ca 0.5") && text.trim_end().ends_with("%%EOF"));
}

#[test]
fn the_same_drawing_gives_the_same_bytes() {
    let (one, other) = (drawing(true), drawing(true));
    assert_eq!(one.png().unwrap(), other.png().unwrap());
    assert_eq!(one.svg().unwrap(), other.svg().unwrap());
    assert_eq!(one.pdf().unwrap(), other.pdf().unwrap());
}

#[test]
fn positions_that_are_not_finite_are_ignored() {
    let mut drawing = drawing(true);
    let places = [Point2::new(f64::NAN, 0.0), Point2::new(1e300, f64::INFINITY), Point2::new(-1e9, 5.0)];
    drawing.groups[0].paths.push(Path::lines(places).stroked(RED, f64::NAN).filled(RED));
    assert!(drawing.pixels().is_ok() && drawing.svg().is_ok() && drawing.pdf().is_ok());
}
