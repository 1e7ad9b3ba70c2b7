//! The iceoryx2 service of a link, and its sizes.

use super::counters::MAX_SENDERS;
use super::stage_counters::StageCounters;
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

/// The maximum number of observers of a link.
pub(crate) const MAX_OBSERVERS: usize = 4;
/// The buffer of an observer, samples.
pub(super) const OBSERVER_BUFFER: usize = 64;
/// The buffer of the owner of a live link, which retains the last messages, samples.
pub(super) const HISTORY_BUFFER: usize = 128;
/// The maximum number of samples that the owner of a live link borrows.
pub(super) const HISTORY_BORROWED: usize = 22;
/// The maximum number of topics in the history. Further topics are not repeated, with a warning. Every reader needs
/// buffer space for the whole history, and that is memory reserved for the largest message of the link.
pub(super) const MAX_TOPICS: usize = 40;
/// The initial capacity of each sample, bytes of payload.
pub(super) const INITIAL_CAPACITY: usize = 4 * 1024;
/// The buffer of a reader of a live link beyond its depth: for the repeated history and end, for itself and for another
/// late joiner at the same time.
const REPEAT_BUFFER: usize = 2 * (MAX_TOPICS + 1);
/// The maximum number of attempts to open a link: on a busy machine, ends that open it concurrently may find it neither
/// existing nor free to be created.
const ATTEMPTS: usize = 100;
const BETWEEN_ATTEMPTS: Duration = Duration::from_millis(10);
/// Borrowed samples reserved for the sample that is being received.
const SPARE: usize = 2;

/// The properties on which all ends of a link must agree.
#[derive(Clone, Debug)]
pub struct LinkShape<'a> {
    /// The stage that owns the link.
    pub stage: &'a str,
    /// Its output port.
    pub port: &'a str,
    /// The number of readers.
    pub readers: usize,
    /// The largest depth of the readers.
    pub depth: usize,
    /// The order in which the readers take their inputs.
    pub order: Order,
    /// What happens to a message for which there is no credit.
    pub overflow: Overflow,
}

/// An output port in the shared counters.
#[derive(Clone)]
pub struct PortCounters {
    /// The counters of its stage.
    pub counters: StageCounters,
    /// The index of the port within the stage.
    pub port: usize,
}

impl LinkShape<'_> {
    /// The name of the link, `STAGE.PORT`.
    pub fn name(&self) -> String {
        format!("{}.{}", self.stage, self.port)
    }

    /// The buffer of a reader of the given depth, samples per sender.
    pub(super) fn buffer(&self, depth: usize) -> usize {
        match (self.order, self.overflow) {
            // Twice the depth, as a reader may have to grant more credit so that its stage is not stuck.
            (Order::LogTime, _) => 2 * depth,
            (Order::Arrival, Overflow::Wait) => depth + REPEAT_BUFFER,
            (Order::Arrival, Overflow::DropOldest) => depth,
        }
    }

    /// The maximum number of samples that a reader of the given depth borrows; further ones are copied.
    pub(super) fn max_borrowed(&self, depth: usize) -> usize {
        match self.order {
            Order::LogTime => depth + 64 - SPARE,
            Order::Arrival => HISTORY_BORROWED,
        }
    }

    pub(super) fn open<S: Service>(
        &self,
        node: &Node<S>,
        names: &RunNames,
    ) -> Result<PortFactory<S, [u8], SampleHeader>, LinkError> {
        let failed = |cause: &dyn std::fmt::Debug| LinkError::shared(format!("open the link {}", self.name()))(cause);
        let _creation = names.begin_creation(|| format!("open the link {}", self.name()))?;
        // A link that does not leave the process cannot be observed.
        let (observers, mut buffer) = match names.is_shared() {
            true => (MAX_OBSERVERS, self.buffer(self.depth).max(OBSERVER_BUFFER)),
            false => (0, self.buffer(self.depth)),
        };
        let (senders, histories) = match self.order {
            Order::LogTime => (1, 0),
            Order::Arrival => (MAX_SENDERS, 1),
        };
        buffer = buffer.max(histories * HISTORY_BUFFER);
        let subscribers = self.readers.max(1) + observers + histories;
        let name = names.link(self.stage, self.port)?;
        // The payload follows the user header, and so has its alignment. Requesting the alignment from iceoryx2 would
        // cost eight bytes per sample.
        let open = || {
            node.service_builder(&name)
                .publish_subscribe::<[u8]>()
                .user_header::<SampleHeader>()
                .enable_safe_overflow(self.overflow == Overflow::DropOldest)
                .history_size(0)
                .subscriber_max_buffer_size(buffer)
                .subscriber_max_borrowed_samples(self.max_borrowed(self.depth) + SPARE)
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

    /// Creates a publisher of the link. It reserves memory for every sample that can be in use at a time: the size of
    /// the largest payload so far, rounded up to a power of two.
    pub(super) fn publisher<S: Service>(
        &self,
        service: &PortFactory<S, [u8], SampleHeader>,
    ) -> Result<Publisher<S, [u8], SampleHeader>, LinkError> {
        service
            .publisher_builder()
            .initial_max_slice_len(INITIAL_CAPACITY)
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

/// The origin of a sender: a number made from the id of its publisher, never 0.
pub(super) fn origin(publisher: u128) -> u64 {
    ((publisher >> 64) as u64 ^ publisher as u64).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::RunFolder;
    use iceoryx2::service::ipc;

    const LARGE: usize = 1 << 20;

    /// The size of the largest file of the run in shared memory, bytes.
    fn largest_file(prefix: &str) -> u64 {
        let files = std::fs::read_dir("/dev/shm").unwrap().map(|file| file.unwrap());
        let of_run = files.filter(|file| file.file_name().to_string_lossy().starts_with(prefix));
        // A file of another link may disappear meanwhile.
        of_run.filter_map(|file| file.metadata().ok()).map(|file| file.len()).max().unwrap()
    }

    #[test]
    fn at_most_twice_the_payload_is_reserved_per_sample_in_use_and_payloads_are_aligned() {
        let folder = RunFolder::create().unwrap();
        let names = folder.names();
        let (readers, depth) = (1, 2);
        let node = names.node::<ipc::Service>().unwrap();
        let (order, overflow) = (Order::LogTime, Overflow::Wait);
        let shape = LinkShape { stage: "a", port: "b", readers, depth, order, overflow };
        let service = shape.open(&node, &names).unwrap();
        let publisher = shape.publisher(&service).unwrap();
        for length in [1, INITIAL_CAPACITY, INITIAL_CAPACITY + 1, LARGE] {
            let sample = publisher.loan_slice(length).unwrap();
            assert!(sample.payload().as_ptr().cast::<u64>().is_aligned(), "{length}");
        }
        let samples = (readers + MAX_OBSERVERS) * (OBSERVER_BUFFER.max(2 * depth) + depth + 64) + 1;
        let reserved = largest_file(folder.prefix());
        assert!(reserved as usize >= samples * LARGE, "{reserved}");
        assert!(reserved as usize <= samples * (2 * LARGE + 64), "{reserved}");
        drop((publisher, service, node));
        folder.remove().unwrap();
    }
}
