//! The parameters of `ros_source`.

use super::connection::{Connection, LISTEN, ROUTER};
use super::discovery_range::DiscoveryRange;
use super::middleware::Middlewares;
use gridweave_logs::source::{CellValues, LidarPoses};
use gridweave_runtime::stage::{ParameterError, Parameters};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// The parameters of `ros_source`.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SourceParameters {
    /// The middlewares of ROS 2 on which robots are heard: `auto` for both, `dds` for the default of ROS 2 alone (Fast
    /// DDS, Cyclone DDS), `zenoh` for `rmw_zenoh_cpp` alone.
    pub middleware: Middlewares,
    /// Where robots on DDS are looked for: `subnet` for the networks of this machine, `localhost` for this machine
    /// alone. If it is not given, the environment variables ROS_LOCALHOST_ONLY and ROS_AUTOMATIC_DISCOVERY_RANGE say
    /// it, as for ROS 2 programs.
    pub discovery_range: Option<DiscoveryRange>,
    /// Machines on which robots on DDS are looked for one by one, by name or address, where multicast does not reach
    /// them. If none are given, those that the environment variable ROS_STATIC_PEERS names.
    pub static_peers: Vec<String>,
    /// The ROS domain. If it is not given, the environment variable ROS_DOMAIN_ID says it, or else it is 0.
    pub domain: Option<u32>,
    /// The Zenoh routers and programs to connect to, as `tcp/HOST:PORT`. Until one answers it is looked for.
    pub connect: Vec<String>,
    /// Where other programs may connect, as `tcp/HOST:PORT`; port 0 is any that is free. Nothing else is listened to.
    pub listen: Vec<String>,
    /// A configuration file of Zenoh (JSON5), which stands in for `connect` and `listen`: for TLS, for example. If it
    /// is not given, the environment variable ZENOH_SESSION_CONFIG_URI names one, as for ROS 2 programs.
    pub zenoh_config: Option<PathBuf>,
    /// The name of the ROS 2 node; `gridweave_` and the name of the stage if it is not given.
    pub node: Option<String>,
    /// Topics of which messages are taken, too, and passed on by the output `other`, `{robot}` standing for any one
    /// part: `["/{robot}/scan"]`.
    pub also: Vec<String>,
    /// Folders of ROS packages, such as `/opt/ros/jazzy/share`, where definitions of types are looked for that
    /// Gridweave does not know, as PACKAGE/msg/TYPE.msg. If none are given, those that the environment variable
    /// AMENT_PREFIX_PATH names.
    pub definitions: Vec<PathBuf>,
    /// So many messages of a topic wait to be taken before the oldest is dropped. Of a map it is the last.
    #[schemars(range(min = 1))]
    pub keep_last: usize,
    /// So long after its scans were seen first a robot may take to publish a map, seconds. Then its scans are taken, if
    /// a stage reads `scans`. If it publishes a map later than that, its scans are taken no longer.
    #[schemars(range(min = 0.0, max = 3600.0))]
    pub wait_for_map: f64,
    /// The longest time that updates of a map are gathered before the map is sent with them, seconds.
    #[schemars(range(min = 0.0, max = 3600.0))]
    pub update_period: f64,
    /// The time without any publisher in the domain after which a warning names the likely reasons, seconds.
    #[schemars(range(min = 0.0, max = 3600.0))]
    pub discovery_timeout: f64,
    /// How the values of maps' cells are read; see `mcap_source`.
    pub map_values: CellValues,
    /// The poses of lidars on the bases of their robots, in place of those in tf; see `mcap_source`.
    pub lidars: LidarPoses,
}

impl Default for SourceParameters {
    fn default() -> Self {
        Self {
            middleware: Middlewares::default(),
            discovery_range: None,
            static_peers: Vec::new(),
            domain: None,
            connect: vec![ROUTER.to_owned()],
            listen: vec![LISTEN.to_owned()],
            zenoh_config: None,
            node: None,
            also: Vec::new(),
            definitions: Vec::new(),
            keep_last: 100,
            wait_for_map: 10.0,
            update_period: 1.0,
            discovery_timeout: 10.0,
            map_values: CellValues::default(),
            lidars: LidarPoses::new(),
        }
    }
}

impl SourceParameters {
    pub(crate) fn connection(&self) -> Connection {
        let Self { middleware, discovery_range, static_peers, domain, connect, listen, zenoh_config, node, .. } =
            self.clone();
        Connection { middleware, discovery_range, static_peers, domain, connect, listen, zenoh_config, node }
    }
}

impl Parameters for SourceParameters {
    fn check_together(&self) -> Vec<ParameterError> {
        self.connection().check()
    }
}
