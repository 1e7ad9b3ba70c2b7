//! The output file, and an earlier file of its name.

use super::*;

#[test]
fn a_failed_run_leaves_a_log_marked_as_incomplete() {
    let mut run = Run::new("");
    run.result(2, "/map", 1, b"grid").unwrap();
    run.sink.node().abort("stage `lines` failed");
    let log = run.log();
    assert_eq!(log.topics(), ["/map"]);
    let expected = [("complete", "false"), ("reason", "stage `lines` failed")];
    assert_eq!(log.outcome, expected.map(|(key, value)| (key.into(), value.into())).into());
}

#[test]
fn a_run_that_fails_at_once_keeps_the_log_of_an_earlier_run() {
    let mut run = Run::new("");
    fs::write(run.file(), "earlier").unwrap();
    run.sink.node().abort("no input");
    assert_eq!(fs::read(run.file()).unwrap(), b"earlier");
}

#[test]
fn a_sink_that_is_dropped_leaves_a_log_that_is_not_complete() {
    let mut run = Run::new("");
    run.result(2, "/map", 1, b"grid").unwrap();
    let Run { folder, sink, .. } = run;
    drop(sink);
    let log = Log::read(&folder.path().join("out.mcap"));
    assert_eq!((log.topics(), log.outcome["complete"].as_str()), (vec!["/map"], "false"));
}

#[test]
fn closed_chunks_can_be_read_during_the_run() {
    let mut run = Run::new("chunk_size = 1024");
    for time in 0..100 {
        run.result(2, "/map", time, &[7; 100]).unwrap();
    }
    let bytes = fs::read(run.folder.path().join("out.mcap.part")).unwrap();
    let options = mcap::read::Options::IgnoreEndMagic.into();
    let stream = mcap::MessageStream::new_with_options(&bytes, options).unwrap();
    let readable = stream.map_while(Result::ok).count();
    assert!((92..100).contains(&readable), "{readable} of 100, with 8 in the open chunk");
}

#[test]
fn a_program_that_has_the_earlier_file_open_keeps_what_it_reads() {
    use std::io::Read;
    let mut run = Run::new("");
    fs::write(run.file(), "earlier").unwrap();
    let mut open = fs::File::open(run.file()).unwrap();
    run.finish();
    let mut text = String::new();
    open.read_to_string(&mut text).unwrap();
    assert_eq!(text, "earlier");
    assert_eq!(run.log().outcome["complete"], "true");
}

#[test]
fn a_sink_that_never_ran_keeps_the_earlier_file() {
    let run = Run::new("");
    fs::write(run.file(), "earlier").unwrap();
    let Run { folder, sink, .. } = run;
    drop(sink);
    assert_eq!(fs::read(folder.path().join("out.mcap")).unwrap(), b"earlier");
}

#[test]
fn bad_paths_are_errors_with_a_fix() {
    let folder = tempfile::tempdir().unwrap();
    let error = |path: &Path| make(path, "").err().unwrap().to_string();
    let at = |name: &str| folder.path().join(name);

    assert_eq!(error(Path::new("")), "cannot write the log: it has no file; give --output LOG or file = \"LOG\"");
    assert!(error(folder.path()).ends_with("is a folder; name a file in it"));
    let missing = at("missing");
    let expected = format!("there is no folder {}; create it, or name a file elsewhere", missing.display());
    assert_eq!(error(&missing.join("out.mcap")), format!("cannot write the log: {expected}"));
    fs::write(at("file"), "").unwrap();
    assert!(error(&at("file").join("out.mcap")).contains("there is no folder"));
}

#[test]
fn a_second_sink_on_one_file_fails_and_changes_nothing() {
    let mut run = Run::new("");
    let error = make(&run.file(), "").err().unwrap().to_string();
    assert!(error.contains("out.mcap is being written by process"), "{error}");
    run.result(2, "/map", 1, b"grid").unwrap();
    run.finish();
    assert_eq!(run.log().topics(), ["/map"]);
}

#[test]
fn a_failed_run_does_not_replace_an_earlier_log() {
    let mut run = Run::new("");
    fs::write(run.file(), "earlier").unwrap();
    run.result(2, "/map", 1, b"grid").unwrap();
    run.sink.node().abort("stage `lines` failed");
    assert_eq!(fs::read(run.file()).unwrap(), b"earlier");
    let log = Log::read(&run.folder.path().join("out.mcap.part"));
    assert_eq!((log.topics(), log.outcome["complete"].as_str()), (vec!["/map"], "false"));
}
