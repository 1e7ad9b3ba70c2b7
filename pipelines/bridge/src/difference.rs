//! The compressed difference of a message to a previous one, for maps, which change little from one to the next.
//!
//! It is a Zstandard frame whose dictionary is the previous message, as `zstd --patch-from` makes it. So it works for
//! maps that grow, shrink and move, and for messages of any type. A checksum verifies that the message is restored byte
//! for byte.

use std::io;
use zstd::zstd_safe::{CCtx, CParameter, DCtx, DParameter, get_error_name, get_frame_content_size};

/// The compression level: higher ones take much longer than they save.
const LEVEL: i32 = 3;
/// The base-2 logarithm of the largest window, which covers two maps of 64 million cells.
pub(super) const LARGEST_WINDOW: u32 = 27;
const SMALLEST_WINDOW: u32 = 10;
/// The maximum size of a message, and of a batch, bytes: a few packed bytes can claim, and expand to, any size.
pub(super) const MAX_SIZE: usize = 128 << 20;

/// The message, compressed with the dictionary `known`; without a dictionary if that is empty.
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

/// Restores the message, of at most `most` bytes, from its difference to the same `known`.
///
/// # Errors
/// The bytes are invalid, or were made with another dictionary; or the message is longer.
pub(super) fn message(known: &[u8], difference: &[u8], most: usize) -> io::Result<Vec<u8>> {
    let size = get_frame_content_size(difference).ok().flatten().and_then(|size| usize::try_from(size).ok());
    let size = size.ok_or(io::ErrorKind::InvalidData)?;
    if size > most {
        return Err(io::Error::new(
            io::ErrorKind::InvalidData,
            format!("it expands to {size} bytes, more than {most}"),
        ));
    }
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
    fn the_difference_of_a_slightly_changed_map_is_small_and_restores_it_byte_for_byte() {
        let before = cells(700, 500);
        let mut after = before.clone();
        for row in 100..140 {
            after[row * 700 + 200..row * 700 + 260].fill(50);
        }
        let whole = difference(&[], &after).unwrap();
        let new = difference(&before, &after).unwrap();
        assert!(new.len() * 4 < whole.len(), "{} and {} bytes", new.len(), whole.len());
        assert_eq!(message(&before, &new, MAX_SIZE).unwrap(), after);
        assert_eq!(message(&[], &whole, MAX_SIZE).unwrap(), after);
    }

    #[test]
    fn a_wrong_dictionary_or_invalid_bytes_are_an_error() {
        let (before, after) = (cells(100, 100), cells(101, 100));
        let new = difference(&before, &after).unwrap();
        assert!(message(&cells(102, 100), &new, MAX_SIZE).is_err());
        assert!(message(&[], &new, MAX_SIZE).is_err());
        assert!(message(&before, &new[..new.len() / 2], MAX_SIZE).is_err());
        assert!(message(&before, b"nothing of that kind", MAX_SIZE).is_err());
        let mut wrong = new.clone();
        let last = wrong.len() - 1;
        wrong[last] ^= 1;
        assert!(message(&before, &wrong, MAX_SIZE).is_err());
    }

    #[test]
    fn a_message_beyond_the_limit_is_an_error() {
        let packed = difference(&[], &[0; 5000]).unwrap();
        assert_eq!(message(&[], &packed, 5000).unwrap().len(), 5000);
        assert!(message(&[], &packed, 4999).unwrap_err().to_string().contains("expands to 5000 bytes"));
    }

    #[test]
    fn an_empty_message_is_restored() {
        let new = difference(&[], &[]).unwrap();
        assert_eq!(message(&[], &new, MAX_SIZE).unwrap(), b"");
    }
}
