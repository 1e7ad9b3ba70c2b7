//! The thread that answers taps, which sleeps while there are none.

use super::super::presence::{Presence, Role, watch};
use super::super::wire::{from_bytes, to_bytes};
use super::super::zenoh_session::in_words;
use super::message_queue::Limits;
use super::requests::{Request, State, TapAnswer};
use super::sessions::TapSessions;
use gridweave_runtime::stage::{RunLinks, StageError};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};
use zenoh::query::{Query, Queryable};
use zenoh::{Session, Wait};

/// The interval at which tapped links are polled.
const POLL_INTERVAL: Duration = Duration::from_millis(5);
/// The time that the end of the run waits for taps to request the last messages.
const LINGER: Duration = Duration::from_secs(2);

enum ServerEvent {
    Asked(Query),
    Left(u64),
    Stop,
}

/// The server of a sender for taps of its run's links.
pub(in super::super) struct Taps {
    events: Sender<ServerEvent>,
    thread: Option<JoinHandle<()>>,
    _queryable: Queryable<()>,
}

impl Taps {
    /// Starts to answer requests under the key of a sender.
    ///
    /// # Errors
    /// The session has failed, or the thread cannot be started.
    pub(in super::super) fn start(
        session: &Session,
        bridge: &str,
        sender: &Presence,
        links: Result<RunLinks, &'static str>,
    ) -> Result<Self, StageError> {
        let key = sender.key(bridge, Role::Sender);
        let (events, received) = channel();
        // A request that arrives while the thread ends is not answered.
        let asked = events.clone();
        let take = move |query: Query| drop(asked.send(ServerEvent::Asked(query)));
        let queryable = session.declare_queryable(key.clone()).callback(take).wait();
        let queryable = queryable.map_err(|error| StageError::new("answer taps", in_words(&error)))?;
        let left = events.clone();
        watch(session, bridge, Role::Tapper, move |tapper, is_present| {
            if !is_present {
                drop(left.send(ServerEvent::Left(tapper.number)));
            }
        })?;
        let thread = thread::Builder::new().name("bridge taps".to_owned());
        // Views of links are not `Send`, so they are opened in the thread.
        let work = move || Worker { key, sessions: TapSessions::new(links, Limits::default()), events: received }.run();
        let thread = thread.spawn(work);
        let thread = thread.map_err(|error| StageError::new("start the thread that answers taps", error))?;
        Ok(Self { events, thread: Some(thread), _queryable: queryable })
    }
}

impl Drop for Taps {
    fn drop(&mut self) {
        drop(self.events.send(ServerEvent::Stop));
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

struct Worker {
    key: String,
    sessions: TapSessions<Query>,
    events: Receiver<ServerEvent>,
}

impl Worker {
    fn run(mut self) {
        while self.next() {}
        self.sessions.end();
        let until = Instant::now() + LINGER;
        while !self.sessions.is_idle() && Instant::now() < until {
            self.next();
        }
    }

    /// Handles the next event, and polls the links. Returns `false` when it must stop.
    fn next(&mut self) -> bool {
        let event = match self.sessions.is_idle() {
            true => self.events.recv().map_err(|_| RecvTimeoutError::Disconnected),
            false => self.events.recv_timeout(POLL_INTERVAL),
        };
        match event {
            Ok(ServerEvent::Asked(query)) => self.take(query),
            Ok(ServerEvent::Left(tapper)) => self.sessions.remove(tapper),
            Ok(ServerEvent::Stop) | Err(RecvTimeoutError::Disconnected) => return false,
            Err(RecvTimeoutError::Timeout) => {}
        }
        for (query, answer) in self.sessions.poll(Instant::now()) {
            self.reply(&query, &answer);
        }
        true
    }

    fn take(&mut self, query: Query) {
        let bytes = query.payload().map(|payload| payload.to_bytes()).unwrap_or_default();
        let answer = match from_bytes::<Request>(&bytes) {
            Ok(request) => self.sessions.request(&request, query, Instant::now()),
            Err(wrong) => Some((query, TapAnswer::nothing(State::Refused, wrong))),
        };
        if let Some((query, answer)) = answer {
            self.reply(&query, &answer);
        }
    }

    fn reply(&self, query: &Query, answer: &TapAnswer) {
        let replied = to_bytes(answer)
            .and_then(|bytes| query.reply(self.key.as_str(), bytes).wait().map_err(|error| in_words(&error)));
        if let Err(wrong) = replied {
            tracing::debug!("cannot answer a tap: {wrong}");
        }
    }
}
