//! Links between stages of one thread: a message is pushed directly to the queues of its readers.

use super::{InputQueue, Sequence};
use crate::message::{LogTime, Message, MessageHeader, Write, write_vec};
use crate::stage::{OutputSink, StageError};
use std::cell::RefCell;
use std::rc::Rc;

/// An input queue that a sender of the same thread pushes to.
pub type SharedQueue = Rc<RefCell<InputQueue>>;

/// An output and the queues of all its readers.
#[derive(Clone, Debug, Default)]
pub struct DirectLink {
    readers: Vec<(SharedQueue, usize)>,
    sequence: Rc<RefCell<Sequence>>,
}

impl DirectLink {
    /// Adds a reader: its queue, and the index of the wire within the reading stage.
    pub fn add_reader(&mut self, queue: SharedQueue, wire: usize) {
        self.readers.push((queue, wire));
    }

    /// Whether anything reads the link.
    pub fn has_readers(&self) -> bool {
        !self.readers.is_empty()
    }

    /// Sends the readers a watermark: no message before it will follow.
    pub fn raise(&self, watermark: LogTime) {
        if self.sequence.borrow_mut().raise(watermark) {
            self.readers.iter().for_each(|(queue, _)| queue.borrow_mut().raise(watermark));
        }
    }

    /// Ends the stream for all readers, at the given log time.
    pub fn end(&self, time: LogTime) {
        self.readers.iter().for_each(|(queue, _)| queue.borrow_mut().end(time));
    }

    /// The memory of the messages that wait in the queue of a reader, bytes: of the one where it is most.
    pub fn pending_bytes(&self) -> usize {
        self.readers.iter().map(|(queue, _)| queue.borrow().bytes()).max().unwrap_or_default()
    }

    /// The log time that the link has reached.
    pub fn reached(&self) -> LogTime {
        self.sequence.borrow().reached()
    }

    fn deliver(&self, header: MessageHeader, bytes: Vec<u8>) {
        let message = Message::from_vec(header, bytes);
        for (queue, wire) in &self.readers {
            queue.borrow_mut().push(message.clone().on_wire(*wire));
        }
    }
}

impl OutputSink for DirectLink {
    fn send(&mut self, mut header: MessageHeader, bytes: &[u8]) -> Result<(), StageError> {
        self.sequence.borrow_mut().stamp(&mut header)?;
        self.deliver(header, bytes.to_vec());
        Ok(())
    }

    fn send_in_place(&mut self, mut header: MessageHeader, write: &mut Write<'_>) -> Result<(), StageError> {
        self.sequence.borrow_mut().stamp(&mut header)?;
        let bytes = write_vec(Vec::new(), header.length as usize, write)?;
        self.deliver(header, bytes);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message::MessageFlags;

    #[test]
    fn what_waits_is_known_until_it_is_taken() {
        let (mut link, queue) = (DirectLink::default(), SharedQueue::default());
        assert_eq!(link.pending_bytes(), 0);
        link.add_reader(Rc::clone(&queue), 0);
        let header = MessageHeader { flags: MessageFlags::DATA, length: 1000, ..Default::default() };
        link.send(header, &[0; 1000]).unwrap();
        assert!(link.pending_bytes() > 1000);
        InputQueue::default().append(&mut queue.borrow_mut());
        assert_eq!(link.pending_bytes(), 0);
    }
}
