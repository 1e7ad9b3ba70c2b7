//! Maps that are published: whole ones, and between them the parts that have changed.
//!
//! A whole map is kept for those who come late (transient local), and updates apply to it; see
//! [`changed_part`](super::changed_part). Updates are kept for nobody: one of them on a later whole map would put back what has
//! changed. So whoever comes when there were updates has an older map, until the next update or, at once, the whole map that is
//! sent because of that.

use super::audience::{Audience, updates_of};
use super::changed_part::{Part, Rectangle, SentMap};
use super::key_expression::Topic;
use super::node::{Node, Publisher};
use super::qos::Qos;
use gridweave_runtime::ros::{OccupancyGrid, OccupancyGridUpdate, RosMessage, encode};
use gridweave_runtime::stage::StageError;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};

/// As many updates wait for one who is slow.
const UPDATES: usize = 10;

/// The maps that are published, by topic.
pub(crate) struct MapTopics {
    audience: Arc<Audience>,
    topics: Arc<Mutex<BTreeMap<String, MapTopic>>>,
    /// Sends whole maps to those who come.
    usher: Option<JoinHandle<()>>,
}

struct MapTopic {
    whole: Publisher,
    updates: Publisher,
    sent: SentMap,
}

/// What was sent of a map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Sent {
    /// All of it.
    Whole,
    /// What has changed.
    Update,
    /// Nothing, as nothing has changed.
    Nothing,
}

impl MapTopics {
    /// Looks out for those who hear maps.
    ///
    /// # Errors
    /// The session has failed, or no thread can be started.
    pub(crate) fn watch(node: &Node) -> Result<Self, StageError> {
        let (audience, topics) = (Arc::<Audience>::default(), Arc::<Mutex<BTreeMap<_, _>>>::default());
        let to = Arc::clone(&audience);
        node.watch(move |entity, is_there| to.note(entity, is_there))?;
        let (of, maps) = (Arc::clone(&audience), Arc::clone(&topics));
        let usher = thread::Builder::new().name("late maps".to_owned()).spawn(move || {
            while let Some(newcomer) = of.next_newcomer() {
                let mut maps = lock(&maps);
                let Some(map) = maps.get_mut(&newcomer.topic) else { continue };
                if !map.sent.is_updated() && newcomer.is_latched {
                    // It asks for the whole map that was sent last. An update might come before that.
                    map.sent.owe_whole();
                } else if let Err(error) = map.send_whole() {
                    tracing::warn!("a map was not sent to one who has come late: {error}");
                }
            }
        });
        let usher = usher.map_err(|error| StageError::new("start a thread for those who come late", error))?;
        Ok(Self { audience, topics, usher: Some(usher) })
    }

    /// Publishes a map on a topic, the whole or what has changed. `None` if it does not hold as many cells as it says.
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
            let updates = node.publish(updates, Qos::reliable(UPDATES))?;
            whole.send(bytes)?;
            topics.insert(name.to_owned(), MapTopic { whole, updates, sent });
            return Ok(Some(Sent::Whole));
        };
        if map.info.width as usize * map.info.height as usize != map.data.len() {
            return Ok(None);
        }
        match topic.sent.take(map, self.audience.hears_updates(name)) {
            Part::Nothing => Ok(Some(Sent::Nothing)),
            Part::Update(part) => topic.send_update(part).map(|()| Some(Sent::Update)),
            Part::Whole => {
                topic.whole.send(bytes)?;
                topic.send_outdated().map(|()| Some(Sent::Whole))
            }
        }
    }

    /// Publishes the whole of each map of which updates were the last that was sent.
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
            .map_err(|error| StageError::new("publish what has changed in a map", error))?;
        self.updates.send(&update)
    }

    /// Behind a whole map: what updates of before would put back that are taken after it.
    fn send_outdated(&mut self) -> Result<(), StageError> {
        self.sent.take_outdated().map_or(Ok(()), |part| self.send_update(part))
    }
}

impl Drop for MapTopics {
    fn drop(&mut self) {
        self.audience.end();
        if let Some(usher) = self.usher.take() {
            // It has told why, if it has panicked.
            let _ = usher.join();
        }
    }
}

fn lock(topics: &Mutex<BTreeMap<String, MapTopic>>) -> MutexGuard<'_, BTreeMap<String, MapTopic>> {
    topics.lock().unwrap_or_else(PoisonError::into_inner)
}
