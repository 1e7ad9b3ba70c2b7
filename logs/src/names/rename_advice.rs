//! Advice on `--rename` for maps and scans whose topics do not fit the pattern of the pipeline.

use super::TopicRename;
use crate::robots::{PLACES, is_merger};
use gridweave_runtime::stage::match_robot;
use std::collections::{BTreeMap, BTreeSet};

/// The placeholder for the name of a robot in a topic.
const ROBOT: &str = "{robot}";

/// First parts of topics that name a program, and no robot.
pub(super) const PROGRAMS: [&str; 10] = [
    "cartographer",
    "hdl_graph_slam",
    "map_merge",
    "map_server",
    "merged",
    "move_base",
    "octomap_server",
    "rtabmap",
    "server",
    "slam_toolbox",
];

/// The options `--rename` that put the maps on `topics` under the names of their robots, where `pattern` is the topic
/// that maps are expected on. Empty if two topics fit at least, or if the topics do not show which robots there are.
///
/// Topics that differ in one part are those of several robots: `/fleet/{robot}/map`, `/maps/{robot}`. Topics of one
/// part, such as `/map1`, `/b_map` or `/map` beside `/robot2/map`, are renamed one by one, as are those of robots whose
/// maps have different names: `/husky/slam_toolbox/map` and `/jackal/map`.
pub fn rename_advice<'a>(topics: impl Iterator<Item = &'a str>, pattern: &str) -> Vec<String> {
    let (fitting, others): (BTreeSet<&str>, BTreeSet<&str>) =
        topics.partition(|topic| match_robot(pattern, topic).is_some());
    // A costmap is made of a map, and takes its place only where there is no map at all.
    let (costmaps, others): (Vec<&str>, Vec<&str>) = others.into_iter().partition(|topic| topic.contains("costmap"));
    let others = match others.is_empty() && fitting.is_empty() {
        true => costmaps.into_iter().filter(|topic| topic.ends_with("global_costmap/costmap")).collect(),
        false => others,
    };
    // Where two robots have maps that fit, further grids are not those of robots.
    if fitting.len() > 1 {
        return Vec::new();
    }
    if fitting.is_empty()
        && let Some(template) = common_template(&others, "map")
    {
        return vec![format!("--rename '{template}={pattern}'")];
    }
    let mut robots: BTreeSet<String> =
        fitting.iter().filter_map(|topic| match_robot(pattern, topic)).map(str::to_owned).collect();
    let (single, longer): (Vec<&str>, Vec<&str>) =
        others.into_iter().partition(|topic| topic.matches('/').count() == 1);
    // One map alone is that of the only robot: there is no other to distinguish it from.
    if robots.len() + single.len() < 2 {
        return advice_by_robot(&fitting, &longer, pattern);
    }
    let mut advice = Vec::new();
    // Beside the maps of two robots that name them, one that names none is a map that they share.
    let (named, nameless): (Vec<&str>, Vec<&str>) = single.into_iter().partition(|topic| *topic != "/map");
    let is_shared = robots.len() + named.len() > 1;
    for topic in named.into_iter().chain(nameless.into_iter().filter(|_| !is_shared)) {
        let Some(robot) = robot_of_part(topic, &robots).filter(|_| !is_merger(topic)) else { continue };
        let renamed = pattern.replace(ROBOT, &robot);
        // Only a valid value of the option is advised.
        if format!("{topic}={renamed}").parse::<TopicRename>().is_ok() {
            advice.push(format!("--rename '{topic}={renamed}'"));
            robots.insert(robot);
        }
    }
    advice
}

/// The options for topics whose robots are named by the first part in which they differ, one for each robot beside
/// those whose topics are `fitting`. Empty if there are not two robots.
fn advice_by_robot(fitting: &BTreeSet<&str>, longer: &[&str], pattern: &str) -> Vec<String> {
    let parts = |topic: &str| topic.split('/').map(str::to_owned).collect::<Vec<_>>();
    let last = |topic: &str| topic.rsplit('/').next().unwrap_or_default().to_owned();
    let is_map = |topic: &&&str| last(topic) == "map" || last(topic).ends_with("_map");
    let maps: Vec<&str> = longer.iter().filter(is_map).copied().collect();
    let all: Vec<Vec<String>> = fitting.iter().chain(&maps).map(|topic| parts(topic)).collect();
    let Some(first) = all.first() else { return Vec::new() };
    let common = (0..first.len()).take_while(|place| all.iter().all(|parts| parts.get(*place) == first.get(*place)));
    let place = common.count();
    let robot = |topic: &str| {
        let parts = parts(topic);
        // The last part names what the topic carries.
        parts.get(place).filter(|_| place + 1 < parts.len()).cloned()
    };
    let known: BTreeSet<String> =
        fitting.iter().filter_map(|topic| match_robot(pattern, topic)).map(str::to_owned).collect();
    let mut topic_of: BTreeMap<String, &str> = BTreeMap::new();
    for topic in maps {
        let Some(robot) = robot(topic).filter(|robot| !known.contains(robot)) else { continue };
        if PROGRAMS.contains(&&*robot) || PLACES.contains(&&*robot) {
            continue;
        }
        let chosen = topic_of.entry(robot).or_insert(topic);
        if last(topic) == "map" && last(chosen) != "map" {
            *chosen = topic;
        }
    }
    if known.len() + topic_of.len() < 2 {
        return Vec::new();
    }
    let options = topic_of.into_iter().map(|(robot, topic)| format!("{topic}={}", pattern.replace(ROBOT, &robot)));
    // What the option takes is the only thing that is advised.
    options
        .filter(|option| option.parse::<TopicRename>().is_ok())
        .map(|option| format!("--rename '{option}'"))
        .collect()
}

/// The option `--rename` that puts the scans on `topics` under the names of their robots, where `pattern` is the topic
/// that scans are expected on; `None` if a topic fits, or if the topics do not show which robots there are. Point clouds
/// that SLAM has put into its map are no scans.
pub fn scan_rename_advice<'a>(topics: impl Iterator<Item = &'a str>, pattern: &str) -> Option<String> {
    let in_map = |topic: &str| {
        let name = topic.rsplit('/').next().unwrap_or(topic);
        ["map", "registered", "aggregated", "assembled"].iter().any(|word| name.contains(word))
    };
    let topics: BTreeSet<&str> = topics.filter(|topic| !in_map(topic)).collect();
    if topics.iter().any(|topic| match_robot(pattern, topic).is_some()) {
        return None;
    }
    let template = common_template(&topics.into_iter().collect::<Vec<_>>(), "scan")?;
    Some(format!("--rename '{template}={pattern}'"))
}

/// The template with one part for the robot that most topics fit, two at the least. What is sought is called `what`.
fn common_template(topics: &[&str], what: &str) -> Option<String> {
    let mut templates: BTreeMap<String, usize> = BTreeMap::new();
    for topic in topics {
        let parts: Vec<&str> = topic.split('/').collect();
        // The last part names what the topic carries, but for `/maps/robot1`; the first is empty.
        let names_robot =
            parts.len().checked_sub(2).is_some_and(|place| [what, &format!("{what}s")].contains(&parts[place]));
        for varying in 1..parts.len() - usize::from(!names_robot) {
            // The lidars of one robot are no robots.
            if parts.get(varying).is_some_and(|part| PLACES.contains(part)) {
                continue;
            }
            let mut template = parts.clone();
            template[varying] = ROBOT;
            *templates.entry(template.join("/")).or_default() += 1;
        }
    }
    let preference = |template: &str| {
        let last = template.rsplit('/').next().unwrap_or_default();
        (last == what, last.ends_with(&format!("_{what}")))
    };
    let several = templates.into_iter().filter(|(_, count)| *count > 1);
    // Of equals the first by name.
    let best = several.rev().max_by_key(|(template, count)| (*count, preference(template)));
    best.map(|(template, _)| template)
}

/// The name of the robot whose map is on a topic of one part: what is left of it without the word `map`; `robot1` and
/// so on where nothing is left.
fn robot_of_part(topic: &str, taken: &BTreeSet<String>) -> Option<String> {
    let part = topic.strip_prefix('/')?;
    let is_separator = |letter: char| letter == '_' || letter == '-';
    let rest = part.strip_suffix("map").or_else(|| part.strip_prefix("map"))?.trim_matches(is_separator);
    let is_number = !rest.is_empty() && rest.chars().all(|letter| letter.is_ascii_digit());
    let name = if is_number { format!("robot{rest}") } else { rest.to_owned() };
    let free = || (1..).map(|number| format!("robot{number}")).find(|name| !taken.contains(name));
    if name.is_empty() { free() } else { Some(name).filter(|name| !taken.contains(name)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn advice(topics: &[&str]) -> Vec<String> {
        rename_advice(topics.iter().copied(), "/{robot}/map")
    }

    #[test]
    fn topics_that_differ_in_one_part_have_one_option() {
        for (topics, template) in [
            (&["/robot1/slam_toolbox/map", "/robot2/slam_toolbox/map"][..], "/{robot}/slam_toolbox/map"),
            (&["/fleet/a/map", "/fleet/b/map", "/fleet/c/map"], "/fleet/{robot}/map"),
            (
                &[
                    "/r1/rtabmap/grid_map",
                    "/r1/rtabmap/octomap_grid",
                    "/r2/rtabmap/grid_map",
                    "/r2/rtabmap/octomap_grid",
                ],
                "/{robot}/rtabmap/grid_map",
            ),
            (&["/x/a/map", "/x/a/global_costmap", "/x/b/map", "/x/b/global_costmap"], "/x/{robot}/map"),
            (&["/maps/a", "/maps/b"], "/maps/{robot}"),
            (&["/map/robot1", "/map/robot2", "/map/robot3"], "/map/{robot}"),
            (
                &["/a/global_costmap/costmap", "/b/global_costmap/costmap", "/a/local_costmap/costmap"],
                "/{robot}/global_costmap/costmap",
            ),
        ] {
            assert_eq!(advice(topics), [format!("--rename '{template}=/{{robot}}/map'")]);
        }
    }

    #[test]
    fn topics_of_one_part_are_renamed_one_by_one() {
        let renamed = |pairs: &[(&str, &str)]| -> Vec<String> {
            pairs.iter().map(|(topic, robot)| format!("--rename '{topic}=/{robot}/map'")).collect()
        };
        assert_eq!(advice(&["/map1", "/map2"]), renamed(&[("/map1", "robot1"), ("/map2", "robot2")]));
        assert_eq!(advice(&["/a_map", "/b_map"]), renamed(&[("/a_map", "a"), ("/b_map", "b")]));
        assert_eq!(advice(&["/map", "/robot2/map"]), renamed(&[("/map", "robot1")]));
        assert_eq!(advice(&["/map", "/robot1/map"]), renamed(&[("/map", "robot2")]));
        // A map that two robots share is not one of theirs.
        let named = [("/a_map", "a"), ("/b_map", "b")];
        assert_eq!(advice(&["/map", "/a_map", "/b_map"]), renamed(&named));
    }

    #[test]
    fn robots_whose_maps_have_different_names_are_renamed_one_by_one() {
        assert_eq!(advice(&["/robot1/map", "/robot2/slam/map"]), ["--rename '/robot2/slam/map=/robot2/map'"]);
        let two = ["--rename '/husky/slam_toolbox/map=/husky/map'", "--rename '/jackal/rtabmap/grid_map=/jackal/map'"];
        assert_eq!(advice(&["/husky/slam_toolbox/map", "/jackal/rtabmap/grid_map"]), two);
        let two = ["--rename '/fleet/a/robot1/map=/a/map'", "--rename '/fleet/b/robot2/map=/b/map'"];
        assert_eq!(advice(&["/fleet/a/robot1/map", "/fleet/b/robot2/map"]), two);
        // A further map of one robot, and that of a program.
        assert_eq!(advice(&["/robot1/map", "/robot1/slam/map", "/rtabmap/x/grid_map"]), Vec::<String>::new());
    }

    #[test]
    fn scans_of_several_robots_have_one_option() {
        let advice = |topics: &[&str]| scan_rename_advice(topics.iter().copied(), "/{robot}/scan");
        for (topics, template) in [
            (&["/robot1/front/scan", "/robot2/front/scan"][..], "/{robot}/front/scan"),
            (&["/r1/front/scan", "/r1/rear/scan", "/r2/front/scan", "/r2/rear/scan"], "/{robot}/front/scan"),
            (&["/robot1/scan_raw", "/robot2/scan_raw"], "/{robot}/scan_raw"),
            (&["/robot1/base_scan", "/robot2/base_scan"], "/{robot}/base_scan"),
            (&["/robot1/scan_echoes", "/robot2/scan_echoes"], "/{robot}/scan_echoes"),
            (&["/fleet/a/scan", "/fleet/b/scan"], "/fleet/{robot}/scan"),
        ] {
            assert_eq!(advice(topics).unwrap(), format!("--rename '{template}=/{{robot}}/scan'"));
        }
        for topics in
            [&["/a/scan", "/b/front/scan", "/c/front/scan"][..], &["/r/front/scan", "/r/rear/scan"], &["/scan"], &[]]
        {
            assert_eq!(advice(topics), None, "{topics:?}");
        }
    }

    #[test]
    fn nothing_is_advised_where_topics_fit_or_show_no_robots() {
        for topics in [
            &["/a/map", "/b/map"][..],
            &["/a/map", "/b/map", "/map"],
            &["/a/map", "/b/map", "/a/local/map", "/b/local/map"],
            &["/map"],
            &["/grid"],
            &["/x/y", "/z/w"],
            &["/global_costmap", "/a/map"],
            &["/merged_map", "/a/map"],
            &["/map_merged", "/a/map"],
            &[],
        ] {
            assert_eq!(advice(topics), Vec::<String>::new(), "{topics:?}");
        }
    }
}
