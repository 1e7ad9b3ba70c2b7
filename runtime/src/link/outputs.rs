//! All outputs of a stage, and how they wait.

use super::stage_board::StageNumber;
use super::{LinkError, LinkSender, Sleeper};
use crate::message::{LogTime, MessageHeader, Write};
use crate::stage::{OutputSink, StageError};
use iceoryx2::service::Service;
use std::cell::RefCell;
use std::rc::Rc;

/// The outputs of one stage. While one of them waits for room, the others send what they have gathered and say how far the
/// stage is, so that no reader waits for a stage that waits.
pub struct Outputs<S: Service> {
    links: Vec<LinkSender<S>>,
    sleeper: Rc<Sleeper>,
    /// How many greetings were answered.
    greeted: u64,
}

impl<S: Service + 'static> Outputs<S> {
    /// The outputs of the stage that sleeps on `sleeper`.
    pub fn new(links: Vec<LinkSender<S>>, sleeper: Rc<Sleeper>) -> Rc<RefCell<Self>> {
        Rc::new(RefCell::new(Self { links, sleeper, greeted: 0 }))
    }

    /// The sink of the output with the given place in the list.
    pub fn sink(outputs: &Rc<RefCell<Self>>, link: usize) -> Box<dyn OutputSink> {
        Box::new(Sink { outputs: Rc::clone(outputs), link })
    }

    /// The outputs.
    pub(crate) fn links(&mut self) -> &mut [LinkSender<S>] {
        &mut self.links
    }

    /// The latest log time that any output has reached.
    pub(crate) fn reached(&self) -> LogTime {
        self.links.iter().map(LinkSender::reached).max().unwrap_or_default()
    }

    /// Sends what was gathered and the watermark, on every link that has room.
    pub(crate) fn flush(&mut self, watermark: LogTime) -> Result<(), LinkError> {
        self.links.iter_mut().try_for_each(|link| flush(link, watermark))
    }

    /// Whether a link has something to flush, and room for it.
    pub(crate) fn can_flush(&mut self, watermark: LogTime) -> bool {
        self.links.iter_mut().any(|link| (link.has_batch() || link.can_raise(watermark)) && link.has_room())
    }

    /// Whether a reader, or a program that looks on, has come and is to be sent what it has missed.
    pub(crate) fn is_greeted(&self) -> bool {
        self.greeted != self.sleeper.board().get(StageNumber::Greetings)
    }

    /// Sends the last messages of live links again, if somebody has come since.
    pub(crate) fn answer_greetings(&mut self) -> Result<(), LinkError> {
        if self.is_greeted() {
            self.greeted = self.sleeper.board().get(StageNumber::Greetings);
            self.links.iter_mut().try_for_each(LinkSender::repeat)?;
        }
        Ok(())
    }

    /// Sends all that was gathered and the end of the stream on every link, and waits until every reader has
    /// acknowledged it. The stage had come to the log time `time`.
    pub(crate) fn end(&mut self, time: LogTime) -> Result<(), LinkError> {
        for link in 0..self.links.len() {
            self.make_way(link, time)?;
            self.links[link].end(time)?;
        }
        let links = &self.links;
        self.sleeper.wait(|| Ok(links.iter().all(LinkSender::is_acknowledged)))
    }

    /// Makes a link ready for a sample by itself: sends what was gathered before it, and waits for room.
    fn make_way(&mut self, link: usize, time: LogTime) -> Result<(), LinkError> {
        self.send_batch(link, time)?;
        self.wait_for_room(link, time)
    }

    fn send_batch(&mut self, link: usize, time: LogTime) -> Result<(), LinkError> {
        if self.links[link].has_batch() {
            self.wait_for_room(link, time)?;
            self.links[link].send_batch()?;
        }
        Ok(())
    }

    /// Waits until the link has room. Meanwhile the others learn that nothing before `watermark` will follow.
    fn wait_for_room(&mut self, link: usize, watermark: LogTime) -> Result<(), LinkError> {
        let Self { links, sleeper, .. } = self;
        if links[link].has_room() {
            return Ok(());
        }
        sleeper.wait(|| {
            for (_, other) in links.iter_mut().enumerate().filter(|(other, _)| *other != link) {
                flush(other, watermark)?;
            }
            Ok(links[link].has_room())
        })
    }
}

/// Sends what a link has gathered, and the watermark, as far as it has room.
fn flush<S: Service + 'static>(link: &mut LinkSender<S>, watermark: LogTime) -> Result<(), LinkError> {
    if link.has_batch() && link.has_room() {
        link.send_batch()?;
    }
    if !link.has_batch() && link.can_raise(watermark) && link.has_room() {
        link.raise(watermark)?;
    }
    Ok(())
}

/// One output of a stage, as the stage sees it.
struct Sink<S: Service> {
    outputs: Rc<RefCell<Outputs<S>>>,
    link: usize,
}

impl<S: Service + 'static> OutputSink for Sink<S> {
    fn send(&mut self, mut header: MessageHeader, bytes: &[u8]) -> Result<(), StageError> {
        let outputs = &mut *self.outputs.borrow_mut();
        outputs.links[self.link].stamp(&mut header)?;
        let time = header.log_time;
        if !outputs.links[self.link].is_gathered(bytes.len()) {
            outputs.make_way(self.link, time)?;
            outputs.links[self.link].send_bytes(header, bytes)?;
        } else if outputs.links[self.link].gather(&header, bytes) {
            outputs.send_batch(self.link, time)?;
        }
        outputs.links[self.link].count(&header);
        Ok(())
    }

    fn send_in_place(&mut self, mut header: MessageHeader, write: &mut Write<'_>) -> Result<(), StageError> {
        let outputs = &mut *self.outputs.borrow_mut();
        outputs.links[self.link].stamp(&mut header)?;
        outputs.make_way(self.link, header.log_time)?;
        outputs.links[self.link].send_in_place(header, write)?;
        outputs.links[self.link].count(&header);
        Ok(())
    }
}
