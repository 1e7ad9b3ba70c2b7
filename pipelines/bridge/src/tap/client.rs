//! The client of a tap: a thread that requests the messages of a link from a sender.

use super::super::network::Network;
use super::super::presence::{Presence, Role, watch};
use super::super::wire::{from_bytes, to_bytes};
use super::super::zenoh_session::{in_words, is_connected};
use super::requests::{Passed, Request, State, TapAnswer, TapLink};
use gridweave_runtime::pipeline::{named_link, suggest};
use gridweave_runtime::stage::StageError;
use std::collections::BTreeSet;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};
use zenoh::qos::{CongestionControl, Priority};
use zenoh::{Session, Wait};

/// The timeout of a request, after which it is repeated.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(30);
/// The interval at which the waiting thread checks its conditions.
const POLL_INTERVAL: Duration = Duration::from_millis(100);
/// The maximum number of attempts to get an answer.
const ATTEMPTS: usize = 20;
/// The maximum number of pending events; while they are pending no more are requested.
const BATCHES: usize = 2;
/// The time that a drop waits for the thread to disconnect from the sender.
const PATIENCE: Duration = Duration::from_secs(1);

/// The settings of a tap.
#[derive(Clone, Debug)]
pub(super) struct TapSettings {
    pub(super) network: Network,
    /// The name of the sender.
    pub(super) sender: String,
    /// The link: STAGE.PORT, or STAGE if it has only one output.
    pub(super) link: String,
    /// The time to wait for the sender; none if unlimited.
    pub(super) wait: Option<Duration>,
}

/// An event of a tap.
#[derive(Debug)]
pub(super) enum TapEvent {
    /// The link was found.
    Found(TapLink),
    Passed(Vec<Passed>),
    /// The number of further missed messages.
    Missed(u64),
    /// A notice for the user.
    Notice(String),
    /// The run has ended.
    Ended,
    Failed(StageError),
}

/// A tapped link, until this is dropped.
pub(super) struct Client {
    pub(super) events: Receiver<TapEvent>,
    is_stopped: Arc<AtomicBool>,
    /// Closed when the thread ends.
    thread: Receiver<()>,
}

impl Client {
    /// Starts to tap.
    ///
    /// # Errors
    /// The thread cannot be started.
    pub(super) fn start(settings: TapSettings) -> Result<Self, StageError> {
        let (to, events) = sync_channel(BATCHES);
        let (running, thread) = sync_channel::<()>(0);
        let is_stopped = Arc::<AtomicBool>::default();
        let until = settings.wait.map(|wait| Instant::now() + wait);
        let poller = Poller { settings, events: to, is_stopped: Arc::clone(&is_stopped), until, opening: 0, taken: 0 };
        let work = move || {
            poller.run();
            drop(running);
        };
        let started = thread::Builder::new().name("bridge tap".to_owned()).spawn(work);
        started.map_err(|error| StageError::new("start the thread of a tap", error))?;
        Ok(Self { events, is_stopped, thread })
    }
}

impl Drop for Client {
    fn drop(&mut self) {
        self.is_stopped.store(true, Ordering::Relaxed);
        // Closing the channel wakes a thread that waits for space in it.
        self.events = sync_channel(0).1;
        // Do not wait for a thread that is still connecting.
        let _ = self.thread.recv_timeout(PATIENCE);
    }
}

/// The reason of the end of a tap.
enum Over {
    /// It was stopped, or its events are no longer read.
    Stopped,
    /// The run has ended.
    Ended,
    /// It cannot go on.
    Failed(StageError),
}

impl From<StageError> for Over {
    fn from(error: StageError) -> Self {
        Self::Failed(error)
    }
}

struct Poller {
    settings: TapSettings,
    events: SyncSender<TapEvent>,
    is_stopped: Arc<AtomicBool>,
    /// The time until which the sender must be found; none if unlimited, and once it was found.
    until: Option<Instant>,
    opening: u64,
    taken: u64,
}

type Senders = Arc<Mutex<BTreeSet<Presence>>>;

impl Poller {
    fn run(mut self) {
        let over = loop {
            let session = match self.join() {
                Ok(session) => session,
                Err(over) => break over,
            };
            let over = self.tap(&session);
            // Closing withdraws the token, so that the sender stops observing.
            drop(session.close().wait());
            match over {
                Ok(()) => {
                    let others = self.settings.network.connect_text();
                    if let Err(over) = self.notify(format!("the connection to {others} is lost: it is retried")) {
                        break over;
                    }
                }
                Err(over) => break over,
            }
        };
        // The reader may be gone.
        drop(match over {
            Over::Stopped => Ok(()),
            Over::Ended => self.events.send(TapEvent::Ended),
            Over::Failed(error) => self.events.send(TapEvent::Failed(error)),
        });
    }

    fn doing(&self) -> String {
        format!("observe `{}` of `{}`", self.settings.link, self.settings.sender)
    }

    fn is_late(&self) -> bool {
        self.until.is_some_and(|until| Instant::now() >= until)
    }

    fn notify(&self, text: String) -> Result<(), Over> {
        self.send(TapEvent::Notice(text))
    }

    fn send(&self, event: TapEvent) -> Result<(), Over> {
        self.events.send(event).map_err(|_| Over::Stopped)
    }

    /// Waits for the poll interval.
    fn pause(&self) -> Result<(), Over> {
        thread::sleep(POLL_INTERVAL);
        match self.is_stopped.load(Ordering::Relaxed) {
            true => Err(Over::Stopped),
            false => Ok(()),
        }
    }

    /// Joins the network once something listens there.
    fn join(&self) -> Result<Session, Over> {
        let mut is_told = false;
        loop {
            let error = match self.settings.network.open_as_client() {
                Ok(session) => return Ok(session),
                Err(error) => error,
            };
            self.pause()?;
            // Finding the reason takes long.
            if !self.is_late() && (is_told || self.until.is_some()) {
                continue;
            }
            let connection_errors = self.settings.network.connection_errors_as_client();
            let why = if connection_errors.is_empty() { error.to_string() } else { connection_errors.join("; ") };
            if self.is_late() {
                return Err(StageError::new(self.doing(), why).into());
            }
            self.notify(format!("cannot connect to any machine ({why}); it is retried"))?;
            is_told = true;
        }
    }

    /// Taps the link until the connection is lost.
    fn tap(&mut self, session: &Session) -> Result<(), Over> {
        let (senders, bridge) = (Senders::default(), self.settings.network.bridge.clone());
        let seen = Arc::clone(&senders);
        watch(session, &bridge, Role::Sender, move |sender, is_present| {
            let mut senders = seen.lock().unwrap_or_else(PoisonError::into_inner);
            match is_present {
                true => drop(senders.insert(sender)),
                false => drop(senders.remove(&sender)),
            }
        })?;
        let me = Presence { name: "tap".to_owned(), number: Presence::number_of(session) };
        let _token = me.declare(session, &bridge, Role::Tapper)?;
        loop {
            let Some(sender) = self.find(session, &senders)? else { return Ok(()) };
            self.tap_sender(session, &me, &sender, &senders)?;
            if !is_connected(session) {
                return Ok(());
            }
            self.notify(format!("the machine `{}` is gone: it is waited for until it is there again", sender.name))?;
        }
    }

    /// Waits for the sender; none if the connection is lost.
    fn find(&self, session: &Session, senders: &Senders) -> Result<Option<Presence>, Over> {
        loop {
            let there = senders.lock().unwrap_or_else(PoisonError::into_inner).clone();
            let mut of_name = there.iter().filter(|sender| sender.name == self.settings.sender);
            if let Some(found) = of_name.next() {
                if of_name.next().is_some() {
                    self.notify(format!("several senders are called `{}`: one of them is asked", found.name))?;
                }
                return Ok(Some(found.clone()));
            }
            if !is_connected(session) {
                return Ok(None);
            }
            // Present senders are discovered within the first interval.
            self.pause()?;
            if self.is_late() {
                return Err(self.nobody(senders).into());
            }
        }
    }

    fn nobody(&self, senders: &Senders) -> StageError {
        let TapSettings { network, sender, .. } = &self.settings;
        let senders = senders.lock().unwrap_or_else(PoisonError::into_inner);
        let names: BTreeSet<&str> = senders.iter().map(|sender| sender.name.as_str()).collect();
        let names: Vec<&str> = names.into_iter().collect();
        let help = suggest(sender, &names, "there are").unwrap_or_else(|| "there is none at all".to_owned());
        let (bridge, others) = (&network.bridge, network.connect_text());
        let cause = format!("the bridge `{bridge}` at {others} has no machine `{sender}`; {help}");
        StageError::new(self.doing(), cause).of_parameter("sender")
    }

    /// Taps the link until the sender is gone.
    fn tap_sender(
        &mut self,
        session: &Session,
        me: &Presence,
        sender: &Presence,
        senders: &Senders,
    ) -> Result<(), Over> {
        let is_present = || senders.lock().unwrap_or_else(PoisonError::into_inner).contains(sender);
        let mut request = Request { tapper: me.number, ..Default::default() };
        let Some(answer) = self.ask_until_answered(session, sender, &request, &is_present)? else { return Ok(()) };
        let links: Vec<(&str, &str)> =
            answer.links.iter().map(|link| (link.stage.as_str(), link.output.as_str())).collect();
        let run = format!("the run on `{}`", sender.name);
        let wrong = |text: String| StageError::new(self.doing(), text).of_parameter("link");
        let link = answer.links[named_link(&self.settings.link, &run, &links).map_err(wrong)?].clone();
        request.link = format!("{}.{}", link.stage, link.output);
        self.send(TapEvent::Found(link))?;
        self.until = None;
        let mut missed = 0;
        loop {
            (request.opening, request.taken) = (self.opening, self.taken);
            let Some(answer) = self.ask_until_answered(session, sender, &request, &is_present)? else { return Ok(()) };
            if answer.opening != self.opening {
                if self.opening != 0 {
                    self.notify(format!("`{}` was reopened: messages may have been missed", request.link))?;
                }
                (self.opening, self.taken, missed) = (answer.opening, 0, 0);
            }
            // A repeated batch was taken already.
            if answer.number > self.taken {
                self.taken = answer.number;
                self.send(TapEvent::Passed(answer.passed))?;
            }
            if answer.missed > missed {
                self.send(TapEvent::Missed(answer.missed - missed))?;
                missed = answer.missed;
            }
            if answer.state == State::Ended {
                return Err(Over::Ended);
            }
        }
    }

    /// Repeats a request until there is an answer; none if the sender is gone.
    fn ask_until_answered(
        &self,
        session: &Session,
        sender: &Presence,
        request: &Request,
        is_present: &dyn Fn() -> bool,
    ) -> Result<Option<TapAnswer>, Over> {
        for _ in 0..ATTEMPTS {
            match self.ask(session, sender, request)? {
                Some(TapAnswer { state: State::Refused, text, .. }) => {
                    let cause = format!("the machine refuses that: {text}");
                    return Err(StageError::new(self.doing(), cause).into());
                }
                Some(answer) => return Ok(Some(answer)),
                None => self.pause()?,
            }
            if !is_present() || !is_connected(session) {
                return Ok(None);
            }
        }
        let error = StageError::new(self.doing(), "the machine is connected, but does not answer");
        Err(error.with_help("its version of `gridweave-ros` must support taps").into())
    }

    /// Sends a request; none if there is no answer.
    fn ask(&self, session: &Session, sender: &Presence, request: &Request) -> Result<Option<TapAnswer>, Over> {
        let failed = |cause: String| StageError::new(self.doing(), cause);
        let asked = session
            .get(sender.key(&self.settings.network.bridge, Role::Sender))
            .payload(to_bytes(request).map_err(failed)?)
            .congestion_control(CongestionControl::Block)
            // The messages of the bridge have priority over taps.
            .priority(Priority::DataLow)
            .timeout(ANSWER_TIMEOUT)
            .wait();
        let answers = asked.map_err(|error| failed(in_words(&error)))?;
        loop {
            match answers.recv_timeout(POLL_INTERVAL) {
                Ok(None) if self.is_stopped.load(Ordering::Relaxed) => return Err(Over::Stopped),
                Ok(None) if !is_connected(session) => return Ok(None),
                Ok(None) => {}
                // The query has ended without an answer.
                Err(_) => return Ok(None),
                Ok(Some(reply)) => {
                    let Ok(sample) = reply.result() else { continue };
                    let answer = from_bytes(&sample.payload().to_bytes());
                    return answer
                        .map(Some)
                        .map_err(|wrong| failed(format!("the answer cannot be read: {wrong}")).into());
                }
            }
        }
    }
}
