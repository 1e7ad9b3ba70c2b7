//! Sessions of Zenoh: their configuration, their errors in words, and whether anybody is at the other end.

use gridweave_runtime::stage::StageError;
use std::path::Path;
use zenoh::{Config, Session, Wait};

/// Opens a session.
///
/// # Errors
/// The configuration is invalid, or the address to listen at cannot be used.
pub fn join(config: Result<Config, String>) -> Result<Session, StageError> {
    let doing = "join the Zenoh network";
    let config = config.map_err(|cause| StageError::new(doing, cause))?;
    zenoh::open(config).wait().map_err(|cause| StageError::new(doing, in_words(&cause)))
}

/// The configuration of a peer that connects to some endpoints and listens at others, with further settings of Zenoh as
/// JSON5.
///
/// # Errors
/// Zenoh rejects a setting.
pub fn peer_config(connect: &[String], listen: &[String], settings: &[(&str, &str)]) -> Result<Config, String> {
    let list = |endpoints: &[String]| serde_json::to_string(endpoints).map_err(|error| error.to_string());
    let mut config = Config::default();
    let (connect, listen) = (list(connect)?, list(listen)?);
    let own = [("mode", "\"peer\""), ("connect/endpoints", &*connect), ("listen/endpoints", &*listen)];
    for (key, value) in own.iter().chain(settings) {
        config.insert_json5(key, value).map_err(|error| format!("{key}: {error}"))?;
    }
    Ok(config)
}

/// Reads a configuration file of Zenoh.
///
/// # Errors
/// It cannot be read, or it has unknown settings.
pub fn file_config(path: &Path) -> Result<Config, String> {
    Config::from_file(path).map_err(|error| format!("{}: {}", path.display(), in_words(&error)))
}

/// The text of an error of Zenoh, without the source location.
pub fn in_words(error: &zenoh::Error) -> String {
    let text = error.to_string();
    match text.rsplit_once(" at ") {
        Some((words, location)) if location.contains(".rs:") => words.to_owned(),
        _ => text,
    }
}

/// Whether a session is connected to a router, or to another program.
pub fn is_connected(session: &Session) -> bool {
    let info = session.info();
    info.routers_zid().wait().next().is_some() || info.peers_zid().wait().next().is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_text_of_an_error_of_zenoh_has_no_source_location() {
        let missing = file_config(Path::new("/there/is/no/such/file.json5")).err().unwrap();
        assert!(missing.starts_with("/there/is/no/such/file.json5: No such file"), "{missing}");
        assert!(!missing.contains(".rs:"), "{missing}");
    }
}
