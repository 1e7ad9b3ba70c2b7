//! What the stages on other machines do, as far as the run that is looked at is told of it, over a bridge.

use super::link_choice::all_links;
use super::running::Running;
use crate::terminal::say;
use anyhow::Result;
use gridweave_runtime::engine::WatchedLink;
use gridweave_runtime::message::MessageFlags;
use gridweave_runtime::ros::{MachineStages, RosMessage};
use gridweave_runtime::stage::PortType;
use std::collections::BTreeMap;
use std::time::{Duration, SystemTime};

/// A machine that was not heard of for so many times as long as it takes to tell something is silent.
const SILENT_AFTER: f64 = 3.0;

/// The machines that a run is told of.
pub(super) struct OtherMachines {
    links: Vec<WatchedLink>,
    /// What each has told last, and when, since the Unix epoch.
    told: BTreeMap<String, (MachineStages, Duration)>,
}

/// What a machine has told last.
pub(super) struct Machine<'a> {
    pub(super) told: &'a MachineStages,
    /// For so long it was not heard of, where that is longer than it should be.
    pub(super) silent: Option<Duration>,
}

impl OtherMachines {
    /// Looks on at the links of a run by which it is told of other machines. Where that cannot be, as the stage does not start, it
    /// says so: what the stages of the run itself do is to be seen all the same.
    pub(super) fn watch(running: &Running) -> Self {
        let pipeline = &running.pipeline;
        let is_told_by = |link: &super::link_choice::Link| {
            pipeline.stages[link.stage].kind.outputs[link.port].port_type == PortType::Ros(MachineStages::NAME)
        };
        let links = all_links(pipeline).into_iter().filter(is_told_by);
        let open = |link: super::link_choice::Link| {
            let opened = WatchedLink::open(&running.run, pipeline, link.stage, link.port);
            opened.map_err(|error| say(format_args!("what other machines do is not shown: {error}"))).ok()
        };
        Self { links: links.filter_map(open).collect(), told: BTreeMap::new() }
    }

    /// Takes what was told since the last call.
    ///
    /// # Errors
    /// The link cannot be read.
    pub(super) fn update(&mut self) -> Result<()> {
        for link in &mut self.links {
            link.take(|_, message| {
                let is_data = message.header().flags.contains(MessageFlags::DATA);
                // What another version tells otherwise is left out.
                if let Some(told) = message.decode::<MachineStages>().ok().filter(|_| is_data) {
                    let at = Duration::from_nanos(message.header().publish_time);
                    self.told.insert(told.machine.clone(), (told, at));
                }
            })?;
        }
        Ok(())
    }

    /// The machines by name.
    pub(super) fn machines(&self) -> impl Iterator<Item = Machine<'_>> {
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        self.told.values().map(move |(told, at)| Machine { told, silent: silence(told.interval, *at, now) })
    }
}

/// For how long a machine was not heard of that tells something every `interval` seconds, if that is too long.
fn silence(interval: f64, at: Duration, now: Duration) -> Option<Duration> {
    let since = now.saturating_sub(at);
    (since.as_secs_f64() > SILENT_AFTER * interval.max(1.0)).then_some(since)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_machine_is_silent_that_has_not_told_anything_for_three_times_as_long_as_it_should() {
        let at = |seconds: u64| Duration::from_secs(1_700_000_000 + seconds);
        assert_eq!(silence(2.0, at(0), at(6)), None);
        assert_eq!(silence(2.0, at(0), at(7)), Some(Duration::from_secs(7)));
        // Its clock is a little ahead, and it tells more often than anybody looks.
        assert_eq!((silence(2.0, at(1), at(0)), silence(0.1, at(0), at(3))), (None, None));
    }
}
