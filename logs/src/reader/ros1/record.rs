//! The records of a bag: a header of named fields, and data.

use crate::reader::bytes::Window;
use crate::reader::record::Fields;
use std::collections::BTreeMap;
use std::ops::Range;

/// The opcodes of records.
pub(crate) const MESSAGE: u8 = 2;
pub(crate) const BAG: u8 = 3;
pub(crate) const INDEX: u8 = 4;
pub(crate) const CHUNK: u8 = 5;
pub(crate) const CHUNK_INFO: u8 = 6;
pub(crate) const CONNECTION: u8 = 7;

/// The maximum length of a header, bytes; actual headers have tens of bytes.
const LONGEST_HEADER: usize = 1 << 20;

/// The fields of a header, by name.
#[derive(Debug, Default)]
pub(super) struct Header<'a>(BTreeMap<&'a [u8], &'a [u8]>);

impl<'a> Header<'a> {
    /// Parses all fields; of fields with the same name the first is used. `None` if they do not fill the bytes.
    pub(super) fn parse(bytes: &'a [u8]) -> Option<Self> {
        let mut rest = Fields(bytes);
        let mut fields = BTreeMap::new();
        while !rest.0.is_empty() {
            let field = rest.block()?.0;
            let end = field.iter().position(|byte| *byte == b'=')?;
            fields.entry(&field[..end]).or_insert(&field[end + 1..]);
        }
        Some(Self(fields))
    }

    pub(super) fn bytes(&self, name: &str) -> Option<&'a [u8]> {
        self.0.get(name.as_bytes()).copied()
    }

    pub(super) fn text(&self, name: &str) -> Option<String> {
        self.bytes(name).map(|bytes| String::from_utf8_lossy(bytes).into_owned())
    }

    pub(super) fn opcode(&self) -> Option<u8> {
        self.bytes("op")?.first().copied()
    }

    pub(super) fn u32(&self, name: &str) -> Option<u32> {
        Fields(self.bytes(name)?).u32()
    }

    /// A time, nanoseconds.
    pub(super) fn time(&self, name: &str) -> Option<u64> {
        time(&mut Fields(self.bytes(name)?))
    }
}

/// A ROS 1 time, converted to nanoseconds: seconds, and nanoseconds of the second.
pub(super) fn time(fields: &mut Fields<'_>) -> Option<u64> {
    let (seconds, nanoseconds) = (u64::from(fields.u32()?), u64::from(fields.u32()?));
    Some(seconds * 1_000_000_000 + nanoseconds)
}

/// A record in memory: its header, its data, and the end position.
pub(super) fn record_at(bytes: &[u8], position: usize) -> Option<(Header<'_>, &[u8], usize)> {
    let mut fields = Fields(bytes.get(position..)?);
    let header = Header::parse(fields.block()?.0)?;
    let data = fields.block()?.0;
    Some((header, data, bytes.len() - fields.0.len()))
}

/// A record in a file: the bytes of its header, and the location of its data.
pub(super) fn record_in(file: &mut Window<'_>, position: usize) -> Option<(Vec<u8>, Range<usize>)> {
    let length_at = |file: &mut Window<'_>, position: usize| {
        usize::try_from(u32::from_le_bytes(file.bytes(position, 4)?.try_into().ok()?)).ok()
    };
    let header_length = length_at(file, position).filter(|length| *length <= LONGEST_HEADER)?;
    let header = file.bytes(position + 4, header_length)?.to_vec();
    let begin = position + 4 + header_length;
    let length = length_at(file, begin)?;
    Some((header, begin + 4..(begin + 4).checked_add(length)?))
}
