//! The stage `bridge_source`: receives messages of other machines over a bridge into a live pipeline.

use super::absent_senders::AbsentSenders;
use super::arrivals::{Arrival, Arrivals, ArrivedBatch};
use super::certificates::Certificates;
use super::channel_numbers::ChannelNumbers;
use super::clock::Clock;
use super::connection_errors::take_refusals;
use super::ingest::{Ingest, Item, Taken};
use super::network::{BASE, Network, is_part_of_key};
use super::presence::{Presence, Role, watch};
use super::report;
use super::warning_texts::WarningTexts;
use super::wire::{Link, to_bytes};
use super::zenoh_session::in_words;
use gridweave_logs::schemas::schema_text;
use gridweave_logs::source::live_kind;
use gridweave_runtime::message::{Channel, MessageHeader};
use gridweave_runtime::ros::{MachineStages, RosMessage};
use gridweave_runtime::stage::{
    AnyMessage, Context, Out, Output, OutputPort, OutputPorts, Outputs, ParameterError, Parameters, PortType, Source,
    StageError, StageKind,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;
use zenoh::liveliness::LivelinessToken;
use zenoh::query::{Query, Queryable};
use zenoh::{Session, Wait};

/// The maximum number of arrivals handled at a time.
const BATCHES: usize = 16;

/// The parameters of `bridge_source`.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SourceParameters {
    /// The name of the bridge, the same as that of the `bridge_sink`s at the other ends.
    pub bridge: String,
    /// The name of this end.
    pub receiver: String,
    /// The senders and routers of Zenoh to connect to, as `tcp/HOST:PORT` or `tls/HOST:PORT`. The connection is retried
    /// until it succeeds.
    pub connect: Vec<String>,
    /// The addresses where others may connect, as `tcp/HOST:PORT` or `tls/HOST:PORT`.
    pub listen: Vec<String>,
    /// Let the other ends find this one on the local network, by multicast.
    pub discover: bool,
    /// The authority (PEM) that must have signed the certificates of all ends that connect to `tls/HOST:PORT`. Without
    /// it no certificate is required of them.
    pub authority: Option<PathBuf>,
    /// The certificate (PEM) of this end, for `tls/HOST:PORT`, with the names by which others connect to it.
    pub certificate: Option<PathBuf>,
    /// The private key (PEM) of `certificate`.
    pub key: Option<PathBuf>,
    /// A configuration file of Zenoh (JSON5) that replaces `connect`, `listen`, `discover` and the certificates.
    pub zenoh_config: Option<PathBuf>,
    /// Allow addresses of other machines without encryption, on a trusted network.
    pub insecure: bool,
    /// The clock offset of a sender beyond which its times are corrected, seconds.
    #[schemars(range(min = 0.0, max = 1e9))]
    pub clock_tolerance: f64,
    /// The number of ended senders after which the run ends; by default it never does.
    #[schemars(range(min = 1))]
    pub end_after: Option<usize>,
}

impl Default for SourceParameters {
    fn default() -> Self {
        Self {
            bridge: "base".to_owned(),
            receiver: "base".to_owned(),
            connect: Vec::new(),
            listen: vec![BASE.to_owned()],
            discover: false,
            authority: None,
            certificate: None,
            key: None,
            zenoh_config: None,
            insecure: false,
            clock_tolerance: 1.0,
            end_after: None,
        }
    }
}

impl SourceParameters {
    fn network(&self) -> Network {
        let Self { bridge, connect, listen, discover, zenoh_config, insecure, authority, certificate, key, .. } =
            self.clone();
        let certificates = Certificates { authority, certificate, key };
        Network { bridge, connect, listen, discover, zenoh_config, insecure, certificates }
    }
}

impl Parameters for SourceParameters {
    fn check_together(&self) -> Vec<ParameterError> {
        let mut errors = self.network().check();
        if !is_part_of_key(&self.receiver) {
            errors.push(ParameterError::new("receiver", "must be letters, digits, `_`, `-` and `.`"));
        }
        errors
    }
}

/// The kind `bridge_source`.
pub fn kind() -> StageKind {
    StageKind::source(
        "bridge_source",
        "Receives the messages of `bridge_sink`s on other machines into a live pipeline, over Zenoh: each message once, and those of \
         a sender in order. Reports when a sender connects, ends, or is gone, and what it has dropped",
        BridgeSource::new,
    )
    .live_only()
}

/// The outputs: those of every source of robots' messages, and the reports of the senders.
pub(super) struct Ports(Vec<Port>);

struct Port {
    name: &'static str,
    port_type: PortType,
    out: Out<AnyMessage>,
}

impl Outputs for Ports {
    fn declare(ports: &mut OutputPorts) -> Self {
        let port =
            |port: OutputPort| Port { name: port.name, port_type: port.port_type, out: ports.encoded_port(port) };
        let stages = OutputPort {
            name: report::PORT,
            port_type: PortType::Ros(MachineStages::NAME),
            topic: None,
            side: true,
            summary: "the progress of the stages of the senders' runs; `top` shows it if something reads it, such as a log",
        };
        Self(live_kind().outputs.into_iter().chain([stages]).map(port).collect())
    }
}

impl Ports {
    /// The port of the same name and type, or the one for all other messages.
    fn of(&self, link: &Link) -> Option<(usize, &Port)> {
        let ports = || self.0.iter().enumerate();
        let same = ports().find(|(_, port)| port.name == link.port && port.port_type.name() == link.ros_type);
        same.or_else(|| ports().find(|(_, port)| port.port_type == PortType::Any))
    }
}

/// The receiving end of a bridge.
pub(super) struct BridgeSource {
    ingest: Ingest,
    arrivals: Arc<Arrivals<Query>>,
    key: String,
    clock: Clock,
    /// The connected senders.
    senders: BTreeSet<Presence>,
    /// The senders that have disconnected without an end.
    absent: AbsentSenders,
    /// The sessions of the senders that have ended.
    ended: BTreeSet<u64>,
    end_after: Option<usize>,
    /// The addresses where others connect, as text.
    listen_text: String,
    warnings: WarningTexts,
    channels: ChannelNumbers,
    _token: LivelinessToken,
    _queryable: Queryable<()>,
    _session: Session,
}

impl BridgeSource {
    pub(super) fn new(parameters: SourceParameters, _: &Context) -> Result<Self, StageError> {
        let network = parameters.network();
        let session = network.open()?;
        let number = Presence::number_of(&session);
        let me = Presence { name: parameters.receiver, number };
        let key = me.key(&network.bridge, Role::Receiver);
        let clock = Clock::default();
        let arrivals = Arc::new(Arrivals::default());
        let batches = Arc::clone(&arrivals);
        let take = move |query: Query| batches.add_query(query, clock.nanoseconds());
        let queryable = session.declare_queryable(key.clone()).callback(take).wait();
        let queryable = queryable.map_err(|error| StageError::new("receive over the bridge", in_words(&error)))?;
        let senders = Arc::clone(&arrivals);
        watch(&session, &network.bridge, Role::Sender, move |sender, is_present| {
            senders.add_sender(sender, is_present);
        })?;
        let token = me.declare(&session, &network.bridge, Role::Receiver)?;
        let tolerance = (parameters.clock_tolerance * 1e9) as i64;
        Ok(Self {
            ingest: Ingest::new(number, tolerance),
            arrivals,
            key,
            clock,
            senders: BTreeSet::new(),
            absent: AbsentSenders::default(),
            ended: BTreeSet::new(),
            end_after: parameters.end_after,
            listen_text: network.listen_text(),
            warnings: WarningTexts::default(),
            channels: ChannelNumbers::default(),
            _token: token,
            _queryable: queryable,
            _session: session,
        })
    }

    fn note_sender(&mut self, sender: Presence, is_present: bool, output: &Output<Ports>) {
        let name = sender.name.clone();
        if is_present {
            self.ingest.announce(sender.number);
            self.absent.remove(&sender).into_iter().for_each(|session| self.ingest.forget(session));
            let is_other =
                |other: &Presence| other.name == name && *other != sender && !self.ended.contains(&other.number);
            if self.senders.iter().any(is_other) {
                self.warn(
                    output,
                    &format!("two senders are called `{name}`: give one of them another name by `sender`"),
                );
            }
            tracing::info!("the sender `{name}` is there");
            output.count("times that a sender came", 1);
            self.senders.insert(sender);
            return;
        }
        self.senders.remove(&sender);
        match self.ended.contains(&sender.number) {
            true => self.ingest.forget(sender.number),
            false => {
                self.absent.add(sender).into_iter().for_each(|session| self.ingest.forget(session));
                // Each time is logged, not only the first.
                let text = self.warnings.limited(&format!("the sender `{name}` is gone without having ended"));
                tracing::warn!("{text}");
                output.warn_logged(text);
            }
        }
    }

    /// Warns with a text that may hold what a sender has written. Each text is logged once.
    fn warn(&mut self, output: &Output<Ports>, text: &str) {
        output.warn(self.warnings.limited(text));
    }

    /// Reports refused connections, and batches that were not kept. Both are tried again.
    fn note_refusals(&mut self, output: &Output<Ports>) {
        for reason in take_refusals() {
            output.count("refused connections", 1);
            self.warn(output, &format!("a connection to {} was refused: {reason}", self.listen_text));
        }
        let left_out = self.arrivals.take_left_out();
        if left_out > 0 {
            output.count("batches left out, to be sent again", left_out);
            output.warn("batches were left out, because others of their senders, or too many, were waiting");
        }
    }

    fn take_batch(&mut self, batch: ArrivedBatch<Query>, output: &Output<Ports>) -> Result<(), StageError> {
        let ArrivedBatch { query, bytes, came, .. } = batch;
        let (taken, answer) = self.ingest.take(&bytes);
        let sender = taken.sender.clone();
        self.report_batch(&taken, output);
        for item in taken.items {
            self.send(taken.session, item, output)?;
        }
        if taken.is_end {
            tracing::info!("the sender `{sender}` has ended");
            output.count("senders that have ended", 1);
            self.ended.insert(taken.session);
        }
        // A batch is acknowledged after its messages were forwarded.
        let answer = super::wire::Answer { came, answered: self.clock.nanoseconds(), ..answer };
        let answered = to_bytes(&answer).and_then(|bytes| {
            let replied = query.reply(self.key.as_str(), bytes).wait();
            replied.map_err(|error| in_words(&error))
        });
        if let Err(wrong) = answered {
            self.warn(output, &format!("cannot answer the sender `{sender}`: {wrong}"));
        }
        Ok(())
    }

    /// Warns of a batch that cannot be read, of dropped messages, and of a wrong clock.
    fn report_batch(&mut self, taken: &Taken, output: &Output<Ports>) {
        let sender = &taken.sender;
        if let Some(wrong) = &taken.wrong {
            self.warn(output, &format!("cannot read a batch of the sender `{sender}`: {wrong}"));
        }
        if taken.dropped > 0 {
            self.warn(
                output,
                &format!(
                    "the sender `{sender}` has dropped messages, because its queue was full or later ones superseded them"
                ),
            );
            output.count("messages that senders have dropped", taken.dropped);
        }
        match taken.clock {
            Some(0) => tracing::info!("the clock of the sender `{sender}` is right"),
            Some(offset) => {
                let (seconds, way) = (offset.unsigned_abs() as f64 * 1e-9, if offset < 0 { "ahead" } else { "behind" });
                self.warn(
                    output,
                    &format!("the clock of the sender `{sender}` is {seconds:.0} s {way}: its times are corrected"),
                );
            }
            None => {}
        }
    }

    fn send(&mut self, sender: u64, item: Item, output: &Output<Ports>) -> Result<(), StageError> {
        match item {
            Item::Channel { link, number, channel } => {
                let Some((index, port)) = output.of(&link) else { return Ok(()) };
                match self.channels.describe((index, sender, number, String::new()), &channel) {
                    Some(here) => port.out.announce(here, &channel)?,
                    None => self.warn(output, &format!("a channel on `{}` was left out: {TOO_MANY}", channel.topic)),
                }
                Ok(())
            }
            Item::Message { link, header, bytes } => {
                let Some((index, port)) = output.of(&link) else { return Ok(()) };
                output.set_log_time(header.log_time);
                let topic = header.topic.as_str();
                // Results of stages have no channel.
                let of = if header.channel == 0 { topic } else { "" };
                let key = (index, sender, header.channel, of.to_owned());
                let is_announced = header.channel != 0 || self.channels.has(&key);
                let Some(channel) = self.channels.number(key) else {
                    output.warn(format!("messages were left out: {TOO_MANY}"));
                    return Ok(());
                };
                if !is_announced {
                    port.out.announce(channel, &channel_of(topic, &link.ros_type, ""))?;
                }
                if port.name != report::PORT {
                    output.count("messages taken", 1);
                }
                port.out.send_encoded(MessageHeader { channel, ..header }, &bytes)
            }
        }
    }
}

const TOO_MANY: &str = "the senders have too many channels";

/// The channel of the results of a stage. `definition` is that of their type, if it is not a built-in one.
pub(super) fn channel_of(topic: &str, ros_type: &str, definition: &str) -> Channel {
    let known = || schema_text(ros_type).unwrap_or_default();
    let schema = if definition.is_empty() { known() } else { definition.to_owned() };
    let encoding = if schema.is_empty() { "" } else { "ros2msg" };
    Channel {
        topic: topic.to_owned(),
        message_encoding: "cdr".to_owned(),
        schema_name: ros_type.to_owned(),
        schema_encoding: encoding.to_owned(),
        schema: schema.as_bytes().to_vec(),
        metadata: gridweave_logs::qos::offered(gridweave_logs::qos::is_latched_result(topic, ros_type)),
    }
}

impl Drop for BridgeSource {
    fn drop(&mut self) {
        self.arrivals.close();
    }
}

impl Source for BridgeSource {
    type Outputs = Ports;

    fn wait(&mut self, longest: Duration) {
        self.arrivals.wait(longest);
    }

    fn next(&mut self, output: &Output<Ports>) -> Result<bool, StageError> {
        self.note_refusals(output);
        for _ in 0..BATCHES {
            match self.arrivals.next() {
                Some(Arrival::Sender(sender, is_present)) => self.note_sender(sender, is_present, output),
                Some(Arrival::Batch(batch)) => self.take_batch(batch, output)?,
                None => break,
            }
        }
        Ok(self.end_after.is_none_or(|senders| self.ended.len() < senders))
    }
}
