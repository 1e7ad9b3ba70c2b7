//! The stage around the Foxglove server.

use super::servers::Servers;
use super::statistics::Statistics;
use super::viewers::Viewers;
use super::{FoxgloveParameters, front};
use crate::browsers::{BrowserServer, Connection, Request};
use crate::os_error;
use crate::qos::is_transient_local;
use crate::reader::SupplementKind;
use crate::sink::given_frames::GivenFrames;
use crate::sink::result_channel;
use crate::sink::routing::{ResultTopics, Route, is_tf};
use foxglove::{ChannelBuilder, RawChannel, Schema};
use gridweave_runtime::message::{Channel, FixedText, Message};
use gridweave_runtime::stage::{Context, InputWire, Output, StageError};
use std::collections::BTreeMap;
use std::io::{self, ErrorKind};
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// A topic that is shown.
struct Shown {
    channel: Channel,
    raw: Arc<RawChannel>,
    is_latched: bool,
}

/// Sends messages to Foxglove.
pub(super) struct FoxgloveSink {
    /// Where clients connect; `None` after the end.
    front: Option<BrowserServer>,
    servers: Servers,
    /// The served channels, which are closed on drop.
    context: Arc<foxglove::Context>,
    viewers: Viewers,
    statistics: Statistics,
    result_topics: ResultTopics,
    given_frames: GivenFrames,
    inputs: Vec<InputWire>,
    shown: Vec<Shown>,
    /// By wire and number, since each source numbers its channels itself. `None` is not shown.
    announced: BTreeMap<(usize, u32), Option<usize>>,
    /// By wire and topic.
    results: BTreeMap<(usize, FixedText<128>), Option<usize>>,
}

impl FoxgloveSink {
    pub(super) fn new(parameters: FoxgloveParameters, context: &Context) -> Result<Self, StageError> {
        let FoxgloveParameters { host, port, backlog, origins } = parameters;
        let (channels, viewers) = (foxglove::Context::new(), Viewers::default());
        let servers = Servers::new(Arc::clone(&channels), viewers.clone(), backlog);
        let serving = servers.clone();
        let serve = move |client: Connection, request: &Request| serving.serve(client, request);
        let front = front::start(&host, port, origins, serve).map_err(|error| cannot_serve(&host, port, &error))?;
        tracing::info!("serving Foxglove on ws://{host}:{}", front.address().port());
        Ok(Self {
            front: Some(front),
            servers,
            statistics: Statistics::start(context.statistics.clone(), &channels, viewers.clone()),
            context: channels,
            viewers,
            result_topics: ResultTopics::new(context),
            given_frames: GivenFrames::new(context),
            inputs: context.inputs.clone(),
            shown: Vec::new(),
            announced: BTreeMap::new(),
            results: BTreeMap::new(),
        })
    }

    /// The topic of a channel; equal channels share one. `None` if it cannot be shown.
    fn show(&mut self, channel: Channel) -> Option<usize> {
        if let Some(place) = self.shown.iter().position(|shown| shown.channel == channel) {
            return Some(place);
        }
        let schema = Schema::new(channel.schema_name.clone(), channel.schema_encoding.clone(), channel.schema.clone());
        let raw = ChannelBuilder::new(channel.topic.clone())
            .message_encoding(channel.message_encoding.clone())
            .schema(schema)
            .context(&self.context)
            .build_raw();
        let is_latched = is_transient_local(&channel.metadata);
        self.shown.push(Shown { channel, raw: raw.ok()?, is_latched });
        Some(self.shown.len() - 1)
    }

    pub(super) fn announce(&mut self, wire: usize, number: u32, channel: &Channel) -> Result<(), StageError> {
        let shown = match self.result_topics.route(channel) {
            _ if SupplementKind::of_channel(channel).is_some() => None,
            Route::Write(channel) => self.show(channel),
            Route::LeaveOut(_) => None,
        };
        self.announced.insert((wire, number), shown);
        Ok(())
    }

    pub(super) fn receive(&mut self, message: &Message, output: &Output<()>) -> Result<(), StageError> {
        let header = message.header();
        let shown = match header.channel {
            0 => self.result(message),
            number => self.announced.get(&(message.wire(), number)).copied().flatten(),
        };
        if let Some(Shown { channel, raw, is_latched }) = shown.and_then(|place| self.shown.get(place)) {
            let mut bytes = std::borrow::Cow::Borrowed(message.bytes());
            if is_tf(channel) && header.channel == 0 {
                self.given_frames.learn(&bytes);
            } else if is_tf(channel) {
                match self.given_frames.without(&bytes) {
                    Some((rest, _)) if rest.is_empty() => return Ok(()),
                    Some((rest, _)) => bytes = rest.into(),
                    None => {}
                }
            }
            output.count("messages", 1);
            self.viewers.send(raw, *is_latched, header.log_time.0, &bytes);
            self.statistics.log_time.store(header.log_time.0, Ordering::Relaxed);
        }
        Ok(())
    }

    /// The topic of a result of a stage; `None` if it has no type.
    fn result(&mut self, message: &Message) -> Option<usize> {
        let key = (message.wire(), message.header().topic);
        if let Some(&place) = self.results.get(&key) {
            return place;
        }
        let input = self.inputs.get(message.wire()).filter(|input| !input.ros_type.is_empty());
        let topic = message.header().topic;
        let channel = input.map(|input| result_channel(topic.as_str(), &input.ros_type, &input.definition));
        let place = channel.and_then(|channel| self.show(channel));
        self.results.insert(key, place);
        place
    }

    /// Closes all connections.
    pub(super) fn close(&mut self) {
        self.statistics.end();
        self.front = None;
        self.servers.close();
    }
}

impl Drop for FoxgloveSink {
    fn drop(&mut self) {
        self.close();
    }
}

fn cannot_serve(host: &str, port: u16, error: &io::Error) -> StageError {
    let another = "choose another, as in --view=8766 or port = 8766";
    let help = match error.kind() {
        ErrorKind::AddrInUse => Some(format!("another program may have that port: {another}")),
        ErrorKind::AddrNotAvailable => {
            Some("this machine has no such address: choose one that it has, or 0.0.0.0 for all".to_owned())
        }
        ErrorKind::PermissionDenied => Some(format!("not every user may have that port: {another}")),
        // The system has no number for a name that is not found.
        _ if error.raw_os_error().is_none() => {
            Some("the host must be an address of this machine, or a name of it that is known here".to_owned())
        }
        _ => None,
    };
    let error = StageError::new(format!("serve Foxglove on {host}:{port}"), os_error::of_reading(error));
    match help {
        Some(help) => error.with_help(help),
        None => error,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::io::Errno;

    #[test]
    fn the_advice_on_an_address_that_cannot_be_bound_is_for_its_reason() {
        let advice = |error: &io::Error| cannot_serve("192.0.2.1", 80, error).to_string();
        let of_system = |errno: Errno| advice(&io::Error::from_raw_os_error(errno.raw_os_error()));
        for (errno, said) in [
            (Errno::ADDRINUSE, "another program"),
            (Errno::ADDRNOTAVAIL, "no such address"),
            (Errno::ACCESS, "not every user"),
            (Errno::MFILE, "ulimit -n"),
        ] {
            let text = of_system(errno);
            assert!(text.contains(said), "{text}");
            assert_eq!(text.contains("another program"), errno == Errno::ADDRINUSE, "{text}");
        }
        let unknown = advice(&io::Error::other("failed to lookup address information: Name or service not known"));
        assert!(unknown.contains("an address of this machine") && !unknown.contains("another program"), "{unknown}");
    }
}
