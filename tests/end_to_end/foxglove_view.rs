//! A live run is shown to the Foxglove app, and not slowed by it.

use crate::python_libraries::{python, script};
use crate::support::{LOG, RECEIVE, Run, gridweave, wait_until};
use serde_json::Value;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Command, Stdio};
use tempfile::TempDir;

/// A port that was free a moment ago.
fn free_port() -> u16 {
    TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

#[test]
fn a_port_that_is_taken_ends_the_run_and_is_reported() {
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port();
    let folder = TempDir::new().unwrap();
    let view = format!("--view={port}");
    let run = gridweave(folder.path(), &["run", "live_merge", "-o", "out.mcap", &view]);
    run.assert(1, &[&format!("serve Foxglove on 127.0.0.1:{port}"), "in use", "choose another"]);
    let wrong = gridweave(folder.path(), &["run", "live_merge", "-o", "out.mcap", "--view=nowhere"]);
    wrong.assert(2, &["`--view=nowhere` is not an address"]);
}

#[test]
fn a_port_that_the_system_chooses_is_reported() {
    let run = Run::start(RECEIVE, &["--view=127.0.0.1:0"]);
    run.top();
    let done = run.interrupt();
    done.assert_done();
    let text = done.ended.text();
    let port: String = text.split_once("ws://127.0.0.1:").unwrap().1.chars().take_while(char::is_ascii_digit).collect();
    assert_ne!(port.parse::<u16>().unwrap(), 0, "{text}");
}

#[test]
fn a_viewer_of_the_older_protocol_is_refused_and_the_needed_one_is_named() {
    let port = free_port();
    let run = Run::start(RECEIVE, &[&format!("--view={port}")]);
    wait_until("the server", || TcpStream::connect(("127.0.0.1", port)).is_ok());
    // Viewers try again.
    for _ in 0..2 {
        let mut viewer = TcpStream::connect(("127.0.0.1", port)).unwrap();
        let request = "GET / HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
                       Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\
                       Sec-WebSocket-Protocol: foxglove.websocket.v1\r\n\r\n";
        viewer.write_all(request.as_bytes()).unwrap();
        let mut answer = String::new();
        viewer.read_to_string(&mut answer).unwrap();
        assert!(answer.starts_with("HTTP/1.1 400"), "{answer}");
    }
    let done = run.interrupt();
    let text = done.ended.text();
    assert_eq!(text.matches("`foxglove.sdk.v1`").count(), 1, "{text}");
}

#[test]
#[ignore = "needs python3 with venv, and the network"]
fn a_client_with_python_libraries_that_comes_late_gets_the_last_of_all_that_is_latched() {
    let tools = TempDir::new().unwrap();
    let (python, script) = (python(tools.path()), script("foxglove.py"));
    let client = |port: u16, wanted: &[&str]| {
        let mut command = Command::new(&python);
        command.arg(&script).arg(format!("ws://127.0.0.1:{port}")).args(wanted);
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    };
    let port = free_port();
    let run = Run::start("live_merge", &[&format!("--view={port}")]);
    run.simulate();
    run.command(&["play", LOG, "--rate", "0", "--end", "1"]).wait().assert(0, &[]);
    // One that reads nothing is there all the time.
    let mut halted = client(port, &["--halt"]).spawn().unwrap();
    let mut output = String::new();
    BufReader::new(halted.stdout.take().unwrap()).read_line(&mut output).unwrap();
    assert_eq!(output.trim(), "halted");
    run.command(&["play", LOG, "--rate", "0"]).wait().assert(0, &[]);
    let wanted = ["/map", "/robot1/map", "/tf_static", "/markers/graph", "/robot_frames", "/gridweave/stages"];
    let shown = client(port, &wanted).output().unwrap();
    assert!(shown.status.success(), "{}", String::from_utf8_lossy(&shown.stderr));
    let shown: Value = serde_json::from_slice(&shown.stdout).unwrap();
    assert_eq!(shown["/map"]["frame"], "world", "{shown}");
    assert!(shown["/map"]["known"].as_u64().unwrap() > 1000, "{shown}");
    assert!(shown["/tf_static"]["frames"].as_array().unwrap().contains(&"robot1/map".into()), "{shown}");
    let stages = shown["/gridweave/stages"]["stages"].as_array().unwrap();
    let tags = stages.iter().find(|stage| stage["name"] == "tags").unwrap();
    assert!(tags["messages_in"].as_u64().unwrap() > 100 && tags["busy_ms"].as_f64().unwrap() > 0.0, "{tags}");
    let done = run.interrupt();
    halted.kill().unwrap();
    halted.wait().unwrap();
    done.assert_done();
    assert!(Path::new(&done.path(LOG)).exists());
}
