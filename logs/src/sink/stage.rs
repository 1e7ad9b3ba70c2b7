//! The stage around [`OutputLog`].

use super::given_frames::GivenFrames;
use super::output_log::OutputLog;
use super::provenance::{INPUTS_RECORD, InputHashes, RUN_RECORD, run_record};
use super::routing::{ResultTopics, Route, is_tf, result_channel};
use super::{LogOptions, LogWriteError, Outcome, SinkParameters};
use crate::reader::{SupplementKind, read_attachment, read_metadata};
use gridweave_runtime::message::{Channel, FixedText, Message};
use gridweave_runtime::ros::{RosMessage, TFMessage};
use gridweave_runtime::stage::{Context, InputWire, Output, StageError, match_robot};
use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

/// A channel of the log.
struct Lane {
    channel: Arc<Channel>,
    /// The number in the log, set with the first message; or why the log cannot hold its messages.
    id: Option<Result<u16, String>>,
    /// The sequence number of the next result.
    next_sequence: u32,
}

/// The target of the messages of an announced channel.
enum Target {
    Lane(usize),
    /// Transforms, from which those are dropped that place frames of the run.
    Transforms(usize),
    /// Attachments or metadata records of an input log.
    Supplement(SupplementKind),
    /// Dropped: the topic is not selected.
    Unwanted,
    LeaveOut(String),
}

fn closed() -> StageError {
    StageError::new("write the log", "it is closed already")
}

fn failure(error: LogWriteError) -> StageError {
    StageError::new("write the log", error)
}

/// Writes all input messages to a log.
///
/// The output file is locked at once, so that of two runs with one output the later one fails before it has done
/// anything.
pub(super) struct McapSink {
    pass_input: bool,
    /// Empty for all topics.
    only_topics: Vec<String>,
    result_topics: ResultTopics,
    inputs: Vec<InputWire>,
    given_frames: GivenFrames,
    /// `None` after the log has ended or failed.
    log: Option<OutputLog>,
    /// Whether the whole log is left as a part.
    leave_part: bool,
    /// Whether anything was written: a run that fails at the start leaves no log.
    begun: bool,
    /// The pipeline, if it is still to be recorded.
    recorded_pipeline: Option<String>,
    recorded_files: Option<InputHashes>,
    lanes: Vec<Lane>,
    lane_of: HashMap<Arc<Channel>, usize>,
    /// By wire and number, since each source numbers its channels itself.
    announced: BTreeMap<(usize, u32), Target>,
    /// By wire and topic.
    results: BTreeMap<(usize, FixedText<128>), usize>,
}

impl McapSink {
    pub(super) fn new(parameters: SinkParameters, context: &Context) -> Result<Self, StageError> {
        let SinkParameters {
            file,
            pass_input,
            only_topics,
            compression,
            chunk_size,
            recorded_pipeline,
            recorded_files,
            leave_part,
        } = parameters;
        if file.as_os_str().is_empty() {
            let doing = "write the log";
            return Err(StageError::new(doing, "it has no file").with_help("give --output LOG or file = \"LOG\""));
        }
        let log = OutputLog::create(&file, LogOptions { compression, chunk_size }).map_err(failure)?;
        Ok(Self {
            pass_input,
            only_topics,
            result_topics: ResultTopics::new(context),
            inputs: context.inputs.clone(),
            given_frames: GivenFrames::new(context),
            log: Some(log),
            leave_part,
            begun: false,
            recorded_pipeline: Some(recorded_pipeline).filter(|text| !text.is_empty()),
            recorded_files: (!recorded_files.is_empty()).then(|| InputHashes::start(recorded_files)),
            lanes: Vec::new(),
            lane_of: HashMap::new(),
            announced: BTreeMap::new(),
            results: BTreeMap::new(),
        })
    }

    fn is_wanted(&self, topic: &str) -> bool {
        self.only_topics.is_empty()
            || self.only_topics.iter().any(|wanted| wanted == topic || match_robot(wanted, topic).is_some())
    }

    /// The lane of a channel; equal channels share one.
    fn lane(&mut self, channel: Channel) -> usize {
        if let Some(&index) = self.lane_of.get(&channel) {
            return index;
        }
        let channel = Arc::new(channel);
        self.lane_of.insert(Arc::clone(&channel), self.lanes.len());
        self.lanes.push(Lane { channel, id: None, next_sequence: 0 });
        self.lanes.len() - 1
    }

    /// The lane of a result of a stage.
    fn result_lane(&mut self, message: &Message, output: &Output<()>) -> Result<usize, StageError> {
        let key = (message.wire(), message.header().topic);
        if let Some(&lane) = self.results.get(&key) {
            return Ok(lane);
        }
        let topic = message.header().topic;
        let input = self.inputs.get(message.wire()).filter(|input| !input.ros_type.is_empty()).ok_or_else(|| {
            StageError::new(format!("write a message on {topic}"), "its type is unknown")
                .with_help("connect an output with a type, or announce a channel before the message")
        })?;
        let channel = result_channel(topic.as_str(), &input.ros_type, &input.definition);
        if channel.schema.is_empty() {
            output.warn(format!("{} has no definition: other programs cannot read {topic} in the log", input.ros_type));
        }
        let lane = self.lane(channel);
        self.results.insert(key, lane);
        Ok(lane)
    }

    fn write(&mut self, lane: usize, message: &Message, bytes: &[u8], output: &Output<()>) -> Result<(), StageError> {
        self.begin()?;
        let log = self.log.as_mut().ok_or_else(closed)?;
        let lane = &mut self.lanes[lane];
        let id = match &lane.id {
            Some(id) => id,
            None => lane.id.insert(log.channel(&lane.channel).map_err(failure)?),
        };
        let left_out = |why: &str| output.warn(format!("messages on {} were left out: {why}", lane.channel.topic));
        let channel_id = match id {
            Ok(id) => *id,
            Err(why) => {
                left_out(why);
                return Ok(());
            }
        };
        let header = message.header();
        let sequence = match header.channel {
            0 => lane.next_sequence,
            _ => header.log_sequence,
        };
        let (log_time, publish_time) = (header.log_time.0, header.publish_time);
        let record = mcap::records::MessageHeader { channel_id, sequence, log_time, publish_time };
        if let Err(why) = log.write(&record, bytes).map_err(failure)? {
            left_out(&why);
            return Ok(());
        }
        output.count("messages", 1);
        if header.channel == 0 {
            lane.next_sequence = lane.next_sequence.wrapping_add(1);
        }
        Ok(())
    }

    /// Writes the record about the run at the beginning of the log.
    fn begin(&mut self) -> Result<(), StageError> {
        self.begun = true;
        let log = self.log.as_mut().ok_or_else(closed)?;
        match self.recorded_pipeline.take() {
            Some(pipeline) => log.metadata(RUN_RECORD, run_record(&pipeline)).map_err(failure),
            None => Ok(()),
        }
    }

    /// Writes an attachment or metadata record of an input log.
    fn write_supplement(&mut self, kind: SupplementKind, body: &[u8], output: &Output<()>) -> Result<(), StageError> {
        self.begin()?;
        let log = self.log.as_mut().ok_or_else(closed)?;
        match kind {
            SupplementKind::Attachment => match read_attachment(body) {
                Some(attachment) => log.attachment(&attachment).map(|is_written| {
                    if !is_written {
                        output.warn("attachments of the input were left out: a ROS 1 bag has none");
                    }
                }),
                None => Ok(()),
            },
            SupplementKind::Metadata => match read_metadata(body) {
                Some((name, metadata)) => match [RUN_RECORD, INPUTS_RECORD].contains(&name.as_str()) {
                    true => log.metadata(&format!("earlier_{name}"), metadata),
                    false => log.metadata(&name, metadata),
                },
                None => Ok(()),
            },
        }
        .map_err(failure)
    }

    pub(super) fn end(&mut self, outcome: Outcome<'_>) -> Result<(), StageError> {
        if self.log.is_none() {
            return Ok(());
        }
        self.begin()?;
        let Some(mut log) = self.log.take() else { return Ok(()) };
        match (self.recorded_files.take(), outcome) {
            (Some(files), Outcome::Complete) => log.metadata(INPUTS_RECORD, files.record()).map_err(failure)?,
            (Some(files), Outcome::Incomplete(_)) => files.stop(),
            (None, _) => {}
        }
        match outcome {
            Outcome::Complete if self.leave_part => log.leave(),
            _ => log.finish(outcome).map(drop),
        }
        .map_err(failure)
    }
}

impl McapSink {
    pub(super) fn announce(&mut self, wire: usize, number: u32, channel: &Channel) -> Result<(), StageError> {
        let channel = &self.given_frames.announce(channel);
        let target = match self.result_topics.route(channel) {
            _ if let Some(kind) = SupplementKind::of_channel(channel) => Target::Supplement(kind),
            _ if !self.is_wanted(&channel.topic) => Target::Unwanted,
            Route::Write(channel) if is_tf(&channel) => Target::Transforms(self.lane(channel)),
            Route::Write(channel) => Target::Lane(self.lane(channel)),
            Route::LeaveOut(reason) => Target::LeaveOut(reason),
        };
        self.announced.insert((wire, number), target);
        Ok(())
    }

    pub(super) fn receive(&mut self, message: &Message, output: &Output<()>) -> Result<(), StageError> {
        let written = self.take(message, output);
        if written.is_err() {
            // The log has failed; not even the incomplete outcome can be written.
            self.log = None;
        }
        written
    }

    fn take(&mut self, message: &Message, output: &Output<()>) -> Result<(), StageError> {
        let number = message.header().channel;
        let mut rest = None;
        let lane = match number {
            0 if !self.is_wanted(message.header().topic.as_str()) => return Ok(()),
            0 => {
                if self.inputs.get(message.wire()).is_some_and(|input| input.ros_type == TFMessage::NAME) {
                    for conflict in self.given_frames.learn(message.bytes()) {
                        output.warn(conflict.to_string());
                    }
                }
                self.result_lane(message, output)?
            }
            _ if !self.pass_input => return Ok(()),
            _ => match self.announced.get(&(message.wire(), number)) {
                Some(Target::Lane(lane)) => *lane,
                Some(Target::Transforms(lane)) => {
                    if let Some((bytes, left_out)) = self.given_frames.without(message.bytes()) {
                        left_out.into_iter().for_each(|reason| output.warn(reason));
                        if bytes.is_empty() {
                            return Ok(());
                        }
                        rest = Some(bytes);
                    }
                    *lane
                }
                Some(Target::Supplement(kind)) => return self.write_supplement(*kind, message.bytes(), output),
                Some(Target::Unwanted) => return Ok(()),
                Some(Target::LeaveOut(reason)) => {
                    output.warn(reason.as_str());
                    return Ok(());
                }
                None => {
                    let doing = format!("write a message on {}", message.header().topic);
                    return Err(StageError::new(doing, format!("its channel, {number}, was not announced")));
                }
            },
        };
        self.write(lane, message, rest.as_deref().unwrap_or(message.bytes()), output)
    }

    pub(super) fn abort(&mut self, reason: &str) {
        if let Some(files) = self.recorded_files.take() {
            files.stop();
        }
        let Some(mut log) = self.log.take() else { return };
        match self.begun {
            true => match log.finish(Outcome::Incomplete(reason)) {
                Ok(path) => tracing::info!("the partial log is in {}", path.display()),
                Err(error) => tracing::warn!("{error}"),
            },
            false => log.keep(false),
        }
    }
}

impl Drop for McapSink {
    fn drop(&mut self) {
        self.abort("the run was stopped before its end");
    }
}

#[cfg(test)]
mod tests;
