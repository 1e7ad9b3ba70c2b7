//! Sends what is in an outbox to the receiver of a bridge, in a thread of its own.

use super::clock::Clock;
use super::network::Network;
use super::outbox::{Limits, Outbox, Totals};
use super::presence::{Presence, Role, watch};
use super::report::Report;
use super::tap::Taps;
use super::wire::{Answer, Link, from_bytes};
use crate::connection::{in_words, is_connected};
use gridweave_runtime::message::MessageHeader;
use gridweave_runtime::stage::{RunLinks, StageError};
use std::collections::BTreeSet;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};
use zenoh::liveliness::LivelinessToken;
use zenoh::qos::CongestionControl;
use zenoh::{Session, Wait};

/// A batch that was not answered for so long is sent again.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(30);
/// So long somebody who waits does not look around.
const LOOK_INTERVAL: Duration = Duration::from_millis(100);
/// After what went wrong, it waits so long before it tries again.
const AFTER_FAILURE: Duration = Duration::from_secs(1);
/// So long a receiver may take to be found before somebody is told.
const PATIENCE: Duration = Duration::from_secs(3);
/// So long after that it is looked for the reason again, which may have become another.
const NEXT_LOOK: Duration = Duration::from_secs(30);

/// How a sender goes about it.
#[derive(Clone, Debug)]
pub(super) struct Settings {
    pub(super) network: Network,
    /// What to call it.
    pub(super) name: String,
    pub(super) limits: Limits,
    /// At least so long from one batch to the next.
    pub(super) interval: Duration,
    pub(super) clock: Clock,
    /// The links of the run, for those who tap, or why they are not shown.
    pub(super) links: Result<RunLinks, &'static str>,
}

/// The end of a bridge that sends.
pub(super) struct Sender {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
    token: Option<LivelinessToken>,
    taps: Option<Taps>,
}

struct Shared {
    state: Mutex<State>,
    has_changed: Condvar,
}

struct State {
    outbox: Outbox,
    /// The receivers that are there.
    receivers: BTreeSet<Presence>,
    is_stopped: bool,
    /// What was told last of why there is no receiver.
    told_of_absence: Option<String>,
    /// What somebody should know.
    notices: Vec<String>,
}

impl Sender {
    /// Joins the network, and begins.
    ///
    /// # Errors
    /// It cannot be joined.
    pub(super) fn start(settings: Settings, mut links: Vec<Link>, report: Option<Report>) -> Result<Self, StageError> {
        let session = settings.network.open()?;
        let number = Presence::number_of(&session);
        let me = Presence { name: settings.name.clone(), number };
        let taps = Taps::start(&session, &settings.network.bridge, &me, settings.links.clone())?;
        let token = me.declare(&session, &settings.network.bridge, Role::Sender)?;
        let carried = links.len();
        links.extend(report.as_ref().map(|_| Report::link()));
        let mut outbox = Outbox::new(settings.name.clone(), number, links, settings.limits);
        if report.is_some() {
            outbox.report_on(carried);
        }
        let state =
            State { outbox, receivers: BTreeSet::new(), is_stopped: false, told_of_absence: None, notices: Vec::new() };
        let shared = Arc::new(Shared { state: Mutex::new(state), has_changed: Condvar::new() });
        let of_callback = Arc::clone(&shared);
        watch(&session, &settings.network.bridge, Role::Receiver, move |receiver, is_there| {
            of_callback.note_receiver(receiver, is_there);
        })?;
        let of_thread = Arc::clone(&shared);
        let thread = thread::Builder::new().name("bridge".to_owned());
        let thread = thread.spawn(move || Worker { session, settings, report, shared: of_thread }.run());
        let thread = thread.map_err(|error| StageError::new("start the thread of a bridge", error))?;
        Ok(Self { shared, thread: Some(thread), token: Some(token), taps: Some(taps) })
    }

    /// Announces a channel of a link.
    pub(super) fn announce(&self, link: usize, number: u32, channel: Vec<u8>) {
        self.shared.lock().outbox.announce(link, number, channel);
        self.shared.has_changed.notify_all();
    }

    /// Sends a message of a link, when its turn has come.
    ///
    /// # Errors
    /// There is not enough memory.
    pub(super) fn push(&self, link: usize, header: &MessageHeader, bytes: &[u8]) -> Result<(), StageError> {
        let pushed = self.shared.lock().outbox.push(link, header, bytes);
        self.shared.has_changed.notify_all();
        pushed.map_err(|error| StageError::new("send a message over the bridge", error))
    }

    /// Says that nothing follows, and waits until the receiver has taken that, but no longer than `longest`. Gives how many
    /// messages it has not taken; none if it has taken everything, and the end.
    pub(super) fn end(&self, longest: Duration) -> Option<usize> {
        let mut state = self.shared.lock();
        state.outbox.end();
        self.shared.has_changed.notify_all();
        let until = Instant::now() + longest;
        while !state.outbox.is_done() {
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Some(state.outbox.untaken());
            }
            state = self.shared.wait(state, left);
        }
        None
    }

    pub(super) fn totals(&self) -> Totals {
        self.shared.lock().outbox.totals()
    }

    /// What has happened since this was asked last.
    pub(super) fn take_notices(&self) -> Vec<String> {
        std::mem::take(&mut self.shared.lock().notices)
    }
}

impl Drop for Sender {
    fn drop(&mut self) {
        // Those who tap get the last of the run.
        drop(self.taps.take());
        self.shared.lock().is_stopped = true;
        self.shared.has_changed.notify_all();
        // Before the thread closes the session.
        drop(self.token.take());
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn wait<'a>(&self, state: MutexGuard<'a, State>, longest: Duration) -> MutexGuard<'a, State> {
        self.has_changed.wait_timeout(state, longest).unwrap_or_else(PoisonError::into_inner).0
    }

    fn note_receiver(&self, receiver: Presence, is_there: bool) {
        let mut state = self.lock();
        match is_there {
            true => {
                let is_new = state.receivers.insert(receiver.clone());
                let others = state.receivers.len() - 1;
                if is_new && others > 0 {
                    state.tell(format!(
                        "{} receivers have the name of one bridge: only one of them is sent anything",
                        others + 1
                    ));
                }
                tracing::info!("the receiver `{}` is there", receiver.name);
            }
            false => {
                state.receivers.remove(&receiver);
                let name = receiver.name;
                // Who has taken the end goes by right; and if it has not, that is told.
                match state.outbox.is_ended() {
                    true => tracing::info!("the receiver `{name}` is gone"),
                    false => {
                        state
                            .tell(format!("the receiver `{name}` is gone: what follows waits until it is there again"));
                    }
                }
            }
        }
        drop(state);
        self.has_changed.notify_all();
    }
}

impl State {
    fn tell(&mut self, text: String) {
        tracing::warn!("{text}");
        self.notices.push(text);
    }
}

/// When it is to be told next that there is no receiver; never, once one was found.
struct Search(Option<Instant>);

impl Search {
    fn is_due(&mut self) -> bool {
        let is_due = self.0.is_some_and(|next| Instant::now() >= next);
        if is_due {
            self.0 = Some(Instant::now() + NEXT_LOOK);
        }
        is_due
    }
}

/// What the thread works with.
struct Worker {
    session: Session,
    settings: Settings,
    report: Option<Report>,
    shared: Arc<Shared>,
}

impl Worker {
    fn run(mut self) {
        let mut search = Search(Some(Instant::now() + PATIENCE));
        while let Some((receiver, batch, is_greeting)) = self.next_batch(&mut search) {
            let sent = Instant::now();
            let answered = self.ask(&receiver, batch).and_then(|answer| {
                let Some((answer, offset)) = answer else { return Ok(false) };
                let answered = self.shared.lock().outbox.answered(&answer, is_greeting.then_some(offset));
                answered.map(|()| true).map_err(|text| format!("the receiver cannot read what it gets: {text}"))
            });
            self.shared.has_changed.notify_all();
            let pause = match answered {
                Ok(true) => self.settings.interval.saturating_sub(sent.elapsed()),
                Ok(false) => LOOK_INTERVAL,
                Err(wrong) => {
                    self.shared.lock().tell(wrong);
                    AFTER_FAILURE
                }
            };
            self.pause(pause);
        }
        // What is still to be told to Zenoh, such as that this sender goes, is told by closing.
        if let Err(error) = self.session.close().wait() {
            tracing::debug!("the session was not closed: {}", in_words(&error));
        }
    }

    /// Waits for something to send, and somebody to send it to. None when it is to stop.
    fn next_batch(&mut self, search: &mut Search) -> Option<(Presence, Vec<u8>, bool)> {
        let shared = Arc::clone(&self.shared);
        let mut state = shared.lock();
        loop {
            if state.is_stopped {
                return None;
            }
            // Its log time is that of the message before it, as that of a log which is played is not that of the clock.
            if let (Some(report), Some(log_time)) = (&mut self.report, state.outbox.last_log_time()) {
                let told = report.take(Instant::now(), log_time, self.settings.clock.nanoseconds().unsigned_abs());
                let told =
                    told.and_then(|told| told.map_or(Ok(()), |(header, bytes)| state.outbox.report(&header, &bytes)));
                if let Err(wrong) = told {
                    state.tell(format!("what the stages here do cannot be told: {wrong}"));
                    self.report = None;
                }
            }
            if search.is_due() && state.receivers.is_empty() {
                self.tell_why_nobody_is_there();
            }
            // Of several the same one always.
            if let Some(receiver) = state.receivers.first().cloned() {
                search.0 = None;
                let batch = state.outbox.batch_for(receiver.number).map(|batch| batch.map(<[u8]>::to_vec));
                let is_greeting = state.outbox.is_greeting();
                match batch {
                    Ok(Some(batch)) => return Some((receiver, batch, is_greeting)),
                    Ok(None) => {}
                    Err(wrong) => state.tell(format!("a batch could not be made: {wrong}")),
                }
            }
            state = shared.wait(state, LOOK_INTERVAL);
        }
    }

    /// Tells that nobody is there, and what is known of the reason: in a thread of its own, as that takes long to find out.
    fn tell_why_nobody_is_there(&self) {
        let (network, shared) = (self.settings.network.clone(), Arc::clone(&self.shared));
        let is_connected = is_connected(&self.session);
        let find = move || {
            let obstacles = if is_connected { Vec::new() } else { network.obstacles() };
            let (bridge, others) = (&network.bridge, network.others());
            let reasons = if obstacles.is_empty() { String::new() } else { format!(" ({})", obstacles.join("; ")) };
            let text = format!(
                "there is no receiver of the bridge `{bridge}` at {others}{reasons}. It is looked for until it is there"
            );
            let mut state = shared.lock();
            if state.receivers.is_empty() && state.told_of_absence.as_ref() != Some(&text) {
                state.told_of_absence = Some(text.clone());
                state.tell(text);
            }
        };
        if let Err(error) = thread::Builder::new().name("bridge search".to_owned()).spawn(find) {
            tracing::warn!("the thread that finds out why nobody is there was not started: {error}");
        }
    }

    /// Sends a batch, and waits for the answer; none if none comes. With it comes by how much the clock of the receiver is ahead.
    fn ask(&self, receiver: &Presence, batch: Vec<u8>) -> Result<Option<(Answer, i64)>, String> {
        let key = receiver.key(&self.settings.network.bridge, Role::Receiver);
        let sent = self.settings.clock.nanoseconds();
        let asked = self
            .session
            .get(key)
            .payload(batch)
            .congestion_control(CongestionControl::Block)
            .timeout(ANSWER_TIMEOUT)
            .wait();
        let answers = asked.map_err(|error| format!("nothing can be sent: {}", in_words(&error)))?;
        loop {
            match answers.recv_timeout(LOOK_INTERVAL) {
                Ok(None) if self.shared.lock().is_stopped => return Ok(None),
                Ok(None) => {}
                // No answer comes any more.
                Err(_) => return Ok(None),
                Ok(Some(reply)) => {
                    let Ok(sample) = reply.result() else { continue };
                    let received = self.settings.clock.nanoseconds();
                    let answer: Answer = from_bytes(&sample.payload().to_bytes())?;
                    let offset = super::clock::offset(sent, answer.came, answer.answered, received);
                    return Ok(Some((answer, offset)));
                }
            }
        }
    }

    fn pause(&self, pause: Duration) {
        let until = Instant::now() + pause;
        let mut state = self.shared.lock();
        while !state.is_stopped {
            let left = until.saturating_duration_since(Instant::now());
            // Who ends waits for what is on its way.
            if left.is_zero() {
                return;
            }
            state = self.shared.wait(state, left);
        }
    }
}
