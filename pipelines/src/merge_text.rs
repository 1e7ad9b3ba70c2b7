//! The result of a merge as text.

use crate::table::Table;
use crate::text_wrapping::{wrap, wrap_up_to};
use gridweave_logs::summary::{DeformationSummary, Frame, Summary};
use std::collections::BTreeMap;
use std::fmt::Write;

/// Maximum number of lines of the reason for a pair; `--explain` prints all.
const REASON_LINES: usize = 3;

/// A name without line ends, with which it could pass for a line of the text.
fn in_one_line(name: &str) -> String {
    name.replace('\n', "\\u000a").replace('\r', "\\u000d")
}

/// Writes the poses of the maps, the robots that are not merged with reasons, and the decision on each pair, in lines
/// of at most `width` columns.
pub(crate) fn write_merge(out: &mut String, merge: &Summary, width: Option<usize>) -> std::fmt::Result {
    if let Some(reference) = merge.reference.as_deref().map(in_one_line) {
        let merged = merge.frames.len();
        match (merged, merged + merge.unmerged.len()) {
            (_, 1) => writeln!(out, "only {reference} has a map: there is nothing to merge it with")?,
            (1, 2) => writeln!(out, "the other robot could not be merged with {reference}")?,
            (1, all) => writeln!(out, "none of the other {} robots could be merged with {reference}", all - 1)?,
            (_, all) => writeln!(out, "merged {merged} of {all} robots; map frames in the frame of {reference}:")?,
        }
        out.push_str(&frames_table(&merge.frames).fit(width));
        if !merge.deformations.is_empty() {
            let head = "deformation of bent maps, and sharpness of walls that several maps show (before and after):";
            writeln!(out, "{}", wrap(head, 2, width))?;
            out.push_str(&deformations_table(&merge.deformations).fit(width));
        }
    }
    for (robot, reason) in &merge.unmerged {
        match short(reason) {
            line if !line.contains('\n') => {
                writeln!(out, "{}", wrap(&format!("not merged: {}: {line}", in_one_line(robot)), 2, width))?
            }
            lines => {
                writeln!(out, "not merged: {}:", in_one_line(robot))?;
                lines.lines().try_for_each(|line| writeln!(out, "{}", wrap(&format!("  {line}"), 4, width)))?;
            }
        }
    }
    for group in &merge.groups {
        let (count, reference) = (group.frames.len(), in_one_line(&group.reference));
        writeln!(out, "{count} of these are merged with each other; map frames in the frame of {reference}:")?;
        out.push_str(&frames_table(&group.frames).fit(width));
    }
    if merge.alignments.is_empty() {
        return Ok(());
    }
    let mut table = Table::new(["pair", "accepted", "score", "method"]);
    for pair in &merge.alignments {
        let accepted = if pair.accepted { "yes" } else { "no" };
        let names = format!("{} {}", pair.a, pair.b);
        table.row([names, accepted.into(), format!("{:.3}", pair.score), pair.method.clone()]);
    }
    let rows = table.fit_rows(width);
    let mut rows = rows.iter();
    write!(out, "\n{}", rows.next().map_or("", String::as_str))?;
    for (row, pair) in rows.zip(&merge.alignments) {
        write!(out, "{row}")?;
        if let Some(headline) = pair.reason.lines().next() {
            writeln!(out, "{}", wrap_up_to(&format!("    {headline}"), 4, width, REASON_LINES))?;
        }
    }
    Ok(())
}

/// Writes the full reasons for each pair of a robot, in lines of at most `width` columns.
pub(crate) fn write_explanation(
    out: &mut String,
    merge: &Summary,
    robot: &str,
    width: Option<usize>,
) -> std::fmt::Result {
    let pairs: Vec<_> = merge.alignments.iter().filter(|pair| pair.a == robot || pair.b == robot).collect();
    if let Some(reason) = merge.unmerged.get(robot).filter(|_| pairs.is_empty()) {
        writeln!(out)?;
        let text = format!("{robot} is not merged: {reason}");
        text.lines().try_for_each(|line| writeln!(out, "{}", wrap(line, 2, width)))?;
    }
    for pair in pairs {
        let outcome = if pair.accepted { "accepted" } else { "refused" };
        let head = format!("{} and {}, {outcome} with {:.3} by {}:", pair.a, pair.b, pair.score, pair.method);
        writeln!(out, "\n{}", wrap(&head, 4, width))?;
        pair.reason.lines().try_for_each(|line| writeln!(out, "{}", wrap(&format!("  {line}"), 4, width)))?;
    }
    Ok(())
}

/// The first paragraph of a reason, which is shown without `--explain`.
pub(crate) fn short(reason: &str) -> &str {
    reason.split("\n\n").next().unwrap_or(reason).trim_end()
}

/// The variance of the position of a map where it is surest, square metres: at the point that its uncertain turn leaves
/// where it is, in the area that the maps have in common. The origin of the frame may be far away, as that of UTM, where a
/// turn moves it by kilometres.
fn position_variance(covariance: &[f64; 9]) -> f64 {
    let [xx, _, x_yaw, _, yy, y_yaw, _, _, yaw] = *covariance;
    let by_turn = if yaw > 0.0 { (x_yaw * x_yaw + y_yaw * y_yaw) / yaw } else { 0.0 };
    (xx + yy - by_turn).max(0.0)
}

/// Makes the table of map frames with their standard deviations.
fn frames_table(frames: &BTreeMap<String, Frame>) -> Table {
    let mut table = Table::new(["robot", "x m", "y m", "yaw deg", "std m", "std deg"]);
    for (robot, Frame { x, y, yaw, covariance }) in frames {
        let std_position = position_variance(covariance).sqrt();
        let std_yaw = covariance[8].max(0.0).sqrt().to_degrees();
        let numbers = [*x, *y, yaw.to_degrees(), std_position, std_yaw];
        table.row(std::iter::once(robot.clone()).chain(numbers.map(|number| format!("{number:.3}"))));
    }
    table
}

/// Makes the table of the largest displacement and rotation of each map, its size, and the thickness spread and share
/// of double walls before and after.
fn deformations_table(deformations: &BTreeMap<String, DeformationSummary>) -> Table {
    let mut table = Table::new(["robot", "max m", "max deg", "size m", "wall spread m", "double walls"]);
    for (robot, deformation) in deformations {
        let (before, after) = (&deformation.sharpness_rigid, &deformation.sharpness);
        table.row([
            robot.clone(),
            format!("{:.3}", deformation.largest_m),
            format!("{:.2}", deformation.largest_deg),
            format!("{:.0}", deformation.over_m),
            format!("{:.3}, {:.3}", before.apart_m, after.apart_m),
            format!("{:.0} %, {:.0} %", 100.0 * before.doubled, 100.0 * after.doubled),
        ]);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn text(merge: serde_json::Value) -> String {
        let mut text = String::new();
        write_merge(&mut text, &serde_json::from_value(merge).unwrap(), None).unwrap();
        text
    }

    #[test]
    fn a_name_with_a_line_end_forges_no_line() {
        let reference = Some("a\nmerged 9 of 9 robots".to_owned());
        let mut text = String::new();
        write_merge(&mut text, &Summary { reference, ..Summary::default() }, None).unwrap();
        assert!(text.contains("a\\u000amerged 9") && text.lines().all(|line| !line.starts_with("merged 9")), "{text}");
    }

    #[test]
    fn robots_merged_only_with_each_other_are_shown_in_their_own_frame() {
        let frame = |x: f64| json!({"x": x, "y": 0.0, "yaw": 0.5, "covariance": vec![0.01; 9]});
        let merge = json!({
            "reference": "robot1",
            "frames": {"robot1": frame(0.0)},
            "unmerged": {"robot2": "it is tied to robot3 only", "robot3": "it is tied to robot2 only"},
            "groups": [{"reference": "robot2", "frames": {"robot2": frame(0.0), "robot3": frame(4.25)}}],
        });
        let text = text(merge);
        let lines: Vec<&str> = text.lines().collect();
        let start = lines.iter().position(|line| line.starts_with("2 of these")).unwrap();
        assert_eq!(lines[start], "2 of these are merged with each other; map frames in the frame of robot2:");
        assert!(lines[start - 1].starts_with("not merged: robot3"), "{text}");
        assert!(lines[start + 3].contains("robot3") && lines[start + 3].contains("4.250"), "{text}");
    }

    #[test]
    fn no_line_is_wider_than_the_terminal_and_a_long_reason_is_cut() {
        let reason = "walls of one map are on free space of the other ".repeat(9);
        let pair = json!({
            "a": "robot1", "b": "robot2", "method": "tags+directions+icp; maps+maps+icp+walls", "x": 0.0, "y": 0.0, "yaw": 0.0,
            "score": 0.25, "accepted": false, "checked": false, "reason": reason,
        });
        let merge = json!({
            "reference": "robot1",
            "frames": {"robot1": {"x": 0.0, "y": 0.0, "yaw": 0.0}},
            "unmerged": {"robot2": reason, "robot3": format!("no alignment with robot1:\n{reason}")},
            "alignments": [pair],
        });
        let merge: Summary = serde_json::from_value(merge).unwrap();
        for width in [60, 80] {
            let (mut text, mut explained) = (String::new(), String::new());
            write_merge(&mut text, &merge, Some(width)).unwrap();
            write_explanation(&mut explained, &merge, "robot2", Some(width)).unwrap();
            let lines = || text.lines().chain(explained.lines());
            assert!(lines().all(|line| line.chars().count() <= width), "{text}{explained}");
            assert!(text.trim_end().ends_with("..."), "{text}");
            assert_eq!(explained.matches("free").count(), 9, "{explained}");
        }
    }

    #[test]
    fn deformations_are_shown_with_their_effect_on_walls() {
        let sharpness = |apart_m: f64, doubled: f64| json!({"apart_m": apart_m, "doubled": doubled});
        let deformation = json!({
            "largest_m": 0.25, "largest_deg": 1.5, "over_m": 40.0, "wall_matched_m": 90.0, "spacing": 3.0, "nodes": [],
            "sharpness_rigid": sharpness(0.12, 0.4), "sharpness": sharpness(0.02, 0.01),
        });
        let frame = json!({"x": 0.0, "y": 0.0, "yaw": 0.0});
        let text = text(json!({"reference": "robot1", "frames": {"robot1": frame}, "bends": {"robot1": deformation}}));
        let line = text.lines().find(|line| line.contains("0.250")).unwrap();
        for part in ["robot1", "1.50", "40", "0.120, 0.020", "40 %, 1 %"] {
            assert!(line.contains(part), "{text}");
        }
    }

    #[test]
    fn a_reason_is_shown_to_the_empty_line_and_explained_in_full() {
        let reason = "the maps fit at 2 places\ntry: one tag\n\nthe whole of it";
        let merge = json!({
            "reference": "robot1",
            "frames": {"robot1": {"x": 0.0, "y": 0.0, "yaw": 0.0}},
            "unmerged": {"robot2": format!("no alignment with robot1:\n{reason}")},
            "alignments": [{
                "a": "robot1", "b": "robot2", "method": "maps", "x": 0.0, "y": 0.0, "yaw": 0.0,
                "score": 0.25, "accepted": false, "checked": false, "reason": reason,
            }],
        });
        let shown = text(merge.clone());
        assert!(shown.contains(
            "not merged: robot2:\n  no alignment with robot1:\n  the maps fit at 2 places\n  try: one tag\n"
        ));
        assert!(shown.contains("  robot1 robot2  no        0.250  maps\n    the maps fit at 2 places\n"), "{shown}");
        assert!(!shown.contains("the whole"), "{shown}");
        let mut explained = String::new();
        write_explanation(&mut explained, &serde_json::from_value(merge).unwrap(), "robot2", None).unwrap();
        assert!(explained.contains("robot1 and robot2, refused with 0.250 by maps:\n  the maps fit"), "{explained}");
        assert_eq!(explained.matches("the whole of it").count(), 1);
    }

    #[test]
    fn a_position_is_as_sure_as_where_the_maps_meet_however_far_the_origin_is() {
        // A turn of 0.005 radians about a point that is so far from the origin of the frame.
        let deviation = |x: f64, y: f64| {
            let [turn, position] = [0.005_f64.powi(2), 0.03_f64.powi(2)];
            let [xx, xy, yy] = [position + turn * y * y, -turn * x * y, position + turn * x * x];
            let covariance = [xx, xy, -turn * y, xy, yy, turn * x, -turn * y, turn * x, turn];
            position_variance(&covariance).sqrt()
        };
        for (x, y) in [(0.0, 0.0), (12.0, -5.0), (5e5, 4e6)] {
            assert!((deviation(x, y) - 0.03 * 2_f64.sqrt()).abs() < 1e-4, "{}", deviation(x, y));
        }
        assert_eq!(position_variance(&[0.0; 9]), 0.0);
    }
}
