//! Where robots on DDS are looked for, as ROS 2 has it.

use super::rtps::Reach;
use gridweave_runtime::stage::StageError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::net::{IpAddr, Ipv4Addr, ToSocketAddrs};

/// The environment variables of ROS 2 that say so.
const RANGE_VARIABLE: &str = "ROS_AUTOMATIC_DISCOVERY_RANGE";
const LOCALHOST_VARIABLE: &str = "ROS_LOCALHOST_ONLY";
const PEERS_VARIABLE: &str = "ROS_STATIC_PEERS";

/// Where robots on DDS are looked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum DiscoveryRange {
    /// On this machine alone.
    Localhost,
    /// In the networks of this machine, by multicast.
    Subnet,
}

impl DiscoveryRange {
    /// The range that the environment asks for; `None` if discovery is off.
    ///
    /// # Errors
    /// It asks for something that there is not.
    pub(crate) fn of_environment() -> Result<Option<Self>, StageError> {
        Self::of_variables(&variable(LOCALHOST_VARIABLE), &variable(RANGE_VARIABLE))
    }

    /// As in ROS 2, where the older variable still counts before the newer one.
    fn of_variables(localhost: &str, range: &str) -> Result<Option<Self>, StageError> {
        match (localhost, range) {
            ("1", _) | (_, "LOCALHOST") => Ok(Some(Self::Localhost)),
            (_, "" | "SUBNET" | "SYSTEM_DEFAULT") => Ok(Some(Self::Subnet)),
            (_, "OFF") => Ok(None),
            (_, other) => {
                Err(StageError::new("find where to look for robots", format!("{RANGE_VARIABLE} is `{other}`"))
                    .with_help("it is SUBNET, LOCALHOST or OFF; `discovery_range` in the pipeline stands in for it"))
            }
        }
    }

    pub(crate) const fn reach(self) -> Reach {
        match self {
            Self::Localhost => Reach::Machine,
            Self::Subnet => Reach::Network,
        }
    }
}

fn variable(name: &str) -> String {
    std::env::var(name).unwrap_or_default().trim().to_owned()
}

/// The machines on which robots are looked for one by one, those of the environment if none are given.
pub(crate) fn static_peers(given: &[String]) -> Vec<Ipv4Addr> {
    let of_environment = variable(PEERS_VARIABLE);
    let names: Vec<&str> = match given.is_empty() {
        true => of_environment.split(';').map(str::trim).filter(|name| !name.is_empty()).collect(),
        false => given.iter().map(String::as_str).collect(),
    };
    let mut peers = Vec::new();
    for name in names {
        match (name, 0).to_socket_addrs() {
            Ok(found) => peers.extend(found.filter_map(|address| match address.ip() {
                IpAddr::V4(address) => Some(address),
                IpAddr::V6(_) => None,
            })),
            Err(error) => tracing::warn!("no robots are looked for at `{name}`: {error}"),
        }
    }
    peers
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_range_is_what_ros_takes_it_for() {
        let of = |localhost, range| DiscoveryRange::of_variables(localhost, range).ok();
        let (localhost, subnet) = (Some(Some(DiscoveryRange::Localhost)), Some(Some(DiscoveryRange::Subnet)));
        assert_eq!([of("", ""), of("0", "SUBNET"), of("", "SYSTEM_DEFAULT")], [subnet; 3]);
        assert_eq!([of("1", ""), of("1", "SUBNET"), of("", "LOCALHOST")], [localhost; 3]);
        assert_eq!(of("", "OFF"), Some(None));
        assert_eq!(of("", "everywhere"), None);
    }
}
