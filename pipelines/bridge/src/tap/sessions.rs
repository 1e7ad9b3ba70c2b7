//! The sessions of taps at a sender, independent of the network.

use super::message_queue::{Limits, MessageQueue};
use super::requests::{Request, State, TapAnswer, TapLink};
use gridweave_runtime::stage::{LinkView, RunLinks};
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// The timeout of long polling: a request is answered after this time even without messages.
const HOLD: Duration = Duration::from_secs(2);
/// The time without requests after which a link is closed: longer than a tap waits for an answer.
const IDLE: Duration = Duration::from_secs(60);
/// The time to wait for a stage to create its link.
const LINK_TIMEOUT: Duration = Duration::from_secs(10);
/// The interval at which a missing link is looked for.
const LINK_INTERVAL: Duration = Duration::from_millis(100);

/// The tapped links. `R` is a handle with which a request is answered.
pub(super) struct TapSessions<R> {
    links: Result<RunLinks, &'static str>,
    limits: Limits,
    openings: u64,
    /// The openings by tapper.
    open: BTreeMap<u64, Opening<R>>,
    is_over: bool,
}

/// A link that one tapper observes.
struct Opening<R> {
    link: usize,
    number: u64,
    view: View,
    queue: MessageQueue,
    /// The last batch, until it is acknowledged.
    last: Option<TapAnswer>,
    /// The number of batches.
    batches: u64,
    asked: Instant,
    /// The request that waits for an answer.
    asks: Option<R>,
}

enum View {
    /// The stage has not created the link yet: when the waiting began, and when the link was looked for last.
    Awaited(Instant, Option<Instant>),
    Open(Box<dyn LinkView>),
}

impl<R> TapSessions<R> {
    /// Sessions for the given links, or with the reason why they are not available.
    pub(super) fn new(links: Result<RunLinks, &'static str>, limits: Limits) -> Self {
        Self { links, limits, openings: 0, open: BTreeMap::new(), is_over: false }
    }

    /// Whether no link is observed.
    pub(super) fn is_idle(&self) -> bool {
        self.open.is_empty()
    }

    /// Handles a request. Returns the answer if it is known at once; otherwise [`poll`](Self::poll) returns it later.
    pub(super) fn request(&mut self, request: &Request, asks: R, now: Instant) -> Option<(R, TapAnswer)> {
        let links = match &self.links {
            Ok(links) => links,
            Err(why) => return Some((asks, TapAnswer::nothing(State::Refused, *why))),
        };
        if request.link.is_empty() {
            let link = |link: &gridweave_runtime::stage::RunLink| TapLink {
                stage: link.stage.clone(),
                output: link.output.clone(),
                ros_type: link.ros_type.clone(),
                definition: link.definition.clone(),
            };
            let links = links.all().iter().map(link).collect();
            return Some((asks, TapAnswer { links, ..TapAnswer::nothing(State::GoesOn, "") }));
        }
        let is_meant =
            |link: &gridweave_runtime::stage::RunLink| format!("{}.{}", link.stage, link.output) == request.link;
        let Some(link) = links.all().iter().position(is_meant) else {
            let text = format!("the run has no link `{}`", request.link);
            return Some((asks, TapAnswer::nothing(State::Refused, text)));
        };
        let known = self.open.get_mut(&request.tapper);
        let known = known.filter(|open| open.link == link && open.number == request.opening);
        if let Some(open) = known.filter(|open| open.goes_on_after(request.taken)) {
            open.asked = now;
            return open.again(request.taken, asks);
        }
        // The previous opening is closed first, because a link has few observers.
        self.open.remove(&request.tapper);
        self.openings += 1;
        let opening = Opening {
            link,
            number: self.openings,
            view: View::Awaited(now, None),
            queue: MessageQueue::new(self.limits),
            last: None,
            batches: 0,
            asked: now,
            asks: Some(asks),
        };
        self.open.insert(request.tapper, opening);
        None
    }

    /// Removes a tapper that has disconnected.
    pub(super) fn remove(&mut self, tapper: u64) {
        self.open.remove(&tapper);
    }

    /// Ends the run: the messages so far are the last ones.
    pub(super) fn end(&mut self) {
        for open in self.open.values_mut() {
            // A link that can no longer be read ends like the others.
            drop(open.take());
        }
        self.is_over = true;
    }

    /// Takes the messages since the last call. Returns the answers that are due.
    pub(super) fn poll(&mut self, now: Instant) -> Vec<(R, TapAnswer)> {
        let Ok(links) = &self.links else { return Vec::new() };
        let is_over = self.is_over;
        let mut answers = Vec::new();
        self.open.retain(|_, open| {
            if now.saturating_duration_since(open.asked) >= IDLE {
                return false;
            }
            let looked = if is_over { Ok(()) } else { open.look(links, now) };
            if let Err(why) = looked {
                answers.extend(open.asks.take().map(|asks| (asks, TapAnswer::nothing(State::Refused, why))));
                return false;
            }
            let is_held = now.saturating_duration_since(open.asked) >= HOLD;
            if (is_over || is_held || !open.queue.is_empty())
                && let Some(asks) = open.asks.take()
            {
                let answer = open.answer(is_over);
                let is_last = answer.state == State::Ended;
                answers.push((asks, answer));
                return !is_last;
            }
            true
        });
        answers
    }
}

impl<R> Opening<R> {
    /// Whether a request with this last received batch can be answered.
    fn goes_on_after(&self, taken: u64) -> bool {
        taken == self.batches || (self.last.is_some() && taken + 1 == self.batches)
    }

    /// Continues with a request: it waits for more messages, or gets the last batch again if it has not received it.
    fn again(&mut self, taken: u64, asks: R) -> Option<(R, TapAnswer)> {
        if taken == self.batches {
            self.last = None;
            self.asks = Some(asks);
            return None;
        }
        self.last.clone().map(|last| (asks, last))
    }

    fn look(&mut self, links: &RunLinks, now: Instant) -> Result<(), String> {
        if let View::Awaited(since, looked) = self.view {
            if looked.is_some_and(|looked| now.saturating_duration_since(looked) < LINK_INTERVAL) {
                return Ok(());
            }
            match links.open(self.link).map_err(|error| error.to_string())? {
                Some(view) => self.view = View::Open(view),
                None if now.saturating_duration_since(since) >= LINK_TIMEOUT => {
                    let seconds = LINK_TIMEOUT.as_secs();
                    return Err(format!("the stage has not created the link within {seconds} s"));
                }
                None => self.view = View::Awaited(since, Some(now)),
            }
        }
        self.take()
    }

    fn take(&mut self) -> Result<(), String> {
        let View::Open(view) = &mut self.view else { return Ok(()) };
        let waiting = &mut self.queue;
        view.take(&mut |message| waiting.push(&message)).map_err(|error| error.to_string())
    }

    fn answer(&mut self, is_over: bool) -> TapAnswer {
        let passed = self.queue.batch();
        self.batches += u64::from(!passed.is_empty());
        let missed = match &self.view {
            View::Awaited(..) => 0,
            View::Open(view) => view.missed(),
        };
        let answer = TapAnswer {
            state: if is_over && self.queue.is_empty() { State::Ended } else { State::GoesOn },
            opening: self.number,
            number: self.batches,
            missed: missed + self.queue.dropped(),
            links: Vec::new(),
            passed,
            text: String::new(),
        };
        if !answer.passed.is_empty() {
            self.last = Some(answer.clone());
        }
        answer
    }
}
