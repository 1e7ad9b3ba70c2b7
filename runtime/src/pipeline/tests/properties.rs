//! Properties of every file.

use super::*;
use proptest::prelude::*;
use proptest::sample::{Index, select};

/// The valid pipeline, split into its head and its stages.
fn sections() -> (String, Vec<String>) {
    let mut parts = VALID.split("[stages.").map(str::to_owned);
    let head = parts.next().unwrap();
    (head, parts.map(|part| format!("[stages.{part}")).collect())
}

/// A change of a text: a removed part and its replacement.
#[derive(Clone, Debug)]
struct Mutation {
    at: Index,
    length: usize,
    text: String,
}

fn mutation() -> impl Strategy<Value = Mutation> {
    let pieces = [
        "",
        "\"",
        "[",
        "]",
        "{",
        "}",
        "=",
        ".",
        "*",
        "\n",
        "\r\n",
        "-1",
        "1e999",
        "nan",
        "é",
        "\u{1f916}",
        "\u{7}",
        "\t",
        "[stages.a]\n",
        "inputs = [\"log.*\"]\n",
        "{robot}",
        "kind = 3\n",
        "lines",
        "fuse.map",
        "'''",
        "\\",
        "#",
        "depth",
        "[[stages.log]]\n",
        "99999999999999999999",
    ];
    let text = prop_oneof![select(pieces.to_vec()).prop_map(str::to_owned), any::<String>()];
    (any::<Index>(), 0..12_usize, text).prop_map(|(at, length, text)| Mutation { at, length, text })
}

fn apply(text: &str, mutation: &Mutation) -> String {
    let chars: Vec<char> = text.chars().collect();
    let start = mutation.at.index(chars.len() + 1);
    let end = (start + mutation.length).min(chars.len());
    let (before, after) = (&chars[..start], &chars[end..]);
    before.iter().chain(mutation.text.chars().collect::<Vec<_>>().iter()).chain(after).collect()
}

proptest! {
    #[test]
    fn the_order_of_the_stages_in_the_file_changes_nothing(order in Just(sections().1).prop_shuffle()) {
        let text = sections().0 + &order.concat();
        prop_assert_eq!(format!("{:?}", parse(&text).unwrap()), format!("{:?}", parse(VALID).unwrap()));
    }

    #[test]
    fn no_text_causes_a_panic(mutations in prop::collection::vec(mutation(), 1..6)) {
        let text = mutations.iter().fold(VALID.to_owned(), |text, mutation| apply(&text, mutation));
        match parse(&text) {
            Ok(pipeline) => prop_assert!(!pipeline.to_text(100).is_empty()),
            Err(errors) => prop_assert!(errors.count() > 0 && !errors.render(true).is_empty()),
        }
    }

    #[test]
    fn any_text_gives_a_pipeline_or_errors(text in any::<String>(), setting in any::<String>()) {
        let mut overrides = Overrides::default();
        let _ = overrides.set(&setting);
        let _ = overrides.set(&format!("log.files={setting}"));
        overrides.set_for_kind("mcap_source", "files", vec![setting]);
        let errors = Pipeline::parse("any.toml", &text, &registry(), &overrides).map(drop).unwrap_err();
        prop_assert!(!errors.render(false).is_empty());
    }

    #[test]
    fn any_setting_gives_a_pipeline_or_errors(setting in any::<String>()) {
        let mut overrides = Overrides::default();
        let _ = overrides.set(&format!("log.files={setting}"));
        let _ = overrides.set(&format!("lines.{setting}"));
        overrides.set_for_kind("mcap_source", "files", vec![setting.clone()]);
        match Pipeline::parse("walls.toml", VALID, &registry(), &overrides) {
            Ok(pipeline) => {
                let files = toml::Value::from(vec![setting]);
                prop_assert_eq!(pipeline.stages[0].parameters.get("files"), Some(&files));
            }
            Err(errors) => prop_assert!(!errors.render(false).is_empty()),
        }
    }
}
