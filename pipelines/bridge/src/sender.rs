//! The sending end of a bridge: a thread that sends the outbox to the receiver.

use super::clock::Clock;
use super::network::Network;
use super::outbox::{Limits, Outbox, Totals};
use super::presence::{Presence, Role, watch};
use super::report::Report;
use super::tap::Taps;
use super::wire::{Answer, Link, from_bytes};
use super::zenoh_session::{in_words, is_connected};
use gridweave_runtime::message::MessageHeader;
use gridweave_runtime::stage::{RunLinks, StageError};
use std::collections::BTreeSet;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};
use zenoh::liveliness::LivelinessToken;
use zenoh::qos::CongestionControl;
use zenoh::{Session, Wait};

/// The time after which an unanswered batch is sent again.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(30);
/// The interval at which a waiting thread checks its conditions.
const POLL_INTERVAL: Duration = Duration::from_millis(100);
/// The delay after an error.
const AFTER_FAILURE: Duration = Duration::from_secs(1);
/// The time without a receiver after which its absence is reported.
const REPORT_AFTER: Duration = Duration::from_secs(3);
/// The time until the reason of the absence is checked again.
const REPORT_INTERVAL: Duration = Duration::from_secs(30);

/// The settings of a sender.
#[derive(Clone, Debug)]
pub(super) struct SenderSettings {
    pub(super) network: Network,
    /// Its name.
    pub(super) name: String,
    pub(super) limits: Limits,
    /// The minimum time from one batch to the next.
    pub(super) interval: Duration,
    pub(super) clock: Clock,
    /// The links of the run, for taps, or why they are not available.
    pub(super) links: Result<RunLinks, &'static str>,
}

/// The sending end of a bridge.
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
    /// The present receivers.
    receivers: BTreeSet<Presence>,
    is_stopped: bool,
    /// The last report of why there is no receiver.
    reported_absence: Option<String>,
    /// Notices for the user.
    notices: Vec<String>,
}

impl Sender {
    /// Joins the network, and starts the thread.
    ///
    /// # Errors
    /// The network cannot be joined.
    pub(super) fn start(
        settings: SenderSettings,
        mut links: Vec<Link>,
        report: Option<Report>,
    ) -> Result<Self, StageError> {
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
        let state = State {
            outbox,
            receivers: BTreeSet::new(),
            is_stopped: false,
            reported_absence: None,
            notices: Vec::new(),
        };
        let shared = Arc::new(Shared { state: Mutex::new(state), has_changed: Condvar::new() });
        let of_callback = Arc::clone(&shared);
        watch(&session, &settings.network.bridge, Role::Receiver, move |receiver, is_present| {
            of_callback.note_receiver(receiver, is_present);
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

    /// Adds a message of a link to the outbox.
    ///
    /// # Errors
    /// There is not enough memory.
    pub(super) fn push(&self, link: usize, header: &MessageHeader, bytes: &[u8]) -> Result<(), StageError> {
        let pushed = self.shared.lock().outbox.push(link, header, bytes);
        self.shared.has_changed.notify_all();
        pushed.map_err(|error| StageError::new("send a message over the bridge", error))
    }

    /// Ends the stream, and waits until the receiver has acknowledged it, for at most `longest`. Returns the number of
    /// unacknowledged messages; none if everything was acknowledged.
    pub(super) fn end(&self, longest: Duration) -> Option<usize> {
        let mut state = self.shared.lock();
        state.outbox.end();
        self.shared.has_changed.notify_all();
        let until = Instant::now() + longest;
        while !state.outbox.is_done() {
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Some(state.outbox.unacknowledged());
            }
            state = self.shared.wait(state, left);
        }
        None
    }

    pub(super) fn totals(&self) -> Totals {
        self.shared.lock().outbox.totals()
    }

    /// The notices since the last call.
    pub(super) fn take_notices(&self) -> Vec<String> {
        std::mem::take(&mut self.shared.lock().notices)
    }
}

impl Drop for Sender {
    fn drop(&mut self) {
        // Taps get the last messages of the run.
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

    fn note_receiver(&self, receiver: Presence, is_present: bool) {
        let mut state = self.lock();
        match is_present {
            true => {
                let is_new = state.receivers.insert(receiver.clone());
                let others = state.receivers.len() - 1;
                if is_new && others > 0 {
                    state.notify(format!(
                        "{} receivers have the name of this bridge: messages are sent to one of them only",
                        others + 1
                    ));
                }
                tracing::info!("the receiver `{}` is there", receiver.name);
            }
            false => {
                state.receivers.remove(&receiver);
                let name = receiver.name;
                // After the end the receiver is expected to leave; a missing acknowledgement is reported elsewhere.
                match state.outbox.is_ended() {
                    true => tracing::info!("the receiver `{name}` is gone"),
                    false => {
                        state.notify(format!(
                            "the receiver `{name}` is gone: what follows waits until it is there again"
                        ));
                    }
                }
            }
        }
        drop(state);
        self.has_changed.notify_all();
    }
}

impl State {
    fn notify(&mut self, text: String) {
        tracing::warn!("{text}");
        self.notices.push(text);
    }
}

/// The time of the next report that there is no receiver; none once one was found.
struct Search(Option<Instant>);

impl Search {
    fn is_due(&mut self) -> bool {
        let is_due = self.0.is_some_and(|next| Instant::now() >= next);
        if is_due {
            self.0 = Some(Instant::now() + REPORT_INTERVAL);
        }
        is_due
    }
}

/// The state of the thread.
struct Worker {
    session: Session,
    settings: SenderSettings,
    report: Option<Report>,
    shared: Arc<Shared>,
}

impl Worker {
    fn run(mut self) {
        let mut search = Search(Some(Instant::now() + REPORT_AFTER));
        while let Some((receiver, batch, is_handshake)) = self.next_batch(&mut search) {
            let sent = Instant::now();
            let answered = self.send_batch(&receiver, batch).and_then(|answer| {
                let Some((answer, offset)) = answer else { return Ok(false) };
                let answered = self.shared.lock().outbox.answered(&answer, is_handshake.then_some(offset));
                answered.map(|()| true).map_err(|text| format!("the receiver cannot read a batch: {text}"))
            });
            self.shared.has_changed.notify_all();
            let pause = match answered {
                Ok(true) => self.settings.interval.saturating_sub(sent.elapsed()),
                Ok(false) => POLL_INTERVAL,
                Err(wrong) => {
                    self.shared.lock().notify(wrong);
                    AFTER_FAILURE
                }
            };
            self.pause(pause);
        }
        // Closing flushes pending messages of Zenoh, such as the withdrawn token.
        if let Err(error) = self.session.close().wait() {
            tracing::debug!("the session was not closed: {}", in_words(&error));
        }
    }

    /// Waits for a batch and a receiver; none when the thread must stop.
    fn next_batch(&mut self, search: &mut Search) -> Option<(Presence, Vec<u8>, bool)> {
        let shared = Arc::clone(&self.shared);
        let mut state = shared.lock();
        loop {
            if state.is_stopped {
                return None;
            }
            // A report has the log time of the previous message, because the log time of a played log is not the clock.
            if let (Some(report), Some(log_time)) = (&mut self.report, state.outbox.last_log_time()) {
                let reported = report.take(Instant::now(), log_time, self.settings.clock.nanoseconds().unsigned_abs());
                let reported = reported.and_then(|reported| {
                    reported.map_or(Ok(()), |(header, bytes)| state.outbox.report(&header, &bytes))
                });
                if let Err(wrong) = reported {
                    state.notify(format!("cannot report the progress of the stages: {wrong}"));
                    self.report = None;
                }
            }
            if search.is_due() && state.receivers.is_empty() {
                self.report_absence();
            }
            // Of several receivers always the same one.
            if let Some(receiver) = state.receivers.first().cloned() {
                search.0 = None;
                let batch = state.outbox.batch_for(receiver.number).map(|batch| batch.map(<[u8]>::to_vec));
                let is_handshake = state.outbox.is_handshake();
                match batch {
                    Ok(Some(batch)) => return Some((receiver, batch, is_handshake)),
                    Ok(None) => {}
                    Err(wrong) => state.notify(format!("cannot encode a batch: {wrong}")),
                }
            }
            state = shared.wait(state, POLL_INTERVAL);
        }
    }

    /// Reports that there is no receiver, with the reason if known. Runs in a separate thread, as finding the reason
    /// takes long.
    fn report_absence(&self) {
        let (network, shared) = (self.settings.network.clone(), Arc::clone(&self.shared));
        let is_connected = is_connected(&self.session);
        let find = move || {
            let connection_errors = if is_connected { Vec::new() } else { network.connection_errors() };
            let (bridge, others) = (&network.bridge, network.connect_text());
            let reasons = if connection_errors.is_empty() {
                String::new()
            } else {
                format!(" ({})", connection_errors.join("; "))
            };
            let text = format!(
                "there is no receiver of the bridge `{bridge}` at {others}{reasons}. It is looked for until it is there"
            );
            let mut state = shared.lock();
            if state.receivers.is_empty() && state.reported_absence.as_ref() != Some(&text) {
                state.reported_absence = Some(text.clone());
                state.notify(text);
            }
        };
        if let Err(error) = thread::Builder::new().name("bridge search".to_owned()).spawn(find) {
            tracing::warn!("cannot start the thread that checks why there is no receiver: {error}");
        }
    }

    /// Sends a batch and waits for the answer; none if there is no answer. Returns it with the clock offset of the
    /// receiver.
    fn send_batch(&self, receiver: &Presence, batch: Vec<u8>) -> Result<Option<(Answer, i64)>, String> {
        let key = receiver.key(&self.settings.network.bridge, Role::Receiver);
        let sent = self.settings.clock.nanoseconds();
        let asked = self
            .session
            .get(key)
            .payload(batch)
            .congestion_control(CongestionControl::Block)
            .timeout(ANSWER_TIMEOUT)
            .wait();
        let answers = asked.map_err(|error| format!("cannot send a batch: {}", in_words(&error)))?;
        loop {
            match answers.recv_timeout(POLL_INTERVAL) {
                Ok(None) if self.shared.lock().is_stopped => return Ok(None),
                Ok(None) => {}
                // The query has ended without an answer.
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
            // A stop ends the pause.
            if left.is_zero() {
                return;
            }
            state = self.shared.wait(state, left);
        }
    }
}
