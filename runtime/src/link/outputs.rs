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
            let greeted = self.greeted;
            self.links.iter_mut().try_for_each(|link| link.repeat(greeted))?;
        }
        Ok(())
    }

    /// Whether a program that sends as this stage waits until what it has sent is taken in.
    pub(crate) fn is_asked(&self) -> bool {
        let board = self.sleeper.board();
        board.get(StageNumber::Asked) != board.get(StageNumber::Answered)
    }

    /// Takes in what programs outside of the run have sent on the links, and tells those that wait for it.
    pub(crate) fn take_in(&mut self) -> Result<(), LinkError> {
        // Read before: what is asked while this goes on is answered by the next.
        let (is_asked, asked) = (self.is_asked(), self.sleeper.board().get(StageNumber::Asked));
        self.links.iter_mut().try_for_each(LinkSender::look)?;
        if is_asked {
            self.sleeper.board().answer(asked);
        }
        Ok(())
    }

    /// Sends all that was gathered and the end of the stream on every link, and waits until every reader has
    /// acknowledged it. The stage had come to the log time `time`. A reader that comes meanwhile, as one does that was
    /// started again, is sent what it has missed, and the end.
    pub(crate) fn end(&mut self, time: LogTime) -> Result<(), LinkError> {
        for link in 0..self.links.len() {
            self.make_way(link, time)?;
            self.links[link].end(time, self.greeted)?;
        }
        let sleeper = Rc::clone(&self.sleeper);
        sleeper.wait(|| {
            self.answer_greetings()?;
            Ok(self.links.iter().all(LinkSender::is_acknowledged))
        })
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::link::{
        Board, Control, InputQueue, LinkReceiver, LinkShape, Order, PortBoard, ReaderEnd, RunNames, SenderRole,
        StageState,
    };
    use crate::message::MessageFlags;
    use crate::pipeline::Overflow;
    use iceoryx2::node::Node;
    use iceoryx2::service::local::Service as Local;
    use std::sync::{Arc, mpsc};
    use std::time::{Duration, Instant};

    const DEPTH: usize = 4;
    const TIME: LogTime = LogTime(7);
    /// So long the test waits before it stops the stage and fails.
    const DEADLINE: Duration = Duration::from_secs(20);

    /// A live link of stage 0, which the stages 1 and 2 read.
    struct World {
        names: RunNames,
        board: Arc<Board>,
        control: Arc<Control>,
    }

    impl World {
        fn new() -> Self {
            let board = Board::new(&[(0, 1), (1, 0), (1, 0)]);
            (1..=2).for_each(|stage| board.stage(stage).set_state(StageState::Starting));
            Self { names: RunNames::unique(), board, control: Arc::default() }
        }

        fn shape(&self) -> LinkShape<'static> {
            let (order, overflow) = (Order::Arrival, Overflow::Wait);
            LinkShape { stage: "a", port: "b", readers: 2, depth: DEPTH, order, overflow }
        }

        fn port(&self) -> PortBoard {
            PortBoard { board: self.board.stage(0), port: 0 }
        }

        fn end_of(&self, stage: usize) -> ReaderEnd {
            ReaderEnd { board: self.board.stage(stage), wire: 0, depth: DEPTH }
        }

        /// Sends one message, waits for the word, and ends.
        fn send(&self, go_on: mpsc::Receiver<()>) -> Result<(), LinkError> {
            let node = self.names.node::<Local>()?;
            let ends = vec![self.end_of(1), self.end_of(2)];
            let sender =
                LinkSender::new(&node, &self.names, &self.shape(), ends, self.port(), SenderRole::Owner, false)?;
            let sleeper = Rc::new(Sleeper::new(self.board.stage(0), Arc::clone(&self.control)));
            let outputs = Outputs::new(vec![sender], Rc::clone(&sleeper));
            sleeper.wait(|| Ok(outputs.borrow().links.iter().all(LinkSender::is_connected)))?;
            outputs.borrow_mut().answer_greetings()?;
            let header = MessageHeader { log_time: TIME, length: 3, flags: MessageFlags::DATA, ..Default::default() };
            Outputs::sink(&outputs, 0).send(header, b"map").expect("it has room");
            go_on.recv().expect("the test goes on");
            outputs.borrow_mut().end(TIME)
        }

        /// A reader with what comes in on it.
        fn reader(&self, node: &Node<Local>, stage: usize) -> (LinkReceiver<Local>, InputQueue) {
            let receiver = LinkReceiver::new(node, &self.names, &self.shape(), self.end_of(stage), self.port());
            self.board.stage(stage).set_state(StageState::Running);
            (receiver.expect("it has a place"), InputQueue::default())
        }

        /// Takes what comes until there are so many messages, or the stream has ended. Gives how many there were.
        fn take(&self, (receiver, queue): &mut (LinkReceiver<Local>, InputQueue), most: usize) -> usize {
            let (start, mut count) = (Instant::now(), 0);
            while count < most && !queue.has_ended() && start.elapsed() < DEADLINE {
                receiver.receive(queue).expect("the link is there");
                while queue.pop().is_some() {
                    receiver.taken();
                    count += 1;
                }
                std::thread::yield_now();
            }
            count
        }
    }

    #[test]
    fn a_program_that_sends_from_outside_can_wait_until_the_stage_has_taken_in_what_it_sent() {
        let world = World::new();
        (1..=2).for_each(|stage| world.board.stage(stage).clear());
        let node = world.names.node::<Local>().unwrap();
        let outputs = |role| {
            let sender = LinkSender::new(&node, &world.names, &world.shape(), Vec::new(), world.port(), role, false);
            let sleeper = Rc::new(Sleeper::new(world.board.stage(0), Arc::clone(&world.control)));
            Outputs::new(vec![sender.unwrap()], sleeper)
        };
        let stage = outputs(SenderRole::FedOwner);
        let board = world.board.stage(0);
        assert!(board.has_answered(board.ask()), "nobody is waited for who is not there");
        board.set_state(StageState::Running);

        // Unless the stage looks while the program is there, it never hears of it.
        let program = outputs(SenderRole::Guest);
        let (asked, asked_by_another) = (board.ask(), board.ask());
        assert!(!board.has_answered(asked) && stage.borrow().is_asked());
        stage.borrow_mut().take_in().unwrap();
        assert!(board.has_answered(asked) && board.has_answered(asked_by_another) && !stage.borrow().is_asked());
        let header = MessageHeader { log_time: TIME, length: 3, flags: MessageFlags::DATA, ..Default::default() };
        Outputs::sink(&program, 0).send(header, b"map").unwrap();
        let asked = board.ask();
        assert!(!board.has_answered(asked));
        stage.borrow_mut().take_in().unwrap();
        assert!(board.has_answered(asked));
        drop(program);
        assert_eq!(board.all_sent(), 1);
    }

    #[test]
    fn a_reader_that_is_started_again_while_the_stream_ends_is_sent_what_it_missed_and_the_end() {
        let world = World::new();
        let (word, words) = mpsc::channel();
        std::thread::scope(|scope| {
            let sender = scope.spawn({
                let world = &world;
                move || world.send(words)
            });
            let node = world.names.node::<Local>().unwrap();
            let mut lasting = world.reader(&node, 1);
            let mut dying = world.reader(&node, 2);
            // Both must be connected for the message to be sent.
            while !(dying.0.has_news(&dying.1).unwrap() || sender.is_finished()) {
                std::thread::yield_now();
            }
            dying.0.receive(&mut dying.1).unwrap();
            let lasting_had = world.take(&mut lasting, 1);
            let dying_had = world.take(&mut dying, 1);

            drop(dying);
            let board = world.board.stage(2);
            board.clear();
            board.add(StageNumber::Restarts, 1);
            board.set_state(StageState::Starting);
            word.send(()).unwrap();
            world.take(&mut lasting, usize::MAX);
            let lasting_ended = lasting.1.has_ended();
            world.board.stage(1).set_state(StageState::Ended);

            let mut restarted = world.reader(&node, 2);
            let restarted_had = world.take(&mut restarted, usize::MAX);
            let restarted_ended = restarted.1.has_ended();
            board.set_state(StageState::Ended);
            if !restarted_ended {
                world.control.stop(&world.board);
            }
            assert_eq!((lasting_had, dying_had, restarted_had), (1, 1, 1));
            assert!(lasting_ended && restarted_ended);
            assert_eq!(restarted.1.bound(), TIME, "it knows how far the stream had come");
            assert_eq!(sender.join().unwrap(), Ok(()));
        });
    }
}
