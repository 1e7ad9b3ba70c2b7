//! Large payloads between threads: buffers on the heap that are passed next to the samples.
//!
//! iceoryx2 reserves a slot for every sample that can ever be in use, each with space for the largest payload so far.
//! Between processes only slots that were written to take memory. Within one process all of them are allocated on the
//! heap at once: 11 GB for a map of 16 MB and six readers. Therefore a large payload gets a separate buffer there,
//! which all readers share without copying it, and its sample is sent without a payload.

use super::LinkError;
use crate::message::Storage;
use std::collections::{BTreeMap, VecDeque};
use std::rc::Rc;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The pending payloads of a run, by the name of the link.
#[derive(Clone, Debug, Default)]
pub(super) struct HeapPayloads(Arc<Mutex<BTreeMap<String, Queue>>>);

/// The pending payloads of one link, in the order in which they were pushed.
type Queue = Arc<Mutex<VecDeque<HeapPayload>>>;

#[derive(Debug)]
struct HeapPayload {
    /// The sequence number of its first message.
    sequence: u64,
    bytes: Arc<Vec<u8>>,
    /// The number of readers that have not taken it.
    readers: usize,
}

impl HeapPayloads {
    /// An end of the link with the given name.
    pub(super) fn link(&self, name: &str) -> HeapLink {
        let payloads = Arc::clone(lock(&self.0).entry(name.to_owned()).or_default());
        HeapLink { payloads, name: name.to_owned() }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // No operation under this lock can panic halfway, so a poisoned lock still guards consistent data.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// An end of a link that passes large payloads on the heap.
pub(super) struct HeapLink {
    payloads: Queue,
    name: String,
}

impl HeapLink {
    /// An empty buffer with a capacity of `length` bytes.
    pub(super) fn buffer(&self, length: usize) -> Result<Vec<u8>, LinkError> {
        let mut buffer = Vec::new();
        let reserved = buffer.try_reserve_exact(length);
        reserved.map_err(|_| LinkError::Memory { link: self.name.clone(), bytes: length })?;
        Ok(buffer)
    }

    /// Adds a payload, whose first message has the number `sequence`, for `readers` readers. Its sample must be sent
    /// afterwards.
    pub(super) fn push(&self, sequence: u64, bytes: Vec<u8>, readers: usize) {
        lock(&self.payloads).push_back(HeapPayload { sequence, bytes: Arc::new(bytes), readers });
    }

    /// Takes the payload whose first message has the number `sequence`; each reader takes it once.
    pub(super) fn take(&self, sequence: u64) -> Result<Rc<dyn Storage>, LinkError> {
        let mut payloads = lock(&self.payloads);
        let found = payloads.iter_mut().enumerate().find(|(_, payload)| payload.sequence == sequence);
        let Some((index, payload)) = found else {
            let problem = format!("the payload of message {sequence} is missing");
            return Err(LinkError::Sample { link: self.name.clone(), problem });
        };
        let bytes = Arc::clone(&payload.bytes);
        payload.readers = payload.readers.saturating_sub(1);
        if payload.readers == 0 {
            payloads.remove(index);
        }
        Ok(Rc::new(bytes))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readers_share_a_payload_and_the_last_one_removes_it() {
        let payloads = HeapPayloads::default();
        let (link, other) = (payloads.link("a.b"), payloads.link("a.c"));
        let mut bytes = link.buffer(5000).unwrap();
        bytes.resize(5000, 3);
        let pointer = bytes.as_ptr();
        link.push(7, bytes, 2);
        assert!(other.take(7).is_err());
        assert!(link.take(8).is_err());
        let [one, two] = [link.take(7).unwrap(), link.take(7).unwrap()];
        assert_eq!((one.bytes().as_ptr(), two.bytes().as_ptr()), (pointer, pointer));
        assert_eq!(one.bytes(), [3; 5000]);
        assert!(lock(&link.payloads).is_empty());
        assert!(link.take(7).is_err());
    }

    #[test]
    fn the_error_of_a_failed_allocation_names_the_link_and_the_size() {
        let link = HeapPayloads::default().link("source.map");
        for length in [usize::MAX / 4, usize::MAX] {
            let error = link.buffer(length).unwrap_err().to_string();
            assert!(error.contains("source.map") && error.contains(&length.to_string()), "{error}");
        }
    }
}
