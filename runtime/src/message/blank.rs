//! Uninitialized memory of a message, and the proof that it was initialized.
//!
//! A sender lends the memory that its readers will see as a [`Blank`]. The writer returns a [`Filled`], which can only
//! be obtained by writing all of a blank. So no byte is written twice, and none is sent uninitialized.

use crate::stage::StageError;
use std::mem::MaybeUninit;
use std::ops::{Deref, DerefMut};

/// Uninitialized memory that is to be written completely.
#[derive(Debug)]
pub struct Blank<'a>(&'a mut [MaybeUninit<u8>]);

/// The memory of a [`Blank`] after it was written completely.
#[derive(Debug)]
pub struct Filled<'a>(&'a mut [u8]);

/// A function that writes a message in place.
pub type Write<'w> = dyn for<'a> FnMut(Blank<'a>) -> Result<Filled<'a>, StageError> + 'w;

impl<'a> Blank<'a> {
    pub(crate) fn new(memory: &'a mut [MaybeUninit<u8>]) -> Self {
        Self(memory)
    }

    /// The number of bytes to be written.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether there is nothing to write.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Fills the memory with one value.
    pub fn fill_with(self, value: u8) -> Filled<'a> {
        self.0.fill(MaybeUninit::new(value));
        // SAFETY: each byte was written.
        #[allow(unsafe_code)]
        let filled = unsafe { self.0.assume_init_mut() };
        Filled(filled)
    }

    /// Copies bytes of the same length.
    ///
    /// # Errors
    /// The lengths differ.
    pub fn copy_from(self, bytes: &[u8]) -> Result<Filled<'a>, StageError> {
        match bytes.len() == self.len() {
            true => Ok(Filled(self.0.write_copy_of_slice(bytes))),
            false => Err(wrong(bytes.len(), self.len())),
        }
    }

    /// Copies the cells of a grid of the same length.
    ///
    /// # Errors
    /// The lengths differ.
    pub fn copy_cells(self, cells: &[i8]) -> Result<Filled<'a>, StageError> {
        self.copy_from(bytemuck::cast_slice(cells))
    }

    /// Copies `head` to the beginning, and lets `rest` write the remaining memory.
    ///
    /// # Errors
    /// `head` is too long, or `rest` fails or returns other memory than it was given.
    pub fn copy_then(self, head: &[u8], rest: &mut Write<'_>) -> Result<Filled<'a>, StageError> {
        if head.len() > self.len() {
            return Err(wrong(head.len(), self.len()));
        }
        let (start, tail) = self.0.split_at_mut(head.len());
        start.write_copy_of_slice(head);
        write_all(tail, rest)?;
        // SAFETY: the head was copied, and `write_all` has succeeded for the rest.
        #[allow(unsafe_code)]
        let filled = unsafe { self.0.assume_init_mut() };
        Ok(Filled(filled))
    }
}

impl Filled<'_> {
    /// The bytes as cells of a grid.
    pub fn cells_mut(&mut self) -> &mut [i8] {
        bytemuck::cast_slice_mut(self.0)
    }
}

impl Deref for Filled<'_> {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        self.0
    }
}

impl DerefMut for Filled<'_> {
    fn deref_mut(&mut self) -> &mut [u8] {
        self.0
    }
}

/// Lets `write` write all of `memory`. If this succeeds, every byte is initialized.
pub(crate) fn write_all(memory: &mut [MaybeUninit<u8>], write: &mut Write<'_>) -> Result<(), StageError> {
    let (start, length) = (memory.as_ptr().cast::<u8>(), memory.len());
    let filled = write(Blank::new(memory))?;
    // A `Filled` with this address and length can only come from this blank, as no two blanks overlap.
    match filled.0.as_ptr() == start && filled.0.len() == length {
        true => Ok(()),
        false => {
            Err(StageError::new("write a message in place", "the memory that was written is not that of the message"))
        }
    }
}

/// Lets `write` write a buffer of `length` bytes, reusing the memory of `buffer`; for a sink with messages on the heap.
///
/// # Errors
/// `write` fails, or returns other memory than it was given.
#[allow(unsafe_code)]
pub fn write_vec(mut buffer: Vec<u8>, length: usize, write: &mut Write<'_>) -> Result<Vec<u8>, StageError> {
    buffer.clear();
    buffer.reserve_exact(length);
    write_all(&mut buffer.spare_capacity_mut()[..length], write)?;
    // SAFETY: `length` is within the capacity, and `write_all` has succeeded, so that many bytes are initialized.
    unsafe { buffer.set_len(length) };
    Ok(buffer)
}

fn wrong(given: usize, expected: usize) -> StageError {
    StageError::new("write a message in place", format!("{given} bytes were given, {expected} expected"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(length: usize, write: &mut Write<'_>) -> Result<Vec<u8>, StageError> {
        write_vec(Vec::new(), length, write)
    }

    #[test]
    fn a_message_is_what_was_written() {
        assert_eq!(written(3, &mut |blank| blank.copy_from(b"abc")).unwrap(), b"abc");
        assert_eq!(written(2, &mut |blank| blank.copy_cells(&[-1, 100])).unwrap(), [255, 100]);
        assert_eq!(written(0, &mut |blank| Ok(blank.fill_with(1))).unwrap(), b"");
        let head_and_rest = written(5, &mut |blank| {
            blank.copy_then(b"ab", &mut |rest| {
                let mut rest = rest.fill_with(b'-');
                rest[1] = b'c';
                Ok(rest)
            })
        });
        assert_eq!(head_and_rest.unwrap(), b"ab-c-");
    }

    #[test]
    fn other_lengths_are_errors() {
        assert!(written(3, &mut |blank| blank.copy_from(b"ab")).is_err());
        assert!(written(1, &mut |blank| blank.copy_then(b"ab", &mut |rest| Ok(rest.fill_with(0)))).is_err());
        assert!(written(1, &mut |_| Err(StageError::new("go on", "on purpose"))).is_err());
    }

    #[test]
    fn memory_of_another_message_is_rejected() {
        let other = || Blank::new(Box::leak(Box::new([MaybeUninit::uninit(); 4]))).fill_with(0);
        assert!(written(4, &mut |_| Ok(other())).is_err());
        let mut whole = [MaybeUninit::uninit(); 4];
        assert!(write_all(&mut whole, &mut |blank| Ok(Blank::new(&mut blank.0[..2]).fill_with(0))).is_err());
    }
}
