//! The certificates with which the ends of a bridge authenticate each other.

use gridweave_runtime::stage::ParameterError;
use std::fs::File;
use std::path::{Path, PathBuf};

/// The encrypted protocols of Zenoh.
const ENCRYPTED: [&str; 2] = ["tls", "quic"];

/// The certificate parameters of a stage: files in PEM.
#[derive(Clone, Debug, Default)]
pub(super) struct Certificates {
    /// The authority that has signed the certificate of the other end.
    pub(super) authority: Option<PathBuf>,
    /// The certificate of this end.
    pub(super) certificate: Option<PathBuf>,
    /// The private key of the certificate.
    pub(super) key: Option<PathBuf>,
}

impl Certificates {
    fn files(&self) -> impl Iterator<Item = (&'static str, &Path)> {
        let files = [("authority", &self.authority), ("certificate", &self.certificate), ("key", &self.key)];
        files.into_iter().filter_map(|(name, file)| Some((name, file.as_deref()?)))
    }

    /// The errors of the parameters for the given addresses.
    pub(super) fn check(&self, connect: &[String], listen: &[String], has_file: bool) -> Vec<ParameterError> {
        let first = self.files().map(|(name, _)| name).next();
        let has_tls = |endpoints: &[String]| endpoints.iter().any(|endpoint| is_encrypted(endpoint));
        let error = |field: &str, text: &str| vec![ParameterError::new(field, text)];
        match (first, &self.certificate, &self.key) {
            (Some(first), ..) if has_file => {
                error(first, "cannot be combined with `zenoh_config`, which has its own certificates")
            }
            (_, Some(_), None) => error("key", "must be given, too: the private key of `certificate`"),
            (_, None, Some(_)) => error("certificate", "must be given, too: the certificate that `key` is for"),
            (Some(first), ..) if !has_tls(connect) && !has_tls(listen) => {
                error(first, "is for addresses of the form `tls/HOST:PORT`, and there is none")
            }
            (_, None, None) if !has_file && has_tls(listen) => {
                error("certificate", "must be given, with its `key`: connections to `tls/...` require it")
            }
            (_, Some(_), _) if self.authority.is_none() && !has_tls(listen) => {
                error("authority", "must be given, too: the authority that has signed the other end's certificate")
            }
            _ => Vec::new(),
        }
    }

    /// The settings of Zenoh, as JSON5. With an authority and a certificate each end requires one of the other (mutual
    /// TLS).
    ///
    /// # Errors
    /// A file cannot be read, which Zenoh would not report.
    pub(super) fn settings(&self) -> Result<Vec<(&'static str, String)>, String> {
        let mut settings = Vec::new();
        for (name, path) in self.files() {
            let cannot_read =
                |cause: &dyn std::fmt::Display| format!("cannot read `{name}`, {}: {cause}", path.display());
            File::open(path).map_err(|error| cannot_read(&error))?;
            let text = serde_json::to_string(path).map_err(|error| cannot_read(&error))?;
            let keys: &[&str] = match name {
                "authority" => &["transport/link/tls/root_ca_certificate"],
                "certificate" => &["transport/link/tls/listen_certificate", "transport/link/tls/connect_certificate"],
                _ => &["transport/link/tls/listen_private_key", "transport/link/tls/connect_private_key"],
            };
            settings.extend(keys.iter().map(|&key| (key, text.clone())));
        }
        if self.authority.is_some() && self.certificate.is_some() {
            settings.push(("transport/link/tls/enable_mtls", "true".to_owned()));
        }
        Ok(settings)
    }
}

/// Whether an endpoint is encrypted.
pub(super) fn is_encrypted(endpoint: &str) -> bool {
    endpoint.split_once('/').is_some_and(|(protocol, _)| ENCRYPTED.contains(&protocol))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn incomplete_or_unused_certificates_are_errors() {
        let given = |names: &str| {
            let path = |name: &str| names.contains(name).then(|| PathBuf::from(name));
            Certificates { authority: path("authority"), certificate: path("certificate"), key: path("key") }
        };
        let wrong = |names: &str, connect: &str, listen: &str, has_file: bool| {
            let list =
                |endpoint: &str| (!endpoint.is_empty()).then(|| endpoint.to_owned()).into_iter().collect::<Vec<_>>();
            given(names).check(&list(connect), &list(listen), has_file).pop().map(|error| error.field)
        };
        for (names, connect, listen) in [
            ("", "tcp/localhost:1", ""),
            ("", "tls/base:1", ""),
            ("authority", "tls/base:1", ""),
            ("authority certificate key", "tls/base:1", ""),
            ("certificate key", "", "tls/0.0.0.0:1"),
            ("authority certificate key", "", "tls/0.0.0.0:1"),
        ] {
            assert_eq!(wrong(names, connect, listen, false), None, "{names} {connect} {listen}");
        }
        for (names, connect, listen, field) in [
            ("authority", "tcp/base:1", "", "authority"),
            ("certificate", "tls/base:1", "", "key"),
            ("key", "tls/base:1", "", "certificate"),
            ("certificate key", "tls/base:1", "", "authority"),
            ("", "", "tls/0.0.0.0:1", "certificate"),
            ("authority", "", "tls/0.0.0.0:1", "certificate"),
        ] {
            assert_eq!(wrong(names, connect, listen, false).as_deref(), Some(field), "{names} {connect} {listen}");
        }
        assert_eq!(wrong("authority", "tls/base:1", "", true).as_deref(), Some("authority"));
        assert_eq!(wrong("", "", "tls/0.0.0.0:1", true), None);
    }

    #[test]
    fn a_missing_file_is_an_error() {
        let missing = Certificates { authority: Some("/there/is/none.pem".into()), ..Default::default() };
        let error = missing.settings().unwrap_err();
        assert!(error.starts_with("cannot read `authority`, /there/is/none.pem: No such file"), "{error}");
    }
}
