//! The topics that are offered to a source.

use super::key_expression::Topic;
use super::liveliness::{Entity, Kind};
use super::middleware::Middleware;
use super::qos::Qos;
use std::collections::BTreeSet;

/// A topic on a middleware.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Offered {
    pub(crate) topic: Topic,
    pub(crate) middleware: Middleware,
}

/// A topic that was seen.
#[derive(Debug)]
pub(crate) struct Seen {
    /// Its number in the router.
    pub(crate) number: usize,
    /// What all that publish it offer.
    pub(crate) qos: Qos,
    /// Those that publish it.
    pub(crate) publishers: BTreeSet<Entity>,
}

impl Seen {
    /// The quality of service that all that publish the topic offer.
    pub(crate) fn offered_by_all(&self) -> Qos {
        let offers = self.publishers.iter().filter_map(|entity| match &entity.kind {
            Kind::Publisher(_, qos) => Some(*qos),
            _ => None,
        });
        let both = |a: Qos, b: Qos| Qos {
            is_reliable: a.is_reliable && b.is_reliable,
            is_latched: a.is_latched && b.is_latched,
            depth: a.depth.max(b.depth),
        };
        offers.reduce(both).unwrap_or(self.qos)
    }
}
