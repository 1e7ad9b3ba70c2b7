//! Messages of types that only their log defines: the text of the definition, and the message.

use super::input::Input;
use super::target::Target;
use gridweave_logs::dynamic::{FieldPath, JsonOptions, Schema, compare};
use gridweave_logs::schemas::{schema_names, schema_text};
use std::fs;
use std::path::Path;

const DEFINITION: &str = "type.msg";
const MESSAGE: &str = "message.cdr";
const PATH: &str = "path.txt";

/// A type with all that a definition may hold, and which is its own, small, world.
const MIXED: &str = "# all kinds\nint32 A=1\nstring<=10[<=5] names\nbool[3] flags\nuint16[] numbers\nOther[] others\n\
    a/Empty nothing\nfloat64 x 1.5\nwstring[] wide\n\
    ================================================================================\nMSG: a/Other\nfloat32 y\nchar c\n\
    ================================================================================\nMSG: a/Empty\n";

#[test]
fn every_definition_and_message_is_read_or_refused() {
    let zeros = [&[0, 1, 0, 0][..], &[0; 400]].concat();
    let ones = [&[0, 1, 0, 0][..], &[1, 0, 0, 0].repeat(40)].concat();
    let path = b"others[0].y".to_vec();
    let mut seeds = vec![Input(vec![MIXED.into(), zeros.clone(), path.clone()])];
    for name in schema_names() {
        let text = schema_text(&name).unwrap();
        seeds.push(Input(vec![text.clone().into(), zeros.clone(), b"header.frame_id".to_vec()]));
        seeds.push(Input(vec![text.into(), ones.clone(), path.clone()]));
    }
    Target {
        name: "definitions",
        files: &[DEFINITION, MESSAGE, PATH],
        seeds,
        words: &[
            "\n",
            "[]",
            "[4294967295]",
            "[18446744073709551615]",
            "[<=3]",
            "a/Type",
            "Type[] ",
            "Other[1000000] o\n",
            "================================================================================\nMSG: a/Type\n",
            "Type",
            "Header",
            "geometry_msgs/Point[] ",
            "bool b\n",
            "string s\n",
            "float64[100] f\n",
            "=",
            "#",
            "\"",
        ],
        cases: 10_000,
        read,
    }
    .check();
}

fn read(folder: &Path) {
    let text = |name| String::from_utf8_lossy(&fs::read(folder.join(name)).unwrap()).into_owned();
    let bytes = fs::read(folder.join(MESSAGE)).unwrap();
    let path = text(PATH).parse::<FieldPath>();
    let schema = match Schema::parse("a/msg/Type", &text(DEFINITION)) {
        Ok(schema) => schema,
        Err(error) => return drop(error.to_string()),
    };
    match schema.decode(&bytes) {
        Ok(value) => {
            assert!(compare(&value, &value, 0.0, 3).is_empty(), "a message differs from itself");
            drop(value.to_json(JsonOptions { longest_array: Some(16) }).to_string());
            let _ =
                path.map(|path| value.find(&path).map(|found| found.to_string()).map_err(|error| error.to_string()));
        }
        Err(error) => drop(error.to_string()),
    }
}
