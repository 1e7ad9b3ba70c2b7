//! The service of a link, as all of its ends open it.

use super::board::MAX_SENDERS;
use super::kept::MAX_TOPICS;
use super::room::Room;
use super::stage_board::StageBoard;
use super::{LinkError, Order, RunNames, SampleHeader};
use crate::pipeline::Overflow;
use iceoryx2::node::Node;
use iceoryx2::port::publisher::{Publisher, PublisherCreateError};
use iceoryx2::prelude::{AllocationStrategy, BackpressureStrategy};
use iceoryx2::service::Service;
use iceoryx2::service::builder::publish_subscribe::{
    PublishSubscribeOpenError as E, PublishSubscribeOpenOrCreateError as OpenError,
};
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use std::time::Duration;

/// How many programs may look on at a link.
pub(crate) const MAX_OBSERVERS: usize = 4;
/// How many samples wait for one that looks on.
pub(super) const OBSERVER_BUFFER: usize = 64;
/// How many samples wait for the owner of a live link, which keeps the last of them.
pub(super) const KEEPER_BUFFER: usize = 128;
/// How many samples the owner of a live link may hold.
pub(super) const KEEPER_HELD: usize = 22;
/// For how large a payload, in bytes, room is set aside for each sample before the first is sent.
pub(super) const FIRST_PLACE: usize = 4 * 1024;
/// What a reader of a live link has room for beyond its depth: for what is repeated, with the end, for itself and for
/// another who came at the same time.
const REPEAT_ROOM: usize = 2 * (MAX_TOPICS + 1);
/// Ends that open a link at once may each find it neither there nor theirs to make, where the machine is busy. They try
/// again, so often at the most.
const ATTEMPTS: usize = 100;
const BETWEEN_ATTEMPTS: Duration = Duration::from_millis(10);
/// Of what may be held, so much is not counted on: for the sample that is being received.
const SPARE: usize = 2;

/// What all ends of a link must agree on.
#[derive(Clone, Debug)]
pub struct LinkShape<'a> {
    /// The stage that owns it.
    pub stage: &'a str,
    /// Its output port.
    pub port: &'a str,
    /// How many stages read it.
    pub readers: usize,
    /// The largest of their depths.
    pub depth: usize,
    /// The order in which they take their inputs.
    pub order: Order,
    /// What becomes of a message for which there is no room.
    pub overflow: Overflow,
}

/// An output port on the board.
#[derive(Clone)]
pub struct PortBoard {
    /// That of the stage.
    pub board: StageBoard,
    /// The port.
    pub port: usize,
}

impl LinkShape<'_> {
    /// STAGE.PORT
    pub fn name(&self) -> String {
        format!("{}.{}", self.stage, self.port)
    }

    /// How many samples of one sender can wait for a reader of the given depth.
    pub(super) fn buffer(&self, depth: usize) -> usize {
        match (self.order, self.overflow) {
            // Twice, as a reader may have to let more in to be able to go on.
            (Order::LogTime, _) => 2 * depth,
            (Order::Arrival, Overflow::Wait) => depth + REPEAT_ROOM,
            (Order::Arrival, Overflow::DropOldest) => depth,
        }
    }

    /// How many samples a reader of the given depth may hold; what comes on top of that is copied.
    pub(super) fn held(&self, depth: usize) -> usize {
        match self.order {
            Order::LogTime => depth + 64 - SPARE,
            Order::Arrival => KEEPER_HELD,
        }
    }

    pub(super) fn open<S: Service>(
        &self,
        node: &Node<S>,
        names: &RunNames,
    ) -> Result<PortFactory<S, [u8], SampleHeader>, LinkError> {
        let failed = |cause: &dyn std::fmt::Debug| LinkError::shared(format!("open the link {}", self.name()))(cause);
        if names.is_shared() {
            Room::default().ask(0, || format!("open the link {}", self.name()))?;
        }
        // Nobody sees a link from outside that does not leave the process.
        let (observers, mut buffer) = match names.is_shared() {
            true => (MAX_OBSERVERS, self.buffer(self.depth).max(OBSERVER_BUFFER)),
            false => (0, self.buffer(self.depth)),
        };
        let (senders, keepers) = match self.order {
            Order::LogTime => (1, 0),
            Order::Arrival => (MAX_SENDERS, 1),
        };
        buffer = buffer.max(keepers * KEEPER_BUFFER);
        let subscribers = self.readers.max(1) + observers + keepers;
        let name = names.link(self.stage, self.port)?;
        // The payload begins where the user header ends, and so is aligned as that is. To ask iceoryx2 for it would set
        // aside eight bytes for each.
        let open = || {
            node.service_builder(&name)
                .publish_subscribe::<[u8]>()
                .user_header::<SampleHeader>()
                .enable_safe_overflow(self.overflow == Overflow::DropOldest)
                .history_size(0)
                .subscriber_max_buffer_size(buffer)
                .subscriber_max_borrowed_samples(self.held(self.depth) + SPARE)
                .max_publishers(senders)
                .max_subscribers(subscribers)
                .max_nodes(subscribers + senders + 1)
                .open_or_create()
        };
        for _ in 1..ATTEMPTS {
            match open() {
                Err(OpenError::SystemInFlux | OpenError::PublishSubscribeOpenError(E::DoesNotExist)) => {
                    std::thread::sleep(BETWEEN_ATTEMPTS);
                }
                done => return done.map_err(|e| failed(&e)),
            }
        }
        open().map_err(|e| failed(&e))
    }

    /// A publisher of the link. It sets memory aside for each sample that can be in use at a time: as much as the largest
    /// payload takes that was sent, rounded up to a power of two.
    pub(super) fn publisher<S: Service>(
        &self,
        service: &PortFactory<S, [u8], SampleHeader>,
    ) -> Result<Publisher<S, [u8], SampleHeader>, LinkError> {
        service
            .publisher_builder()
            .initial_max_slice_len(FIRST_PLACE)
            .max_loaned_samples(1)
            .allocation_strategy(AllocationStrategy::PowerOfTwo)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|e| match e {
                PublisherCreateError::ExceedsMaxSupportedPublishers => {
                    LinkError::Crowded { doing: "send on".into(), link: self.name(), most: MAX_SENDERS - 1 }
                }
                other => LinkError::shared(format!("publish {}", self.name()))(&other),
            })
    }
}

/// The number by which readers know a sender, made of iceoryx2's for its publisher; never 0.
pub(super) fn origin(publisher: u128) -> u64 {
    ((publisher >> 64) as u64 ^ publisher as u64).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::RunFolder;
    use iceoryx2::service::ipc;

    const LARGE: usize = 1 << 20;

    /// How many bytes the largest file of the run in shared memory has.
    fn largest_file(prefix: &str) -> u64 {
        let files = std::fs::read_dir("/dev/shm").unwrap().map(|file| file.unwrap());
        let of_run = files.filter(|file| file.file_name().to_string_lossy().starts_with(prefix));
        // One of another link may go away meanwhile.
        of_run.filter_map(|file| file.metadata().ok()).map(|file| file.len()).max().unwrap()
    }

    #[test]
    fn a_byte_that_is_sent_sets_no_more_aside_than_two_for_each_sample_in_use_and_payloads_are_aligned() {
        let folder = RunFolder::create().unwrap();
        let names = folder.names();
        let (readers, depth) = (1, 2);
        let node = names.node::<ipc::Service>().unwrap();
        let (order, overflow) = (Order::LogTime, Overflow::Wait);
        let shape = LinkShape { stage: "a", port: "b", readers, depth, order, overflow };
        let service = shape.open(&node, &names).unwrap();
        let publisher = shape.publisher(&service).unwrap();
        for length in [1, FIRST_PLACE, FIRST_PLACE + 1, LARGE] {
            let sample = publisher.loan_slice(length).unwrap();
            assert!(sample.payload().as_ptr().cast::<u64>().is_aligned(), "{length}");
        }
        let samples = (readers + MAX_OBSERVERS) * (OBSERVER_BUFFER.max(2 * depth) + depth + 64) + 1;
        let set_aside = largest_file(folder.prefix());
        assert!(set_aside as usize >= samples * LARGE, "{set_aside}");
        assert!(set_aside as usize <= samples * (2 * LARGE + 64), "{set_aside}");
        drop((publisher, service, node));
        folder.remove().unwrap();
    }
}
