//! Serialization of a pipeline as a file that does not depend on defaults, overrides or the order of inputs.

use super::live::Keyword;
use super::{DEFAULT_SAME_TIME_LIMIT, Mode, Pipeline};
use crate::stage::{InitialPose, InitialPoses, RobotTopics, TagFields};
use toml::{Table, Value};

impl Pipeline {
    /// The text of a pipeline file that loads as the same pipeline without any overrides: for passing it to another
    /// process, or storing it with the results.
    pub fn to_toml(&self) -> String {
        let seed = i64::try_from(self.seed).map_or_else(|_| Value::from(self.seed.to_string()), Value::from);
        let mut pipeline = Table::from_iter([
            ("name".to_owned(), Value::from(self.name.as_str())),
            ("mode".into(), self.mode.keyword().into()),
            ("seed".into(), seed),
            ("batch".into(), self.batch.into()),
            ("stall_timeout".into(), self.stall_timeout.map_or(0.0, |timeout| timeout.as_secs_f64()).into()),
        ]);
        if let Some(limit) = self.memory_limit {
            pipeline.insert("memory_limit".into(), Value::Integer(i64::try_from(limit).unwrap_or(i64::MAX)));
        }
        // It changes no results, so outputs do not mention the default.
        if self.same_time_limit != DEFAULT_SAME_TIME_LIMIT {
            let limit = i64::try_from(self.same_time_limit).unwrap_or(i64::MAX);
            pipeline.insert("same_time_limit".into(), limit.into());
        }
        if let Some(reference) = &self.reference {
            pipeline.insert("reference".into(), reference.as_str().into());
        }
        let stages =
            (0..self.stages.len()).map(|index| (self.stages[index].name.clone(), self.stage_table(index).into()));
        let file: [(String, Value); 3] = [
            ("pipeline".into(), pipeline.into()),
            ("robots".into(), robots_table(&self.robots, &self.initial_poses).into()),
            ("stages".into(), Table::from_iter(stages).into()),
        ];
        Table::from_iter(file).to_string()
    }

    fn stage_table(&self, index: usize) -> Table {
        let stage = &self.stages[index];
        let mut table = stage.parameters.clone();
        table.insert("kind".into(), stage.kind.name.into());
        table.insert("depth".into(), Value::Integer(i64::try_from(stage.depth).unwrap_or(i64::MAX)));
        table.insert("process".into(), stage.process.as_str().into());
        if self.mode == Mode::Live {
            table.insert("restart".into(), stage.restart.keyword().into());
            let overflow = stage.kind.outputs.iter().zip(&stage.overflow);
            let overflow = Table::from_iter(overflow.map(|(port, it)| (port.name.to_owned(), it.keyword().into())));
            table.insert("overflow".into(), overflow.into());
        }
        let mut inputs = Table::new();
        for wire in &stage.inputs {
            let from = &self.stages[wire.from_stage];
            let output = format!("{}.{}", from.name, from.kind.outputs[wire.from_port].name);
            let port = inputs.entry(stage.kind.inputs[wire.port].name).or_insert_with(|| Value::Array(Vec::new()));
            if let Value::Array(outputs) = port {
                outputs.push(output.into());
            }
        }
        if !inputs.is_empty() {
            table.insert("inputs".into(), inputs.into());
        }
        let topics = stage.kind.outputs.iter().zip(&stage.topics);
        let topics = Table::from_iter(topics.map(|(port, topic)| (port.name.to_owned(), topic.as_str().into())));
        if !topics.is_empty() {
            table.insert("topics".into(), topics.into());
        }
        table
    }
}

fn robots_table(robots: &RobotTopics, initial_poses: &InitialPoses) -> Table {
    let RobotTopics { map, pose, tags, tag_fields, topology, scan, tf } = robots;
    let topics = [("map", map), ("pose", pose), ("tags", tags), ("topology", topology), ("scan", scan)];
    let mut table = Table::from_iter(topics.map(|(key, topic)| (key.to_owned(), topic.as_str().into())));
    if let Some(tf) = tf {
        let frames = [("map_frame", &tf.map_frame), ("base_frame", &tf.base_frame)];
        let frames = Table::from_iter(frames.map(|(key, frame)| (key.to_owned(), frame.as_str().into())));
        table.insert("tf".into(), frames.into());
    }
    if let Some(fields) = tag_fields {
        table.insert("tags".into(), tag_fields_table(tags, fields).into());
    }
    for (robot, initial) in initial_poses.iter().filter(|(_, initial)| **initial != InitialPose::ORIGIN) {
        let values = InitialPose::FIELDS.into_iter().zip(initial.values());
        let initial = Table::from_iter(values.map(|(key, value)| (key.to_owned(), value.into())));
        table.insert(robot.clone(), Table::from_iter([("initial".to_owned(), initial.into())]).into());
    }
    table
}

fn tag_fields_table(topic: &str, fields: &TagFields) -> Table {
    let TagFields { each, id_field, range_field, range_unit, rssi_field, path_loss, stddev_field, stddev, .. } = fields;
    let TagFields { pose_field, bearing_field, bearing_unit, bearing_stddev_field, bearing_stddev, .. } = fields;
    let texts = [
        ("topic", Some(topic)),
        ("each", each.as_deref()),
        ("id_field", Some(id_field.as_str())),
        ("range_field", range_field.as_deref()),
        ("rssi_field", rssi_field.as_deref()),
        ("stddev_field", stddev_field.as_deref()),
        ("pose_field", pose_field.as_deref()),
        ("bearing_field", bearing_field.as_deref()),
        ("bearing_stddev_field", bearing_stddev_field.as_deref()),
    ];
    let numbers = [
        ("range_unit", *range_unit),
        ("stddev", *stddev),
        ("bearing_unit", *bearing_unit),
        ("bearing_stddev", *bearing_stddev),
        ("rssi_at_1m", path_loss.map(|model| model.rssi_at_1m)),
        ("path_loss_exponent", path_loss.map(|model| model.exponent)),
        ("rssi_stddev", path_loss.map(|model| model.stddev)),
    ];
    let texts = texts.into_iter().filter_map(|(key, text)| Some((key.to_owned(), text?.into())));
    let numbers = numbers.into_iter().filter_map(|(key, number)| Some((key.to_owned(), number?.into())));
    Table::from_iter(texts.chain(numbers))
}
