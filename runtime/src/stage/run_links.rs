//! The links of a run, for a stage that forwards their messages.

use super::StageError;
use crate::message::Message;
use std::fmt;
use std::sync::Arc;

/// A link of a run: an output of a stage that has readers.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RunLink {
    /// The stage that the output belongs to.
    pub stage: String,
    /// The name of the output.
    pub output: String,
    /// The ROS 2 type of its messages; empty for any.
    pub ros_type: String,
    /// The definition of that type in the format `ros2msg`; empty for types that Gridweave knows.
    pub definition: String,
}

/// An observed link. Observing never affects the run: if [`take`](Self::take) is not called often enough, messages are
/// missed.
pub trait LinkView {
    /// Takes the messages since the last call, and the announcements of their channels.
    ///
    /// # Errors
    /// The link cannot be read.
    fn take(&mut self, take: &mut dyn FnMut(Message)) -> Result<(), StageError>;

    /// The number of messages that were missed.
    fn missed(&self) -> u64;
}

type Open = dyn Fn(usize) -> Result<Option<Box<dyn LinkView>>, StageError> + Send + Sync;

/// The links of a run, each of which can be observed. The observed messages depend on timing: the outputs of a stage
/// must not depend on them.
#[derive(Clone)]
pub struct RunLinks {
    links: Arc<[RunLink]>,
    open: Arc<Open>,
}

impl RunLinks {
    /// The given links. `open` starts to observe one of them, by its index.
    pub fn new(
        links: impl IntoIterator<Item = RunLink>,
        open: impl Fn(usize) -> Result<Option<Box<dyn LinkView>>, StageError> + Send + Sync + 'static,
    ) -> Self {
        Self { links: links.into_iter().collect(), open: Arc::new(open) }
    }

    /// All of them, in the order of the pipeline.
    pub fn all(&self) -> &[RunLink] {
        &self.links
    }

    /// Starts to observe a link, by its index in [`all`](Self::all). A live link repeats the last message of each topic
    /// for it. None if its stage has not created it yet.
    ///
    /// # Errors
    /// The run has ended, or the link has the maximum number of observers.
    pub fn open(&self, link: usize) -> Result<Option<Box<dyn LinkView>>, StageError> {
        (self.open)(link)
    }
}

impl fmt::Debug for RunLinks {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RunLinks").field("links", &self.links).finish_non_exhaustive()
    }
}
