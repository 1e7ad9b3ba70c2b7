//! The connection of a stage to the network of ROS 2 programs.

use super::dds_node::DdsNode;
use super::discovery::node_identity::NodeIdentity;
use super::discovery_range::{DiscoveryRange, static_peers};
use super::middleware::{Middleware, Middlewares};
use super::rtps::LAST_DOMAIN;
use gridweave_bridge::zenoh_session::{file_config, join, peer_config};
use gridweave_runtime::stage::{ParameterError, StageError};
use std::path::PathBuf;
use zenoh::{Config, Session};

/// The default router of `rmw_zenoh`.
pub(crate) const ROUTER: &str = "tcp/localhost:7447";
/// The default address to listen at, reachable from this machine only.
pub(crate) const LISTEN: &str = "tcp/localhost:0";
/// The environment variable with Zenoh's configuration file for ROS 2 programs.
const CONFIGURATION_VARIABLE: &str = "ZENOH_SESSION_CONFIG_URI";
/// The environment variable with the domain of ROS 2 programs.
const DOMAIN_VARIABLE: &str = "ROS_DOMAIN_ID";

/// The network parameters of a stage.
#[derive(Clone, Debug)]
pub(crate) struct Connection {
    pub(crate) middleware: Middlewares,
    pub(crate) discovery_range: Option<DiscoveryRange>,
    pub(crate) static_peers: Vec<String>,
    pub(crate) domain: Option<u32>,
    pub(crate) connect: Vec<String>,
    pub(crate) listen: Vec<String>,
    pub(crate) zenoh_config: Option<PathBuf>,
    pub(crate) node: Option<String>,
}

impl Connection {
    /// The errors of the parameters.
    pub(crate) fn check(&self) -> Vec<ParameterError> {
        let is_named = |name: &str| {
            let is_part = |c: char| c.is_ascii_alphanumeric() || c == '_';
            name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_') && name.chars().all(is_part)
        };
        let mut errors = Vec::new();
        match self.find_domain() {
            // Stages fail with the same, and where they start again, again and again.
            Err(wrong) => errors.push(ParameterError::new("domain", format!("is not given, and {wrong}"))),
            Ok(domain) if domain > LAST_DOMAIN && self.middleware.has(Middleware::Dds) => {
                let of = if self.domain.is_none() { format!(", of {DOMAIN_VARIABLE},") } else { String::new() };
                errors.push(ParameterError::new(
                    "domain",
                    format!("{domain}{of} is none of DDS, whose domains end at {LAST_DOMAIN}; `middleware = \"zenoh\"` has others"),
                ));
            }
            Ok(_) => {}
        }
        if self.node.as_ref().is_some_and(|node| !is_named(node)) {
            errors.push(ParameterError::new("node", "must be letters, digits and underscores, as ROS asks of it"));
        }
        for (key, endpoints) in [("connect", &self.connect), ("listen", &self.listen)] {
            if let Some(wrong) = endpoints.iter().find(|endpoint| endpoint.parse::<zenoh::config::EndPoint>().is_err())
            {
                errors.push(ParameterError::new(
                    key,
                    format!("`{wrong}` is not an endpoint; write it as `tcp/HOST:PORT`"),
                ));
            }
        }
        errors
    }

    /// The ROS domain: what the parameters say, or else the environment, or else 0.
    ///
    /// # Errors
    /// The environment says something that is no number.
    pub(crate) fn domain(&self) -> Result<u32, StageError> {
        self.find_domain().map_err(|wrong| StageError::new("find the ROS domain", wrong))
    }

    fn find_domain(&self) -> Result<u32, String> {
        domain_of(self.domain, &std::env::var(DOMAIN_VARIABLE).unwrap_or_default())
    }

    /// Joins a domain on DDS.
    ///
    /// # Errors
    /// The environment turns discovery off, or the system refuses the sockets.
    pub(crate) fn join_dds(&self, domain: u32, name: &NodeIdentity) -> Result<DdsNode, StageError> {
        let range = match self.discovery_range {
            Some(range) => Some(range),
            None => DiscoveryRange::of_environment()?,
        };
        let range = range.ok_or_else(|| {
            StageError::new("join the DDS network", "ROS_AUTOMATIC_DISCOVERY_RANGE is OFF")
                .with_help("SUBNET and LOCALHOST are others; `discovery_range` in the pipeline stands in for it")
        })?;
        DdsNode::start(domain, name, range.reach(), &static_peers(&self.static_peers))
    }

    /// Opens a session.
    ///
    /// # Errors
    /// The configuration file is invalid, or the address to listen at cannot be used.
    pub(crate) fn open(&self) -> Result<Session, StageError> {
        join(self.config())
    }

    fn config(&self) -> Result<Config, String> {
        let of_environment = || std::env::var_os(CONFIGURATION_VARIABLE).filter(|path| !path.is_empty());
        if let Some(path) = self.zenoh_config.clone().or_else(|| of_environment().map(PathBuf::from)) {
            return file_config(&path);
        }
        let settings = [
            ("scouting/multicast/enabled", "false"),
            ("scouting/gossip/enabled", "true"),
            // The history for late joiners is sorted by time.
            ("timestamping/enabled", "true"),
        ];
        peer_config(&self.connect, &self.listen, &settings)
    }

    /// The addresses of routers, as text.
    pub(crate) fn routers(&self) -> String {
        match self.connect.is_empty() {
            true => "anywhere".to_owned(),
            false => self.connect.join(" or "),
        }
    }
}

/// The domain that is given or, if none is, that of the environment. An error says why that is none.
fn domain_of(given: Option<u32>, of_environment: &str) -> Result<u32, String> {
    match (given, of_environment.trim()) {
        (Some(domain), _) => Ok(domain),
        (None, "") => Ok(0),
        (None, text) => text.parse().map_err(|_| format!("{DOMAIN_VARIABLE} is `{text}`, and no whole number")),
    }
}

#[cfg(test)]
mod tests {
    use super::super::source_parameters::SourceParameters;
    use super::*;

    fn wrong(domain: Option<u32>, middleware: Middlewares) -> Vec<String> {
        let connection = Connection { domain, middleware, ..SourceParameters::default().connection() };
        connection.check().iter().map(ToString::to_string).collect()
    }

    #[test]
    fn a_domain_that_dds_does_not_have_is_wrong_unless_it_is_one_of_zenoh() {
        let errors = wrong(Some(233), Middlewares::Auto);
        assert!(errors.len() == 1 && errors[0].contains("end at 232"), "{errors:?}");
        assert_eq!(
            (wrong(Some(232), Middlewares::Dds), wrong(Some(300), Middlewares::Zenoh)),
            (Vec::new(), Vec::new())
        );
    }

    #[test]
    fn the_domain_of_the_environment_is_a_whole_number() {
        assert_eq!(
            [domain_of(None, "").ok(), domain_of(None, " 5 ").ok(), domain_of(Some(7), "abc").ok()],
            [Some(0), Some(5), Some(7)]
        );
        for text in ["abc", "-1", "1.5"] {
            assert!(domain_of(None, text).is_err_and(|error| error.contains(text)), "{text}");
        }
    }
}
