//! Map files: the YAML text and the image that it names.

use super::input::Input;
use super::target::Target;
use gridweave_logs::map_file::load;
use image::{DynamicImage, ImageFormat};
use std::io::Cursor;
use std::path::Path;

const DESCRIPTION: &str = "map.yaml";
const IMAGE: &str = "map.image";

#[test]
fn every_map_file_is_read_or_refused() {
    let text = "image: map.image\nresolution: 0.05\norigin: [-1.0, -2.0, 0.5]\nnegate: 0\noccupied_thresh: 0.65\n\
        free_thresh: 0.25\n";
    let texts = ["", "mode: trinary\n", "mode: scale\n", "mode: raw\n"].map(|mode| format!("{text}{mode}"));
    let grey = DynamicImage::ImageLuma8(image::GrayImage::from_fn(7, 5, |x, y| image::Luma([(40 * x + y) as u8])));
    let encode = |image: &DynamicImage, format| {
        let mut bytes = Vec::new();
        image.write_to(&mut Cursor::new(&mut bytes), format).unwrap();
        bytes
    };
    let images = [
        encode(&grey, ImageFormat::Pnm),
        encode(&grey, ImageFormat::Png),
        encode(&grey.clone().into_luma16().into(), ImageFormat::Png),
        encode(&grey.clone().into_luma_alpha8().into(), ImageFormat::Png),
        encode(&grey.clone().into_rgba8().into(), ImageFormat::Png),
        encode(&grey.into_rgb8().into(), ImageFormat::Pnm),
        b"P1\n# a map\n3 2\n1 0 1 0 1 1\n".to_vec(),
        b"P2 3 2 255\n0 100 255\n254 205 0\n".to_vec(),
        b"P4 9 2\n\x80\x80\x40\x00".to_vec(),
        b"P5\n3 1\n65535\n\x01\x02\x03\x04\x05\x06".to_vec(),
        b"P7\nWIDTH 2\nHEIGHT 2\nDEPTH 1\nMAXVAL 255\nTUPLTYPE GRAYSCALE\nENDHDR\n\x00\x01\x02\x03".to_vec(),
    ];
    let seeds = texts.iter().cycle().zip(&images).map(|(text, image)| Input(vec![text.clone().into(), image.clone()]));
    Target {
        name: "map_files",
        files: &[DESCRIPTION, IMAGE],
        seeds: seeds.collect(),
        words: &[
            "image",
            "resolution",
            "mode: raw\n",
            "&a [*a, *a, *a]",
            "[[[[[[[[[[[[[[[[",
            "{{{{{{{{{{{{{{{{",
            "- ",
            "!!binary ",
            ".nan",
            "1e999",
            "-.inf",
            "99999999999",
            "65535 65535",
            "P5 ",
            "P2 ",
            "P4 ",
            "P6 ",
            "\n",
            "IDAT",
            "IHDR",
        ],
        cases: 6000,
        read,
    }
    .check();
}

fn read(folder: &Path) {
    match load(&folder.join(DESCRIPTION)) {
        Ok(map) => {
            assert_eq!(map.cells.len(), map.info.width as usize * map.info.height as usize);
            assert!(map.cells.iter().all(|cell| (-1..=100).contains(cell)));
        }
        Err(error) => drop(error.to_string()),
    }
}
