//! The topics that are offered to a source.

use crate::key_expression::Topic;
use crate::liveliness::{Entity, Kind};
use crate::middleware::Middleware;
use crate::qos::Qos;
use std::collections::BTreeSet;

/// A topic on a middleware.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct OfferedTopic {
    pub(crate) topic: Topic,
    pub(crate) middleware: Middleware,
}

/// A topic with publishers.
#[derive(Debug)]
pub(crate) struct SeenTopic {
    /// Its number in the router.
    pub(crate) number: usize,
    /// The quality of service that all publishers offer.
    pub(crate) qos: Qos,
    /// Its publishers.
    pub(crate) publishers: BTreeSet<Entity>,
}

impl SeenTopic {
    /// The quality of service that all publishers offer.
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
