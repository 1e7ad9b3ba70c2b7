//! What the stages of the run do, for those who look on.

use super::kept::KeptMessages;
use foxglove::{ChannelBuilder, Schema};
use gridweave_runtime::stage::RunStatistics;
use serde_json::json;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

/// The topic: JSON, of the schema below.
const TOPIC: &str = "/gridweave/stages";
const SCHEMA_NAME: &str = "gridweave.Stages";
const SCHEMA: &str = include_str!("stages.schema.json");
/// So often it is told.
const INTERVAL: Duration = Duration::from_secs(1);

/// Tells once a second what the stages have done so far, from the first message that was shown on and at its log time: viewers
/// show what belongs to one time, and these are no times of the run.
pub(super) struct Statistics {
    /// The log time of the last message that was shown; 0 before the first.
    pub(super) log_time: Arc<AtomicU64>,
    /// The thread, and what ends it by going.
    thread: Option<(Sender<()>, JoinHandle<()>)>,
}

impl Statistics {
    /// Begins to tell; nothing where the engine has nothing to tell of.
    pub(super) fn start(run: Option<RunStatistics>, context: &Arc<foxglove::Context>, kept: KeptMessages) -> Self {
        let log_time = Arc::new(AtomicU64::new(0));
        let schema = Schema::new(SCHEMA_NAME, "jsonschema", SCHEMA.as_bytes());
        let raw = ChannelBuilder::new(TOPIC).message_encoding("json").schema(schema).context(context).build_raw().ok();
        let thread = run.zip(raw).map(|(run, raw)| {
            let (stop, stopped) = channel();
            let seen = Arc::clone(&log_time);
            let tell = move || {
                while let Err(RecvTimeoutError::Timeout) = stopped.recv_timeout(INTERVAL) {
                    let log_time = seen.load(Ordering::Relaxed);
                    if log_time != 0 {
                        let message = json!({ "stages": run.now() }).to_string();
                        kept.send(&raw, true, log_time, message.as_bytes());
                    }
                }
            };
            (stop, std::thread::spawn(tell))
        });
        Self { log_time, thread }
    }

    /// Tells no more.
    pub(super) fn end(&mut self) {
        if let Some((stop, thread)) = self.thread.take() {
            drop(stop);
            // It panics at nothing; and if it did, the run would be none the worse.
            drop(thread.join());
        }
    }
}
