//! The maps of real logs are merged rightly, or not at all, and alike on every engine.
//!
//! The logs and their truth lie in the folder that `GRIDWEAVE_LOGS` names: `NAME.mcap`, and `NAME.truth.json` where
//! the robots' maps can be merged.

use crate::engines_agree::{FAR_APART, assert_same_output};
use crate::support::{evaluate, logs_in, real_logs};
use serde_json::Value;
use tempfile::TempDir;

#[test]
#[ignore = "needs GRIDWEAVE_LOGS: the folder of real logs"]
fn every_pair_with_a_truth_is_right_on_every_engine_and_no_other_is_merged() {
    let logs = real_logs();
    let folder = TempDir::new().unwrap();
    let mut errors = Vec::new();
    for log in logs_in(&logs) {
        let name = log.file_stem().unwrap().to_str().unwrap();
        let (ended, summary) = assert_same_output(folder.path(), &log, &FAR_APART);
        let truth = log.with_extension("truth.json");
        if !truth.exists() {
            ended.assert(3, &["not merged"]);
            let reason = summary["unmerged"]["robot2"].as_str().unwrap();
            println!("{name}: not merged: {reason}");
            assert_eq!(summary["frames"].as_object().unwrap().len(), 1);
            continue;
        }
        assert_eq!(ended.status, 0, "{name}: {ended:#?}");
        let evaluation = evaluate(folder.path(), &truth);
        println!("{name}: {evaluation}");
        assert_eq!((&evaluation["wrong"], &evaluation["refused"]), (&Value::from(0), &Value::from(0)), "{name}");
        let robots = evaluation["robots"].as_array().unwrap();
        errors.extend(robots.iter().filter_map(|robot| robot["error_m"].as_f64()));
    }
    errors.sort_by(f64::total_cmp);
    let median = errors[errors.len() / 2];
    println!("{} pairs, median error {median:.4} m", errors.len());
    assert!(median < 0.05, "{errors:?}");
}
