//! Running a stage by itself: what it sends is kept in lists.

use super::{Output, OutputSink, Sent, StageError, StageKind};
use crate::message::{LogTime, Message, MessageHeader, Write, write_vec};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::rc::Rc;

/// The outputs of a stage that runs by itself, for tests and benches of stages.
pub struct CollectedOutputs {
    ports: Vec<Sent>,
    lists: Vec<Rc<RefCell<Vec<Message>>>>,
    warnings: BTreeMap<String, u64>,
}

struct List(Rc<RefCell<Vec<Message>>>);

impl OutputSink for List {
    fn send(&mut self, header: MessageHeader, bytes: &[u8]) -> Result<(), StageError> {
        self.0.borrow_mut().push(Message::from_vec(header, bytes.to_vec()));
        Ok(())
    }

    fn send_in_place(&mut self, header: MessageHeader, write: &mut Write<'_>) -> Result<(), StageError> {
        let bytes = write_vec(Vec::new(), header.length as usize, write)?;
        self.0.borrow_mut().push(Message::from_vec(header, bytes));
        Ok(())
    }
}

impl CollectedOutputs {
    /// The outputs of a stage of `kind`, empty.
    pub fn new(kind: &StageKind) -> Self {
        let lists: Vec<Rc<RefCell<Vec<Message>>>> = kind.outputs.iter().map(|_| Rc::default()).collect();
        let ports = kind
            .outputs
            .iter()
            .zip(&lists)
            .map(|(port, list)| {
                let template = format!("/{{robot}}/{}/{}", kind.name, port.name);
                Sent::new(port.name, port.topic.map_or(template, str::to_owned), Some(Box::new(List(Rc::clone(list)))))
            })
            .collect();
        Self { ports, lists, warnings: BTreeMap::new() }
    }

    /// What to hand to the stage with a message of `log_time`.
    pub fn output(&mut self, log_time: LogTime) -> Output<'_> {
        Output::new(&mut self.ports, log_time, &mut self.warnings)
    }

    /// Takes what was sent on a port since the last call. A port that does not exist has nothing.
    pub fn take(&mut self, port: usize) -> Vec<Message> {
        self.lists.get(port).map(|list| list.take()).unwrap_or_default()
    }

    /// What was warned of, and how often.
    pub fn warnings(&self) -> &BTreeMap<String, u64> {
        &self.warnings
    }
}
