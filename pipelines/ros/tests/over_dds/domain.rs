//! A domain for each test, on this machine alone.

use gridweave_ros::{sink, source};
use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::{Header, MapMetaData, OccupancyGrid, PoseStamped, encode};
use gridweave_runtime::stage::{Context, InputWire, RunLinks, StageHarness};
use std::sync::atomic::{AtomicU32, Ordering};

/// A domain that no other test uses.
pub(crate) struct Domain(u32);

impl Domain {
    pub(crate) fn new() -> Self {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        // Processes that run at a time have other domains, or else other topics come among these.
        Self(60 + (std::process::id() * 16 + NEXT.fetch_add(1, Ordering::Relaxed)) % 160)
    }

    pub(crate) fn number(&self) -> u32 {
        self.0
    }

    /// The parameters of a stage in it.
    pub(crate) fn parameters(&self) -> String {
        format!("middleware = \"dds\"\ndiscovery_range = \"localhost\"\ndomain = {}", self.0)
    }

    pub(crate) fn source(&self, parameters: &str) -> StageHarness {
        StageHarness::new(&source::kind(), &format!("{}\n{parameters}", self.parameters())).unwrap()
    }

    /// A node that publishes messages of these types on these topics, as a robot or a viewer's peer.
    pub(crate) fn sink(&self, node: &str, wires: &[(&'static str, &str)]) -> StageHarness {
        self.sink_with(&format!("node = \"{node}\"\nas_robot = true"), wires, None)
    }

    /// The node of another run of Gridweave that publishes these.
    pub(crate) fn other_run(&self, node: &str, wires: &[(&'static str, &str)]) -> StageHarness {
        // A stage with links is in a process of its own, and its run is the process that has started it.
        let links = RunLinks::new([], |_| Ok(None));
        self.sink_with(&format!("node = \"{node}\""), wires, Some(links))
    }

    /// A node of this run, or of the run with these links.
    pub(crate) fn sink_with(
        &self,
        parameters: &str,
        wires: &[(&'static str, &str)],
        links: Option<RunLinks>,
    ) -> StageHarness {
        let wire = |(ros_type, topic): &(&str, &str)| InputWire {
            port: "in",
            from: "a".into(),
            ros_type: (*ros_type).to_owned(),
            topic: (*topic).to_owned(),
            ..Default::default()
        };
        let inputs = wires.iter().map(wire).collect();
        let context = Context { stage: "ros".into(), inputs, links, ..Default::default() };
        let parameters = format!("{}\n{parameters}", self.parameters());
        StageHarness::with_context(&sink::kind(), &parameters, &context).unwrap()
    }
}

/// A square map, all of whose cells have one value.
pub(crate) fn map(width: u32, value: u8) -> Vec<u8> {
    let info = MapMetaData { width, height: width, resolution: 0.05, ..Default::default() };
    let header = Header::new(LogTime(1_000_000_000), "map");
    encode(&OccupancyGrid { header, info, data: &vec![value; (width * width) as usize] }).unwrap()
}

/// Where the robots are by the poses that have come: x of each.
pub(crate) fn poses(source: &mut StageHarness) -> Vec<f64> {
    let messages = source.take_messages("pose");
    messages.iter().filter_map(|message| Some(message.decode::<PoseStamped>().ok()?.pose.position.x)).collect()
}
