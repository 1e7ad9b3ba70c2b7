//! The image files of maps: PNG and the Netpbm formats.

use super::netpbm;
use std::io::Cursor;

/// Memory that an image may take, bytes: a small file must not ask for more.
pub(super) const MOST_BYTES: usize = 512 * 1024 * 1024;

/// A decoded image.
pub(super) struct Raster {
    pub(super) width: u32,
    pub(super) height: u32,
    /// Samples a pixel: grey or three colours, and one more for opacity.
    pub(super) channels: usize,
    pub(super) samples: Samples,
}

/// The samples of an image row by row, from its upper left corner; the largest value of the type is white.
pub(super) enum Samples {
    Eight(Vec<u8>),
    Sixteen(Vec<u16>),
}

/// Why an image cannot be decoded.
#[derive(Debug, thiserror::Error)]
pub(super) enum RasterError {
    #[error("it is neither a PNG nor a PGM, PPM or PBM image")]
    Format,
    #[error("its header has no {0}")]
    Header(&'static str),
    #[error("its brightest value is {0}, and not 1 to 65535")]
    Brightest(u32),
    #[error("it has fewer pixels than it says")]
    Cut,
    #[error("a pixel is no number from 0 to 65535")]
    Number,
    #[error("it is larger than {} MB", MOST_BYTES / 1024 / 1024)]
    Size,
    #[error(transparent)]
    Png(#[from] png::DecodingError),
}

impl Raster {
    /// Decodes an image file: PGM, PPM, PBM or PNG, told by its first bytes.
    pub(super) fn decode(file: &[u8]) -> Result<Self, RasterError> {
        match file {
            [0x89, b'P', b'N', b'G', ..] => decode_png(file),
            [b'P', digit @ b'1'..=b'6', rest @ ..] => netpbm::decode(digit - b'0', rest),
            _ => Err(RasterError::Format),
        }
    }
}

fn decode_png(file: &[u8]) -> Result<Raster, RasterError> {
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(file), png::Limits { bytes: MOST_BYTES });
    // Palettes become colours, and one, two and four bits eight.
    decoder.set_transformations(png::Transformations::EXPAND);
    let mut reader = decoder.read_info()?;
    let (width, height) = reader.info().size();
    let (colour, depth) = reader.output_color_type();
    let bytes = reader.output_buffer_size().filter(|&bytes| bytes <= MOST_BYTES).ok_or(RasterError::Size)?;
    let mut samples = vec![0; bytes];
    reader.next_frame(&mut samples)?;
    let samples = match depth {
        png::BitDepth::Sixteen => Samples::Sixteen(netpbm::big_endian(&samples)),
        _ => Samples::Eight(samples),
    };
    Ok(Raster { width, height, channels: colour.samples(), samples })
}
