//! Short text of a fixed size, for shared memory.

use iceoryx2::prelude::ZeroCopySend;
use std::borrow::Cow;
use std::fmt;

/// UTF-8 text of at most `N` bytes, padded with zero bytes.
///
/// It has the same layout in every language: `N` bytes, no length, and no terminator if it is full.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, ZeroCopySend)]
#[repr(C)]
pub struct FixedText<const N: usize> {
    bytes: [u8; N],
}

/// A text is too long for its fixed size.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{}` has {length} bytes, and at most {limit} fit: choose a shorter name", shortened(text))]
pub struct TextTooLong {
    /// The text.
    pub text: String,
    /// Its length in bytes.
    pub length: usize,
    /// The maximum length in bytes.
    pub limit: usize,
}

/// The largest number of characters of a name in a message to the user.
const LONGEST_SHOWN: usize = 100;

/// A name for a message to the user: only its beginning, if it is so long that it would hide the rest.
pub fn shortened(name: &str) -> Cow<'_, str> {
    match name.char_indices().nth(LONGEST_SHOWN) {
        Some((end, _)) => Cow::Owned(format!("{}...", &name[..end])),
        None => Cow::Borrowed(name),
    }
}

impl<const N: usize> FixedText<N> {
    /// The empty text.
    pub const EMPTY: Self = Self { bytes: [0; N] };

    /// `text` in its fixed form.
    pub fn new(text: &str) -> Result<Self, TextTooLong> {
        let mut bytes = [0; N];
        match bytes.get_mut(..text.len()) {
            Some(target) => target.copy_from_slice(text.as_bytes()),
            None => return Err(TextTooLong { text: text.to_owned(), length: text.len(), limit: N }),
        }
        Ok(Self { bytes })
    }

    /// The text, up to the first byte that is not valid UTF-8.
    pub fn as_str(&self) -> &str {
        let end = self.bytes.iter().position(|&byte| byte == 0).unwrap_or(N);
        let bytes = &self.bytes[..end];
        match std::str::from_utf8(bytes) {
            Ok(text) => text,
            Err(error) => std::str::from_utf8(&bytes[..error.valid_up_to()]).unwrap_or_default(),
        }
    }

    /// The text in its fixed form.
    pub fn as_bytes(&self) -> &[u8; N] {
        &self.bytes
    }

    /// The text of its fixed form.
    pub fn from_bytes(bytes: [u8; N]) -> Self {
        Self { bytes }
    }

    /// Whether the text is empty.
    pub fn is_empty(&self) -> bool {
        self.bytes.first().is_none_or(|&byte| byte == 0)
    }
}

impl<const N: usize> Default for FixedText<N> {
    fn default() -> Self {
        Self::EMPTY
    }
}

impl<const N: usize> fmt::Debug for FixedText<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self.as_str(), f)
    }
}

impl<const N: usize> fmt::Display for FixedText<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_that_fits_is_unchanged() {
        for text in ["", "robot1", "Größe", "12345678"] {
            assert_eq!(FixedText::<8>::new(text).unwrap().as_str(), text);
        }
    }

    #[test]
    fn a_text_that_is_too_long_is_rejected() {
        let error = FixedText::<8>::new("123456789").unwrap_err();
        assert_eq!((error.length, error.limit), (9, 8));
        let error = FixedText::<8>::new(&"ö".repeat(60_000)).unwrap_err().to_string();
        assert!(error.contains("120000 bytes") && error.len() < 400, "{error}");
    }
}
