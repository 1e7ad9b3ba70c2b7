//! Bridges over TLS, with certificates of authorities that the tests make.

use crate::bridge::{Wire, give, give_pose, map, sink, source};
use crate::bridge_tap::{Link, go_on, robot, tap_stage, times};
use crate::command::{GRIDWEAVE, Running, wait_until};
use crate::waiting::sent;
use gridweave_runtime::message::Message;
use gridweave_runtime::stage::StageHarness;
use rcgen::{BasicConstraints, CertificateParams, DnType, IsCa, Issuer, KeyPair};
use std::fs;
use std::net::TcpListener;
use std::path::Path;
use tempfile::TempDir;

/// Who signs certificates, with what it signs in a folder: `NAME.pem` and `NAME.key`.
struct Authority<'a> {
    folder: &'a Path,
    issuer: Issuer<'static, KeyPair>,
}

fn parameters(name: &str, names: &[&str]) -> CertificateParams {
    let mut parameters = CertificateParams::new(names.iter().map(|&name| name.to_owned()).collect::<Vec<_>>()).unwrap();
    parameters.distinguished_name.push(DnType::CommonName, name);
    parameters
}

impl<'a> Authority<'a> {
    fn new(folder: &'a Path, name: &str) -> Self {
        let mut parameters = parameters(name, &[]);
        parameters.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
        let key = KeyPair::generate().unwrap();
        fs::write(folder.join(format!("{name}.pem")), parameters.self_signed(&key).unwrap().pem()).unwrap();
        Self { folder, issuer: Issuer::new(parameters, key) }
    }

    /// Signs a certificate for somebody who is reached by the given names.
    fn sign(&self, name: &str, names: &[&str]) {
        let key = KeyPair::generate().unwrap();
        let certificate = parameters(name, names).signed_by(&key, &self.issuer).unwrap();
        fs::write(self.folder.join(format!("{name}.pem")), certificate.pem()).unwrap();
        fs::write(self.folder.join(format!("{name}.key")), key.serialize_pem()).unwrap();
    }
}

/// The parameters that name files in a folder.
fn files(folder: &Path, authority: Option<&str>, certificate: Option<&str>) -> String {
    let path = |file: String| folder.join(file).display().to_string();
    let authority = authority.map(|name| format!("authority = \"{}\"\n", path(format!("{name}.pem"))));
    let certificate = certificate.map(|name| {
        format!("certificate = \"{}\"\nkey = \"{}\"\n", path(format!("{name}.pem")), path(format!("{name}.key")))
    });
    [authority, certificate].into_iter().flatten().collect()
}

fn free_port() -> u16 {
    TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

/// Whether somebody who reads what passes finds these words in it.
fn is_readable(wire: &Wire, words: &str) -> bool {
    wire.passed().windows(words.len()).any(|part| part == words.as_bytes())
}

#[test]
fn what_goes_over_tls_comes_as_it_was_sent_and_cannot_be_read_on_its_way() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    let fleet = Authority::new(folder, "fleet");
    fleet.sign("base", &["localhost"]);
    fleet.sign("robot", &["robot"]);
    let by_tls = |authority, certificate| files(folder, authority, certificate);
    for (protocol, of_base, of_robot) in [
        ("tcp", String::new(), String::new()),
        ("tls", by_tls(None, Some("base")), by_tls(Some("fleet"), None)),
        ("tls", by_tls(Some("fleet"), Some("base")), by_tls(Some("fleet"), Some("robot"))),
    ] {
        let port = free_port();
        let mut source = source(&format!("{protocol}/127.0.0.1:{port}"), &of_base);
        let (wire, by_wire) = Wire::new(port);
        let by_wire = by_wire.replace("tcp/127.0.0.1", &format!("{protocol}/localhost"));
        let mut sink = sink(&by_wire, &format!("sender = \"robot-1\"\n{of_robot}"));
        let maps: Vec<Vec<u8>> = (1..4).map(|time| map("robot1/map", time, 200 + 10 * time as usize)).collect();
        for (time, bytes) in (1..).zip(&maps) {
            give(&mut sink, 0, "robot1", "/robot1/map", time, bytes.clone());
        }
        let came = sent(&mut source, "map", 3);
        assert!(came.iter().map(Message::bytes).eq(maps.iter().map(Vec::as_slice)), "{protocol}");
        assert_eq!(is_readable(&wire, "sender/robot-1"), protocol == "tcp", "{of_robot}");
    }
}

#[test]
fn a_link_is_tapped_over_tls_with_a_certificate_of_the_fleet_alone() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    let (fleet, others) = (Authority::new(folder, "fleet"), Authority::new(folder, "others"));
    fleet.sign("base", &["localhost"]);
    fleet.sign("robot", &["robot"]);
    others.sign("stranger", &["stranger"]);
    let port = free_port();
    let of_base = files(folder, Some("fleet"), Some("base"));
    let _base = source(&format!("tls/127.0.0.1:{port}"), &of_base);
    let link = Link::default();
    link.lock().unwrap().0.push(7);
    let endpoint = format!("tls/localhost:{port}");
    let _robot = robot(&endpoint, &files(folder, Some("fleet"), Some("robot")), Some(&link));
    let stranger = files(folder, Some("fleet"), Some("stranger"));
    let refused = go_on(&mut tap_stage(&endpoint, &format!("wait = 1.0\n{stranger}")), "refused", |_| false).unwrap();
    assert!(refused.contains("it must be its `authority`") || refused.contains("asks for"), "{refused}");
    // The base itself, by an address that its certificate does not have.
    let mut tap = tap_stage(&format!("tls/127.0.0.1:{port}"), &of_base);
    assert_eq!(go_on(&mut tap, "message", |tap| times(tap) == [7]), None);
}

const BASE: &str = r#"
[pipeline]
name = "base"
mode = "live"

[stages.robots]
kind = "bridge_source"
listen = ["tls/127.0.0.1:PORT"]
end_after = 1
FILES

[stages.output]
kind = "mcap_sink"
inputs = ["robots.*"]
"#;

#[test]
fn a_peer_without_the_right_certificate_is_refused_and_both_ends_report_why() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    let (fleet, others) = (Authority::new(folder, "fleet"), Authority::new(folder, "others"));
    fleet.sign("base", &["localhost"]);
    fleet.sign("robot", &["robot"]);
    others.sign("stranger", &["localhost"]);
    let port = free_port();
    let of_base = files(folder, Some("fleet"), Some("base"));
    fs::write(folder.join("base.toml"), BASE.replace("PORT", &port.to_string()).replace("FILES", &of_base)).unwrap();
    let args = ["run", "base.toml", "--output", "base.mcap", "--summary", "summary.json"];
    let mut base = Running::start(GRIDWEAVE, &args, folder, "base.log");

    let (by_name, by_address) = (format!("tls/localhost:{port}"), format!("tls/127.0.0.1:{port}"));
    let refused = [
        // Without a certificate: it depends on who is faster whether the base's word arrives before it hangs up.
        (
            &by_name,
            files(folder, Some("fleet"), None),
            &["asks for"][..],
            "sent no certificates: the other end must have",
        ),
        // One of another authority.
        (
            &by_name,
            files(folder, Some("fleet"), Some("stranger")),
            &["it must be its `authority`", "asks for"],
            "UnknownIssuer: the certificate of the other end is not signed by",
        ),
        // A base of another authority than the robot trusts.
        (
            &by_name,
            files(folder, Some("others"), Some("robot")),
            &["UnknownIssuer: the certificate of the other end is not signed by"],
            "UnknownCA: the other end does not know",
        ),
        // A base whose certificate has another name than the one that the robot connects by.
        (
            &by_address,
            files(folder, Some("fleet"), Some("robot")),
            &["connect by a name that the certificate has"],
            "BadCertificate: the other end does not take",
        ),
    ];
    let mut sinks: Vec<StageHarness> =
        refused.iter().map(|(endpoint, files, ..)| sink(endpoint, &format!("linger = 0.0\n{files}"))).collect();
    for (sink, (endpoint, _, words, _)) in sinks.iter_mut().zip(&refused) {
        let mut warnings = String::new();
        let is_told = || {
            give_pose(sink, 1);
            warnings = format!("{:?}", sink.warnings().keys());
            warnings.contains("no receiver of the bridge") && words.iter().any(|words| warnings.contains(words))
        };
        wait_until(words[0], is_told, || base.errors());
        assert!(warnings.contains(*endpoint), "{warnings}");
        let at_base = format!("a connection to tls/127.0.0.1:{port} was refused: ");
        base.wait_for(&at_base);
    }
    for (.., at_base) in &refused {
        base.wait_for(at_base);
    }
    // Who has a right one is let in all the same.
    let mut right = sink(&by_name, &files(folder, Some("fleet"), Some("robot")));
    give_pose(&mut right, 7);
    right.finish(gridweave_runtime::message::LogTime(7)).unwrap();
    assert_eq!(right.counts()["messages taken by the other end"], 1, "{:?}", right.warnings());
    base.end_with(0);
    // What Zenoh has to say beside that is not for users.
    assert!(!base.errors().contains("DEBUG"), "{}", base.errors());
    let summary: serde_json::Value = serde_json::from_slice(&fs::read(folder.join("summary.json")).unwrap()).unwrap();
    let robots = &summary["stages"]["robots"];
    assert!(robots["counts"]["refused connections"].as_u64() >= Some(4), "{robots}");
    assert_eq!(robots["counts"]["messages taken"], 1, "{robots}");
}
