//! The live view of a run for Foxglove (`--view`).

use super::LOG_SINK;
use crate::status::BadUse;
use gridweave_runtime::pipeline::Pipeline;
use gridweave_runtime::stage::Registry;
use std::collections::BTreeSet;
use std::net::TcpListener;

/// The kind of stage that serves the view.
const VIEW: &str = "foxglove_sink";
/// The default address, which is that of the stage.
pub(crate) const STANDARD_VIEW: &str = "127.0.0.1:8765";

/// Adds the view to a pipeline: it shows the messages that its logs contain or, without logs, all messages between its
/// stages. Returns the address to open.
///
/// # Errors
/// The address is wrong, or this program has no such stage.
pub(super) fn attach(pipeline: &mut Pipeline, registry: &Registry, address: &str) -> Result<String, BadUse> {
    let (host, port) = parse(address)?;
    let port = if port == 0 { free_port(host) } else { port };
    let kind = registry.get(VIEW).ok_or_else(|| {
        BadUse("this program was built without the view for Foxglove: build it with the feature `foxglove`".to_owned())
    })?;
    let read = |by_logs: bool| -> BTreeSet<(String, &'static str)> {
        let stages = pipeline.stages.iter().filter(|stage| !by_logs || stage.kind.name == LOG_SINK);
        let wires = stages.flat_map(|stage| &stage.inputs);
        wires
            .map(|wire| {
                let from = &pipeline.stages[wire.from_stage];
                (from.name.clone(), from.kind.outputs[wire.from_port].name)
            })
            .collect()
    };
    let shown = Some(read(true)).filter(|shown| !shown.is_empty()).unwrap_or_else(|| read(false));
    let mut parameters = toml::Table::new();
    parameters.insert("host".to_owned(), host.into());
    parameters.insert("port".to_owned(), i64::from(port).into());
    pipeline.attach(kind, parameters, VIEW, |_, from, output| shown.contains(&(from.name.clone(), output.name)));
    Ok(format!("ws://{host}:{port}"))
}

/// Finds a free port of the host, since the stage may be in another process and could not report the one it has chosen.
/// 0 if there is none, or no such host, which the stage reports.
fn free_port(host: &str) -> u16 {
    let host = host.trim_start_matches('[').trim_end_matches(']');
    TcpListener::bind((host, 0)).and_then(|listener| listener.local_addr()).map_or(0, |address| address.port())
}

/// Parses HOST:PORT, or PORT on this machine.
fn parse(address: &str) -> Result<(&str, u16), BadUse> {
    let standard_host = STANDARD_VIEW.split(':').next().unwrap_or_default();
    let (host, port) = address.rsplit_once(':').unwrap_or((standard_host, address));
    match port.parse() {
        Ok(port) if !host.is_empty() => Ok((host, port)),
        _ => Err(BadUse(format!(
            "`--view={address}` is not an address: write PORT or HOST:PORT, such as {STANDARD_VIEW}"
        ))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_is_a_port_of_this_machine_or_a_host_and_a_port() {
        assert_eq!(parse("8766").unwrap(), ("127.0.0.1", 8766));
        assert_eq!(parse("0.0.0.0:80").unwrap(), ("0.0.0.0", 80));
        assert_eq!(parse("[::1]:0").unwrap(), ("[::1]", 0));
        for wrong in ["", "host", ":8765", "host:", "127.0.0.1:70000"] {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
    }
}
