//! The check of one case.

use super::GoldenArgs;
use super::case_file::Case;
use super::compare::Comparison;
use super::differences::{self, Written};
use super::find::CaseFolder;
use super::recording::Recording;
use super::run_case::run_case;
use anyhow::Result;
use gridweave_runtime::engine::Observer;
use gridweave_runtime::stage::Registry;

/// Result of a case.
#[derive(Debug)]
pub(super) struct CaseOutcome {
    /// `KIND/CASE`.
    pub(super) name: String,
    pub(super) status: CaseStatus,
    /// Why the case fails, besides the differences.
    pub(super) problems: Vec<String>,
    /// Differences from the expected log, if there is one that can be read.
    pub(super) comparison: Option<Comparison>,
    /// Files that were written to the folder of differences.
    pub(super) written: Option<Written>,
}

/// The status of a case.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum CaseStatus {
    /// All is as expected.
    Passed,
    /// Something is not as expected.
    Failed,
    /// The expected log was rewritten, for this reason.
    Blessed(String),
}

/// Runs a case and compares its messages with the expected ones, or blesses them.
pub(super) fn check_case(
    folder: &CaseFolder,
    args: &GoldenArgs,
    registry: &Registry,
    observer: &dyn Observer,
) -> CaseOutcome {
    let failed = |error: anyhow::Error| CaseOutcome {
        name: folder.name(),
        status: CaseStatus::Failed,
        problems: vec![format!("{error:#}")],
        comparison: None,
        written: None,
    };
    check(folder, args, registry, observer).unwrap_or_else(failed)
}

fn check(folder: &CaseFolder, args: &GoldenArgs, registry: &Registry, observer: &dyn Observer) -> Result<CaseOutcome> {
    let case = Case::load(folder, registry)?;
    let got = run_case(&case, observer)?;
    let mut problems: Vec<String> =
        case.expects.iter().filter_map(|expect| expect.check(&got, case.float_tolerance).err()).collect();
    let holds = problems.is_empty();
    let CaseVerdict { comparison, wrong } = compare(&case, &got, args.limit);
    let status = match wrong {
        None if holds => CaseStatus::Passed,
        None => CaseStatus::Failed,
        Some(wrong) if args.bless && holds => {
            got.write(&case.expected)?;
            CaseStatus::Blessed(wrong.blessing)
        }
        Some(wrong) => {
            if args.bless {
                problems.push("not blessed, since a condition of [[expect]] does not hold".to_owned());
            }
            problems.extend(wrong.problem);
            CaseStatus::Failed
        }
    };
    let differs = comparison.as_ref().is_none_or(|comparison| !comparison.is_empty());
    let written = match status == CaseStatus::Failed && differs {
        true => Some(differences::write(&args.differences, folder, &got, comparison.as_ref())?),
        false => None,
    };
    Ok(CaseOutcome { name: folder.name(), status, problems, comparison, written })
}

/// Result of the comparison with the expected log.
struct CaseVerdict {
    /// Differences, if there is an expected log that can be read.
    comparison: Option<Comparison>,
    /// `None` if nothing differs.
    wrong: Option<Wrong>,
}

/// A mismatch with the expected log.
struct Wrong {
    /// Why the messages cannot be compared; `None` if they differ.
    problem: Option<String>,
    /// Why the expected log is rewritten, if it is.
    blessing: String,
}

fn compare(case: &Case, got: &Recording, limit: usize) -> CaseVerdict {
    let unusable = |problem: String, blessing: String| CaseVerdict {
        comparison: None,
        wrong: Some(Wrong { problem: Some(problem), blessing }),
    };
    if !case.expected.exists() {
        let problem = format!("there is no expected.mcap (--bless writes it); the stage sends {}", count(got));
        return unusable(problem, format!("new, {}", count(got)));
    }
    match Recording::read(&case.expected) {
        Err(error) => unusable(
            format!("expected.mcap cannot be read: {error:#}"),
            format!("the old one could not be read, {}", count(got)),
        ),
        Ok(expected) => {
            let comparison = Comparison::new(&expected, got, case.float_tolerance, limit);
            let wrong = Wrong { problem: None, blessing: comparison.summary() };
            CaseVerdict { wrong: (!comparison.is_empty()).then_some(wrong), comparison: Some(comparison) }
        }
    }
}

/// `3 messages on 1 topic`.
fn count(got: &Recording) -> String {
    let count = |count: usize, what: &str| format!("{count} {what}{}", if count == 1 { "" } else { "s" });
    format!("{} on {}", count(got.messages.len(), "message"), count(got.by_topic().len(), "topic"))
}
