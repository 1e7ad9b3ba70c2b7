//! The identity of a node of Gridweave: its name, and an enclave by which the nodes of all runs recognise each other.
//!
//! No run may take its own topics, or those of another run, for those of a robot. So these nodes are in the enclave
//! `/gridweave/RUN`, on both middlewares. ROS needs enclaves for SROS alone, and accepts any name for one.

use crate::liveliness::Entity;
use gridweave_runtime::stage::Context;
use std::fs;

/// The enclave of the nodes of all runs.
const ENCLAVE: &str = "/gridweave/";
/// Where the time at which a process was started is in its `stat`, after its name (proc(5)).
const START_TIME: usize = 19;

/// The name and the enclave of a node.
#[derive(Clone, Debug)]
pub(crate) struct NodeIdentity {
    pub(crate) node: String,
    pub(crate) enclave: String,
}

impl NodeIdentity {
    /// The name of the node of a stage, if none is given `gridweave_` and the name of the stage.
    pub(crate) fn of_stage(context: &Context, given: Option<&String>) -> Self {
        // The engine `processes` has the links, and starts the process of this stage.
        let of_run = if context.links.is_some() { std::os::unix::process::parent_id() } else { std::process::id() };
        Self::new(&context.stage, given, of_run)
    }

    /// The name of the node of a program with no stages.
    pub(crate) fn of_program(name: &str, given: Option<&String>) -> Self {
        Self::new(name, given, std::process::id())
    }

    fn new(stage: &str, given: Option<&String>, run: u32) -> Self {
        let usable = stage.replace(|c: char| !c.is_ascii_alphanumeric(), "_");
        let node = given.cloned().unwrap_or_else(|| format!("gridweave_{usable}"));
        // In containers processes of two runs may have one number.
        Self { node, enclave: format!("{ENCLAVE}run_{run}_{}", start_time(run).unwrap_or_default()) }
    }

    /// The same node in the enclave of robots.
    #[must_use]
    pub(crate) fn into_robot(self) -> Self {
        Self { enclave: "/".to_owned(), ..self }
    }

    /// The owner of an entity.
    pub(crate) fn owner(&self, entity: &Entity) -> Owner {
        match is_of_gridweave(&entity.enclave) {
            true if entity.enclave == self.enclave => Owner::ThisRun,
            true => Owner::OtherRun,
            false => Owner::Other,
        }
    }
}

/// Whether nodes in an enclave are those of a run of Gridweave.
pub(crate) fn is_of_gridweave(enclave: &str) -> bool {
    enclave.starts_with(ENCLAVE)
}

/// The owner of an entity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Owner {
    /// That of this run of Gridweave.
    ThisRun,
    /// That of another run of Gridweave.
    OtherRun,
    /// That of a robot, a viewer, or whatever else there is.
    Other,
}

fn start_time(process: u32) -> Option<String> {
    let stat = fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    stat.rsplit_once(')')?.1.split_whitespace().nth(START_TIME).map(str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::liveliness::Kind;

    fn entity(enclave: &str) -> Entity {
        Entity {
            domain: 0,
            session: "a".into(),
            node_number: 0,
            number: 0,
            enclave: enclave.into(),
            namespace: "/".into(),
            node: "gridweave_ros".into(),
            kind: Kind::Node,
        }
    }

    #[test]
    fn nodes_of_one_run_recognise_each_other_and_those_of_other_runs() {
        let [source, sink] = ["robots", "ros"].map(|name| NodeIdentity::of_program(name, None));
        assert_eq!((source.node.as_str(), source.enclave.split('_').count()), ("gridweave_robots", 3));
        assert!(!source.enclave.ends_with('_'), "{}", source.enclave);
        assert_eq!(source.owner(&entity(&sink.enclave)), Owner::ThisRun);
        assert_eq!(source.owner(&entity(&NodeIdentity::new("ros", None, 1).enclave)), Owner::OtherRun);
        assert_eq!(source.owner(&entity(&sink.into_robot().enclave)), Owner::Other);
        assert_eq!(source.owner(&entity("")), Owner::Other);
    }
}
