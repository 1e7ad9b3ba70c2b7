//! What is new of a message, against another that the reader has: for maps, of which little changes from one to the next.
//!
//! It is a frame of Zstandard whose dictionary is the other message, as `zstd --patch-from` makes it. So it holds for maps that
//! grow, shrink and move, and for messages of any type, and what comes out is the message byte for byte: a checksum says so.

use std::io;
use zstd::zstd_safe::{CCtx, CParameter, DCtx, DParameter, get_error_name, get_frame_content_size};

/// Beyond it a step of compression takes far longer than it saves.
const LEVEL: i32 = 3;
/// Windows of 2 to this reach back over two maps of 64 million cells.
const LARGEST_WINDOW: u32 = 27;
const SMALLEST_WINDOW: u32 = 10;
/// The most bytes of a message, against those that say they are larger than memory.
pub(super) const LARGEST: usize = 1 << 30;

/// The message, compressed against `known`; against nothing where that is empty.
///
/// # Errors
/// There is not enough memory.
pub(super) fn difference(known: &[u8], message: &[u8]) -> io::Result<Vec<u8>> {
    let mut context = CCtx::try_create().ok_or(io::ErrorKind::OutOfMemory)?;
    let reach = (known.len() + message.len()).max(1);
    let window = (reach.ilog2() + 1).clamp(SMALLEST_WINDOW, LARGEST_WINDOW);
    let mut parameters =
        vec![CParameter::CompressionLevel(LEVEL), CParameter::ChecksumFlag(true), CParameter::WindowLog(window)];
    if !known.is_empty() {
        parameters.push(CParameter::EnableLongDistanceMatching(true));
    }
    for parameter in parameters {
        context.set_parameter(parameter).map_err(failed)?;
    }
    if !known.is_empty() {
        context.ref_prefix(known).map_err(failed)?;
    }
    let mut bytes = Vec::with_capacity(zstd::zstd_safe::compress_bound(message.len()));
    context.compress2(&mut bytes, message).map_err(failed)?;
    bytes.shrink_to_fit();
    Ok(bytes)
}

/// The message of which `difference` was made against the same `known`.
///
/// # Errors
/// The bytes are none, or were made against something else.
pub(super) fn message(known: &[u8], difference: &[u8]) -> io::Result<Vec<u8>> {
    let size = get_frame_content_size(difference).ok().flatten().and_then(|size| usize::try_from(size).ok());
    let size = size.filter(|size| *size <= LARGEST).ok_or(io::ErrorKind::InvalidData)?;
    let mut context = DCtx::try_create().ok_or(io::ErrorKind::OutOfMemory)?;
    context.set_parameter(DParameter::WindowLogMax(LARGEST_WINDOW)).map_err(failed)?;
    if !known.is_empty() {
        context.ref_prefix(known).map_err(failed)?;
    }
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(size).map_err(|_| io::ErrorKind::OutOfMemory)?;
    context.decompress(&mut bytes, difference).map_err(failed)?;
    Ok(bytes)
}

fn failed(code: usize) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, get_error_name(code))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rooms with walls around them, and specks in them that do not repeat.
    fn cells(width: usize, height: usize) -> Vec<u8> {
        let speck = |at: usize| ((at as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 60) as u8;
        let cell = |at: usize| match (at % width % 60, at / width % 45) {
            (0, _) | (_, 0) => 100,
            _ => speck(at),
        };
        (0..width * height).map(cell).collect()
    }

    #[test]
    fn a_map_with_little_new_takes_little_and_comes_back_byte_for_byte() {
        let before = cells(700, 500);
        let mut after = before.clone();
        for row in 100..140 {
            after[row * 700 + 200..row * 700 + 260].fill(50);
        }
        let whole = difference(&[], &after).unwrap();
        let new = difference(&before, &after).unwrap();
        assert!(new.len() * 4 < whole.len(), "{} and {} bytes", new.len(), whole.len());
        assert_eq!(message(&before, &new).unwrap(), after);
        assert_eq!(message(&[], &whole).unwrap(), after);
    }

    #[test]
    fn a_difference_to_another_message_is_none() {
        let (before, after) = (cells(100, 100), cells(101, 100));
        let new = difference(&before, &after).unwrap();
        assert!(message(&cells(102, 100), &new).is_err());
        assert!(message(&[], &new).is_err());
        assert!(message(&before, &new[..new.len() / 2]).is_err());
        assert!(message(&before, b"nothing of that kind").is_err());
        let mut wrong = new.clone();
        let last = wrong.len() - 1;
        wrong[last] ^= 1;
        assert!(message(&before, &wrong).is_err());
    }

    #[test]
    fn what_is_empty_stays_empty() {
        let new = difference(&[], &[]).unwrap();
        assert_eq!(message(&[], &new).unwrap(), b"");
    }
}
