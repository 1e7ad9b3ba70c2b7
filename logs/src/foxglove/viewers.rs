//! The viewers, and what is sent to each.
//!
//! A viewer may take less than the run sends, or nothing. The server of the Foxglove SDK has a queue for each, with a limit
//! of messages and none of bytes, and each viewer's copy of its own. So it is counted here what waits for each viewer. While
//! there is too much, a message is not sent to it. The latest of a latched topic is sent later from what is retained, where
//! it takes room once: what it supersedes is never sent, and it is sent again only once the viewer has taken it.

use super::retained::RetainedMessages;
use super::waiting::Waiting;
use crate::browsers::{Frame, Relayed};
use foxglove::{ChannelId, PartialMetadata, RawChannel, SinkId};
use std::collections::HashSet;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The kind of the frames that hold messages: whole, and binary.
const DATA_FRAME: u8 = 0x82;
/// What the content of such a frame begins with: an opcode, the number of a subscription, and the log time.
const OPCODE: u8 = 1;
const DATA_HEAD: usize = 1 + 4 + 8;

/// All viewers.
///
/// The lock is also held while a message is sent: otherwise a viewer that subscribes at that time could get an older message
/// after a newer one.
#[derive(Clone, Default)]
pub(super) struct Viewers(Arc<Mutex<State>>);

#[derive(Default)]
struct State {
    retained: RetainedMessages,
    viewers: Vec<Viewer>,
    entered: u64,
}

/// The number of a viewer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct ViewerNumber(u64);

struct Viewer {
    number: ViewerNumber,
    /// Where its messages go; `None` until it has subscribed.
    sink: Option<SinkId>,
    subscribed: HashSet<ChannelId>,
    /// The latched channels whose latest message is to be sent when there is room.
    owed: Vec<ChannelId>,
    waiting: Waiting,
}

impl Viewers {
    /// Adds a viewer.
    pub(super) fn enter(&self) -> ViewerNumber {
        let mut state = self.lock();
        state.entered += 1;
        let number = ViewerNumber(state.entered);
        state.viewers.push(Viewer {
            number,
            sink: None,
            subscribed: HashSet::new(),
            owed: Vec::new(),
            waiting: Waiting::default(),
        });
        number
    }

    /// Removes a viewer for which nothing waits any more.
    pub(super) fn leave(&self, number: ViewerNumber) {
        let mut state = self.lock();
        state.viewers.retain(|viewer| viewer.number != number);
        state.send_owed();
    }

    /// A viewer has subscribed to a channel, and gets what is retained of it.
    pub(super) fn subscribe(&self, number: ViewerNumber, sink: Option<SinkId>, channel: ChannelId) {
        let mut state = self.lock();
        let is_retained = state.retained.of(channel).is_some();
        let Some(viewer) = state.viewer(number) else { return };
        viewer.sink = viewer.sink.or(sink);
        // Another program that has found the server of a viewer gets nothing.
        if viewer.sink != sink {
            return;
        }
        viewer.subscribed.insert(channel);
        if is_retained && !viewer.owed.contains(&channel) {
            viewer.owed.push(channel);
        }
        state.send_owed();
    }

    /// A viewer has ended its subscription.
    pub(super) fn unsubscribe(&self, number: ViewerNumber, sink: Option<SinkId>, channel: ChannelId) {
        if let Some(viewer) = self.lock().viewer(number).filter(|viewer| viewer.sink == sink) {
            viewer.subscribed.remove(&channel);
            viewer.owed.retain(|owed| *owed != channel);
        }
    }

    /// Sends a message to all subscribers of its channel, and retains it if the channel is latched.
    pub(super) fn send(&self, channel: &Arc<RawChannel>, is_latched: bool, log_time: u64, message: &[u8]) {
        let mut state = self.lock();
        if is_latched {
            state.retained.keep(channel, log_time, message);
        }
        let (id, mut all) = (channel.id(), state.waiting());
        for viewer in state.viewers.iter_mut().filter(|viewer| viewer.subscribed.contains(&id)) {
            // What is owed is the latest, and comes after what has been sent.
            if viewer.owed.contains(&id) {
                continue;
            }
            if viewer.waiting.has_room(message.len(), all) && (is_latched || !viewer.is_room_reserved()) {
                all += viewer.send(channel, log_time, message);
            } else if is_latched {
                viewer.owed.push(id);
            }
        }
    }

    /// The server of a viewer has sent something to it.
    pub(super) fn relayed(&self, number: ViewerNumber, what: &Relayed<'_>) {
        let mut state = self.lock();
        let Some(viewer) = state.viewer(number) else { return };
        match what {
            Relayed::Frame(frame) => {
                let Some((log_time, length)) = message(frame) else { return };
                viewer.waiting.take(log_time, length);
            }
            // What still seems to wait was dropped by the server.
            Relayed::Nothing => viewer.waiting.clear(),
        }
        state.send_owed();
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // The state is consistent between any two changes.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    fn viewer(&mut self, number: ViewerNumber) -> Option<&mut Viewer> {
        self.viewers.iter_mut().find(|viewer| viewer.number == number)
    }

    /// How much waits for all viewers, bytes.
    fn waiting(&self) -> usize {
        self.viewers.iter().map(|viewer| viewer.waiting.bytes()).sum()
    }

    /// Sends the latest messages that are owed and have room.
    fn send_owed(&mut self) {
        let mut all = self.waiting();
        for viewer in &mut self.viewers {
            for channel in std::mem::take(&mut viewer.owed) {
                let Some(retained) = self.retained.of(channel) else { continue };
                // A second copy would be of no use to the viewer before it has taken the first.
                let message = if viewer.waiting.has(channel) { None } else { retained.message() };
                match message {
                    Some(message) if viewer.waiting.has_room(message.len(), all) => {
                        all += viewer.send(&retained.channel, retained.log_time, &message);
                    }
                    _ => viewer.owed.push(channel),
                }
            }
        }
    }
}

impl Viewer {
    /// Sends a message. Returns how much more waits.
    fn send(&mut self, channel: &RawChannel, log_time: u64, message: &[u8]) -> usize {
        let before = self.waiting.bytes();
        // Before the server can send it.
        self.waiting.add(channel.id(), log_time, message.len());
        channel.log_with_meta_to_sink(message, PartialMetadata::with_log_time(log_time), self.sink);
        self.waiting.bytes() - before
    }

    /// Whether room is kept for a large message that is owed: many small ones would always take it first.
    fn is_room_reserved(&self) -> bool {
        self.waiting.bytes() > 0 && self.owed.iter().any(|channel| !self.waiting.has(*channel))
    }
}

/// The log time and the length of the message in a frame, if it holds one.
fn message(frame: &Frame) -> Option<(u64, usize)> {
    if (frame.kind, frame.start.first()) != (DATA_FRAME, Some(&OPCODE)) {
        return None;
    }
    let log_time = frame.start.get(5..DATA_HEAD)?.try_into().ok()?;
    let length = usize::try_from(frame.length).ok()?.checked_sub(DATA_HEAD)?;
    Some((u64::from_le_bytes(log_time), length))
}

#[cfg(test)]
mod tests {
    use super::*;
    use foxglove::{ChannelBuilder, Context, FoxgloveError, Metadata, Sink};

    const MAP: usize = 16_000_000;

    /// A viewer that takes what it is told to.
    struct Slow {
        viewers: Viewers,
        number: ViewerNumber,
        queue: Arc<Queue>,
    }

    struct Queue {
        sink: SinkId,
        /// The log times and lengths of the messages in it.
        messages: Mutex<Vec<(u64, usize)>>,
    }

    impl Sink for Queue {
        fn id(&self) -> SinkId {
            self.sink
        }

        fn log(&self, _: &RawChannel, message: &[u8], metadata: &Metadata) -> Result<(), FoxgloveError> {
            self.messages.lock().unwrap().push((metadata.log_time, message.len()));
            Ok(())
        }
    }

    impl Slow {
        fn enter(viewers: &Viewers, context: &Context) -> Self {
            let queue = Arc::new(Queue { sink: SinkId::next(), messages: Mutex::default() });
            context.add_sink(queue.clone());
            Self { viewers: viewers.clone(), number: viewers.enter(), queue }
        }

        fn subscribe(&self, channel: &RawChannel) {
            self.viewers.subscribe(self.number, Some(self.queue.sink), channel.id());
        }

        fn unsubscribe(&self, channel: &RawChannel) {
            self.viewers.unsubscribe(self.number, Some(self.queue.sink), channel.id());
        }

        /// The log times of what is queued.
        fn queued(&self) -> Vec<u64> {
            self.queue.messages.lock().unwrap().iter().map(|(log_time, _)| *log_time).collect()
        }

        fn take(&self) -> u64 {
            let (log_time, length) = self.queue.messages.lock().unwrap().remove(0);
            let start = [&[OPCODE, 7, 0, 0, 0][..], &log_time.to_le_bytes(), &[0; 3]].concat();
            let frame = Frame { kind: DATA_FRAME, length: (length + DATA_HEAD) as u64, start };
            self.viewers.relayed(self.number, &Relayed::Frame(&frame));
            log_time
        }
    }

    fn channel(context: &Arc<Context>, topic: &str) -> Arc<RawChannel> {
        ChannelBuilder::new(topic).message_encoding("cdr").context(context).build_raw().unwrap()
    }

    #[test]
    fn a_latched_message_waits_once_however_often_a_viewer_subscribes() {
        let (viewers, context) = (Viewers::default(), Context::new());
        let map = channel(&context, "/map");
        viewers.send(&map, true, 5, &vec![0; MAP]);
        let viewer = Slow::enter(&viewers, &context);
        for _ in 0..300 {
            viewer.subscribe(&map);
            viewer.unsubscribe(&map);
        }
        assert_eq!(viewer.queued(), [5]);
        viewer.take();
        assert_eq!(viewer.queued(), [0; 0], "it has left the topic");
        viewer.subscribe(&map);
        assert_eq!(viewer.queued(), [5]);
        viewer.unsubscribe(&map);
        viewer.subscribe(&map);
        viewer.take();
        assert_eq!(viewer.queued(), [5], "the subscription is another one");
    }

    #[test]
    fn a_slow_viewer_gets_the_latest_of_what_is_latched_and_what_is_superseded_does_not_wait() {
        let (viewers, context) = (Viewers::default(), Context::new());
        let map = channel(&context, "/map");
        let slow = [Slow::enter(&viewers, &context), Slow::enter(&viewers, &context)];
        slow.iter().for_each(|viewer| viewer.subscribe(&map));
        for log_time in 1..=20 {
            viewers.send(&map, true, log_time, &vec![0; MAP]);
        }
        for viewer in slow {
            assert_eq!(viewer.queued(), [1, 2]);
            assert_eq!([viewer.take(), viewer.take(), viewer.take()], [1, 2, 20]);
            assert_eq!(viewer.queued(), [0; 0]);
        }
    }

    #[test]
    fn what_waits_for_all_viewers_together_has_a_limit() {
        let (viewers, context) = (Viewers::default(), Context::new());
        let map = channel(&context, "/map");
        viewers.send(&map, true, 1, &vec![0; MAP]);
        let mut all: Vec<Slow> = (0..32).map(|_| Slow::enter(&viewers, &context)).collect();
        all.iter().for_each(|viewer| viewer.subscribe(&map));
        let queued = |all: &[Slow]| all.iter().map(|viewer| viewer.queued().len()).sum::<usize>();
        assert_eq!(queued(&all), 16);
        viewers.leave(all.remove(0).number);
        assert_eq!(queued(&all), 16, "the next takes the room of one that leaves");
        for viewer in &all {
            assert_eq!(viewer.take(), 1, "and of one that takes its message");
        }
    }

    #[test]
    fn many_small_messages_leave_room_for_a_large_one_and_are_not_stopped_by_it() {
        let (viewers, context) = (Viewers::default(), Context::new());
        let (map, scan) = (channel(&context, "/map"), channel(&context, "/scan"));
        let viewer = Slow::enter(&viewers, &context);
        viewer.subscribe(&map);
        viewer.subscribe(&scan);
        let scans = |times: std::ops::Range<u64>| {
            for log_time in times {
                viewers.send(&scan, false, log_time, &vec![0; MAP / 8]);
            }
        };
        scans(100..200);
        viewers.send(&map, true, 1, &vec![0; MAP]);
        let mut taken = Vec::new();
        for next in 200..240 {
            taken.push(viewer.take());
            scans(next..next + 1);
        }
        assert_eq!(taken.iter().filter(|log_time| **log_time == 1).count(), 1, "{taken:?}");
        assert!(taken.last().is_some_and(|log_time| *log_time >= 200), "{taken:?}");
    }

    #[test]
    fn what_the_server_has_dropped_keeps_no_room() {
        let (viewers, context) = (Viewers::default(), Context::new());
        let map = channel(&context, "/map");
        viewers.send(&map, true, 1, &vec![0; MAP]);
        let viewer = Slow::enter(&viewers, &context);
        viewer.subscribe(&map);
        viewer.queue.messages.lock().unwrap().clear();
        viewer.unsubscribe(&map);
        viewer.subscribe(&map);
        assert_eq!(viewer.queued(), [0; 0]);
        viewers.relayed(viewer.number, &Relayed::Nothing);
        assert_eq!(viewer.queued(), [1]);
    }

    #[test]
    fn only_the_first_client_of_the_server_of_a_viewer_gets_messages() {
        let (viewers, context) = (Viewers::default(), Context::new());
        let map = channel(&context, "/map");
        viewers.send(&map, true, 1, b"map");
        let viewer = Slow::enter(&viewers, &context);
        viewer.subscribe(&map);
        let other = Slow::enter(&viewers, &context);
        viewers.subscribe(viewer.number, Some(other.queue.sink), map.id());
        viewers.unsubscribe(viewer.number, Some(other.queue.sink), map.id());
        viewers.send(&map, true, 2, b"next");
        assert_eq!((viewer.queued(), other.queued()), (vec![1, 2], vec![]));
    }
}
