//! The subscribers of maps and of their updates.

use super::liveliness::{Entity, Kind};
use gridweave_runtime::ros::{OccupancyGrid, OccupancyGridUpdate, RosMessage};
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

/// The topic of the updates of a map, as in nav2 and RViz.
pub(crate) fn updates_of(map: &str) -> String {
    format!("{map}_updates")
}

/// The subscribers of maps, and the late joiners among them.
#[derive(Debug, Default)]
pub(crate) struct MapSubscribers {
    state: Mutex<State>,
    has_come: Condvar,
}

#[derive(Debug, Default)]
struct State {
    /// The subscribers by topic, of maps and of updates.
    subscribers: BTreeMap<String, BTreeSet<Entity>>,
    /// The late joiners that were not handled yet.
    late_joiners: VecDeque<LateJoiner>,
    is_over: bool,
}

/// A new subscriber of a map.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct LateJoiner {
    /// The topic of the map.
    pub(crate) topic: String,
    /// Whether it requests the last message of the publisher (transient local).
    pub(crate) is_latched: bool,
}

impl MapSubscribers {
    /// Records that a publisher or subscriber has appeared or disappeared.
    pub(crate) fn note(&self, entity: Entity, is_present: bool) {
        let Kind::Subscriber(topic, qos) = &entity.kind else { return };
        let is_map = topic.ros_type == OccupancyGrid::NAME;
        if !is_map && topic.ros_type != OccupancyGridUpdate::NAME {
            return;
        }
        let late_joiner = LateJoiner { topic: topic.name.clone(), is_latched: qos.is_latched };
        let mut state = self.lock();
        if !is_present {
            if let Some(subscribers) = state.subscribers.get_mut(&late_joiner.topic) {
                subscribers.remove(&entity);
            }
            return;
        }
        let is_new = state.subscribers.entry(late_joiner.topic.clone()).or_default().insert(entity);
        if is_map && is_new {
            state.late_joiners.push_back(late_joiner);
            self.has_come.notify_one();
        }
    }

    /// Whether a map has subscribers, and every node that subscribes to it subscribes to its updates too. Nodes of a
    /// process whose names are not known are one here, and subscribe to updates as often as to the map if each of them
    /// does.
    pub(crate) fn receives_updates(&self, map: &str) -> bool {
        let state = self.lock();
        let counts = |topic: &str| {
            let mut counts = BTreeMap::<_, usize>::new();
            for entity in state.subscribers.get(topic).into_iter().flatten() {
                *counts.entry((entity.session.clone(), entity.full_node_name())).or_default() += 1;
            }
            counts
        };
        let (of_map, of_updates) = (counts(map), counts(&updates_of(map)));
        let receives = |node, count| of_updates.get(node).is_some_and(|updates| updates >= count);
        !of_map.is_empty() && of_map.iter().all(|(node, count)| receives(node, count))
    }

    /// Waits for the next late joiner; `None` after [`end`](Self::end).
    pub(crate) fn next_late_joiner(&self) -> Option<LateJoiner> {
        let is_idle = |state: &mut State| state.late_joiners.is_empty() && !state.is_over;
        let waited = self.has_come.wait_while(self.lock(), is_idle);
        let mut state = waited.unwrap_or_else(PoisonError::into_inner);
        match state.is_over {
            true => None,
            false => state.late_joiners.pop_front(),
        }
    }

    /// Ends [`next_late_joiner`](Self::next_late_joiner).
    pub(crate) fn end(&self) {
        self.lock().is_over = true;
        self.has_come.notify_all();
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::super::key_expression::Topic;
    use super::super::qos::Qos;
    use super::*;

    fn subscriber(session: &str, name: &str, ros_type: &str, qos: Qos) -> Entity {
        Entity {
            domain: 0,
            session: session.into(),
            node_number: 0,
            number: 10,
            enclave: "/".into(),
            namespace: "/".into(),
            node: "rviz".into(),
            kind: Kind::Subscriber(Topic::known(name, ros_type).unwrap(), qos),
        }
    }

    #[test]
    fn updates_are_received_if_every_node_that_subscribes_to_the_map_subscribes_to_them() {
        let subscribers = MapSubscribers::default();
        let map = |session| subscriber(session, "/map", OccupancyGrid::NAME, Qos::latched(1));
        let updates = |session| subscriber(session, "/map_updates", OccupancyGridUpdate::NAME, Qos::reliable(5));
        assert!(!subscribers.receives_updates("/map"), "there are no subscribers");
        subscribers.note(updates("a"), true);
        assert!(!subscribers.receives_updates("/map"));
        subscribers.note(map("a"), true);
        assert!(subscribers.receives_updates("/map") && !subscribers.receives_updates("/other"));
        subscribers.note(map("b"), true);
        assert!(!subscribers.receives_updates("/map"));
        subscribers.note(map("b"), false);
        let second = Entity { number: 11, ..map("a") };
        subscribers.note(second.clone(), true);
        assert!(!subscribers.receives_updates("/map"), "there may be a second node in that process");
        subscribers.note(second, false);
        assert!(subscribers.receives_updates("/map"));
        subscribers.note(updates("a"), false);
        assert!(!subscribers.receives_updates("/map"));
    }

    #[test]
    fn each_new_subscriber_of_a_map_is_returned_once_and_none_after_the_end() {
        let subscribers = MapSubscribers::default();
        let volatile = subscriber("a", "/map", OccupancyGrid::NAME, Qos::reliable(1));
        subscribers.note(volatile.clone(), true);
        subscribers.note(volatile, true);
        subscribers.note(subscriber("a", "/map_updates", OccupancyGridUpdate::NAME, Qos::reliable(5)), true);
        subscribers.note(subscriber("b", "/fleet/map", OccupancyGrid::NAME, Qos::latched(1)), true);
        let late_joiner = |topic: &str, is_latched| Some(LateJoiner { topic: topic.into(), is_latched });
        assert_eq!(subscribers.next_late_joiner(), late_joiner("/map", false));
        std::thread::scope(|scope| {
            let rest = scope.spawn(|| [subscribers.next_late_joiner(), subscribers.next_late_joiner()]);
            while !rest.is_finished() {
                if subscribers.lock().late_joiners.is_empty() {
                    subscribers.end();
                }
                std::thread::yield_now();
            }
            assert_eq!(rest.join().unwrap(), [late_joiner("/fleet/map", true), None]);
        });
    }
}
