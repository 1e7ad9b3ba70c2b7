//! Reading of bytes from the network, none of which can be trusted.

/// Reads values from bytes, one after the other. Beyond the end there is `None`.
#[derive(Clone, Debug)]
pub(crate) struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
    is_little: bool,
}

impl<'a> Cursor<'a> {
    pub(crate) const fn new(bytes: &'a [u8], is_little: bool) -> Self {
        Self { bytes, at: 0, is_little }
    }

    pub(crate) fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let end = self.at.checked_add(count)?;
        let taken = self.bytes.get(self.at..end)?;
        self.at = end;
        Some(taken)
    }

    pub(crate) fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.take(N)?.try_into().ok()
    }

    pub(crate) fn u16(&mut self) -> Option<u16> {
        let bytes = self.array()?;
        Some(if self.is_little { u16::from_le_bytes(bytes) } else { u16::from_be_bytes(bytes) })
    }

    pub(crate) fn u32(&mut self) -> Option<u32> {
        let bytes = self.array()?;
        Some(if self.is_little { u32::from_le_bytes(bytes) } else { u32::from_be_bytes(bytes) })
    }

    pub(crate) fn i32(&mut self) -> Option<i32> {
        self.u32().map(u32::cast_signed)
    }

    /// A sequence number: the upper half, then the lower one.
    pub(crate) fn sequence(&mut self) -> Option<i64> {
        let (high, low) = (self.i32()?, self.u32()?);
        Some((i64::from(high) << 32) | i64::from(low))
    }

    /// A text of CDR: its length with the zero at its end, and its bytes; then what aligns the next value to four
    /// bytes.
    pub(crate) fn text(&mut self) -> Option<String> {
        let length = self.u32()? as usize;
        let bytes = self.take(length)?;
        self.at = self.at.next_multiple_of(4);
        let text = bytes.strip_suffix(&[0]).unwrap_or(bytes);
        Some(String::from_utf8_lossy(text).into_owned())
    }

    pub(crate) fn rest(&self) -> &'a [u8] {
        self.bytes.get(self.at..).unwrap_or_default()
    }
}

/// Appends a text as CDR has it, aligned to four bytes at its end.
pub(crate) fn push_text(bytes: &mut Vec<u8>, text: &str) {
    bytes.extend((text.len() as u32 + 1).to_le_bytes());
    bytes.extend(text.as_bytes());
    bytes.push(0);
    bytes.resize(bytes.len().next_multiple_of(4), 0);
}

/// Appends a sequence number.
pub(crate) fn push_sequence(bytes: &mut Vec<u8>, sequence: i64) {
    bytes.extend(((sequence >> 32) as i32).to_le_bytes());
    bytes.extend((sequence as u32).to_le_bytes());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_appended_is_read_back() {
        let mut bytes = Vec::new();
        push_text(&mut bytes, "rt/map");
        push_sequence(&mut bytes, -3);
        push_sequence(&mut bytes, 5 << 33);
        let mut cursor = Cursor::new(&bytes, true);
        assert_eq!(cursor.text().as_deref(), Some("rt/map"));
        assert_eq!([cursor.sequence(), cursor.sequence(), cursor.sequence()], [Some(-3), Some(5 << 33), None]);
    }

    #[test]
    fn a_length_beyond_the_end_is_nothing() {
        assert_eq!(Cursor::new(&[255, 255, 255, 255, b'a'], true).text(), None);
        assert_eq!(Cursor::new(&[1, 2, 3], false).u32(), None);
    }
}
