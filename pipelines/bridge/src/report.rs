//! Reports of the stages' progress to the other end of a bridge.

use super::network::is_part_of_key;
use super::wire::Link;
use gridweave_runtime::message::{FixedText, LogTime, MessageHeader};
use gridweave_runtime::ros::{Header, MachineStages, RosMessage, StageProgress, encode};
use gridweave_runtime::stage::{RunStatistics, StageStatistics};
use std::time::{Duration, Instant};

/// The output of a receiver for the reports.
pub(super) const PORT: &str = "stages";

/// Periodic reports of the progress of a run's stages.
#[derive(Debug)]
pub(super) struct Report {
    machine: String,
    statistics: RunStatistics,
    interval: Duration,
    /// The time and the statistics of the previous report.
    before: Option<(Instant, Vec<StageStatistics>)>,
}

impl Report {
    /// Reports of `statistics` every `interval`, on behalf of the machine.
    pub(super) fn new(machine: &str, statistics: RunStatistics, interval: Duration) -> Self {
        Self { machine: machine.to_owned(), statistics, interval, before: None }
    }

    /// The link of the reports.
    pub(super) fn link() -> Link {
        Link { port: PORT.to_owned(), ros_type: MachineStages::NAME.to_owned() }
    }

    /// The next report, if it is due; `clock` is the time in nanoseconds since the Unix epoch.
    ///
    /// # Errors
    /// The message cannot be encoded.
    pub(super) fn take(
        &mut self,
        now: Instant,
        log_time: LogTime,
        clock: u64,
    ) -> Result<Option<(MessageHeader, Vec<u8>)>, String> {
        let since = self.before.as_ref().map(|(at, _)| now.saturating_duration_since(*at));
        if since.is_some_and(|since| since < self.interval) {
            return Ok(None);
        }
        let stages = self.statistics.now();
        let seconds = since.unwrap_or_default().as_secs_f64();
        let before = self.before.as_ref().map(|(_, stages)| stages.as_slice()).unwrap_or_default();
        let progress = stages.iter().enumerate().map(|(index, stage)| progress(stage, before.get(index), seconds));
        let message = MachineStages {
            header: Header::new(log_time, ""),
            machine: self.machine.clone(),
            interval: self.interval.as_secs_f64(),
            stages: progress.collect(),
        };
        self.before = Some((now, stages));
        let topic = self.machine.replace(|c: char| !is_part_of_key(&c.to_string()) || "-.".contains(c), "_");
        let topic = FixedText::new(&format!("/{topic}/stages")).map_err(|error| error.to_string())?;
        let header = MessageHeader { log_time, publish_time: clock, topic, ..Default::default() };
        Ok(Some((header, encode(&message).map_err(|error| error.to_string())?)))
    }
}

/// The progress of a stage, with rates since `before`, `seconds` seconds ago.
fn progress(stage: &StageStatistics, before: Option<&StageStatistics>, seconds: f64) -> StageProgress {
    let rate = |now: f64, before: Option<f64>| match before {
        Some(before) if seconds > 0.0 => (now - before).max(0.0) / seconds,
        _ => 0.0,
    };
    let StageStatistics { name, state, messages_in, messages_out, busy_ms, dropped, restarts, warnings } =
        stage.clone();
    StageProgress {
        name,
        state: state.to_owned(),
        messages_in,
        messages_out,
        in_per_s: rate(messages_in as f64, before.map(|before| before.messages_in as f64)),
        out_per_s: rate(messages_out as f64, before.map(|before| before.messages_out as f64)),
        busy: rate(busy_ms * 1e-3, before.map(|before| before.busy_ms * 1e-3)).min(1.0),
        dropped,
        restarts,
        warnings,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_runtime::ros::decode;
    use std::sync::atomic::{AtomicU64, Ordering};

    #[test]
    fn a_report_is_due_every_interval_and_has_the_rates_since_the_previous_one() {
        static MESSAGES: AtomicU64 = AtomicU64::new(100);
        let now = || {
            let messages_in = MESSAGES.load(Ordering::Relaxed);
            let busy_ms = messages_in as f64 * 10.0;
            vec![StageStatistics { name: "lines".into(), state: "running", messages_in, busy_ms, ..Default::default() }]
        };
        let mut report = Report::new("robot-1.local", RunStatistics::new(now), Duration::from_secs(2));
        let start = Instant::now();
        let mut take = |seconds: f64| report.take(start + Duration::from_secs_f64(seconds), LogTime(5), 9).unwrap();
        let (header, bytes) = take(0.0).unwrap();
        assert_eq!(
            (header.topic.as_str(), header.robot.as_str(), header.log_time),
            ("/robot_1_local/stages", "", LogTime(5))
        );
        assert_eq!(header.publish_time, 9);
        let first = decode::<MachineStages>(&bytes).unwrap();
        assert_eq!((first.machine.as_str(), first.interval), ("robot-1.local", 2.0));
        assert_eq!((first.stages[0].messages_in, first.stages[0].in_per_s, first.stages[0].busy), (100, 0.0, 0.0));
        // Decoding by the definition gives the same.
        let text = gridweave_logs::schemas::schema_text(MachineStages::NAME).unwrap();
        let schema = gridweave_logs::dynamic::Schema::parse(MachineStages::NAME, &text).unwrap();
        let read = schema.decode(&bytes).unwrap().to_json(gridweave_logs::dynamic::JsonOptions::default());
        assert_eq!(read, serde_json::to_value(&first).unwrap());
        assert!(take(1.9).is_none());
        MESSAGES.store(200, Ordering::Relaxed);
        let later = decode::<MachineStages>(&take(4.0).unwrap().1).unwrap();
        let stage = &later.stages[0];
        assert_eq!((stage.messages_in, stage.in_per_s, stage.busy, stage.state.as_str()), (200, 25.0, 0.25, "running"));
    }
}
