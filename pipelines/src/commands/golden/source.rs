//! The source of a case: `input.mcap`, with a port for every wire to the stage.

use super::routes::Feed;
use gridweave_logs::reader::{self, LogReader};
use gridweave_runtime::message::MessageHeader;
use gridweave_runtime::stage::{AnyMessage, Context, Out, Output, OutputPorts, Outputs, Source, StageError, StageKind};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::{Arc, LazyLock};

/// A stage can be fed by so many wires.
pub(super) const MOST_FEEDS: usize = 256;

/// The names of the ports, which must differ from each other.
static PORT_NAMES: LazyLock<Vec<String>> = LazyLock::new(|| (0..MOST_FEEDS).map(|at| format!("feed{at}")).collect());

/// The kind of a source that sends the messages of the log at `path`. Its ports are the `feeds`, of which there are at
/// most [`MOST_FEEDS`], each with the type of the input of `stage` that it leads to.
pub(super) fn kind(name: &'static str, stage: &StageKind, path: &Path, feeds: Vec<Feed>) -> StageKind {
    let ports = feeds.iter().filter_map(|feed| stage.inputs.get(feed.port)).zip(PORT_NAMES.iter());
    let ports: Vec<_> = ports.map(|(port, name)| (name.as_str(), port.port_type, port.summary)).collect();
    let declare = move |outputs: &mut OutputPorts| {
        let declared = ports.iter().map(|(name, port_type, summary)| outputs.encoded_output(*port_type, name, summary));
        Feeds(declared.collect())
    };
    let (path, feeds): (PathBuf, Arc<[Feed]>) = (path.to_owned(), feeds.into());
    StageKind::source_with(name, "Sends the input of a golden case.", declare, move |(): (), _: &Context| {
        let reader = reader::open(std::slice::from_ref(&path)).map_err(failure)?;
        if let Some(damage) = reader.files().iter().flat_map(|file| file.damage()).next() {
            return Err(failure(damage));
        }
        Ok(CaseSource { reader, feeds: Arc::clone(&feeds), announced: BTreeSet::new() })
    })
}

fn failure(error: impl std::fmt::Display) -> StageError {
    StageError::new("read input.mcap", error)
}

/// An output for each of the feeds.
struct Feeds(Vec<Out<AnyMessage>>);

/// The ports are those of a case; see [`kind`].
impl Outputs for Feeds {
    fn declare(_: &mut OutputPorts) -> Self {
        Self(Vec::new())
    }
}

struct CaseSource {
    reader: LogReader,
    feeds: Arc<[Feed]>,
    /// By feed and number.
    announced: BTreeSet<(usize, u16)>,
}

impl Source for CaseSource {
    type Outputs = Feeds;

    fn next(&mut self, output: &Output<Feeds>) -> Result<bool, StageError> {
        let Some(message) = self.reader.next_message() else {
            return match self.reader.take_damage().first() {
                Some((_, damage)) => Err(failure(damage)),
                None => Ok(false),
            };
        };
        output.set_log_time(message.log_time);
        for (port, (feed, out)) in self.feeds.iter().zip(&output.0).enumerate() {
            let Some(fed) = feed.channels.get(&message.channel) else { continue };
            // 0 stands for messages that no log has described.
            let number = if feed.announces { u32::from(message.channel) + 1 } else { 0 };
            if feed.announces && self.announced.insert((port, message.channel)) {
                out.announce(number, &fed.channel)?;
            }
            let header = MessageHeader {
                log_time: message.log_time,
                publish_time: message.publish_time,
                log_sequence: message.sequence,
                channel: number,
                robot: fed.robot,
                topic: fed.topic,
                ..Default::default()
            };
            out.send_encoded(header, message.data)?;
        }
        Ok(true)
    }
}
