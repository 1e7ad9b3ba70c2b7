//! Statistics of stages on other machines, which a bridge sends to the run.

use super::link_choice::all_links;
use super::running::Running;
use crate::terminal::eprint_line;
use anyhow::Result;
use gridweave_runtime::engine::WatchedLink;
use gridweave_runtime::message::MessageFlags;
use gridweave_runtime::ros::{MachineStages, RosMessage};
use gridweave_runtime::stage::PortType;
use std::collections::BTreeMap;
use std::time::{Duration, SystemTime};

/// A machine is silent after so many of its reporting intervals without a report.
const SILENT_AFTER: f64 = 3.0;

/// Machines that report to a run.
pub(super) struct OtherMachines {
    links: Vec<WatchedLink>,
    /// The last report of each machine, and when it was sent, since the Unix epoch.
    reports: BTreeMap<String, (MachineStages, Duration)>,
}

/// The last report of a machine.
pub(super) struct Machine<'a> {
    pub(super) report: &'a MachineStages,
    /// Time since the last report, if it is too long.
    pub(super) silent: Option<Duration>,
}

impl OtherMachines {
    /// Watches the links of a run that carry reports of other machines. A link that cannot be watched is reported and
    /// left out, so that the stages of the run itself can still be shown.
    pub(super) fn watch(running: &Running) -> Self {
        let pipeline = &running.pipeline;
        let has_reports = |link: &super::link_choice::Link| {
            pipeline.stages[link.stage].kind.outputs[link.port].port_type == PortType::Ros(MachineStages::NAME)
        };
        let links = all_links(pipeline).into_iter().filter(has_reports);
        let open = |link: super::link_choice::Link| {
            let opened = WatchedLink::open(&running.run, pipeline, link.stage, link.port);
            opened
                .map_err(|error| eprint_line(format_args!("warning: stages of other machines are not shown: {error}")))
                .ok()
        };
        Self { links: links.filter_map(open).collect(), reports: BTreeMap::new() }
    }

    /// Takes the reports since the last call.
    ///
    /// # Errors
    /// The link cannot be read.
    pub(super) fn update(&mut self) -> Result<()> {
        for link in &mut self.links {
            link.take(|_, message| {
                let is_data = message.header().flags.contains(MessageFlags::DATA);
                // A report of another version that cannot be decoded is left out.
                if let Some(report) = message.decode::<MachineStages>().ok().filter(|_| is_data) {
                    let at = Duration::from_nanos(message.header().publish_time);
                    self.reports.insert(report.machine.clone(), (report, at));
                }
            })?;
        }
        Ok(())
    }

    /// Iterates over the machines by name.
    pub(super) fn machines(&self) -> impl Iterator<Item = Machine<'_>> {
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        self.reports.values().map(move |(report, at)| Machine { report, silent: silence(report.interval, *at, now) })
    }
}

/// Time since the last report of a machine that reports every `interval` seconds, if it is too long.
fn silence(interval: f64, at: Duration, now: Duration) -> Option<Duration> {
    let since = now.saturating_sub(at);
    (since.as_secs_f64() > SILENT_AFTER * interval.max(1.0)).then_some(since)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_machine_is_silent_after_three_intervals_without_a_report() {
        let at = |seconds: u64| Duration::from_secs(1_700_000_000 + seconds);
        assert_eq!(silence(2.0, at(0), at(6)), None);
        assert_eq!(silence(2.0, at(0), at(7)), Some(Duration::from_secs(7)));
        // A clock that is ahead, and reports that are more frequent than the display.
        assert_eq!((silence(2.0, at(1), at(0)), silence(0.1, at(0), at(3))), (None, None));
    }
}
