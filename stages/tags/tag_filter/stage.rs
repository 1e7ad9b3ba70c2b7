//! The stage `tag_filter`.

use super::{RobotTags, TagFilterParameters, TagJudgement, judge};
use crate::shared::robot_pair::RobotPair;
use gridweave_runtime::ros::{CommonTag, CommonTags, Header, TagEstimates};
use gridweave_runtime::stage::{Out, Output, OutputPorts, Outputs, Received, StageError, StageKind};
use std::collections::BTreeMap;

/// The stage kind `tag_filter`.
pub fn kind() -> StageKind {
    StageKind::stage(
        "tag_filter",
        "Finds the tags that two robots have in common (Tsardoulias et al., sections 4 and 4.1.3) and leaves out those \
         that do not agree with the others on one rigid transform. Sends the tags of a pair of robots when they change, \
         with the reason if they do not suffice for a merge.",
        |parameters, _| Ok(TagFilter { parameters, robots: BTreeMap::new(), sent: BTreeMap::new() }),
    )
    .input("estimates", "all tags of one robot", TagFilter::receive_estimates)
    .finish(TagFilter::finish)
    .build()
}

struct TagFilter {
    parameters: TagFilterParameters,
    /// Latest estimates of each robot.
    robots: BTreeMap<String, TagEstimates>,
    /// The judgement sent last for each pair.
    sent: BTreeMap<RobotPair, TagJudgement>,
}

struct Pairs {
    common: Out<CommonTags>,
}

impl Outputs for Pairs {
    fn declare(ports: &mut OutputPorts) -> Self {
        Self { common: ports.output("common", "the common tags of one pair of robots") }
    }
}

impl TagFilter {
    fn receive_estimates(
        &mut self,
        estimates: Received<'_, TagEstimates>,
        output: &Output<Pairs>,
    ) -> Result<(), StageError> {
        // The robot's name in the message counts; a program that fills the header only is accepted as well.
        let robot = if estimates.robot.is_empty() { estimates.robot() } else { &estimates.robot }.to_owned();
        if robot.is_empty() {
            output.warn("tag estimates without a robot are left out");
            return Ok(());
        }
        for _ in estimates.tags.iter().filter(|tag| !super::common::is_usable(tag)) {
            output.warn("tag estimates without an id or with a value that is not finite are left out");
        }
        self.robots.insert(robot.clone(), estimates.into_content());
        let others: Vec<String> = self.robots.keys().filter(|other| **other != robot).cloned().collect();
        for other in others {
            let pair = RobotPair::by_name(&robot, other);
            self.update(pair, self.parameters.min_change, output)?;
        }
        Ok(())
    }

    fn finish(&mut self, output: &Output<Pairs>) -> Result<(), StageError> {
        let pairs: Vec<_> = self.sent.keys().cloned().collect();
        pairs.into_iter().try_for_each(|pair| self.update(pair, 0.0, output))
    }

    /// Judges a pair and sends the result, unless it was sent before and no tag has moved by more than `min_change`
    /// metres since.
    fn update(&mut self, pair: RobotPair, min_change: f64, output: &Output<Pairs>) -> Result<(), StageError> {
        let (Some(a), Some(b)) = (self.robots.get(&pair.a), self.robots.get(&pair.b)) else { return Ok(()) };
        let judgement = judge(
            RobotTags { robot: &pair.a, tags: &a.tags },
            RobotTags { robot: &pair.b, tags: &b.tags },
            &self.parameters,
        );
        if self.sent.get(&pair).is_some_and(|sent| is_same(sent, &judgement, min_change)) {
            return Ok(());
        }
        let message = CommonTags {
            header: Header::new(output.log_time(), a.header.frame_id.clone()),
            robot_a: pair.a.clone(),
            robot_b: pair.b.clone(),
            tags: judgement.tags.clone(),
            accepted: judgement.accepted,
            provisional: judgement.provisional,
            reason: judgement.reason.clone(),
        };
        output.common.send("", &message)?;
        self.sent.insert(pair, judgement);
        Ok(())
    }
}

/// Whether two judgements are equal or, if both are accepted alike, have the same tags within `min_change` metres.
fn is_same(sent: &TagJudgement, judgement: &TagJudgement, min_change: f64) -> bool {
    let near = |one: &[f64; 2], other: &[f64; 2]| (one[0] - other[0]).hypot(one[1] - other[1]) <= min_change;
    let same_tags = sent.tags.len() == judgement.tags.len()
        && sent.tags.iter().all(|one| {
            let same = |other: &&CommonTag| other.tag_id == one.tag_id;
            judgement.tags.iter().find(same).is_some_and(|other| near(&one.a, &other.a) && near(&one.b, &other.b))
        });
    sent == judgement
        || min_change > 0.0
            && sent.accepted
            && judgement.accepted
            && sent.provisional == judgement.provisional
            && same_tags
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_runtime::message::LogTime;
    use gridweave_runtime::ros::TagEstimate;
    use gridweave_runtime::stage::StageHarness;

    struct Bench(StageHarness);

    impl Bench {
        fn new() -> Self {
            Self(StageHarness::new(&kind(), "").unwrap())
        }

        fn send(&mut self, robot: &str, tags: &[TagEstimate]) -> Vec<CommonTags> {
            let estimates = TagEstimates { robot: robot.into(), tags: tags.to_vec(), ..Default::default() };
            self.0.give::<TagEstimates>("estimates", robot, LogTime(1), &estimates).unwrap();
            self.0.take("common").unwrap()
        }
    }

    fn tags() -> Vec<TagEstimate> {
        let places = [(0.0, 0.0), (5.0, 1.0), (9.0, -2.0), (3.0, 7.0)];
        let tag = |(index, (x, y)): (usize, (f64, f64))| TagEstimate {
            tag_id: format!("tag{index}"),
            x,
            y,
            covariance: [4e-4, 0.0, 0.0, 4e-4],
            certainty: 0.95,
            readings: 50,
        };
        places.into_iter().enumerate().map(tag).collect()
    }

    #[test]
    fn every_pair_is_sent_when_it_changes_and_only_then() {
        let mut bench = Bench::new();
        assert_eq!(bench.send("robot2", &tags()).len(), 0);
        let sent = bench.send("robot1", &tags());
        assert_eq!((sent[0].robot_a.as_str(), sent[0].robot_b.as_str(), sent[0].accepted), ("robot1", "robot2", true));
        assert_eq!(bench.send("robot1", &tags()), vec![], "nothing has changed");
        let third = bench.send("robot3", &tags()[..1]);
        let pairs: Vec<_> = third.iter().map(|pair| (pair.robot_a.as_str(), pair.robot_b.as_str())).collect();
        assert_eq!(pairs, [("robot1", "robot3"), ("robot2", "robot3")]);
        assert!(third.iter().all(|pair| !pair.accepted && pair.reason.contains("2 are needed")), "{third:?}");
        assert_eq!(bench.send("robot2", &tags()[..3]).len(), 1, "the other pair is as it was");
    }

    #[test]
    fn a_third_tag_ends_what_two_leave_provisional() {
        let mut bench = Bench::new();
        bench.send("robot1", &tags());
        let provisional =
            |sent: &[CommonTags]| sent.iter().map(|sent| (sent.accepted, sent.provisional)).collect::<Vec<_>>();
        assert_eq!(provisional(&bench.send("robot2", &tags()[..2])), [(true, true)]);
        assert_eq!(provisional(&bench.send("robot2", &tags()[..3])), [(true, false)]);
    }
}
