//! The names of the services of a run.

use super::LinkError;
use super::heap::{HeapLink, HeapPayloads};
use super::shared_memory::begin_creation;
use iceoryx2::node::{Node, NodeBuilder};
use iceoryx2::prelude::{Config, FileName, Path, SemanticString, ServiceName, SignalHandlingMode};
use iceoryx2::service::Service;
use std::fs::{self, Permissions};
use std::io;
use std::os::unix::fs::PermissionsExt;
use std::sync::MutexGuard;
use std::sync::atomic::{AtomicU64, Ordering};

/// The name prefix and the scope of the services of one run.
#[derive(Clone, Debug)]
pub struct RunNames {
    prefix: String,
    scope: Scope,
}

/// The visibility of the services of a run.
#[derive(Clone, Debug)]
enum Scope {
    /// The threads of this process, which pass large payloads on the heap.
    Process(HeapPayloads),
    /// All processes of this machine that know the folder of the run.
    Machine { root: String },
}

impl RunNames {
    /// Names that are unique within this process: for services that do not leave it.
    pub fn unique() -> Self {
        static COUNTER: AtomicU64 = AtomicU64::new(0);
        let number = COUNTER.fetch_add(1, Ordering::Relaxed);
        Self { prefix: format!("gw{}_{number}_", std::process::id()), scope: Scope::Process(HeapPayloads::default()) }
    }

    /// Names with the given prefix (letters, digits and `_`) and the folder `root` for their files: for a run of
    /// several processes, all of which must use the same.
    pub fn shared(prefix: impl Into<String>, root: impl Into<String>) -> Self {
        Self { prefix: prefix.into(), scope: Scope::Machine { root: root.into() } }
    }

    /// Whether other processes can see the services.
    pub(crate) fn is_shared(&self) -> bool {
        matches!(self.scope, Scope::Machine { .. })
    }

    /// The heap payloads of the link `name`; none if payloads are part of the samples.
    pub(super) fn heap_link(&self, name: &str) -> Option<HeapLink> {
        match &self.scope {
            Scope::Process(payloads) => Some(payloads.link(name)),
            Scope::Machine { .. } => None,
        }
    }

    /// Begins to create something of iceoryx2, where that is in the shared memory of the machine; `doing` describes the
    /// purpose. The creation ends with the guard.
    pub(super) fn begin_creation(
        &self,
        doing: impl FnOnce() -> String,
    ) -> Result<Option<MutexGuard<'static, ()>>, LinkError> {
        self.is_shared().then(|| begin_creation(doing)).transpose()
    }

    /// Creates the iceoryx2 node of a thread or process of the run.
    pub fn node<S: Service>(&self) -> Result<Node<S>, LinkError> {
        let doing = || LinkError::shared(format!("open shared memory for the run {}", self.prefix));
        let _creation = self.begin_creation(|| format!("open shared memory for the run {}", self.prefix))?;
        let mut config = Config::default();
        config.global.prefix = FileName::new(self.prefix.as_bytes()).map_err(|e| doing()(&e))?;
        // The prefix is unique to this run: there are no nodes of other runs to clean up.
        config.global.node.cleanup_dead_nodes_on_creation = false;
        config.global.node.cleanup_dead_nodes_on_destruction = false;
        if let Scope::Machine { root } = &self.scope {
            let root = Path::new(root.as_bytes()).map_err(|e| doing()(&e))?;
            config.global.set_root_path(&root);
        }
        let node = NodeBuilder::new()
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .config(&config)
            .create::<S>()
            .map_err(|e| doing()(&e))?;
        if self.is_shared() {
            self.restrict_permissions().map_err(|e| doing()(&e))?;
        }
        Ok(node)
    }

    /// Removes the permissions of other users for iceoryx2's node management segment, which iceoryx2 creates for
    /// everybody.
    fn restrict_permissions(&self) -> io::Result<()> {
        for entry in fs::read_dir("/dev/shm")?.flatten() {
            let name = entry.file_name();
            let name = name.to_string_lossy();
            if name.starts_with(&self.prefix) && name.ends_with(".global_mgmt") {
                fs::set_permissions(entry.path(), Permissions::from_mode(0o600))?;
            }
        }
        Ok(())
    }

    /// The service name of an output port.
    pub(crate) fn link(&self, stage: &str, port: &str) -> Result<ServiceName, LinkError> {
        self.service(&format!("link/{stage}/{port}"))
    }

    /// The service name between a stage and its program; `direction` is `to` or `from` the program.
    pub(crate) fn call(&self, direction: &str) -> Result<ServiceName, LinkError> {
        self.service(&format!("call/{direction}"))
    }

    fn service(&self, name: &str) -> Result<ServiceName, LinkError> {
        let name = format!("{}/{name}", self.prefix);
        ServiceName::new(&name).map_err(|e| LinkError::shared(format!("name the service {name}"))(&e))
    }
}
