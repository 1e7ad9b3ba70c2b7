//! All outputs of a stage, and how they wait for credit.

use super::stage_counters::StageCounter;
use super::{LinkError, LinkSender, Sleeper};
use crate::message::{LogTime, MessageHeader, Write};
use crate::stage::{OutputSink, StageError};
use iceoryx2::service::Service;
use std::cell::RefCell;
use std::rc::Rc;

/// The outputs of one stage. While one of them waits for credit, the others send their batches and watermarks, so that
/// no reader of theirs waits for a stage that is itself waiting.
pub struct Outputs<S: Service> {
    links: Vec<LinkSender<S>>,
    sleeper: Rc<Sleeper>,
    /// The number of history requests that were answered.
    answered_requests: u64,
}

impl<S: Service + 'static> Outputs<S> {
    /// The outputs of a stage that sleeps on `sleeper`.
    pub fn new(links: Vec<LinkSender<S>>, sleeper: Rc<Sleeper>) -> Rc<RefCell<Self>> {
        Rc::new(RefCell::new(Self { links, sleeper, answered_requests: 0 }))
    }

    /// The sink of the output with the given index.
    pub fn sink(outputs: &Rc<RefCell<Self>>, link: usize) -> Box<dyn OutputSink> {
        Box::new(Sink { outputs: Rc::clone(outputs), link })
    }

    /// The links of the outputs.
    pub(crate) fn links(&mut self) -> &mut [LinkSender<S>] {
        &mut self.links
    }

    /// The latest log time that any output has reached.
    pub(crate) fn reached(&self) -> LogTime {
        self.links.iter().map(LinkSender::reached).max().unwrap_or_default()
    }

    /// Sends the batch and the watermark on every link that has credit.
    pub(crate) fn flush(&mut self, watermark: LogTime) -> Result<(), LinkError> {
        self.links.iter_mut().try_for_each(|link| flush(link, watermark))
    }

    /// Whether a link has something to flush, and credit for it.
    pub(crate) fn can_flush(&mut self, watermark: LogTime) -> bool {
        self.links.iter_mut().any(|link| (link.has_batch() || link.can_raise(watermark)) && link.has_credit())
    }

    /// Whether a reader or an observer has requested the history since it was last repeated.
    pub(crate) fn has_history_requests(&self) -> bool {
        self.answered_requests != self.sleeper.counters().get(StageCounter::HistoryRequests)
    }

    /// Repeats the history of live links, if it was requested.
    pub(crate) fn answer_history_requests(&mut self) -> Result<(), LinkError> {
        if self.has_history_requests() {
            self.answered_requests = self.sleeper.counters().get(StageCounter::HistoryRequests);
            let answered_requests = self.answered_requests;
            self.links.iter_mut().try_for_each(|link| link.repeat(answered_requests))?;
        }
        Ok(())
    }

    /// Whether a program that sends as this stage waits until its messages are ingested.
    pub(crate) fn has_ingest_requests(&self) -> bool {
        let counters = self.sleeper.counters();
        counters.get(StageCounter::IngestRequests) != counters.get(StageCounter::IngestsAnswered)
    }

    /// Ingests what programs outside of the run have sent on the links, and answers those that wait for it.
    pub(crate) fn ingest(&mut self) -> Result<(), LinkError> {
        // Read first: a request made meanwhile is answered by the next call.
        let (has_ingest_requests, requests) =
            (self.has_ingest_requests(), self.sleeper.counters().get(StageCounter::IngestRequests));
        self.links.iter_mut().try_for_each(LinkSender::ingest)?;
        if has_ingest_requests {
            self.sleeper.counters().set_ingested(requests);
        }
        Ok(())
    }

    /// Sends the batches and the end of the stream, at the log time `time`, on every link, and waits until every reader
    /// has acknowledged it. A reader that joins meanwhile, such as a restarted one, is sent the history and the end.
    pub(crate) fn end(&mut self, time: LogTime) -> Result<(), LinkError> {
        for link in 0..self.links.len() {
            self.prepare_single(link, time)?;
            self.links[link].end(time, self.answered_requests)?;
        }
        let sleeper = Rc::clone(&self.sleeper);
        sleeper.wait(|| {
            self.answer_history_requests()?;
            Ok(self.links.iter().all(LinkSender::is_acknowledged))
        })
    }

    /// Prepares a link for a sample of a single message: sends the pending batch, and waits for credit.
    fn prepare_single(&mut self, link: usize, time: LogTime) -> Result<(), LinkError> {
        self.send_batch(link, time)?;
        self.wait_for_credit(link, time)
    }

    fn send_batch(&mut self, link: usize, time: LogTime) -> Result<(), LinkError> {
        if self.links[link].has_batch() {
            self.wait_for_credit(link, time)?;
            self.links[link].send_batch()?;
        }
        Ok(())
    }

    /// Waits until the link has credit. Meanwhile the others send `watermark`.
    fn wait_for_credit(&mut self, link: usize, watermark: LogTime) -> Result<(), LinkError> {
        let Self { links, sleeper, .. } = self;
        if links[link].has_credit() {
            return Ok(());
        }
        sleeper.wait(|| {
            for (_, other) in links.iter_mut().enumerate().filter(|(other, _)| *other != link) {
                flush(other, watermark)?;
            }
            Ok(links[link].has_credit())
        })
    }
}

/// Sends the batch of a link and the watermark, as far as it has credit.
fn flush<S: Service + 'static>(link: &mut LinkSender<S>, watermark: LogTime) -> Result<(), LinkError> {
    if link.has_batch() && link.has_credit() {
        link.send_batch()?;
    }
    if !link.has_batch() && link.can_raise(watermark) && link.has_credit() {
        link.raise(watermark)?;
    }
    Ok(())
}

/// An output of a stage, as seen by the stage.
struct Sink<S: Service> {
    outputs: Rc<RefCell<Outputs<S>>>,
    link: usize,
}

impl<S: Service + 'static> OutputSink for Sink<S> {
    fn send(&mut self, mut header: MessageHeader, bytes: &[u8]) -> Result<(), StageError> {
        let outputs = &mut *self.outputs.borrow_mut();
        outputs.links[self.link].stamp(&mut header)?;
        let time = header.log_time;
        if !outputs.links[self.link].is_batched(bytes.len()) {
            outputs.prepare_single(self.link, time)?;
            outputs.links[self.link].send_bytes(header, bytes)?;
        } else if outputs.links[self.link].add_to_batch(&header, bytes) {
            outputs.send_batch(self.link, time)?;
        }
        outputs.links[self.link].count(&header);
        Ok(())
    }

    fn send_in_place(&mut self, mut header: MessageHeader, write: &mut Write<'_>) -> Result<(), StageError> {
        let outputs = &mut *self.outputs.borrow_mut();
        outputs.links[self.link].stamp(&mut header)?;
        outputs.prepare_single(self.link, header.log_time)?;
        outputs.links[self.link].send_in_place(header, write)?;
        outputs.links[self.link].count(&header);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::link::{
        Control, InputQueue, LinkReceiver, LinkShape, Order, PortCounters, ReaderEnd, RunNames, SenderRole,
        SharedCounters, StageState,
    };
    use crate::message::MessageFlags;
    use crate::pipeline::Overflow;
    use iceoryx2::node::Node;
    use iceoryx2::service::local::Service as Local;
    use std::sync::{Arc, mpsc};
    use std::time::{Duration, Instant};

    const DEPTH: usize = 4;
    const TIME: LogTime = LogTime(7);
    /// The watchdog of a test that could deadlock.
    const DEADLINE: Duration = Duration::from_secs(20);

    /// A live link of stage 0 that stages 1 and 2 read.
    struct World {
        names: RunNames,
        counters: Arc<SharedCounters>,
        control: Arc<Control>,
    }

    impl World {
        fn new() -> Self {
            let counters = SharedCounters::new(&[(0, 1), (1, 0), (1, 0)]);
            (1..=2).for_each(|stage| counters.stage(stage).set_state(StageState::Starting));
            Self { names: RunNames::unique(), counters, control: Arc::default() }
        }

        fn shape(&self) -> LinkShape<'static> {
            let (order, overflow) = (Order::Arrival, Overflow::Wait);
            LinkShape { stage: "a", port: "b", readers: 2, depth: DEPTH, order, overflow }
        }

        fn port(&self) -> PortCounters {
            PortCounters { counters: self.counters.stage(0), port: 0 }
        }

        fn end_of(&self, stage: usize) -> ReaderEnd {
            ReaderEnd { counters: self.counters.stage(stage), wire: 0, depth: DEPTH }
        }

        /// Sends one message, waits for `go_on`, and ends.
        fn send(&self, go_on: mpsc::Receiver<()>) -> Result<(), LinkError> {
            let node = self.names.node::<Local>()?;
            let ends = vec![self.end_of(1), self.end_of(2)];
            let sender =
                LinkSender::new(&node, &self.names, &self.shape(), ends, self.port(), SenderRole::Owner, false)?;
            let sleeper = Rc::new(Sleeper::new(self.counters.stage(0), Arc::clone(&self.control)));
            let outputs = Outputs::new(vec![sender], Rc::clone(&sleeper));
            sleeper.wait(|| Ok(outputs.borrow().links.iter().all(LinkSender::is_connected)))?;
            outputs.borrow_mut().answer_history_requests()?;
            let header = MessageHeader { log_time: TIME, length: 3, flags: MessageFlags::DATA, ..Default::default() };
            Outputs::sink(&outputs, 0).send(header, b"map").expect("it has credit");
            go_on.recv().expect("the test goes on");
            outputs.borrow_mut().end(TIME)
        }

        /// A reader and its queue.
        fn reader(&self, node: &Node<Local>, stage: usize) -> (LinkReceiver<Local>, InputQueue) {
            let receiver = LinkReceiver::new(node, &self.names, &self.shape(), self.end_of(stage), self.port());
            self.counters.stage(stage).set_state(StageState::Running);
            (receiver.expect("the link can be opened"), InputQueue::default())
        }

        /// Takes messages until there are `most` or the stream has ended. Returns their number.
        fn take(&self, (receiver, queue): &mut (LinkReceiver<Local>, InputQueue), most: usize) -> usize {
            let (start, mut count) = (Instant::now(), 0);
            while count < most && !queue.has_ended() && start.elapsed() < DEADLINE {
                receiver.receive(queue).expect("the link is there");
                while queue.pop().is_some() {
                    receiver.record_taken();
                    count += 1;
                }
                std::thread::yield_now();
            }
            count
        }
    }

    #[test]
    fn an_external_sender_can_wait_until_the_stage_has_ingested_its_messages() {
        let world = World::new();
        (1..=2).for_each(|stage| world.counters.stage(stage).clear());
        let node = world.names.node::<Local>().unwrap();
        let outputs = |role| {
            let sender = LinkSender::new(&node, &world.names, &world.shape(), Vec::new(), world.port(), role, false);
            let sleeper = Rc::new(Sleeper::new(world.counters.stage(0), Arc::clone(&world.control)));
            Outputs::new(vec![sender.unwrap()], sleeper)
        };
        let stage = outputs(SenderRole::PassiveOwner);
        let counters = world.counters.stage(0);
        assert!(counters.has_ingested(counters.request_ingest()), "a stage that is not running is not waited for");
        counters.set_state(StageState::Running);

        // The stage sees the program's messages only while the program exists.
        let program = outputs(SenderRole::External);
        let (asked, asked_by_another) = (counters.request_ingest(), counters.request_ingest());
        assert!(!counters.has_ingested(asked) && stage.borrow().has_ingest_requests());
        stage.borrow_mut().ingest().unwrap();
        assert!(
            counters.has_ingested(asked)
                && counters.has_ingested(asked_by_another)
                && !stage.borrow().has_ingest_requests()
        );
        let header = MessageHeader { log_time: TIME, length: 3, flags: MessageFlags::DATA, ..Default::default() };
        Outputs::sink(&program, 0).send(header, b"map").unwrap();
        let asked = counters.request_ingest();
        assert!(!counters.has_ingested(asked));
        stage.borrow_mut().ingest().unwrap();
        assert!(counters.has_ingested(asked));
        drop(program);
        assert_eq!(counters.all_sent(), 1);
    }

    #[test]
    fn a_reader_that_is_restarted_while_the_stream_ends_receives_the_history_and_the_end() {
        let world = World::new();
        let (go_on, goes_on) = mpsc::channel();
        std::thread::scope(|scope| {
            let sender = scope.spawn({
                let world = &world;
                move || world.send(goes_on)
            });
            let node = world.names.node::<Local>().unwrap();
            let mut lasting = world.reader(&node, 1);
            let mut dying = world.reader(&node, 2);
            // Both must be connected for the message to be sent.
            while !(dying.0.has_pending(&dying.1).unwrap() || sender.is_finished()) {
                std::thread::yield_now();
            }
            dying.0.receive(&mut dying.1).unwrap();
            let lasting_had = world.take(&mut lasting, 1);
            let dying_had = world.take(&mut dying, 1);

            drop(dying);
            let counters = world.counters.stage(2);
            counters.clear();
            counters.add(StageCounter::Restarts, 1);
            counters.set_state(StageState::Starting);
            go_on.send(()).unwrap();
            world.take(&mut lasting, usize::MAX);
            let lasting_ended = lasting.1.has_ended();
            world.counters.stage(1).set_state(StageState::Ended);

            let mut restarted = world.reader(&node, 2);
            let restarted_had = world.take(&mut restarted, usize::MAX);
            let restarted_ended = restarted.1.has_ended();
            counters.set_state(StageState::Ended);
            if !restarted_ended {
                world.control.stop(&world.counters);
            }
            assert_eq!((lasting_had, dying_had, restarted_had), (1, 1, 1));
            assert!(lasting_ended && restarted_ended);
            assert_eq!(restarted.1.bound(), TIME, "it knows the log time of the end");
            assert_eq!(sender.join().unwrap(), Ok(()));
        });
    }
}
