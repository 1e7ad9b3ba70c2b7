//! The stage `bridge_sink`: sends links of a live run to another machine.

use super::certificates::Certificates;
use super::clock::Clock;
use super::network::{BASE, Network, is_part_of_key};
use super::outbox::{Limits, Totals};
use super::report::Report;
use super::sender::{Sender, SenderSettings};
use super::wire::Link;
use gridweave_runtime::message::{Channel, FixedText, Message};
use gridweave_runtime::ros::{OccupancyGrid, RosMessage, encode};
use gridweave_runtime::stage::bridge_counts;
use gridweave_runtime::stage::{Context, Output, ParameterError, Parameters, StageError, StageKind, frame_of_robot};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use std::time::Duration;

/// The reasons why links cannot be tapped.
const NOT_ALLOWED: &str = "its `bridge_sink` has `allow_tap = false`";
const NOT_TO_BE_SEEN: &str = "the links of its run cannot be observed: that needs the engine `processes`";

/// The parameters of `bridge_sink`.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SinkParameters {
    /// The name of the bridge, the same as that of the `bridge_source` at the other end.
    pub bridge: String,
    /// The name of this end; the default is the name of the machine.
    pub sender: Option<String>,
    /// The robot as which messages about no particular robot are sent, for example by a base that sends its merged map
    /// to another base. Their topics and map frames get its name.
    pub robot: Option<String>,
    /// The receivers and routers of Zenoh to connect to, as `tcp/HOST:PORT` or `tls/HOST:PORT`. The connection is
    /// retried until it succeeds.
    pub connect: Vec<String>,
    /// The addresses where others may connect, as `tcp/HOST:PORT` or `tls/HOST:PORT`.
    pub listen: Vec<String>,
    /// Search for the other end on the local network, by multicast.
    pub discover: bool,
    /// The authority (PEM) that must have signed the certificate of the other end, for `tls/HOST:PORT`; the default is
    /// the public authorities of browsers.
    pub authority: Option<PathBuf>,
    /// The certificate (PEM) of this end, for receivers that require one.
    pub certificate: Option<PathBuf>,
    /// The private key (PEM) of `certificate`.
    pub key: Option<PathBuf>,
    /// A configuration file of Zenoh (JSON5) that replaces `connect`, `listen`, `discover` and the certificates.
    pub zenoh_config: Option<PathBuf>,
    /// Allow addresses of other machines without encryption, on a trusted network.
    pub insecure: bool,
    /// The maximum number of pending messages of a topic; beyond it the oldest is dropped.
    #[schemars(range(min = 1))]
    pub keep_last: usize,
    /// The maximum number of pending messages of a topic with states, such as maps; beyond it all of them are replaced
    /// by the next.
    #[schemars(range(min = 1))]
    pub keep_maps: usize,
    /// The minimum time from one batch of messages to the next, seconds.
    #[schemars(range(min = 0.0, max = 60.0))]
    pub interval: f64,
    /// The period at which the progress of the stages is reported to the other end, for its `top`, seconds; 0 for
    /// never.
    #[schemars(range(min = 0.0, max = 3600.0))]
    pub report_stages: f64,
    /// Allow the other end to tap the links of this run, including those that are not sent, with `tap` on the base.
    pub allow_tap: bool,
    /// The maximum time that the end of the run waits for the other end to acknowledge the last messages, seconds.
    #[schemars(range(min = 0.0, max = 86400.0))]
    pub linger: f64,
}

impl Default for SinkParameters {
    fn default() -> Self {
        Self {
            bridge: "base".to_owned(),
            sender: None,
            robot: None,
            connect: vec![BASE.to_owned()],
            listen: Vec::new(),
            discover: false,
            authority: None,
            certificate: None,
            key: None,
            zenoh_config: None,
            insecure: false,
            keep_last: 6000,
            keep_maps: 100,
            interval: 0.05,
            report_stages: 2.0,
            allow_tap: true,
            linger: 30.0,
        }
    }
}

impl SinkParameters {
    fn network(&self) -> Network {
        let Self { bridge, connect, listen, discover, zenoh_config, insecure, authority, certificate, key, .. } =
            self.clone();
        let certificates = Certificates { authority, certificate, key };
        Network { bridge, connect, listen, discover, zenoh_config, insecure, certificates }
    }

    fn settings(&self, clock: Clock, context: &Context) -> SenderSettings {
        let seconds = |seconds: f64| Duration::try_from_secs_f64(seconds).unwrap_or_default();
        SenderSettings {
            network: self.network(),
            name: self.sender.clone().unwrap_or_else(machine),
            limits: Limits { messages: self.keep_last, states: self.keep_maps },
            interval: seconds(self.interval),
            clock,
            links: match self.allow_tap {
                false => Err(NOT_ALLOWED),
                true => context.links.clone().ok_or(NOT_TO_BE_SEEN),
            },
        }
    }
}

/// The name of this machine, with characters replaced that are not allowed in the name of a sender.
fn machine() -> String {
    let name = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    let name = name.trim().replace(|c: char| !is_part_of_key(&c.to_string()), "_");
    if name.is_empty() { "sender".to_owned() } else { name }
}

impl Parameters for SinkParameters {
    fn check_together(&self) -> Vec<ParameterError> {
        let mut errors = self.network().check();
        if self.sender.as_ref().is_some_and(|sender| !is_part_of_key(sender)) {
            errors.push(ParameterError::new("sender", "must be letters, digits, `_`, `-` and `.`"));
        }
        if self.robot.as_ref().is_some_and(|robot| robot.is_empty() || robot.contains('/') || robot.len() > 60) {
            errors.push(ParameterError::new(
                "robot",
                "must be the name of a robot, without a slash and at most 60 bytes",
            ));
        }
        errors
    }
}

/// The kind `bridge_sink`.
pub fn kind() -> StageKind {
    kind_with(Clock::default())
}

/// The same on a machine with the given clock.
pub(super) fn kind_with(clock: Clock) -> StageKind {
    StageKind::stage(
        "bridge_sink",
        "Sends its inputs to the `bridge_source` of a run on another machine, over Zenoh: each message once and in order, even over \
         a bad connection. Of a map only the difference is sent. While the connection is broken messages are queued; those beyond \
         the limits are dropped and counted",
        move |parameters, context| BridgeSink::new(parameters, context, clock),
    )
    .any_inputs("in", "what to send: outputs of any stage", BridgeSink::receive)
    .announce(BridgeSink::announce)
    .finish(BridgeSink::finish)
    .build()
}

/// Sends its inputs over the bridge.
pub(super) struct BridgeSink {
    sender: Sender,
    links: Vec<Link>,
    robot: Option<String>,
    linger: Duration,
    /// The totals that were counted already.
    counted: Totals,
}

impl BridgeSink {
    pub(super) fn new(parameters: SinkParameters, context: &Context, clock: Clock) -> Result<Self, StageError> {
        let link = |wire: &gridweave_runtime::stage::InputWire| Link {
            port: wire.output.to_owned(),
            ros_type: wire.ros_type.clone(),
        };
        let links: Vec<Link> = context.inputs.iter().map(link).collect();
        let settings = parameters.settings(clock, context);
        let interval =
            Duration::try_from_secs_f64(parameters.report_stages).ok().filter(|interval| !interval.is_zero());
        let reported = context.statistics.clone().zip(interval);
        let report = reported.map(|(statistics, interval)| Report::new(&settings.name, statistics, interval));
        Ok(Self {
            sender: Sender::start(settings, links.clone(), report)?,
            links,
            robot: parameters.robot,
            linger: Duration::try_from_secs_f64(parameters.linger).unwrap_or_default(),
            counted: Totals::default(),
        })
    }

    pub(super) fn announce(&mut self, wire: usize, number: u32, channel: &Channel) -> Result<(), StageError> {
        let bytes = channel.encode();
        let bytes = bytes.map_err(|error| StageError::new(format!("announce the channel {}", channel.topic), error))?;
        self.sender.announce(wire, number, bytes);
        Ok(())
    }

    pub(super) fn receive(&mut self, message: &Message, output: &Output<()>) -> Result<(), StageError> {
        match &self.robot {
            Some(robot) if message.robot().is_empty() && message.header().channel == 0 => {
                let (header, bytes) = self.as_robot(robot, message)?;
                self.sender.push(message.wire(), &header, bytes.as_deref().unwrap_or(message.bytes()))?;
            }
            _ => self.sender.push(message.wire(), message.header(), message.bytes())?,
        }
        self.report_counts(output);
        Ok(())
    }

    /// Changes a message about no robot to one about the given robot; returns its bytes if they have changed.
    fn as_robot(
        &self,
        robot: &str,
        message: &Message,
    ) -> Result<(gridweave_runtime::message::MessageHeader, Option<Vec<u8>>), StageError> {
        let failed = |cause: &dyn std::fmt::Display| StageError::new(format!("send a message as of `{robot}`"), cause);
        let mut header = *message.header();
        header.robot = FixedText::new(robot).map_err(|error| failed(&error))?;
        let topic = header.topic;
        header.topic = FixedText::new(&format!("/{robot}{}", topic.as_str())).map_err(|error| failed(&error))?;
        let is_grid = self.links.get(message.wire()).is_some_and(|link| link.ros_type == OccupancyGrid::NAME);
        let bytes = match message.decode::<OccupancyGrid<'_>>() {
            Ok(mut grid) if is_grid => {
                grid.header.frame_id = frame_of_robot(robot, &grid.header.frame_id).into_owned();
                Some(encode(&grid).map_err(|error| failed(&error))?)
            }
            _ => None,
        };
        Ok((header, bytes))
    }

    pub(super) fn finish(&mut self, output: &Output<()>) -> Result<(), StageError> {
        let unacknowledged = self.sender.end(self.linger);
        self.report_counts(output);
        if let Some(messages) = unacknowledged {
            let seconds = self.linger.as_secs_f64();
            let text = format!("the other end of the bridge has not acknowledged the end within {seconds} s");
            tracing::warn!("{text}; {messages} messages were not acknowledged");
            output.warn_logged(text);
            output.count(bridge_counts::UNACKNOWLEDGED, messages as u64);
        }
        Ok(())
    }

    /// Counts the changes of the totals since the last call, and forwards notices.
    fn report_counts(&mut self, output: &Output<()>) {
        let now = self.sender.totals();
        let before = std::mem::replace(&mut self.counted, now);
        for (what, more) in [
            ("messages taken by the other end", now.sent - before.sent),
            ("batches", now.batches - before.batches),
            (bridge_counts::BYTES_SENT, now.bytes - before.bytes),
            ("bytes of the messages in them", now.message_bytes - before.message_bytes),
            (bridge_counts::DROPPED, now.dropped - before.dropped),
            (bridge_counts::SUPERSEDED, now.superseded - before.superseded),
        ] {
            if more > 0 {
                output.count(what, more);
            }
        }
        if now.dropped > before.dropped {
            output.warn("messages were dropped because the bridge does not keep up");
        }
        if now.superseded > before.superseded {
            output.warn("only the last of the pending maps were sent, as the receiver was restarted");
        }
        self.sender.take_notices().into_iter().for_each(|notice| output.warn_logged(notice));
    }
}
