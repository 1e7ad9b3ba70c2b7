//! The service of a link, as its sender and its readers open it.

use super::{LinkError, RunNames, SampleHeader};
use crate::link::live::{MAX_OBSERVERS, OBSERVER_BUFFER};
use iceoryx2::node::Node;
use iceoryx2::port::publisher::{Publisher, PublisherCreateError};
use iceoryx2::prelude::{AllocationStrategy, BackpressureStrategy};
use iceoryx2::service::Service;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;

/// For how large a payload, in bytes, room is set aside for each sample before the first is sent.
pub(super) const FIRST_PLACE: usize = 4 * 1024;
/// How many samples a reader may hold beside those that wait for it; what comes on top of that is copied.
pub(super) const HELD_SAMPLES: usize = 64;

/// The service of a link, the same for its sender and its readers.
pub(super) fn link_service<S: Service>(
    node: &Node<S>,
    names: &RunNames,
    stage: &str,
    port: &str,
    readers: usize,
    depth: usize,
) -> Result<PortFactory<S, [u8], SampleHeader>, LinkError> {
    let failed = |cause: &dyn std::fmt::Debug| LinkError::shared(format!("open the link {stage}.{port}"))(cause);
    // Nobody sees a link from outside that does not leave the process.
    let observers = if names.is_shared() { MAX_OBSERVERS } else { 0 };
    // The payload begins where the user header ends, and so is aligned as that is. To ask iceoryx2 for it would set aside
    // eight bytes for each.
    node.service_builder(&names.link(stage, port)?)
        .publish_subscribe::<[u8]>()
        .user_header::<SampleHeader>()
        .enable_safe_overflow(false)
        .history_size(0)
        .subscriber_max_buffer_size(if names.is_shared() { (2 * depth).max(OBSERVER_BUFFER) } else { 2 * depth })
        .subscriber_max_borrowed_samples(depth + HELD_SAMPLES)
        .max_publishers(1)
        .max_subscribers(readers.max(1) + observers)
        .max_nodes(readers + 2 + observers)
        .open_or_create()
        .map_err(|e| failed(&e))
}

/// The publisher of a link. It sets memory aside for each sample that can be in use at a time: as much as the largest
/// payload takes that was sent, rounded up to a power of two.
pub(super) fn link_publisher<S: Service>(
    service: &PortFactory<S, [u8], SampleHeader>,
) -> Result<Publisher<S, [u8], SampleHeader>, PublisherCreateError> {
    service
        .publisher_builder()
        .initial_max_slice_len(FIRST_PLACE)
        .max_loaned_samples(1)
        .allocation_strategy(AllocationStrategy::PowerOfTwo)
        .backpressure_strategy(BackpressureStrategy::DiscardData)
        .create()
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
        let service = link_service(&node, &names, "a", "b", readers, depth).unwrap();
        let publisher = link_publisher(&service).unwrap();
        for length in [1, FIRST_PLACE, FIRST_PLACE + 1, LARGE] {
            let sample = publisher.loan_slice(length).unwrap();
            assert!(sample.payload().as_ptr().cast::<u64>().is_aligned(), "{length}");
        }
        let samples = (readers + MAX_OBSERVERS) * (OBSERVER_BUFFER.max(2 * depth) + depth + HELD_SAMPLES) + 1;
        let set_aside = largest_file(folder.prefix());
        assert!(set_aside as usize >= samples * LARGE, "{set_aside}");
        assert!(set_aside as usize <= samples * (2 * LARGE + 64), "{set_aside}");
        drop((publisher, service, node));
        folder.remove().unwrap();
    }
}
