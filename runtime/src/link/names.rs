//! The names of a run's services.

use super::LinkError;
use super::heap::{HeapLink, HeapPayloads};
use super::room::Room;
use iceoryx2::node::{Node, NodeBuilder};
use iceoryx2::prelude::{Config, FileName, Path, SemanticString, ServiceName, SignalHandlingMode};
use iceoryx2::service::Service;
use std::fs::{self, Permissions};
use std::io;
use std::os::unix::fs::PermissionsExt;
use std::sync::atomic::{AtomicU64, Ordering};

/// What keeps the services of one run apart from those of all others.
#[derive(Clone, Debug)]
pub struct RunNames {
    prefix: String,
    reach: Reach,
}

/// Who can see the services of a run.
#[derive(Clone, Debug)]
enum Reach {
    /// The threads of this process, which hand large payloads over on the heap.
    Process(HeapPayloads),
    /// All processes of this machine that know the folder of its files.
    Machine { root: String },
}

impl RunNames {
    /// Names that no other run of this process has: for services that do not leave it.
    pub fn unique() -> Self {
        static COUNTER: AtomicU64 = AtomicU64::new(0);
        let number = COUNTER.fetch_add(1, Ordering::Relaxed);
        Self { prefix: format!("gw{}_{number}_", std::process::id()), reach: Reach::Process(HeapPayloads::default()) }
    }

    /// Names with the given prefix (letters, digits and `_`), whose files lie in the folder `root`: for a run of several
    /// processes, which must all be told the same.
    pub fn shared(prefix: impl Into<String>, root: impl Into<String>) -> Self {
        Self { prefix: prefix.into(), reach: Reach::Machine { root: root.into() } }
    }

    /// Whether other processes can see the services.
    pub(crate) fn is_shared(&self) -> bool {
        matches!(self.reach, Reach::Machine { .. })
    }

    /// Where the large payloads of the link `name` travel; none if that is in its samples.
    pub(super) fn heap_link(&self, name: &str) -> Option<HeapLink> {
        match &self.reach {
            Reach::Process(payloads) => Some(payloads.link(name)),
            Reach::Machine { .. } => None,
        }
    }

    /// The iceoryx2 node of one thread or process of the run.
    pub fn node<S: Service>(&self) -> Result<Node<S>, LinkError> {
        let doing = || LinkError::shared(format!("open shared memory for the run {}", self.prefix));
        if self.is_shared() {
            Room::default().ask(0, || format!("open shared memory for the run {}", self.prefix))?;
        }
        let mut config = Config::default();
        config.global.prefix = FileName::new(self.prefix.as_bytes()).map_err(|e| doing()(&e))?;
        // The prefix is this run's own: there are no nodes of others to look for.
        config.global.node.cleanup_dead_nodes_on_creation = false;
        config.global.node.cleanup_dead_nodes_on_destruction = false;
        if let Reach::Machine { root } = &self.reach {
            let root = Path::new(root.as_bytes()).map_err(|e| doing()(&e))?;
            config.global.set_root_path(&root);
        }
        let node = NodeBuilder::new()
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .config(&config)
            .create::<S>()
            .map_err(|e| doing()(&e))?;
        if self.is_shared() {
            self.close_to_others().map_err(|e| doing()(&e))?;
        }
        Ok(node)
    }

    /// Takes from other users the right to the segment in which iceoryx2 numbers the nodes, which it gives to everybody.
    fn close_to_others(&self) -> io::Result<()> {
        for entry in fs::read_dir("/dev/shm")?.flatten() {
            let name = entry.file_name();
            let name = name.to_string_lossy();
            if name.starts_with(&self.prefix) && name.ends_with(".global_mgmt") {
                fs::set_permissions(entry.path(), Permissions::from_mode(0o600))?;
            }
        }
        Ok(())
    }

    /// The service of an output port.
    pub(crate) fn link(&self, stage: &str, port: &str) -> Result<ServiceName, LinkError> {
        self.service(&format!("link/{stage}/{port}"))
    }

    /// A service between a stage and its program, `to` or `from` that.
    pub(crate) fn call(&self, way: &str) -> Result<ServiceName, LinkError> {
        self.service(&format!("call/{way}"))
    }

    fn service(&self, name: &str) -> Result<ServiceName, LinkError> {
        let name = format!("{}/{name}", self.prefix);
        ServiceName::new(&name).map_err(|e| LinkError::shared(format!("name the service {name}"))(&e))
    }
}
