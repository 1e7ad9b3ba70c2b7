//! The source of a program without inputs.

use super::header::{Reply, Request};
use super::stage::{Ports, ProgramStage, take};
use crate::message::{LogTime, MessageHeader};
use crate::stage::{Output, Source, StageError};

/// A source whose messages a running program produces.
pub(super) struct ProgramSource {
    stage: ProgramStage,
    /// The log time of the last message.
    reached: LogTime,
    has_ended: bool,
}

impl ProgramSource {
    pub(super) fn new(stage: ProgramStage) -> Self {
        Self { stage, reached: LogTime(0), has_ended: false }
    }
}

impl Source for ProgramSource {
    type Outputs = Ports;

    fn next(&mut self, output: &Output<Ports>) -> Result<bool, StageError> {
        if self.has_ended {
            return Ok(false);
        }
        let (reached, has_ended) = (&mut self.reached, &mut self.has_ended);
        let nothing = (&MessageHeader::default(), &[][..]);
        let called = self.stage.program.call(Request::Next, (0, 0), nothing, |reply, header, bytes| {
            match reply {
                Reply::End => *has_ended = true,
                Reply::Output if header.message.log_time < *reached => {
                    let cause = format!(
                        "its log time, {} ns, is before that of the previous message, {} ns",
                        header.message.log_time.0, reached.0
                    );
                    return Err(StageError::new("send a message of a source", cause));
                }
                Reply::Output => {
                    *reached = header.message.log_time;
                    output.set_log_time(*reached);
                }
                _ => {}
            }
            take(output, reply, header, bytes)
        });
        called.map_err(|error| self.stage.failed(error, |what| format!("get the next messages of {what}")))?;
        Ok(!self.has_ended)
    }

    fn abort(&mut self, reason: &str) {
        self.stage.abort(reason);
    }
}
