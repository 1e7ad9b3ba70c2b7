//! Who hears maps, and whether they hear their updates as well.

use super::liveliness::{Entity, Kind};
use gridweave_runtime::ros::{OccupancyGrid, OccupancyGridUpdate, RosMessage};
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

/// The topic of the updates of a map, as nav2 and RViz have it.
pub(crate) fn updates_of(map: &str) -> String {
    format!("{map}_updates")
}

/// The programs that hear maps.
#[derive(Debug, Default)]
pub(crate) struct Audience {
    state: Mutex<State>,
    has_come: Condvar,
}

#[derive(Debug, Default)]
struct State {
    /// By topic of a map or of updates.
    hearers: BTreeMap<String, BTreeSet<Entity>>,
    /// Those that have come and were not seen to yet.
    newcomers: VecDeque<Newcomer>,
    is_over: bool,
}

/// One who hears a map from here on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Newcomer {
    /// The topic of the map.
    pub(crate) topic: String,
    /// Whether it asks for the last map that was sent before it came.
    pub(crate) is_latched: bool,
}

impl Audience {
    /// A program is there from here on (or no longer).
    pub(crate) fn note(&self, entity: Entity, is_there: bool) {
        let Kind::Subscriber(topic, qos) = &entity.kind else { return };
        let is_map = topic.ros_type == OccupancyGrid::NAME;
        if !is_map && topic.ros_type != OccupancyGridUpdate::NAME {
            return;
        }
        let newcomer = Newcomer { topic: topic.name.clone(), is_latched: qos.is_latched };
        let mut state = self.lock();
        if !is_there {
            if let Some(hearers) = state.hearers.get_mut(&newcomer.topic) {
                hearers.remove(&entity);
            }
            return;
        }
        let is_new = state.hearers.entry(newcomer.topic.clone()).or_default().insert(entity);
        if is_map && is_new {
            state.newcomers.push_back(newcomer);
            self.has_come.notify_one();
        }
    }

    /// Whether somebody hears a map, and every node that does hears its updates as well.
    pub(crate) fn hears_updates(&self, map: &str) -> bool {
        let state = self.lock();
        let hearers = |topic: &str| state.hearers.get(topic).into_iter().flatten();
        let node = |entity: &Entity| (entity.session.clone(), entity.full_node_name());
        let with_updates: BTreeSet<_> = hearers(&updates_of(map)).map(node).collect();
        let mut of_map = hearers(map).peekable();
        of_map.peek().is_some() && of_map.all(|entity| with_updates.contains(&node(entity)))
    }

    /// Waits for the next one who comes; `None` if it is over.
    pub(crate) fn next_newcomer(&self) -> Option<Newcomer> {
        let is_idle = |state: &mut State| state.newcomers.is_empty() && !state.is_over;
        let waited = self.has_come.wait_while(self.lock(), is_idle);
        let mut state = waited.unwrap_or_else(PoisonError::into_inner);
        match state.is_over {
            true => None,
            false => state.newcomers.pop_front(),
        }
    }

    /// Nobody is waited for any more.
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
            namespace: "/".into(),
            node: "rviz".into(),
            kind: Kind::Subscriber(Topic::known(name, ros_type).unwrap(), qos),
        }
    }

    #[test]
    fn updates_are_heard_where_every_program_that_hears_the_map_hears_them() {
        let audience = Audience::default();
        let map = |session| subscriber(session, "/map", OccupancyGrid::NAME, Qos::latched(1));
        let updates = |session| subscriber(session, "/map_updates", OccupancyGridUpdate::NAME, Qos::reliable(5));
        assert!(!audience.hears_updates("/map"), "nobody is there");
        audience.note(updates("a"), true);
        assert!(!audience.hears_updates("/map"));
        audience.note(map("a"), true);
        assert!(audience.hears_updates("/map") && !audience.hears_updates("/other"));
        audience.note(map("b"), true);
        assert!(!audience.hears_updates("/map"));
        audience.note(map("b"), false);
        assert!(audience.hears_updates("/map"));
        audience.note(updates("a"), false);
        assert!(!audience.hears_updates("/map"));
    }

    #[test]
    fn those_who_hear_a_map_are_met_once_each_and_nobody_at_the_end() {
        let audience = Audience::default();
        let volatile = subscriber("a", "/map", OccupancyGrid::NAME, Qos::reliable(1));
        audience.note(volatile.clone(), true);
        audience.note(volatile, true);
        audience.note(subscriber("a", "/map_updates", OccupancyGridUpdate::NAME, Qos::reliable(5)), true);
        audience.note(subscriber("b", "/fleet/map", OccupancyGrid::NAME, Qos::latched(1)), true);
        let newcomer = |topic: &str, is_latched| Some(Newcomer { topic: topic.into(), is_latched });
        assert_eq!(audience.next_newcomer(), newcomer("/map", false));
        std::thread::scope(|scope| {
            let rest = scope.spawn(|| [audience.next_newcomer(), audience.next_newcomer()]);
            while !rest.is_finished() {
                if audience.lock().newcomers.is_empty() {
                    audience.end();
                }
                std::thread::yield_now();
            }
            assert_eq!(rest.join().unwrap(), [newcomer("/fleet/map", true), None]);
        });
    }
}
