//! The connection between the ends of a bridge, and its encryption.

use super::certificates::{Certificates, is_encrypted};
use super::connection_errors::connection_error;
use super::zenoh_session::{file_config, join, peer_config};
use gridweave_runtime::stage::{ParameterError, StageError};
use std::net::IpAddr;
use std::path::PathBuf;
use zenoh::config::EndPoint;
use zenoh::{Config, Session};

/// The default address of a receiver.
pub(super) const BASE: &str = "tcp/localhost:7448";

/// The network parameters of a stage.
#[derive(Clone, Debug)]
pub(super) struct Network {
    pub(super) bridge: String,
    pub(super) connect: Vec<String>,
    pub(super) listen: Vec<String>,
    pub(super) discover: bool,
    pub(super) zenoh_config: Option<PathBuf>,
    pub(super) insecure: bool,
    pub(super) certificates: Certificates,
}

impl Network {
    /// The errors of the parameters.
    pub(super) fn check(&self) -> Vec<ParameterError> {
        let mut errors = Vec::new();
        if !is_part_of_key(&self.bridge) {
            errors.push(ParameterError::new("bridge", "must be letters, digits, `_`, `-` and `.`"));
        }
        for (key, endpoints) in [("connect", &self.connect), ("listen", &self.listen)] {
            for endpoint in endpoints {
                match endpoint.parse::<EndPoint>() {
                    Err(_) => {
                        let text = format!("`{endpoint}` is not an endpoint; write it as `tcp/HOST:PORT`");
                        errors.push(ParameterError::new(key, text));
                    }
                    Ok(_) if !self.insecure && is_unencrypted(endpoint) => {
                        errors.push(ParameterError::new(key, open(endpoint)))
                    }
                    Ok(_) if !cfg!(feature = "tls") && is_encrypted(endpoint) => {
                        errors.push(ParameterError::new(key, "the program was built without the feature `tls`"))
                    }
                    Ok(_) => {}
                }
            }
        }
        if self.discover && !self.insecure && self.zenoh_config.is_none() {
            let text = "connects to any program that answers on the network, without encryption: name the other end as \
                        `tls/HOST:PORT`, or set `insecure = true` on a network that you trust";
            errors.push(ParameterError::new("discover", text));
        }
        let has_file = self.zenoh_config.is_some();
        errors.extend(self.certificates.check(&self.connect, &self.listen, has_file));
        errors
    }

    /// Joins the network.
    ///
    /// # Errors
    /// The configuration file is invalid or has unencrypted addresses, or the address to listen at cannot be used.
    pub(super) fn open(&self) -> Result<Session, StageError> {
        join(self.config())
    }

    /// Joins the network as a client of the program that listens there, which routes to all others connected to it.
    ///
    /// # Errors
    /// The configuration file is invalid, or nothing listens there.
    pub(super) fn open_as_client(&self) -> Result<Session, StageError> {
        join(self.client_config())
    }

    fn client_config(&self) -> Result<Config, String> {
        let mut config = self.config()?;
        let mut settings = vec![("mode", "\"client\""), ("listen/endpoints", "[]")];
        let is_here = |endpoint: &String| host(endpoint).is_some_and(is_loopback);
        if self.zenoh_config.is_none() && self.connect.iter().all(is_here) {
            // The certificate has another name for this machine.
            settings.push(("transport/link/tls/verify_name_on_connect", "false"));
        }
        for (key, value) in settings {
            config.insert_json5(key, value).map_err(|error| format!("{key}: {error}"))?;
        }
        Ok(config)
    }

    fn config(&self) -> Result<Config, String> {
        if let Some(path) = &self.zenoh_config {
            let config = file_config(path)?;
            let endpoints = ["connect/endpoints", "listen/endpoints"].map(|key| endpoints_of(&config, key));
            return match endpoints.iter().flatten().find(|endpoint| !self.insecure && is_unencrypted(endpoint)) {
                Some(endpoint) => Err(format!("{}: {}", path.display(), open(endpoint))),
                None => Ok(config),
            };
        }
        let certificates = self.certificates.settings()?;
        let mut settings = vec![
            ("scouting/multicast/enabled", if self.discover { "true" } else { "false" }),
            // Senders need no connections to each other.
            ("scouting/gossip/autoconnect", "{ router: [], peer: [], client: [] }"),
        ];
        settings.extend(certificates.iter().map(|(key, value)| (*key, value.as_str())));
        peer_config(&self.connect, &self.listen, &settings)
    }

    /// The reasons why the endpoints cannot be reached, as far as known. Tries each of them, one after the other.
    pub(super) fn connection_errors(&self) -> Vec<String> {
        connection_errors_of(self.config())
    }

    /// The same for a client.
    pub(super) fn connection_errors_as_client(&self) -> Vec<String> {
        connection_errors_of(self.client_config())
    }

    /// The addresses to listen at, as text.
    pub(super) fn listen_text(&self) -> String {
        match &self.zenoh_config {
            Some(path) => format!("the addresses in {}", path.display()),
            None => self.listen.join(" and "),
        }
    }

    /// The addresses to connect to, as text.
    pub(super) fn connect_text(&self) -> String {
        match (&self.zenoh_config, self.connect.is_empty()) {
            (Some(path), _) => format!("the addresses in {}", path.display()),
            (None, true) => "anywhere".to_owned(),
            (None, false) => self.connect.join(" or "),
        }
    }
}

fn connection_errors_of(config: Result<Config, String>) -> Vec<String> {
    let Ok(config) = config else { return Vec::new() };
    let why = |endpoint: String| {
        let mut config = config.clone();
        let list = serde_json::to_string(&[&endpoint]).ok()?;
        config.insert_json5("connect/endpoints", &list).ok()?;
        Some(format!("{endpoint}: {}", connection_error(config)?))
    };
    endpoints_of(&config, "connect/endpoints").into_iter().filter_map(why).collect()
}

/// Whether a text is a valid name of a bridge or a sender.
pub(super) fn is_part_of_key(name: &str) -> bool {
    let is_usual = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-' | '.');
    !name.is_empty() && name.len() <= 100 && name.chars().all(is_usual)
}

/// Whether an endpoint is on another machine and not encrypted.
fn is_unencrypted(endpoint: &str) -> bool {
    host(endpoint).is_none_or(|host| !is_loopback(host)) && !is_encrypted(endpoint)
}

/// The host of an endpoint.
fn host(endpoint: &str) -> Option<&str> {
    let (_, rest) = endpoint.split_once('/')?;
    let address = rest.split(['?', '#']).next().unwrap_or(rest);
    let host = address.rsplit_once(':').map_or(address, |(host, _)| host);
    Some(host.trim_start_matches('[').trim_end_matches(']'))
}

fn is_loopback(host: &str) -> bool {
    host == "localhost" || host.parse().is_ok_and(|address: IpAddr| address.is_loopback())
}

fn open(endpoint: &str) -> String {
    format!(
        "`{endpoint}` is on another machine, and the connection is not encrypted: write it as `tls/HOST:PORT`, with certificates, \
         or set `insecure = true` on a network that you trust"
    )
}

/// All endpoints of a configuration under a key, for any mode.
fn endpoints_of(config: &Config, key: &str) -> Vec<String> {
    fn strings(value: &serde_json::Value, found: &mut Vec<String>) {
        match value {
            serde_json::Value::String(text) if text.contains('/') => found.push(text.clone()),
            serde_json::Value::Array(values) => values.iter().for_each(|value| strings(value, found)),
            serde_json::Value::Object(values) => values.values().for_each(|value| strings(value, found)),
            _ => {}
        }
    }
    let mut found = Vec::new();
    let value = config.get_json(key).ok().and_then(|text| serde_json::from_str(&text).ok());
    strings(&value.unwrap_or_default(), &mut found);
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn network(connect: &[&str], listen: &[&str]) -> Network {
        let owned = |list: &[&str]| list.iter().map(|&text| text.to_owned()).collect();
        let (connect, listen) = (owned(connect), owned(listen));
        Network {
            bridge: "base".into(),
            connect,
            listen,
            discover: false,
            zenoh_config: None,
            insecure: false,
            certificates: Certificates::default(),
        }
    }

    #[test]
    fn an_endpoint_on_another_machine_must_be_encrypted_or_insecure_must_be_set() {
        for closed in ["tcp/localhost:7448", "tcp/127.0.0.1:0", "tcp/[::1]:7448", "tls/10.0.0.1:7448"] {
            let is_known = cfg!(feature = "tls") || !is_encrypted(closed);
            assert_eq!(network(&[closed], &[]).check().is_empty(), is_known, "{closed}");
        }
        for open in ["tcp/0.0.0.0:7448", "tcp/[::]:0", "tcp/base:7448", "udp/10.0.0.1:7448", "tcp/1.2.3.4:5#iface=lo"] {
            let errors = network(&[], &[open]).check();
            assert!(errors.len() == 1 && errors[0].to_string().contains("insecure = true"), "{open} {errors:?}");
            assert_eq!(network(&[open], &[]).check().len(), 1, "{open}");
            assert_eq!(Network { insecure: true, ..network(&[open], &[open]) }.check(), []);
        }
        assert_eq!(Network { discover: true, ..network(&[], &[]) }.check()[0].field, "discover");
        assert!(network(&["nonsense"], &[]).check()[0].problem.contains("tcp/HOST:PORT"));
        assert_eq!(Network { bridge: "a/**".into(), ..network(&[], &[]) }.check()[0].field, "bridge");
    }

    #[test]
    fn a_configuration_file_needs_insecure_for_unencrypted_endpoints() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("zenoh.json5");
        let config = |listen: &str| {
            std::fs::write(&path, format!("{{ mode: 'peer', listen: {{ endpoints: {listen} }} }}")).unwrap();
            Network { zenoh_config: Some(path.clone()), ..network(&[], &[]) }
        };
        assert!(config("['tls/0.0.0.0:7448']").config().is_ok());
        assert!(config("{ peer: ['tcp/127.0.0.1:0'] }").config().is_ok());
        for open in ["['tcp/0.0.0.0:7448']", "{ peer: ['tcp/10.0.0.1:0'] }"] {
            let error = config(open).config().err().unwrap();
            assert!(error.contains("zenoh.json5") && error.contains("insecure = true"), "{error}");
            assert!(Network { insecure: true, ..config(open) }.config().is_ok());
        }
    }
}
