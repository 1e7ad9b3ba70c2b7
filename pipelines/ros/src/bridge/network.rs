//! How the ends of a bridge find each other, and whom they let in.

use super::certificates::Certificates;
use super::refusals::obstacle;
use crate::connection::{file_config, join, peer_config};
use gridweave_runtime::stage::{ParameterError, StageError};
use std::net::IpAddr;
use std::path::PathBuf;
use zenoh::config::EndPoint;
use zenoh::{Config, Session};

/// Where a receiver listens, and a sender looks for it, where nothing else is said.
pub(super) const BASE: &str = "tcp/localhost:7448";
/// The protocols of Zenoh that encrypt.
const ENCRYPTED: [&str; 2] = ["tls", "quic"];

/// What the parameters of a stage say of the network.
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
    /// What is wrong with it.
    pub(super) fn check(&self) -> Vec<ParameterError> {
        let mut errors = Vec::new();
        if !is_part_of_key(&self.bridge) {
            errors.push(ParameterError::new("bridge", "must be letters, digits, `_`, `-` and `.`"));
        }
        for (key, endpoints) in [("connect", &self.connect), ("listen", &self.listen)] {
            for endpoint in endpoints {
                match endpoint.parse::<EndPoint>() {
                    Err(_) => {
                        let text = format!("`{endpoint}` is none; write it as `tcp/HOST:PORT`");
                        errors.push(ParameterError::new(key, text));
                    }
                    Ok(_) if !self.insecure && is_open(endpoint) => {
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
            let text = "asks everybody on the network, and what is sent to who answers is not encrypted: name the other end as \
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
    /// The configuration file is wrong, or opens what is not to be open; or nothing can listen where it is to.
    pub(super) fn open(&self) -> Result<Session, StageError> {
        join(self.config())
    }

    /// Joins the network as a client of who listens there, which leads to all others that are connected to it.
    ///
    /// # Errors
    /// The configuration file is wrong, or nothing listens there.
    pub(super) fn open_as_client(&self) -> Result<Session, StageError> {
        join(self.client_config())
    }

    fn client_config(&self) -> Result<Config, String> {
        let mut config = self.config()?;
        let mut settings = vec![("mode", "\"client\""), ("listen/endpoints", "[]")];
        let is_here = |endpoint: &String| host(endpoint).is_some_and(is_loopback);
        if self.zenoh_config.is_none() && self.connect.iter().all(is_here) {
            // This machine is called otherwise in its certificate.
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
            return match endpoints.iter().flatten().find(|endpoint| !self.insecure && is_open(endpoint)) {
                Some(endpoint) => Err(format!("{}: {}", path.display(), open(endpoint))),
                None => Ok(config),
            };
        }
        let certificates = self.certificates.settings()?;
        let mut settings = vec![
            ("scouting/multicast/enabled", if self.discover { "true" } else { "false" }),
            // Senders have nothing to say to each other.
            ("scouting/gossip/autoconnect", "{ router: [], peer: [], client: [] }"),
        ];
        settings.extend(certificates.iter().map(|(key, value)| (*key, value.as_str())));
        peer_config(&self.connect, &self.listen, &settings)
    }

    /// Why none of the endpoints to connect to is reached, as far as that can be told. Asks each of them, one after the other.
    pub(super) fn obstacles(&self) -> Vec<String> {
        obstacles_of(self.config())
    }

    /// The same for a client.
    pub(super) fn obstacles_as_client(&self) -> Vec<String> {
        obstacles_of(self.client_config())
    }

    /// Where others connect to, as words.
    pub(super) fn doors(&self) -> String {
        match &self.zenoh_config {
            Some(path) => format!("where {} says", path.display()),
            None => self.listen.join(" and "),
        }
    }

    /// Where the other end is looked for, as words.
    pub(super) fn others(&self) -> String {
        match (&self.zenoh_config, self.connect.is_empty()) {
            (Some(path), _) => format!("where {} says", path.display()),
            (None, true) => "anywhere".to_owned(),
            (None, false) => self.connect.join(" or "),
        }
    }
}

fn obstacles_of(config: Result<Config, String>) -> Vec<String> {
    let Ok(config) = config else { return Vec::new() };
    let why = |endpoint: String| {
        let mut config = config.clone();
        let list = serde_json::to_string(&[&endpoint]).ok()?;
        config.insert_json5("connect/endpoints", &list).ok()?;
        Some(format!("{endpoint}: {}", obstacle(config)?))
    };
    endpoints_of(&config, "connect/endpoints").into_iter().filter_map(why).collect()
}

/// What the name of a bridge or a sender may be.
pub(super) fn is_part_of_key(name: &str) -> bool {
    let is_usual = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-' | '.');
    !name.is_empty() && name.len() <= 100 && name.chars().all(is_usual)
}

/// Whether what goes there leaves this machine, and can be read on its way.
fn is_open(endpoint: &str) -> bool {
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

/// Whether what goes there is encrypted.
pub(super) fn is_encrypted(endpoint: &str) -> bool {
    endpoint.split_once('/').is_some_and(|(protocol, _)| ENCRYPTED.contains(&protocol))
}

fn open(endpoint: &str) -> String {
    format!(
        "`{endpoint}` is not this machine, and what goes there is not encrypted: write it as `tls/HOST:PORT`, with certificates, or \
         set `insecure = true` on a network that you trust"
    )
}

/// All endpoints that a configuration has under a key, for whatever mode.
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
    fn what_leaves_the_machine_is_encrypted_or_told_to_be_open() {
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
    fn a_configuration_file_does_not_open_what_is_not_told_to_be_open() {
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
