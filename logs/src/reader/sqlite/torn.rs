//! Incomplete messages of a truncated database, whose missing parts SQLite reads as zeros.
//!
//! The table is scanned page by page (SQLite, "Database File Format", sections 1.6 and 1.7): a row that does not fit
//! into its page continues in a chain of overflow pages, which must all be present.

use crate::reader::bytes::FileBytes;

/// The page types of a table.
const INTERIOR: u8 = 0x05;
const LEAF: u8 = 0x0d;
/// The length of the database header, in the first page.
const FILE_HEADER: usize = 100;

/// The pages of a database.
pub(super) struct Pages<'a> {
    file: &'a FileBytes,
    size: usize,
    /// The usable bytes of a page.
    usable: usize,
    /// The number of complete pages.
    whole: usize,
}

impl<'a> Pages<'a> {
    /// Opens the pages of a file; `None` if its header is invalid.
    pub(super) fn new(file: &'a FileBytes) -> Option<Self> {
        let header = file.read(0..FILE_HEADER)?;
        let size = match u16::from_be_bytes(header.get(16..18)?.try_into().ok()?) {
            1 => 65536,
            size => usize::from(size),
        };
        let usable = size.checked_sub(usize::from(*header.get(20)?))?;
        (size.is_power_of_two() && usable >= 480).then(|| Self { file, size, usable, whole: file.len() / size })
    }

    /// The ids of incomplete rows of a table, ascending. `root` is the table's first page.
    pub(super) fn torn_rows(&self, root: usize) -> Vec<i64> {
        let mut torn = Vec::new();
        let mut pending = vec![root];
        // Pages may point to each other in a cycle.
        let mut left = self.whole + 1;
        // Each overflow page belongs to one row.
        let mut overflow_left = self.whole;
        while let Some(number) = pending.pop() {
            let Some(page) = self.page(number) else { continue };
            let Some(fewer) = left.checked_sub(1) else { break };
            left = fewer;
            let start = if number == 1 { FILE_HEADER } else { 0 };
            let _ = self.look_into(&page, start, &mut pending, &mut torn, &mut overflow_left);
        }
        torn.sort_unstable();
        torn
    }

    /// Scans a page of a table, as far as it is valid.
    fn look_into(
        &self,
        page: &[u8],
        start: usize,
        pending: &mut Vec<usize>,
        torn: &mut Vec<i64>,
        overflow_left: &mut usize,
    ) -> Option<()> {
        let cells = usize::from(u16::from_be_bytes(page.get(start + 3..start + 5)?.try_into().ok()?));
        let kind = *page.get(start)?;
        let pointers = match kind {
            INTERIOR => {
                pending.push(number_at(page, start + 8)?);
                start + 12
            }
            LEAF => start + 8,
            _ => return None,
        };
        for cell in 0..cells {
            let at = pointers + 2 * cell;
            let cell = usize::from(u16::from_be_bytes(page.get(at..at + 2)?.try_into().ok()?));
            match kind {
                INTERIOR => pending.push(number_at(page, cell)?),
                _ => torn.extend(self.torn_row(page, cell, overflow_left)),
            }
        }
        Some(())
    }

    /// The id of the row in a cell, if it is incomplete, or needs more than `overflow_left` overflow pages.
    fn torn_row(&self, page: &[u8], cell: usize, overflow_left: &mut usize) -> Option<i64> {
        let (length, used) = varint(page.get(cell..)?)?;
        let (row, more) = varint(page.get(cell + used..)?)?;
        let (length, most) = (usize::try_from(length).ok()?, self.usable - 35);
        let begin = cell + used + more;
        if length <= most {
            return (begin + length > page.len()).then_some(row.cast_signed());
        }
        let least = (self.usable - 12) * 32 / 255 - 23;
        let rest = least + (length - least) % (self.usable - 4);
        let local = if rest <= most { rest } else { least };
        let Some(mut next) = number_at(page, begin + local) else { return Some(row.cast_signed()) };
        for _ in 0..(length - local).div_ceil(self.usable - 4) {
            let Some(left) = overflow_left.checked_sub(1) else { return Some(row.cast_signed()) };
            *overflow_left = left;
            let place = next.checked_sub(1).filter(|_| next <= self.whole);
            let Some(place) = place else { return Some(row.cast_signed()) };
            let start = place * self.size;
            next = number_at(&self.file.read(start..start + 4)?, 0)?;
        }
        None
    }

    /// A page, or the existing part of it.
    fn page(&self, number: usize) -> Option<Vec<u8>> {
        let start = number.checked_sub(1)?.checked_mul(self.size)?;
        self.file.read(start..start.checked_add(self.size)?.min(self.file.len()))
    }
}

fn number_at(page: &[u8], at: usize) -> Option<usize> {
    usize::try_from(u32::from_be_bytes(page.get(at..at + 4)?.try_into().ok()?)).ok()
}

/// A varint of 1 to 9 bytes, of which all but the ninth have a continuation bit; and its length.
fn varint(bytes: &[u8]) -> Option<(u64, usize)> {
    let mut number = 0_u64;
    for (at, &byte) in bytes.iter().take(9).enumerate() {
        if at == 8 {
            return Some((number << 8 | u64::from(byte), 9));
        }
        number = number << 7 | u64::from(byte & 0x7f);
        if byte & 0x80 == 0 {
            return Some((number, at + 1));
        }
    }
    None
}
