//! Publishing of maps: whole maps, and updates of the changed parts between them.
//!
//! A whole map is retained for late joiners (transient local), and updates apply to it; see
//! [`changed_part`](super::changed_part). Updates are not retained (volatile): an old update applied to a later whole
//! map would revert changes. So a late joiner after updates receives an outdated map first, and a whole map is sent for
//! it at once.

use super::changed_part::{Part, Rectangle, SentMap};
use super::key_expression::Topic;
use super::map_subscribers::{MapSubscribers, updates_of};
use super::node::{Node, Publisher};
use super::qos::Qos;
use gridweave_runtime::ros::{OccupancyGrid, OccupancyGridUpdate, RosMessage, encode};
use gridweave_runtime::stage::StageError;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};

/// The depth of the publishers of updates, messages.
const UPDATES_DEPTH: usize = 10;

/// The published maps, by topic.
pub(crate) struct MapTopics {
    subscribers: Arc<MapSubscribers>,
    topics: Arc<Mutex<BTreeMap<String, MapTopic>>>,
    /// The thread that sends whole maps for late joiners.
    late_join_thread: Option<JoinHandle<()>>,
}

struct MapTopic {
    whole: Publisher,
    updates: Publisher,
    sent: SentMap,
}

/// The part of a map that was sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Sent {
    /// The whole map.
    Whole,
    /// An update of the changed part.
    Update,
    /// Nothing, as nothing has changed.
    Nothing,
}

impl MapTopics {
    /// Watches for subscribers of maps, and sends whole maps for late joiners.
    ///
    /// # Errors
    /// The session has failed, or no thread can be started.
    pub(crate) fn watch(node: &Node) -> Result<Self, StageError> {
        let (subscribers, topics) = (Arc::<MapSubscribers>::default(), Arc::<Mutex<BTreeMap<_, _>>>::default());
        let to = Arc::clone(&subscribers);
        node.watch(move |_, entity, is_present| to.note(entity, is_present))?;
        let (of, maps) = (Arc::clone(&subscribers), Arc::clone(&topics));
        let late_join_thread = thread::Builder::new().name("late maps".to_owned()).spawn(move || {
            while let Some(late_joiner) = of.next_late_joiner() {
                let mut maps = lock(&maps);
                let Some(map) = maps.get_mut(&late_joiner.topic) else { continue };
                if !map.sent.is_updated() && late_joiner.is_latched {
                    // It requests the last whole map itself. An update could arrive before that.
                    map.sent.request_whole();
                } else if let Err(error) = map.send_whole() {
                    tracing::warn!("cannot send a whole map for a late joiner: {error}");
                }
            }
        });
        let late_join_thread =
            late_join_thread.map_err(|error| StageError::new("start the thread for late joiners", error))?;
        Ok(Self { subscribers, topics, late_join_thread: Some(late_join_thread) })
    }

    /// Whether a map is published on a topic.
    pub(crate) fn has(&self, name: &str) -> bool {
        lock(&self.topics).contains_key(name)
    }

    /// Publishes a map on a topic, as a whole or as an update. `None` if the number of cells does not match its size.
    ///
    /// # Errors
    /// The session has failed.
    pub(crate) fn send(
        &self,
        node: &mut Node,
        name: &str,
        map: &OccupancyGrid<'_>,
        bytes: &[u8],
    ) -> Result<Option<Sent>, StageError> {
        let mut topics = lock(&self.topics);
        let Some(topic) = topics.get_mut(name) else {
            let Some(sent) = SentMap::new(map) else { return Ok(None) };
            let of = |name: &str, ros_type| {
                Topic::known(name, ros_type)
                    .ok_or_else(|| StageError::new(format!("publish `{name}`"), "its type is not known"))
            };
            let mut whole = node.publish(of(name, OccupancyGrid::NAME)?, Qos::latched(1))?;
            let updates = of(&updates_of(name), OccupancyGridUpdate::NAME)?;
            let updates = node.publish(updates, Qos::reliable(UPDATES_DEPTH))?;
            whole.send(bytes)?;
            topics.insert(name.to_owned(), MapTopic { whole, updates, sent });
            return Ok(Some(Sent::Whole));
        };
        if map.info.width as usize * map.info.height as usize != map.data.len() {
            return Ok(None);
        }
        match topic.sent.take(map, self.subscribers.receives_updates(name)) {
            Part::Nothing => Ok(Some(Sent::Nothing)),
            Part::Update(part) => topic.send_update(part).map(|()| Some(Sent::Update)),
            Part::Whole => {
                topic.whole.send(bytes)?;
                topic.send_outdated().map(|()| Some(Sent::Whole))
            }
        }
    }

    /// Publishes the whole of each map that was last sent as an update.
    ///
    /// # Errors
    /// The session has failed.
    pub(crate) fn send_updated(&self) -> Result<(), StageError> {
        let mut topics = lock(&self.topics);
        topics.values_mut().filter(|topic| topic.sent.is_updated()).try_for_each(MapTopic::send_whole)
    }
}

impl MapTopic {
    fn send_whole(&mut self) -> Result<(), StageError> {
        let bytes = encode(&self.sent.whole()).map_err(|error| StageError::new("publish a whole map", error))?;
        self.whole.send(&bytes)?;
        self.send_outdated()
    }

    fn send_update(&mut self, part: Rectangle) -> Result<(), StageError> {
        let mut cells = Vec::new();
        let update = encode(&self.sent.update(part, &mut cells))
            .map_err(|error| StageError::new("publish an update of a map", error))?;
        self.updates.send(&update)
    }

    /// Sends an update after a whole map, for subscribers that apply an earlier update to it.
    fn send_outdated(&mut self) -> Result<(), StageError> {
        self.sent.take_outdated().map_or(Ok(()), |part| self.send_update(part))
    }
}

impl Drop for MapTopics {
    fn drop(&mut self) {
        self.subscribers.end();
        if let Some(late_join_thread) = self.late_join_thread.take() {
            // A panic has been reported already.
            let _ = late_join_thread.join();
        }
    }
}

fn lock(topics: &Mutex<BTreeMap<String, MapTopic>>) -> MutexGuard<'_, BTreeMap<String, MapTopic>> {
    topics.lock().unwrap_or_else(PoisonError::into_inner)
}
