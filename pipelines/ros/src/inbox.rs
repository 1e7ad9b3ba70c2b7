//! The queue of received events.

use super::liveliness::Entity;
use super::middleware::Middleware;
use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// A received event.
pub(crate) enum Event<M> {
    /// A publisher, subscriber or node has appeared (or disappeared).
    Entity(Middleware, Box<Entity>, bool),
    /// A message on the topic with the given index.
    Message { topic: usize, message: M, arrived: i64 },
}

/// A queue of events with a limited number of messages per topic. Beyond it the oldest is dropped, like `keep_last` of
/// ROS.
pub(crate) struct Inbox<M> {
    state: Mutex<State<M>>,
    has_come: Condvar,
}

struct State<M> {
    events: VecDeque<Event<M>>,
    /// The number of pending messages by topic.
    waiting: Vec<usize>,
    /// The number of dropped messages since the last query.
    dropped: u64,
}

impl<M> Default for Inbox<M> {
    fn default() -> Self {
        let state = State { events: VecDeque::new(), waiting: Vec::new(), dropped: 0 };
        Self { state: Mutex::new(state), has_come: Condvar::new() }
    }
}

impl<M> Inbox<M> {
    /// Adds an event, and keeps the last `depth` messages of its topic.
    pub(crate) fn push(&self, event: Event<M>, depth: usize) {
        let mut state = self.lock();
        if let Event::Message { topic, .. } = event {
            if state.waiting.len() <= topic {
                state.waiting.resize(topic + 1, 0);
            }
            state.waiting[topic] += 1;
            if state.waiting[topic] > depth.max(1) {
                let is_oldest =
                    |event: &Event<M>| matches!(event, Event::Message { topic: other, .. } if *other == topic);
                if let Some(oldest) = state.events.iter().position(is_oldest) {
                    state.events.remove(oldest);
                    state.waiting[topic] -= 1;
                    state.dropped += 1;
                }
            }
        }
        state.events.push_back(event);
        self.has_come.notify_one();
    }

    /// Takes the next event.
    pub(crate) fn take(&self) -> Option<Event<M>> {
        let mut state = self.lock();
        let event = state.events.pop_front()?;
        if let Event::Message { topic, .. } = event
            && let Some(waiting) = state.waiting.get_mut(topic)
        {
            *waiting -= 1;
        }
        Some(event)
    }

    /// The number of messages dropped since the last call.
    pub(crate) fn take_dropped(&self) -> u64 {
        std::mem::take(&mut self.lock().dropped)
    }

    /// Waits until there is an event, for at most `longest`.
    pub(crate) fn wait(&self, longest: Duration) {
        let is_empty = |state: &mut State<M>| state.events.is_empty();
        drop(self.has_come.wait_timeout_while(self.lock(), longest, is_empty));
    }

    fn lock(&self) -> MutexGuard<'_, State<M>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn taken(inbox: &Inbox<u32>) -> Vec<(usize, u32)> {
        let message = |event| match event {
            Event::Message { topic, message, .. } => (topic, message),
            Event::Entity(..) => panic!(),
        };
        std::iter::from_fn(|| inbox.take()).map(message).collect()
    }

    #[test]
    fn the_last_messages_of_each_topic_are_kept() {
        let inbox = Inbox::default();
        let push = |topic, message, depth| inbox.push(Event::Message { topic, message, arrived: 0 }, depth);
        for message in 0..4 {
            push(0, message, 2);
            push(1, 10 + message, 10);
        }
        assert_eq!(taken(&inbox), [(1, 10), (1, 11), (0, 2), (1, 12), (0, 3), (1, 13)]);
        assert_eq!((inbox.take_dropped(), inbox.take_dropped()), (2, 0));
        push(0, 7, 0);
        push(0, 8, 0);
        assert_eq!(taken(&inbox), [(0, 8)], "one is always kept");
    }

    #[test]
    fn an_event_wakes_the_waiting_thread() {
        let inbox = Inbox::default();
        inbox.wait(Duration::ZERO);
        std::thread::scope(|scope| {
            scope.spawn(|| inbox.push(Event::Message { topic: 0, message: 5, arrived: 0 }, 1));
            // As long as that takes, and no longer.
            inbox.wait(Duration::from_secs(600));
        });
        assert_eq!(taken(&inbox), [(0, 5)]);
    }
}
