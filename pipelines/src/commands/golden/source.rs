//! The source of a case: `input.mcap`, with a port for every wire to the stage.

use super::routes::InputStream;
use gridweave_logs::reader::{self, LogReader};
use gridweave_runtime::message::MessageHeader;
use gridweave_runtime::stage::{AnyMessage, Context, Out, Output, OutputPorts, Outputs, Source, StageError, StageKind};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::{Arc, LazyLock};

/// Maximum number of input streams of a stage.
pub(super) const MAX_STREAMS: usize = 256;

/// Names of the ports, which must be unique.
static PORT_NAMES: LazyLock<Vec<String>> = LazyLock::new(|| (0..MAX_STREAMS).map(|at| format!("stream{at}")).collect());

/// Makes the kind of a source that sends the messages of the log at `path`. It has a port for each of the `streams`, at
/// most [`MAX_STREAMS`], with the type of the input of `stage` that it is connected to.
pub(super) fn kind(name: &'static str, stage: &StageKind, path: &Path, streams: Vec<InputStream>) -> StageKind {
    let ports = streams.iter().filter_map(|stream| stage.inputs.get(stream.port)).zip(PORT_NAMES.iter());
    let ports: Vec<_> = ports.map(|(port, name)| (name.as_str(), port.port_type, port.summary)).collect();
    let declare = move |outputs: &mut OutputPorts| {
        let declared = ports.iter().map(|(name, port_type, summary)| outputs.encoded_output(*port_type, name, summary));
        StreamOutputs(declared.collect())
    };
    let (path, streams): (PathBuf, Arc<[InputStream]>) = (path.to_owned(), streams.into());
    StageKind::source_with(name, "Sends the input of a golden case.", declare, move |(): (), _: &Context| {
        let reader = reader::open(std::slice::from_ref(&path)).map_err(failure)?;
        if let Some(damage) = reader.files().iter().flat_map(|file| file.damage()).next() {
            return Err(failure(damage));
        }
        Ok(CaseSource { reader, streams: Arc::clone(&streams), announced: BTreeSet::new() })
    })
}

fn failure(error: impl std::fmt::Display) -> StageError {
    StageError::new("read input.mcap", error)
}

/// An output for each input stream. [`kind`] declares the ports.
struct StreamOutputs(Vec<Out<AnyMessage>>);

impl Outputs for StreamOutputs {
    fn declare(_: &mut OutputPorts) -> Self {
        Self(Vec::new())
    }
}

struct CaseSource {
    reader: LogReader,
    streams: Arc<[InputStream]>,
    /// Announced channels by stream and number.
    announced: BTreeSet<(usize, u16)>,
}

impl Source for CaseSource {
    type Outputs = StreamOutputs;

    fn next(&mut self, output: &Output<StreamOutputs>) -> Result<bool, StageError> {
        let Some(message) = self.reader.next_message() else {
            return match self.reader.take_damage().first() {
                Some((_, damage)) => Err(failure(damage)),
                None => Ok(false),
            };
        };
        output.set_log_time(message.log_time);
        for (port, (stream, out)) in self.streams.iter().zip(&output.0).enumerate() {
            let Some(routed) = stream.channels.get(&message.channel) else { continue };
            // 0 marks messages without an announced channel.
            let number = if stream.announces { u32::from(message.channel) + 1 } else { 0 };
            if stream.announces && self.announced.insert((port, message.channel)) {
                out.announce(number, &routed.channel)?;
            }
            let header = MessageHeader {
                log_time: message.log_time,
                publish_time: message.publish_time,
                log_sequence: message.sequence,
                channel: number,
                robot: routed.robot,
                topic: routed.topic,
                ..Default::default()
            };
            out.send_encoded(header, message.data)?;
        }
        Ok(true)
    }
}
