//! Decoding by schema: valid messages, errors, and damaged bytes.

use super::*;
use crate::schemas::{schema_names, schema_text};
use gridweave_runtime::message::Channel;
use gridweave_runtime::ros::{Header, OccupancyGrid, RosMessage, TagEstimate, TagEstimates, encode};
use proptest::prelude::*;
use serde_json::json;

/// A definition with every construct.
const ALL: &str = "\
# Everything.
int32 LIMIT=5
string NAME = \"a # b\"
bool flag
byte raw 7
char letter
int8 i8
int16 i16
uint16 u16
int64 i64
uint64 u64
float32 f32
string<=10 text \"default\"
bool[2] flags
float64[<=3] few
string[] names
Part[] parts
Nothing nothing
other/Kind[2] kinds
uint8 last
================================================================================
MSG: mine/Part
uint16 a   # two bytes
float64 b
================================================================================
MSG: mine/Nothing
uint8 ONLY=1
================================================================================
MSG: other/msg/Kind
uint32[] numbers
";

/// Writes CDR in either byte order.
struct Writer {
    bytes: Vec<u8>,
    big: bool,
}

impl Writer {
    fn new(big: bool) -> Self {
        Self { bytes: vec![0, u8::from(!big), 0, 0], big }
    }

    fn put<const N: usize>(&mut self, little_endian: [u8; N]) -> &mut Self {
        while !(self.bytes.len() - 4).is_multiple_of(N) {
            self.bytes.push(0);
        }
        let mut bytes = little_endian;
        if self.big {
            bytes.reverse();
        }
        self.bytes.extend(bytes);
        self
    }

    fn text(&mut self, text: &str) -> &mut Self {
        self.put((text.len() as u32 + 1).to_le_bytes());
        self.bytes.extend(text.as_bytes());
        self.bytes.push(0);
        self
    }
}

fn everything(big: bool) -> Vec<u8> {
    let mut writer = Writer::new(big);
    writer.put([1]).put([7]).put([65]).put((-8i8).to_le_bytes()).put((-1600i16).to_le_bytes());
    writer.put(65_000u16.to_le_bytes()).put(i64::MIN.to_le_bytes()).put(u64::MAX.to_le_bytes());
    writer.put(0.05f32.to_le_bytes()).text("Größe").put([0]).put([1]);
    writer.put(2u32.to_le_bytes()).put(f64::NAN.to_le_bytes()).put(1.5f64.to_le_bytes());
    writer.put(2u32.to_le_bytes()).text("a").text("");
    writer.put(2u32.to_le_bytes());
    for a in [1u16, 2] {
        writer.put(a.to_le_bytes()).put((f64::from(a) / 4.0).to_le_bytes());
    }
    writer.put([9]);
    writer.put(1u32.to_le_bytes()).put(70_000u32.to_le_bytes()).put(0u32.to_le_bytes());
    writer.put([255]);
    writer.bytes
}

fn schema() -> Schema {
    Schema::parse("mine/msg/All", ALL).unwrap()
}

fn estimates() -> TagEstimates {
    let tag = |tag_id: &str| TagEstimate { tag_id: tag_id.into(), x: 1.0, certainty: 0.5, ..Default::default() };
    TagEstimates { header: Header::default(), robot: "robot1".into(), tags: vec![tag("9"), tag("10")] }
}

fn estimates_schema() -> Schema {
    Schema::parse(TagEstimates::NAME, &schema_text(TagEstimates::NAME).unwrap()).unwrap()
}

#[test]
fn every_type_is_read_in_either_byte_order() {
    for big in [false, true] {
        let (schema, bytes) = (schema(), everything(big));
        let json = schema.decode(&bytes).unwrap().to_json(JsonOptions::default());
        let expected = json!({
            "flag": true, "raw": 7, "letter": 65, "i8": -8, "i16": -1600, "u16": 65000,
            "i64": i64::MIN, "u64": u64::MAX, "f32": 0.05, "text": "Größe", "flags": [false, true],
            "few": ["NaN", 1.5], "names": ["a", ""],
            "parts": [{ "a": 1, "b": 0.25 }, { "a": 2, "b": 0.5 }],
            "nothing": {}, "kinds": [{ "numbers": [70000] }, { "numbers": [] }], "last": 255,
        });
        assert_eq!(json, expected);
        let keys: Vec<&String> = json.as_object().unwrap().keys().collect();
        assert_eq!((keys[0].as_str(), keys[9].as_str()), ("flag", "text"), "in the order of the definition");
    }
}

#[test]
fn long_arrays_are_shortened_in_json_if_asked_for() {
    let info = gridweave_runtime::ros::MapMetaData { width: 100, height: 1, ..Default::default() };
    let bytes = encode(&OccupancyGrid { header: Header::default(), info, data: &[255; 100] }).unwrap();
    let schema = Schema::parse(OccupancyGrid::NAME, &schema_text(OccupancyGrid::NAME).unwrap()).unwrap();
    let value = schema.decode(&bytes).unwrap();
    assert!(matches!(value.field("data"), Some(Value::Array(Array::I8(cells))) if cells.len() == 100));
    let json = value.to_json(JsonOptions { longest_array: Some(3) });
    assert_eq!(json["data"], json!([-1, -1, -1, "... 97 more"]));
    assert_eq!(value.to_json(JsonOptions::default())["data"].as_array().unwrap().len(), 100);
}

#[test]
fn a_field_is_found_by_its_path() {
    let (schema, bytes) = (estimates_schema(), encode(&estimates()).unwrap());
    let value = schema.decode(&bytes).unwrap();
    let find = |path: &str| match path.parse::<FieldPath>().and_then(|path| value.find(&path)) {
        Ok(value) => value.to_string(),
        Err(error) => format!("error: {error}"),
    };
    assert_eq!(find("tags[1].tag_id"), "\"10\"");
    assert_eq!(find("tags[0].covariance[3]"), "0.0");
    assert_eq!(find("tags[0].covariance"), "[0.0, 0.0, 0.0, 0.0]");
    assert_eq!(find("tags"), "2 elements");
    for (path, text) in [
        ("tag", "the message has no field `tag`; it has header, robot, tags"),
        ("tags[2].x", "`tags` has 2 elements, and no element 2"),
        ("tags[0].id", "`tags[0]` has no field `id`; it has tag_id"),
        ("robot[0]", "`robot` is not an array"),
        ("robot.x", "`robot` has no field `x`"),
        ("tags.x", "`tags` has no field `x`"),
        ("", "not a field path"),
        ("tags[", "not a field path"),
        ("tags[-1]", "not a field path"),
        ("a..b", "not a field path"),
    ] {
        assert!(find(path).starts_with("error: ") && find(path).contains(text), "{path}: {}", find(path));
    }
}

#[test]
fn values_are_compared_field_by_field() {
    let (schema, bytes) = (estimates_schema(), encode(&estimates()).unwrap());
    let expected = schema.decode(&bytes).unwrap();
    let differences = |change: &dyn Fn(&mut TagEstimates), tolerance| {
        let mut other = estimates();
        change(&mut other);
        let bytes = encode(&other).unwrap();
        let found = compare(&expected, &schema.decode(&bytes).unwrap(), tolerance, 2);
        let text = |d: &Difference| format!("{}: {} / {}", d.path, d.expected, d.got);
        (found.count, found.listed.iter().map(text).collect::<Vec<_>>().join("; "))
    };
    let none = (0, String::new());
    assert_eq!(differences(&|_| {}, 0.0), none);
    assert_eq!(differences(&|new| new.tags[1].x += 1e-10, 1e-9), none);
    assert_eq!(differences(&|new| new.tags[1].x += 1e-8, 1e-9).1, "tags[1].x: 1.0 / 1.00000001");
    assert_eq!(differences(&|new| new.tags[0].readings = 1, 10.0).1, "tags[0].readings: 0 / 1");
    assert_eq!(differences(&|new| new.robot = "r".into(), 0.0).1, "robot: \"robot1\" / \"r\"");
    assert_eq!(differences(&|new| new.tags.truncate(1), 0.0), (1, "tags: 2 elements / 1 element".into()));
    let (count, text) = differences(&|new| new.tags[0].covariance = [1.0; 4], 0.0);
    assert_eq!((count, text.as_str()), (4, "tags[0].covariance[0]: 0.0 / 1.0; tags[0].covariance[1]: 0.0 / 1.0"));
}

#[test]
fn fields_that_only_one_type_has_differ() {
    let old = Schema::parse("a/A", "int32 x\nint32 y").unwrap();
    let new = Schema::parse("a/A", "int32 x\nfloat32 z").unwrap();
    let bytes = [0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0];
    let found = compare(&old.decode(&bytes).unwrap(), &new.decode(&bytes).unwrap(), 0.0, 9);
    let text: Vec<String> = found.listed.iter().map(|d| format!("{}: {} / {}", d.path, d.expected, d.got)).collect();
    assert_eq!(text, ["y: 0 / no such field", "z: no such field / 0.0"]);
}

#[test]
fn numbers_are_nearly_equal_by_the_greater_of_them_and_one() {
    let (nan, infinity) = (f64::NAN, f64::INFINITY);
    for (a, b) in [(nan, nan), (infinity, infinity), (0.0, 1e-9), (1e9, 1e9 + 0.9), (0.0, -0.0)] {
        assert!(nearly_equal(a, b, 1e-9), "{a} {b}");
    }
    for (a, b) in [(nan, 0.0), (infinity, -infinity), (infinity, 1.0), (0.0, 2e-9), (1e9, 1e9 + 1.1)] {
        assert!(!nearly_equal(a, b, 1e-9), "{a} {b}");
    }
}

#[test]
fn times_need_no_definition() {
    // The Python library mcap-ros2-support writes definitions like this.
    let text = "std_msgs/Header header\n===\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n";
    let full = format!("{text}===\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n");
    let parsed = |text: &str| format!("{:?}", Schema::parse("a/msg/A", text).unwrap());
    assert_eq!(parsed(text), parsed(&full));
    assert!(Schema::parse("a/msg/A", "builtin_interfaces/Duration[] x").is_ok());
}

#[test]
fn a_schema_that_cannot_be_used_gives_a_reason() {
    let of = |text: &str| Schema::parse("a/msg/A", text).unwrap_err().to_string();
    assert_eq!(of("b/B[] x"), "there is no definition of b/B");
    assert_eq!(of("int32 x\nint32"), "the definition of a/A has the invalid line `int32`");
    assert_eq!(of("int32 x\nint8 y\nfloat64 x"), "the definition of a/A has two fields named `x`");
    assert!(of("A[] again").contains("contains itself"), "{}", of("A[] again"));
    let chain: String = (0..1000).map(|n| format!("===\nMSG: a/T{n}\nT{} x\n", n + 1)).collect();
    assert!(of(&format!("T0 x\n{chain}")).contains("nested too deeply"));
    let many: String = (0..10_001).map(|n| format!("int8 a{n}\n")).collect();
    assert!(of(&many).contains("more than 10000 fields"), "{}", of(&many));
    let some: String = many.lines().take(6000).map(|line| format!("{line}\n")).collect();
    assert!(of(&format!("B b\nC c\n===\nMSG: a/B\n{some}===\nMSG: a/C\n{some}")).contains("more than 10000 fields"));
    assert!(Schema::parse("a/msg/A", &some).is_ok());
    let channel = Channel { message_encoding: "ros1".into(), ..Default::default() };
    let error = Schema::of_channel(&channel).unwrap_err().to_string();
    assert_eq!(error, "the message is encoded as `ros1`; only `cdr` is supported");
    let channel = Channel { message_encoding: "cdr".into(), schema_name: "x/msg/X".into(), ..Default::default() };
    assert_eq!(Schema::of_channel(&channel).unwrap_err().to_string(), "there is no definition of x/msg/X");
    let known = Channel { schema_name: TagEstimates::NAME.into(), ..channel };
    assert!(Schema::of_channel(&known).is_ok(), "a built-in type needs no schema in the log");
}

#[test]
fn bytes_that_do_not_match_give_an_error_with_the_field() {
    let schema = Schema::parse("a/A", "b/B[] list\n===\nMSG: b/B\nstring name\nbool ok").unwrap();
    let of = |body: &[u8]| schema.decode(&[&[0, 1, 0, 0], body].concat()).unwrap_err().to_string();
    assert!(
        of(&[9, 0, 0, 0, 1]).contains("the message is too short for 9 elements at `list`"),
        "{}",
        of(&[9, 0, 0, 0])
    );
    assert!(of(&[1, 0, 0, 0, 9, 0, 0, 0, 65]).ends_with("the message ends at `list[0].name`"));
    assert!(of(&[1, 0, 0, 0, 1, 0, 0, 0, 0, 7]).ends_with("the boolean is 7 at `list[0].ok`"));
    assert!(of(&[1, 0, 0, 0, 1, 0, 0, 0, 0xff, 1]).ends_with("the string is not UTF-8 at `list[0].name`"));
    assert!(of(&[0, 0, 0, 0, 1, 2, 3, 4]).contains("4 bytes are left"));
    assert_eq!(schema.decode(&[0, 1, 0]), Err(SchemaMismatch::Encapsulation));
    assert_eq!(schema.decode(&[0, 7, 0, 0, 0]), Err(SchemaMismatch::Encapsulation));
    let wide = Schema::parse("a/A", "wstring s").unwrap();
    assert!(wide.decode(&[0, 1, 0, 0, 0, 0, 0, 0]).unwrap_err().to_string().contains("wstring"));
}

#[test]
fn a_claimed_length_allocates_nothing_that_is_not_there() {
    for text in [
        "int64[] x",
        "string[] x",
        "b/B[] x\n===\nMSG: b/B\nint8 y",
        "int8[4294967295] x",
        "b/B[99999999999] x\n===\nMSG: b/B\nb/C[99999999999] y\n===\nMSG: b/C\nint8 z",
    ] {
        let schema = Schema::parse("a/A", text).unwrap();
        let error = schema.decode(&[0, 1, 0, 0, 255, 255, 255, 255, 1, 2, 3]).unwrap_err();
        assert!(matches!(error, SchemaMismatch::Field { fault: DecodeFault::Count(_), .. }), "{text}: {error}");
    }
}

/// A definition of which a message of `fields` times `fields` values takes one byte for each `fields` of them, or none.
fn fields_without_bytes(fields: usize) -> String {
    let names = |of: &str| (0..fields).map(|number| format!("{of} f{number}\n")).collect::<String>();
    format!("uint32 length\nb/B[] first\n===\nMSG: b/B\n{}", names("int8[0]"))
}

#[test]
fn a_definition_is_limited_by_its_length_whatever_it_holds() {
    let with = |line: &str, lines: usize| Schema::parse("a/msg/A", &format!("int8 x\n{}", line.repeat(lines)));
    assert!(with("# x\n", 100_000).is_ok());
    for line in ["# x\n", "===\nMSG: b/B\n", "int8 A=1\n"] {
        let error = with(line, 1_000_000).unwrap_err();
        assert!(matches!(error, SchemaError::Long { .. }), "{error}");
        assert!(error.to_string().starts_with("the definition of a/msg/A has "), "{error}");
    }
}

#[test]
fn fields_without_bytes_are_limited_by_the_length_of_the_message() {
    let elements =
        |count: u32, rest: usize| [&[0, 1, 0, 0][..], &[0; 4], &count.to_le_bytes(), &vec![0; rest]].concat();
    let schema = Schema::parse("a/A", &fields_without_bytes(1000)).unwrap();
    let is_refused = |bytes: &[u8]| match schema.decode(bytes) {
        Err(SchemaMismatch::Field { fault: DecodeFault::Values(most), .. }) => most <= 8 * bytes.len() + 256,
        _ => false,
    };
    assert!(is_refused(&elements(10_000, 10_000)) && is_refused(&elements(8, 8)));
    // However long the message is.
    let flat = Schema::parse("a/A", "b/B[] x\n===\nMSG: b/B\nint8 y").unwrap();
    let long = |count: u32| [&[0, 1, 0, 0][..], &count.to_le_bytes(), &vec![0; count as usize]].concat();
    assert!(flat.decode(&long(10_000)).is_ok());
    let error = flat.decode(&long(2_000_000)).unwrap_err();
    assert!(matches!(error, SchemaMismatch::Field { fault: DecodeFault::Values(2_097_152), .. }), "{error}");
    // A few of them are read.
    let few = Schema::parse("a/A", &fields_without_bytes(3)).unwrap();
    assert!(few.decode(&elements(3, 3)).is_ok());
}

#[test]
fn a_converted_message_is_limited_by_the_length_of_the_message() {
    let fields: String = (0..500).map(|number| format!("std_msgs/Empty[] f{number}\n")).collect();
    let recoder = Recoder::new(Schema::parse("a/A", &format!("{fields}===\nMSG: std_msgs/Empty\n")).unwrap()).unwrap();
    // In ROS 1, the elements take no bytes, so each field could have as many as there are bytes.
    let message = 1000_u32.to_le_bytes().repeat(500);
    let mut copy = Vec::new();
    let error = recoder.append_ros1(&message, &mut copy).unwrap_err();
    assert!(matches!(error, SchemaMismatch::Field { fault: DecodeFault::Values(_), .. }), "{error}");
    assert!(copy.is_empty());
    let few = [2_u32.to_le_bytes().repeat(500), vec![0; 8]].concat();
    recoder.append_ros1(&few, &mut copy).unwrap();
    assert!(copy.len() > 2 * 500 && copy.len() < 8 * message.len(), "{}", copy.len());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn damaged_bytes_are_an_error_or_a_value_but_no_panic(
        cut in 0usize..200, at in 0usize..200, byte in any::<u8>(), big in any::<bool>(),
    ) {
        let (schema, mut bytes) = (schema(), everything(big));
        let at = at % bytes.len();
        bytes[at] = byte;
        bytes.truncate(cut);
        if let Ok(value) = schema.decode(&bytes) {
            prop_assert!(value.to_json(JsonOptions::default()).is_object());
            prop_assert!(compare(&value, &value, 0.0, 3).is_empty());
        }
    }

    #[test]
    fn any_bytes_under_any_known_schema(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
        for name in schema_names() {
            let schema = Schema::parse(&name, &schema_text(&name).unwrap()).unwrap();
            let bytes = [&[0, 1, 0, 0], bytes.as_slice()].concat();
            if let Ok(value) = schema.decode(&bytes) {
                prop_assert!(compare(&value, &value, 0.0, 3).is_empty());
            }
        }
    }

    #[test]
    fn any_text_is_a_schema_or_an_error(text in "[a-z0-9\\[\\]<=# /:\nMSGint]{0,200}", bytes in proptest::collection::vec(any::<u8>(), 0..64)) {
        if let Ok(schema) = Schema::parse("a/A", &text) {
            let _ = schema.decode(&bytes);
        }
        let _ = text.parse::<FieldPath>();
    }
}
