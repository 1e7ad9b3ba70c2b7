//! The links of the run that a stage is part of, for a stage that shows elsewhere what passes on them.

use super::StageError;
use crate::message::Message;
use std::fmt;
use std::sync::Arc;

/// A link of a run: an output of a stage that others read.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RunLink {
    /// The stage that the output belongs to.
    pub stage: String,
    /// The name of the output.
    pub output: String,
    /// The ROS 2 type of its messages; empty for any.
    pub ros_type: String,
    /// The definition of that type, a text of the form `ros2msg`; empty if the stage brings none, as those of all types that
    /// Gridweave knows do not.
    pub definition: String,
}

/// A link that is looked on at. It changes nothing in the run: where it is not asked often enough, it misses messages.
pub trait LinkView {
    /// Takes what has passed since the last call: the messages, and the announcements of their channels.
    ///
    /// # Errors
    /// The link cannot be read.
    fn take(&mut self, take: &mut dyn FnMut(Message)) -> Result<(), StageError>;

    /// How many messages it has missed.
    fn missed(&self) -> u64;
}

type Open = dyn Fn(usize) -> Result<Option<Box<dyn LinkView>>, StageError> + Send + Sync;

/// The links of a run, and a way to look on at each. What passes changes with the clock: nothing that a stage makes of its input
/// may rest on it.
#[derive(Clone)]
pub struct RunLinks {
    links: Arc<[RunLink]>,
    open: Arc<Open>,
}

impl RunLinks {
    /// These links. `open` looks on at one of them, by its index.
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

    /// Looks on at one of them, by its index in [`all`](Self::all). A live link sends the last message of each topic again for it.
    /// None if its stage has not made it yet.
    ///
    /// # Errors
    /// The run has gone, or too many look on.
    pub fn open(&self, link: usize) -> Result<Option<Box<dyn LinkView>>, StageError> {
        (self.open)(link)
    }
}

impl fmt::Debug for RunLinks {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RunLinks").field("links", &self.links).finish_non_exhaustive()
    }
}
