//! How a stage sleeps and what wakes it.

use super::{Activity, LinkError, RunNames};
use iceoryx2::node::Node;
use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::prelude::EventId;
use iceoryx2::service::Service;
use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::time::Duration;

/// After this long asleep a stage looks at its links again. Nothing depends on it; it bounds the harm of a lost event.
const LONGEST_SLEEP: Duration = Duration::from_secs(1);

/// The ids of the events that wake a stage with `readers` readers over all its outputs.
#[derive(Clone, Copy, Debug)]
pub struct WakeEvents {
    readers: usize,
}

impl WakeEvents {
    /// The run is being stopped.
    pub const STOP: usize = 0;
    /// An input has a sample, or its publisher is there.
    pub const DATA: usize = 1;

    /// The events of a stage with so many readers over all its outputs.
    pub fn new(readers: usize) -> Self {
        Self { readers }
    }

    /// The reader with this number gives one credit.
    pub fn credit(self, reader: usize) -> usize {
        2 + reader
    }

    /// The reader with this number has taken the end of the stream and holds nothing any more.
    pub fn acknowledged(self, reader: usize) -> usize {
        2 + self.readers + reader
    }

    /// The largest id.
    fn largest(self) -> usize {
        1 + 2 * self.readers
    }
}

/// What a stage sleeps on, and the credit that has come in.
pub struct Wake<S: Service> {
    listener: Listener<S>,
    events: WakeEvents,
    credits: RefCell<Vec<u64>>,
    acknowledged: RefCell<Vec<bool>>,
    /// Whether an input may have something that has not been looked at.
    data: Cell<bool>,
    stopped: Cell<bool>,
    activity: Activity,
}

impl<S: Service> Wake<S> {
    /// The wake service of `stage`, which has `readers` readers over all its outputs and `writers` peers that may wake
    /// it. `activity` is told when it sleeps.
    pub fn new(
        node: &Node<S>,
        names: &RunNames,
        stage: &str,
        readers: usize,
        writers: usize,
        activity: Activity,
    ) -> Result<Rc<Self>, LinkError> {
        let events = WakeEvents::new(readers);
        let listener = wake_service(node, names, stage, events, writers)?
            .listener_builder()
            .create()
            .map_err(|e| LinkError::shared(format!("listen for the stage {stage}"))(&e))?;
        Ok(Rc::new(Self {
            listener,
            events,
            credits: RefCell::new(vec![0; readers]),
            acknowledged: RefCell::new(vec![false; readers]),
            data: Cell::new(false),
            stopped: Cell::new(false),
            activity,
        }))
    }

    /// Whether a reader has given credit.
    pub(crate) fn has_credit(&self, reader: usize) -> bool {
        self.credits.borrow()[reader] > 0
    }

    /// Spends one credit of a reader.
    pub(crate) fn spend(&self, reader: usize) {
        let credit = &mut self.credits.borrow_mut()[reader];
        *credit = credit.saturating_sub(1);
    }

    /// Whether readers of a live link have come since this was last asked. They say so by the event that gives credit.
    pub(crate) fn take_greetings(&self) -> bool {
        let greetings: u64 = self.credits.borrow_mut().iter_mut().map(std::mem::take).sum();
        greetings > 0
    }

    /// Whether a reader has acknowledged the end of the stream.
    pub(crate) fn has_acknowledged(&self, reader: usize) -> bool {
        self.acknowledged.borrow()[reader]
    }

    /// Takes in what has happened, without sleeping. An error if the run is being stopped.
    pub(crate) fn poll(&self) -> Result<(), LinkError> {
        self.listener.try_wait(|event| self.note(event.id.as_value(), event.count)).map_err(|e| failed(&e))?;
        self.check()
    }

    /// Called before the inputs are looked at: what comes in from here on will end the next sleep.
    pub(crate) fn look_at_inputs(&self) -> Result<(), LinkError> {
        self.poll()?;
        self.data.set(false);
        Ok(())
    }

    /// Sleeps until something happens, unless an input may have something already.
    pub(crate) fn sleep_for_input(&self) -> Result<(), LinkError> {
        match self.data.get() {
            true => Ok(()),
            false => self.sleep(),
        }
    }

    /// Sleeps until something happens, and takes it in.
    pub(crate) fn sleep(&self) -> Result<(), LinkError> {
        self.sleep_for(LONGEST_SLEEP)
    }

    /// Sleeps until something happens, but not longer than this, and takes it in.
    pub(crate) fn sleep_for(&self, longest: Duration) -> Result<(), LinkError> {
        let is_working = self.activity.is_working();
        self.activity.wait();
        let waited = self.listener.timed_wait(|event| self.note(event.id.as_value(), event.count), longest);
        if is_working {
            self.activity.work();
        }
        waited.map_err(|e| failed(&e))?;
        self.check()
    }

    /// Whether an input may have something that has not been looked at.
    pub(crate) fn has_news(&self) -> bool {
        self.data.get()
    }

    /// Whether the stage works or waits. It is at work while this value lives and it does not sleep here.
    pub(crate) fn working(&self) -> Working<'_> {
        self.activity.work();
        Working(&self.activity)
    }

    fn check(&self) -> Result<(), LinkError> {
        match self.stopped.get() {
            true => Err(LinkError::Stopped),
            false => Ok(()),
        }
    }

    fn note(&self, id: usize, count: u64) {
        let readers = self.events.readers;
        match id {
            WakeEvents::STOP => self.stopped.set(true),
            WakeEvents::DATA => self.data.set(true),
            credit if credit < 2 + readers => self.credits.borrow_mut()[credit - 2] += count,
            acknowledged => {
                if let Some(place) = self.acknowledged.borrow_mut().get_mut(acknowledged - 2 - readers) {
                    *place = true;
                }
            }
        }
    }
}

/// The stage is at work while this lives.
pub(crate) struct Working<'a>(&'a Activity);

impl Drop for Working<'_> {
    fn drop(&mut self) {
        self.0.wait();
    }
}

fn failed(cause: &dyn std::fmt::Debug) -> LinkError {
    LinkError::shared("wait for other stages")(cause)
}

/// Wakes one stage.
pub struct Waker<S: Service> {
    notifier: Notifier<S>,
    stage: String,
}

impl<S: Service> Waker<S> {
    /// A way to wake `stage`; `readers` and `writers` as in [`Wake::new`].
    pub fn new(
        node: &Node<S>,
        names: &RunNames,
        stage: &str,
        readers: usize,
        writers: usize,
    ) -> Result<Self, LinkError> {
        let notifier = wake_service(node, names, stage, WakeEvents::new(readers), writers)?
            .notifier_builder()
            .create()
            .map_err(|e| LinkError::shared(format!("wake the stage {stage}"))(&e))?;
        Ok(Self { notifier, stage: stage.to_owned() })
    }

    /// Sends one event.
    pub fn wake(&self, event: usize) -> Result<(), LinkError> {
        match self.notifier.notify_with_custom_event_id(EventId::new(event)) {
            Ok(_) => Ok(()),
            Err(e) => Err(LinkError::shared(format!("wake the stage {}", self.stage))(&e)),
        }
    }
}

fn wake_service<S: Service>(
    node: &Node<S>,
    names: &RunNames,
    stage: &str,
    events: WakeEvents,
    writers: usize,
) -> Result<iceoryx2::service::port_factory::event::PortFactory<S>, LinkError> {
    node.service_builder(&names.wake(stage)?)
        .event()
        .max_listeners(1)
        .max_notifiers(writers.max(1))
        .max_nodes(writers + 2)
        .event_id_max_value(events.largest())
        .open_or_create()
        .map_err(|e| LinkError::shared(format!("open the events of the stage {stage}"))(&e))
}
