//! Large payloads between threads: buffers on the heap that travel beside the samples.
//!
//! iceoryx2 sets as many places aside as can ever be in use, each with room for the largest payload so far. Between
//! processes only the places that were written to take memory. Within one process all of them are asked of the heap at
//! once: for a map of 16 MB and six readers that is 11 GB. So there a large payload gets a buffer of its own, which all
//! readers share without copying it, and its sample, sent as any other, has no payload.

use super::LinkError;
use crate::message::Storage;
use std::collections::{BTreeMap, VecDeque};
use std::rc::Rc;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The payloads of a run that readers have yet to take, by the name of the link.
#[derive(Clone, Debug, Default)]
pub(super) struct HeapPayloads(Arc<Mutex<BTreeMap<String, Queue>>>);

/// The payloads of one link, in the order in which they were left.
type Queue = Arc<Mutex<VecDeque<HeapPayload>>>;

#[derive(Debug)]
struct HeapPayload {
    /// The number of its first message.
    sequence: u64,
    bytes: Arc<Vec<u8>>,
    /// How many readers have yet to take it.
    readers: usize,
}

impl HeapPayloads {
    /// One end of the link with the given name.
    pub(super) fn link(&self, name: &str) -> HeapLink {
        let payloads = Arc::clone(lock(&self.0).entry(name.to_owned()).or_default());
        HeapLink { payloads, name: name.to_owned() }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // Nothing that is done under a lock here can be left half done.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// One end of a link whose large payloads travel on the heap.
pub(super) struct HeapLink {
    payloads: Queue,
    name: String,
}

impl HeapLink {
    /// An empty buffer with room for `length` bytes.
    pub(super) fn buffer(&self, length: usize) -> Result<Vec<u8>, LinkError> {
        let mut buffer = Vec::new();
        let reserved = buffer.try_reserve_exact(length);
        reserved.map_err(|_| LinkError::Memory { link: self.name.clone(), bytes: length })?;
        Ok(buffer)
    }

    /// Leaves a payload whose first message has the number `sequence` for `readers` readers. Its sample must be sent
    /// after this.
    pub(super) fn leave(&self, sequence: u64, bytes: Vec<u8>, readers: usize) {
        lock(&self.payloads).push_back(HeapPayload { sequence, bytes: Arc::new(bytes), readers });
    }

    /// Takes the payload whose first message has the number `sequence`, once for each reader.
    pub(super) fn take(&self, sequence: u64) -> Result<Rc<dyn Storage>, LinkError> {
        let mut payloads = lock(&self.payloads);
        let found = payloads.iter_mut().enumerate().find(|(_, payload)| payload.sequence == sequence);
        let Some((place, payload)) = found else {
            let problem = format!("the bytes of its message {sequence} are not there");
            return Err(LinkError::Sample { link: self.name.clone(), problem });
        };
        let bytes = Arc::clone(&payload.bytes);
        payload.readers = payload.readers.saturating_sub(1);
        if payload.readers == 0 {
            payloads.remove(place);
        }
        Ok(Rc::new(bytes))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readers_share_the_bytes_and_the_last_leaves_nothing_behind() {
        let payloads = HeapPayloads::default();
        let (link, other) = (payloads.link("a.b"), payloads.link("a.c"));
        let mut bytes = link.buffer(5000).unwrap();
        bytes.resize(5000, 3);
        let place = bytes.as_ptr();
        link.leave(7, bytes, 2);
        assert!(other.take(7).is_err());
        assert!(link.take(8).is_err());
        let [one, two] = [link.take(7).unwrap(), link.take(7).unwrap()];
        assert_eq!((one.bytes().as_ptr(), two.bytes().as_ptr()), (place, place));
        assert_eq!(one.bytes(), [3; 5000]);
        assert!(lock(&link.payloads).is_empty());
        assert!(link.take(7).is_err());
    }

    #[test]
    fn a_payload_for_which_there_is_no_memory_is_an_error_that_names_the_link_and_the_size() {
        let link = HeapPayloads::default().link("source.map");
        for length in [usize::MAX / 4, usize::MAX] {
            let error = link.buffer(length).unwrap_err().to_string();
            assert!(error.contains("source.map") && error.contains(&length.to_string()), "{error}");
        }
    }
}
