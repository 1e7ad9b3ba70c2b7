//! The stage `bridge_tap`: observes a link of a run on another machine.

use super::super::certificates::Certificates;
use super::super::network::{BASE, Network, is_part_of_key};
use super::super::source::channel_of;
use super::super::wire::Form;
use super::client::{Client, TapEvent, TapSettings};
use super::requests::{Passed, TapLink};
use gridweave_runtime::message::{Channel, MessageHeader};
use gridweave_runtime::stage::{
    AnyMessage, Context, Out, Output, OutputPorts, Outputs, ParameterError, Parameters, Source, StageError, StageKind,
    bridge_counts,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::ops::Deref;
use std::path::PathBuf;
use std::sync::mpsc::{RecvTimeoutError, TryRecvError};
use std::time::Duration;

/// The parameters of `bridge_tap`.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct TapParameters {
    /// The name of the bridge.
    pub(super) bridge: String,
    /// The name of the machine: the `sender` of its `bridge_sink`, by default its host name.
    pub(super) sender: String,
    /// The link of its run: STAGE.PORT, or STAGE if it has only one output.
    pub(super) link: String,
    /// The addresses that the senders connect to, where a `bridge_source` or a router of Zenoh listens, as
    /// `tcp/HOST:PORT` or `tls/HOST:PORT`.
    pub(super) connect: Vec<String>,
    /// The authority (PEM) that must have signed the certificate of the listening end, for `tls/HOST:PORT`; the default
    /// is the public authorities of browsers.
    pub(super) authority: Option<PathBuf>,
    /// The certificate (PEM) of this end, if one is required.
    pub(super) certificate: Option<PathBuf>,
    /// The private key (PEM) of `certificate`.
    pub(super) key: Option<PathBuf>,
    /// A configuration file of Zenoh (JSON5) that replaces `connect` and the certificates.
    pub(super) zenoh_config: Option<PathBuf>,
    /// Allow addresses of other machines without encryption, on a trusted network.
    pub(super) insecure: bool,
    /// The time to wait for the machine, seconds; unlimited by default.
    #[schemars(range(min = 0.0, max = 86400.0))]
    pub(super) wait: Option<f64>,
}

impl Default for TapParameters {
    fn default() -> Self {
        Self {
            bridge: "base".to_owned(),
            sender: String::new(),
            link: String::new(),
            connect: vec![BASE.to_owned()],
            authority: None,
            certificate: None,
            key: None,
            zenoh_config: None,
            insecure: false,
            wait: None,
        }
    }
}

impl TapParameters {
    fn network(&self) -> Network {
        let Self { bridge, connect, zenoh_config, insecure, authority, certificate, key, .. } = self.clone();
        let certificates = Certificates { authority, certificate, key };
        Network { bridge, connect, listen: Vec::new(), discover: false, zenoh_config, insecure, certificates }
    }
}

impl Parameters for TapParameters {
    fn check_together(&self) -> Vec<ParameterError> {
        let mut errors = self.network().check();
        if !is_part_of_key(&self.sender) {
            errors.push(ParameterError::new("sender", "must be given: letters, digits, `_`, `-` and `.`"));
        }
        if self.link.is_empty() {
            errors.push(ParameterError::new("link", "must be given, as STAGE.PORT"));
        }
        errors
    }
}

/// The kind `bridge_tap`.
pub(in super::super) fn kind() -> StageKind {
    StageKind::source(
        "bridge_tap",
        "Observes a link of a run on another machine, even if the `bridge_sink` there does not send it; as the command `tap` does. It \
         never affects that run; if it is too slow, messages are missed and counted",
        BridgeTap::new,
    )
    .live_only()
}

/// The output.
pub(super) struct Ports(Out<AnyMessage>);

impl Outputs for Ports {
    fn declare(ports: &mut OutputPorts) -> Self {
        Self(ports.any_output("messages", "the messages of the link, with their original topics"))
    }
}

/// Observes a link.
struct BridgeTap {
    client: Client,
    /// The received event that was not handled yet.
    waiting: Option<TapEvent>,
    link: TapLink,
    /// The local numbers of channels, by their number at the sender and topic.
    channels: BTreeMap<(u32, String), u32>,
}

impl BridgeTap {
    fn new(parameters: TapParameters, _: &Context) -> Result<Self, StageError> {
        let settings = TapSettings {
            network: parameters.network(),
            sender: parameters.sender,
            link: parameters.link,
            wait: parameters.wait.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok()),
        };
        let (link, channels) = (TapLink::default(), BTreeMap::new());
        Ok(Self { client: Client::start(settings)?, waiting: None, link, channels })
    }

    fn send(&mut self, passed: Passed, output: &Output<Ports>) -> Result<(), StageError> {
        let Passed { sequence, entry } = passed;
        let unreadable = |cause: String| StageError::new("read a message of another machine", cause);
        if entry.form == Form::Channel {
            let channel = Channel::decode(&entry.bytes).map_err(|error| unreadable(error.to_string()))?;
            return output.announce(self.number(entry.channel, "").0, &channel);
        }
        let header = entry.header().map_err(unreadable)?;
        output.set_log_time(header.log_time);
        // Results of stages have no channel.
        let topic = if entry.channel == 0 { entry.topic.as_str() } else { "" };
        let (channel, is_new) = self.number(entry.channel, topic);
        if is_new && entry.channel == 0 {
            output.announce(channel, &channel_of(topic, &self.link.ros_type, &self.link.definition))?;
        }
        output.count("messages taken", 1);
        output.send_encoded(MessageHeader { sequence, channel, ..header }, &entry.bytes)
    }

    /// The local number of a channel, and whether it is new.
    fn number(&mut self, number: u32, topic: &str) -> (u32, bool) {
        let next = u32::try_from(self.channels.len()).unwrap_or(u32::MAX - 1) + 1;
        let here = *self.channels.entry((number, topic.to_owned())).or_insert(next);
        (here, here == next)
    }
}

impl Deref for Ports {
    type Target = Out<AnyMessage>;

    fn deref(&self) -> &Out<AnyMessage> {
        &self.0
    }
}

impl Source for BridgeTap {
    type Outputs = Ports;

    fn wait(&mut self, longest: Duration) {
        if self.waiting.is_none() {
            self.waiting = match self.client.events.recv_timeout(longest) {
                Ok(event) => Some(event),
                Err(RecvTimeoutError::Timeout) => None,
                Err(RecvTimeoutError::Disconnected) => Some(TapEvent::Ended),
            };
        }
    }

    fn next(&mut self, output: &Output<Ports>) -> Result<bool, StageError> {
        let event = self.waiting.take().map_or_else(|| self.client.events.try_recv(), Ok);
        match event {
            Ok(TapEvent::Found(link)) => self.link = link,
            Ok(TapEvent::Passed(passed)) => passed.into_iter().try_for_each(|passed| self.send(passed, output))?,
            Ok(TapEvent::Missed(messages)) => {
                output.count(bridge_counts::MISSED, messages);
                output.warn("messages were missed, because the tap was too slow");
            }
            Ok(TapEvent::Notice(text)) => {
                tracing::warn!("{text}");
                output.warn(text);
            }
            Ok(TapEvent::Failed(error)) => return Err(error),
            Err(TryRecvError::Empty) => {}
            Ok(TapEvent::Ended) | Err(TryRecvError::Disconnected) => return Ok(false),
        }
        Ok(true)
    }
}
