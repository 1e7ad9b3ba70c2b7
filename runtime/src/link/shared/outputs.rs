//! All outputs of a stage over shared memory, and how they wait.

use super::{LinkError, LinkSender, Wake};
use crate::message::{LogTime, MessageHeader};
use crate::stage::{OutputSink, StageError};
use iceoryx2::service::Service;
use std::cell::RefCell;
use std::rc::Rc;
use std::time::{Duration, Instant};

/// The outputs of one stage. While one of them waits for credit, the others send what they have gathered and say how
/// far the stage is, so that no reader waits for a stage that waits.
pub struct SharedOutputs<S: Service> {
    links: Vec<LinkSender<S>>,
    wake: Rc<Wake<S>>,
    waited: Duration,
}

impl<S: Service + 'static> SharedOutputs<S> {
    /// The given outputs of the stage that sleeps on `wake`.
    pub fn new(links: Vec<LinkSender<S>>, wake: Rc<Wake<S>>) -> Rc<RefCell<Self>> {
        Rc::new(RefCell::new(Self { links, wake, waited: Duration::ZERO }))
    }

    /// The sink of the output with the given place in the list.
    pub fn sink(outputs: &Rc<RefCell<Self>>, link: usize) -> Box<dyn OutputSink> {
        Box::new(SharedSink { outputs: Rc::clone(outputs), link })
    }

    /// How long outputs have waited for credit.
    pub fn waited(&self) -> Duration {
        self.waited
    }

    /// The latest log time that any output has reached.
    pub fn reached(&self) -> LogTime {
        self.links.iter().map(LinkSender::reached).max().unwrap_or_default()
    }

    /// Sends what was gathered and the watermark, on every link that has credit.
    pub fn flush(&mut self, watermark: LogTime) -> Result<(), LinkError> {
        if self.links.iter().any(|link| (link.has_batch() || link.can_raise(watermark)) && !link.has_credit()) {
            self.wake.poll()?;
        }
        self.links.iter_mut().try_for_each(|link| flush_link(link, watermark))
    }

    /// Sends all that was gathered and the end of the stream on every link, and waits until every reader has
    /// acknowledged it. The stage had come to the log time `time`.
    pub fn end(&mut self, time: LogTime) -> Result<(), LinkError> {
        for link in 0..self.links.len() {
            if self.links[link].has_batch() {
                self.wait_for_credit(link, time)?;
                self.links[link].send_batch()?;
            }
            self.wait_for_credit(link, time)?;
            self.links[link].end(time)?;
        }
        while !self.links.iter().all(LinkSender::is_acknowledged) {
            self.wake.sleep()?;
        }
        Ok(())
    }

    /// Waits until the link has credit. Meanwhile the others learn that nothing before `watermark` will follow.
    fn wait_for_credit(&mut self, link: usize, watermark: LogTime) -> Result<(), LinkError> {
        if self.links[link].has_credit() {
            return Ok(());
        }
        self.wake.poll()?;
        let start = Instant::now();
        while !self.links[link].has_credit() {
            for (other, sender) in self.links.iter_mut().enumerate() {
                if other != link {
                    flush_link(sender, watermark)?;
                }
            }
            self.wake.sleep()?;
        }
        self.waited += start.elapsed();
        Ok(())
    }
}

/// Sends what a link has gathered, and the watermark, as far as it has credit.
fn flush_link<S: Service>(link: &mut LinkSender<S>, watermark: LogTime) -> Result<(), LinkError> {
    if link.has_batch() && link.has_credit() {
        link.send_batch()?;
    }
    if !link.has_batch() && link.can_raise(watermark) && link.has_credit() {
        link.raise(watermark)?;
    }
    Ok(())
}

/// One output of a stage, as the stage sees it.
struct SharedSink<S: Service> {
    outputs: Rc<RefCell<SharedOutputs<S>>>,
    link: usize,
}

impl<S: Service + 'static> OutputSink for SharedSink<S> {
    fn send(&mut self, mut header: MessageHeader, bytes: &[u8]) -> Result<(), StageError> {
        let outputs = &mut *self.outputs.borrow_mut();
        outputs.links[self.link].stamp(&mut header)?;
        let time = header.log_time;
        if outputs.links[self.link].is_gathered(bytes.len()) {
            if outputs.links[self.link].gather(&header, bytes) {
                outputs.wait_for_credit(self.link, time)?;
                outputs.links[self.link].send_batch()?;
            }
            return Ok(());
        }
        outputs.make_way(self.link, time)?;
        Ok(outputs.links[self.link].send_bytes(header, bytes)?)
    }

    fn send_in_place(
        &mut self,
        mut header: MessageHeader,
        write: &mut dyn FnMut(&mut [u8]) -> Result<(), StageError>,
    ) -> Result<(), StageError> {
        let outputs = &mut *self.outputs.borrow_mut();
        outputs.links[self.link].stamp(&mut header)?;
        outputs.make_way(self.link, header.log_time)?;
        outputs.links[self.link].send_in_place(header, write)
    }
}

impl<S: Service + 'static> SharedOutputs<S> {
    /// Makes a link ready for a message by itself: sends what was gathered before it, and waits for credit.
    fn make_way(&mut self, link: usize, time: LogTime) -> Result<(), LinkError> {
        if self.links[link].has_batch() {
            self.wait_for_credit(link, time)?;
            self.links[link].send_batch()?;
        }
        self.wait_for_credit(link, time)
    }
}

impl From<LinkError> for StageError {
    fn from(error: LinkError) -> Self {
        StageError::new("send a message", error)
    }
}
