//! The Netpbm formats: PBM, PGM and PPM, as text (P1 to P3) and in binary (P4 to P6).

use super::raster::{MOST_BYTES, Raster, RasterError, Samples};

/// Decodes what follows the `P` and the digit.
pub(super) fn decode(digit: u8, rest: &[u8]) -> Result<Raster, RasterError> {
    let mut header = Header { rest };
    let width = header.number().ok_or(RasterError::Header("width"))?;
    let height = header.number().ok_or(RasterError::Header("height"))?;
    let bits = matches!(digit, 1 | 4);
    let brightest = if bits { 1 } else { header.number().ok_or(RasterError::Header("brightest value"))? };
    let brightest =
        u16::try_from(brightest).ok().filter(|&value| value > 0).ok_or(RasterError::Brightest(brightest))?;

    let channels = if matches!(digit, 3 | 6) { 3 } else { 1 };
    let bytes_a_sample = if brightest > 255 { 2 } else { 1 };
    let row = (width as usize).checked_mul(channels).ok_or(RasterError::Size)?;
    let count = row.checked_mul(height as usize).ok_or(RasterError::Size)?;
    if count.checked_mul(bytes_a_sample).is_none_or(|bytes| bytes > MOST_BYTES) {
        return Err(RasterError::Size);
    }

    let body = header.rest;
    let samples = match digit {
        1 => eight(text_bits(body, count)?, 1),
        4 => eight(packed_bits(body, row, height as usize)?, 1),
        2 | 3 => scaled(text(body, count)?, brightest),
        _ => {
            let body = body.get(..count * bytes_a_sample).ok_or(RasterError::Cut)?;
            if brightest > 255 { scaled(big_endian(body), brightest) } else { eight(body.to_vec(), brightest as u8) }
        }
    };
    Ok(Raster { width, height, channels, samples })
}

/// Two bytes a sample, the higher first.
pub(super) fn big_endian(bytes: &[u8]) -> Vec<u16> {
    bytes.chunks_exact(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]])).collect()
}

/// What is left of the file behind the numbers that were read.
struct Header<'a> {
    rest: &'a [u8],
}

impl Header<'_> {
    /// The next number, and the one white space behind it. A comment goes from # to the end of its line.
    fn number(&mut self) -> Option<u32> {
        let mut value: Option<u32> = None;
        while let Some((&byte, rest)) = self.rest.split_first() {
            self.rest = rest;
            match byte {
                b'#' => {
                    let end = rest.iter().position(|byte| matches!(byte, b'\n' | b'\r'));
                    // The end of the line ends the number, too.
                    self.rest = &rest[end.unwrap_or(rest.len())..];
                }
                b'0'..=b'9' => {
                    value = Some(value.unwrap_or(0).checked_mul(10)?.checked_add(u32::from(byte - b'0'))?);
                }
                _ if is_space(byte) && value.is_none() => {}
                _ if is_space(byte) => break,
                _ => return None,
            }
        }
        value
    }
}

fn is_space(byte: u8) -> bool {
    matches!(byte, b'\t' | b'\n' | 0x0b | 0x0c | b'\r' | b' ')
}

/// Numbers with white space between them.
fn text(body: &[u8], count: usize) -> Result<Vec<u16>, RasterError> {
    let words = body.split(|&byte| is_space(byte)).filter(|word| !word.is_empty());
    let samples: Vec<u16> = words
        .take(count)
        .map(|word| std::str::from_utf8(word).ok().and_then(|word| word.parse().ok()).ok_or(RasterError::Number))
        .collect::<Result<_, _>>()?;
    if samples.len() == count { Ok(samples) } else { Err(RasterError::Cut) }
}

/// Digits with or without white space between them, 1 being black.
fn text_bits(body: &[u8], count: usize) -> Result<Vec<u8>, RasterError> {
    let digits = body.iter().filter(|&&byte| !is_space(byte)).take(count);
    let samples: Vec<u8> = digits
        .map(|digit| match digit {
            b'0' => Ok(1),
            b'1' => Ok(0),
            _ => Err(RasterError::Number),
        })
        .collect::<Result<_, _>>()?;
    if samples.len() == count { Ok(samples) } else { Err(RasterError::Cut) }
}

/// Eight pixels a byte, the leftmost in its highest bit, 1 being black; each row starts with a byte of its own.
fn packed_bits(body: &[u8], width: usize, height: usize) -> Result<Vec<u8>, RasterError> {
    let row = width.div_ceil(8);
    let body = row.checked_mul(height).and_then(|bytes| body.get(..bytes)).ok_or(RasterError::Cut)?;
    let pixel = |row: &[u8], x: usize| 1 - (row[x / 8] >> (7 - x % 8) & 1);
    Ok(body.chunks_exact(row.max(1)).flat_map(|row| (0..width).map(move |x| pixel(row, x))).collect())
}

/// Samples up to `brightest`, spread so that white is the largest value of as few bits as hold it.
fn scaled(samples: Vec<u16>, brightest: u16) -> Samples {
    if brightest <= 255 {
        return eight(samples.into_iter().map(|sample| sample.min(255) as u8).collect(), brightest as u8);
    }
    let factor = 65535.0 / f32::from(brightest);
    Samples::Sixteen(samples.into_iter().map(|sample| (f32::from(sample) * factor).round() as u16).collect())
}

fn eight(mut samples: Vec<u8>, brightest: u8) -> Samples {
    if brightest < 255 {
        let factor = 255.0 / f32::from(brightest);
        samples.iter_mut().for_each(|sample| *sample = (f32::from(*sample) * factor).round() as u8);
    }
    Samples::Eight(samples)
}
