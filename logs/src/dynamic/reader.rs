//! CDR by hand: numbers and texts, aligned as the encoding wants it; and the encoding of ROS 1, which aligns nothing.

/// What is wrong with a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DecodeFault {
    /// The bytes end within it.
    #[error("it ends")]
    End,
    /// It claims more elements than the rest of the message has room for.
    #[error("there is no room for the {0} elements that it claims")]
    Count(usize),
    /// A truth value is neither 0 nor 1.
    #[error("a truth value is {0}")]
    Boolean(u8),
    /// A text is not UTF-8.
    #[error("the text is not UTF-8")]
    Text,
    /// `wstring`: how it is encoded differs between the versions of ROS 2.
    #[error("there is a wide text (wstring), which cannot be read")]
    WideText,
}

/// Reads the fields of a message one after the other.
pub(super) struct CdrReader<'a> {
    /// What follows the encapsulation; alignment counts from here.
    body: &'a [u8],
    at: usize,
    big_endian: bool,
    /// Whether the fields follow each other without a gap, as in ROS 1.
    packed: bool,
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
    /// Reads what follows the encapsulation, which says the byte order. `None` if it is none of plain CDR.
    pub(super) fn new(bytes: &'a [u8]) -> Option<Self> {
        let (encapsulation, body) = bytes.split_at_checked(4)?;
        let big_endian = match encapsulation {
            [0, 0, ..] => true,
            [0, 1, ..] => false,
            _ => return None,
        };
        Some(Self { body, at: 0, big_endian, packed: false })
    }

    /// Reads a message as ROS 1 encodes it: little-endian, without gaps, texts without a zero byte.
    pub(super) fn ros1(body: &'a [u8]) -> Self {
        Self { body, at: 0, big_endian: false, packed: true }
    }

    /// Whether numbers are big-endian.
    pub(super) fn is_big_endian(&self) -> bool {
        self.big_endian
    }

    /// Whether the message is encoded as in ROS 1.
    pub(super) fn is_ros1(&self) -> bool {
        self.packed
    }

    /// How many bytes are left.
    pub(super) fn left(&self) -> usize {
        self.body.len().saturating_sub(self.at)
    }

    /// Goes on to where a number of this size may begin.
    pub(super) fn align(&mut self, size: usize) {
        if !self.packed {
            self.at = self.at.next_multiple_of(size);
        }
    }

    /// The next bytes, as they are.
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

    /// The next truth value.
    pub(super) fn boolean(&mut self) -> Result<bool, DecodeFault> {
        match self.number::<1, u8>()? {
            0 => Ok(false),
            1 => Ok(true),
            other => Err(DecodeFault::Boolean(other)),
        }
    }

    /// The next text: its length with the zero byte behind it, and its bytes.
    pub(super) fn text(&mut self) -> Result<&'a str, DecodeFault> {
        std::str::from_utf8(self.text_bytes()?).map_err(|_| DecodeFault::Text)
    }

    /// The bytes of the next text, without the zero byte behind it.
    pub(super) fn text_bytes(&mut self) -> Result<&'a [u8], DecodeFault> {
        let length = self.number::<4, u32>()? as usize;
        let bytes = self.bytes(length)?;
        // Some writers give an empty text no zero byte.
        Ok(bytes.strip_suffix(&[0]).unwrap_or(bytes))
    }
}
