//! What a sender shows of the links of its run, and to whom. It knows no network.

use super::message_queue::{Limits, MessageQueue};
use super::requests::{Answer, Link, Request, State};
use gridweave_runtime::stage::{LinkView, RunLinks};
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// A request for what has passed is answered after so long where nothing has.
const HOLD: Duration = Duration::from_secs(2);
/// A link is looked on at no longer when nobody has asked for so long: longer than a program waits for an answer.
const IDLE: Duration = Duration::from_secs(60);
/// So long a stage may take to make a link, and so often it is looked whether it has.
const LINK_TIMEOUT: Duration = Duration::from_secs(10);
const LINK_INTERVAL: Duration = Duration::from_millis(100);

/// The links that are looked on at. `R` is a way to answer a request.
pub(super) struct TapSessions<R> {
    links: Result<RunLinks, &'static str>,
    limits: Limits,
    openings: u64,
    /// By tapper.
    open: BTreeMap<u64, Opening<R>>,
    is_over: bool,
}

/// A link that is looked on at for one tapper.
struct Opening<R> {
    link: usize,
    number: u64,
    view: View,
    queue: MessageQueue,
    /// The last batch, until it is known to have come.
    last: Option<Answer>,
    /// How many batches there were.
    batches: u64,
    asked: Instant,
    /// Who waits for an answer.
    asks: Option<R>,
}

enum View {
    /// The stage has not made the link yet: since when it is waited for, and when it was looked last.
    Awaited(Instant, Option<Instant>),
    Open(Box<dyn LinkView>),
}

impl<R> TapSessions<R> {
    /// Shows these links, or says why it shows none.
    pub(super) fn new(links: Result<RunLinks, &'static str>, limits: Limits) -> Self {
        Self { links, limits, openings: 0, open: BTreeMap::new(), is_over: false }
    }

    /// Whether nothing is looked on at.
    pub(super) fn is_idle(&self) -> bool {
        self.open.is_empty()
    }

    /// Somebody asks. Gives what to answer if that is known at once; otherwise [`poll`](Self::poll) will tell.
    pub(super) fn request(&mut self, request: &Request, asks: R, now: Instant) -> Option<(R, Answer)> {
        let links = match &self.links {
            Ok(links) => links,
            Err(why) => return Some((asks, Answer::nothing(State::Refused, *why))),
        };
        if request.link.is_empty() {
            let link = |link: &gridweave_runtime::stage::RunLink| Link {
                stage: link.stage.clone(),
                output: link.output.clone(),
                ros_type: link.ros_type.clone(),
                definition: link.definition.clone(),
            };
            let links = links.all().iter().map(link).collect();
            return Some((asks, Answer { links, ..Answer::nothing(State::GoesOn, "") }));
        }
        let is_meant =
            |link: &gridweave_runtime::stage::RunLink| format!("{}.{}", link.stage, link.output) == request.link;
        let Some(link) = links.all().iter().position(is_meant) else {
            let text = format!("the run has no link `{}`", request.link);
            return Some((asks, Answer::nothing(State::Refused, text)));
        };
        let known = self.open.get_mut(&request.tapper);
        let known = known.filter(|open| open.link == link && open.number == request.opening);
        if let Some(open) = known.filter(|open| open.goes_on_after(request.taken)) {
            open.asked = now;
            return open.again(request.taken, asks);
        }
        // What was looked on at for it before goes first: few may look on at a link.
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

    /// The tapper has gone.
    pub(super) fn remove(&mut self, tapper: u64) {
        self.open.remove(&tapper);
    }

    /// The run ends: what has passed so far is the last.
    pub(super) fn end(&mut self) {
        for open in self.open.values_mut() {
            // What cannot be read any more is told with the last answer.
            drop(open.take());
        }
        self.is_over = true;
    }

    /// Takes what has passed since the last time. Gives what there is to answer.
    pub(super) fn poll(&mut self, now: Instant) -> Vec<(R, Answer)> {
        let Ok(links) = &self.links else { return Vec::new() };
        let is_over = self.is_over;
        let mut answers = Vec::new();
        self.open.retain(|_, open| {
            if now.saturating_duration_since(open.asked) >= IDLE {
                return false;
            }
            let looked = if is_over { Ok(()) } else { open.look(links, now) };
            if let Err(why) = looked {
                answers.extend(open.asks.take().map(|asks| (asks, Answer::nothing(State::Refused, why))));
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
    /// Whether a request of who has this batch can be answered.
    fn goes_on_after(&self, taken: u64) -> bool {
        taken == self.batches || (self.last.is_some() && taken + 1 == self.batches)
    }

    /// Who has all so far waits for more; who has not is given the last batch once more.
    fn again(&mut self, taken: u64, asks: R) -> Option<(R, Answer)> {
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
                    return Err(format!("the stage has not made the link within {seconds} s"));
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

    fn answer(&mut self, is_over: bool) -> Answer {
        let passed = self.queue.batch();
        self.batches += u64::from(!passed.is_empty());
        let missed = match &self.view {
            View::Awaited(..) => 0,
            View::Open(view) => view.missed(),
        };
        let answer = Answer {
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
