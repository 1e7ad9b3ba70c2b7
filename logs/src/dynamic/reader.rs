//! Reader of CDR: aligned numbers and strings; and of the ROS 1 encoding, which has no alignment.

/// The fault of a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DecodeFault {
    /// The bytes end within it.
    #[error("the message ends")]
    End,
    /// It claims more elements than the rest of the message can contain.
    #[error("the message is too short for {0} elements")]
    Count(usize),
    /// It and the fields before it have more values than a message of this length is expected to have.
    #[error("the message has more than {0} values, the maximum for its length")]
    Values(usize),
    /// Its conversion is longer than a message can be.
    #[error("the message takes more than {0} bytes in CDR, the maximum")]
    Long(usize),
    /// A boolean is neither 0 nor 1.
    #[error("the boolean is {0}")]
    Boolean(u8),
    /// A string is not UTF-8.
    #[error("the string is not UTF-8")]
    Text,
    /// `wstring`: its encoding differs between ROS 2 versions.
    #[error("wstring is not supported")]
    WideText,
}

/// The maximum number of values in a message: so many for each of its bytes, and so many more. Fields without elements
/// take no bytes, so the length of a message alone does not limit their number.
const VALUES_A_BYTE: usize = 8;
const VALUES_ANYWAY: usize = 256;

/// Reads the fields of a message in order.
pub(super) struct CdrReader<'a> {
    /// The bytes after the encapsulation header; alignment is relative to their start.
    body: &'a [u8],
    at: usize,
    big_endian: bool,
    /// Whether there is no alignment, as in ROS 1.
    unaligned: bool,
    /// The maximum number of values, and how many of them were not read yet.
    most_values: usize,
    values_left: usize,
}

/// A number of fixed size.
pub(super) trait Number<const N: usize>: Sized {
    fn from_le(bytes: [u8; N]) -> Self;
    fn from_be(bytes: [u8; N]) -> Self;
}

macro_rules! numbers {
    ($($of:ty: $size:literal),*) => {$(
        impl Number<$size> for $of {
            fn from_le(bytes: [u8; $size]) -> Self {
                Self::from_le_bytes(bytes)
            }

            fn from_be(bytes: [u8; $size]) -> Self {
                Self::from_be_bytes(bytes)
            }
        }
    )*};
}

numbers!(i8: 1, u8: 1, i16: 2, u16: 2, i32: 4, u32: 4, i64: 8, u64: 8, f32: 4, f64: 8);

impl<'a> CdrReader<'a> {
    /// Reads after the encapsulation header, which contains the byte order. `None` if it is not plain CDR.
    pub(super) fn new(bytes: &'a [u8]) -> Option<Self> {
        let (encapsulation, body) = bytes.split_at_checked(4)?;
        let big_endian = match encapsulation {
            [0, 0, ..] => true,
            [0, 1, ..] => false,
            _ => return None,
        };
        Some(Self::of(body, big_endian, false))
    }

    /// Reads a message in ROS 1 encoding: little-endian, without alignment and without zero bytes after strings.
    pub(super) fn ros1(body: &'a [u8]) -> Self {
        Self::of(body, false, true)
    }

    fn of(body: &'a [u8], big_endian: bool, unaligned: bool) -> Self {
        let most_values = body.len().saturating_mul(VALUES_A_BYTE).saturating_add(VALUES_ANYWAY);
        Self { body, at: 0, big_endian, unaligned, most_values, values_left: most_values }
    }

    /// Reads at most so many values, however long the message is.
    pub(super) fn limit_values(&mut self, most: usize) {
        self.most_values = self.most_values.min(most);
        self.values_left = self.values_left.min(most);
    }

    /// Counts values that are about to be read: fields, and elements that are messages or strings.
    pub(super) fn count_values(&mut self, count: usize) -> Result<(), DecodeFault> {
        self.values_left = self.values_left.checked_sub(count).ok_or(DecodeFault::Values(self.most_values))?;
        Ok(())
    }

    /// Whether numbers are big-endian.
    pub(super) fn is_big_endian(&self) -> bool {
        self.big_endian
    }

    /// Whether the message is in ROS 1 encoding.
    pub(super) fn is_ros1(&self) -> bool {
        self.unaligned
    }

    /// The number of bytes left.
    pub(super) fn left(&self) -> usize {
        self.body.len().saturating_sub(self.at)
    }

    /// Skips to the alignment of a number with this size.
    pub(super) fn align(&mut self, size: usize) {
        if !self.unaligned {
            self.at = self.at.next_multiple_of(size);
        }
    }

    /// The next bytes.
    pub(super) fn bytes(&mut self, count: usize) -> Result<&'a [u8], DecodeFault> {
        let end = self.at.checked_add(count).ok_or(DecodeFault::End)?;
        let bytes = self.body.get(self.at..end).ok_or(DecodeFault::End)?;
        self.at = end;
        Ok(bytes)
    }

    /// The next number.
    pub(super) fn number<const N: usize, T: Number<N>>(&mut self) -> Result<T, DecodeFault> {
        self.align(N);
        let bytes = self.bytes(N)?.try_into().map_err(|_| DecodeFault::End)?;
        Ok(if self.big_endian { T::from_be(bytes) } else { T::from_le(bytes) })
    }

    /// The next `count` numbers.
    pub(super) fn numbers<const N: usize, T: Number<N>>(&mut self, count: usize) -> Result<Vec<T>, DecodeFault> {
        if count == 0 {
            return Ok(Vec::new());
        }
        self.align(N);
        let bytes = self.bytes(count.checked_mul(N).ok_or(DecodeFault::End)?)?;
        let (numbers, _) = bytes.as_chunks::<N>();
        let order = if self.big_endian { T::from_be } else { T::from_le };
        Ok(numbers.iter().map(|bytes| order(*bytes)).collect())
    }

    /// The next boolean.
    pub(super) fn boolean(&mut self) -> Result<bool, DecodeFault> {
        match self.number::<1, u8>()? {
            0 => Ok(false),
            1 => Ok(true),
            other => Err(DecodeFault::Boolean(other)),
        }
    }

    /// The next string: its length including the zero byte, and its bytes.
    pub(super) fn text(&mut self) -> Result<&'a str, DecodeFault> {
        std::str::from_utf8(self.text_bytes()?).map_err(|_| DecodeFault::Text)
    }

    /// The bytes of the next string, without the zero byte.
    pub(super) fn text_bytes(&mut self) -> Result<&'a [u8], DecodeFault> {
        let length = self.number::<4, u32>()? as usize;
        let bytes = self.bytes(length)?;
        // Some writers omit the zero byte of an empty string.
        Ok(bytes.strip_suffix(&[0]).unwrap_or(bytes))
    }
}
