//! The progress of a run's stages, for viewers.

use super::viewers::Viewers;
use foxglove::{ChannelBuilder, Schema};
use gridweave_runtime::stage::RunStatistics;
use serde_json::json;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

/// The topic, with JSON messages of the schema below.
const TOPIC: &str = "/gridweave/stages";
const SCHEMA_NAME: &str = "gridweave.Stages";
const SCHEMA: &str = include_str!("stages.schema.json");
/// The interval of the messages.
const INTERVAL: Duration = Duration::from_secs(1);

/// Publishes the progress of the stages once a second, from the first shown message on, with its log time: viewers show
/// messages of one time together, and progress has no log time.
pub(super) struct Statistics {
    /// The log time of the latest shown message; 0 before the first.
    pub(super) log_time: Arc<AtomicU64>,
    /// The thread, and the sender whose drop stops it.
    thread: Option<(Sender<()>, JoinHandle<()>)>,
}

impl Statistics {
    /// Starts publishing; does nothing if the engine has no statistics, or a thread cannot be started.
    pub(super) fn start(run: Option<RunStatistics>, context: &Arc<foxglove::Context>, viewers: Viewers) -> Self {
        let log_time = Arc::new(AtomicU64::new(0));
        let schema = Schema::new(SCHEMA_NAME, "jsonschema", SCHEMA.as_bytes());
        let raw = ChannelBuilder::new(TOPIC).message_encoding("json").schema(schema).context(context).build_raw().ok();
        let thread = run.zip(raw).and_then(|(run, raw)| {
            let (stop, stopped) = channel();
            let seen = Arc::clone(&log_time);
            let publish = move || {
                while let Err(RecvTimeoutError::Timeout) = stopped.recv_timeout(INTERVAL) {
                    let log_time = seen.load(Ordering::Relaxed);
                    if log_time != 0 {
                        let message = json!({ "stages": run.now() }).to_string();
                        viewers.send(&raw, true, log_time, message.as_bytes());
                    }
                }
            };
            Some((stop, std::thread::Builder::new().spawn(publish).ok()?))
        });
        Self { log_time, thread }
    }

    /// Stops publishing.
    pub(super) fn end(&mut self) {
        if let Some((stop, thread)) = self.thread.take() {
            drop(stop);
            // The thread does not panic; if it did, the run would be unaffected.
            drop(thread.join());
        }
    }
}
