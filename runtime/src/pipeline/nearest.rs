//! Suggestions for misspelt names.

/// The name among `names` that is most similar to `wrong`, if one is similar enough; the first of equally similar ones.
pub(super) fn nearest<'a>(wrong: &str, names: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let lower = wrong.to_lowercase();
    let near = names.into_iter().filter_map(|name| {
        let similarity = strsim::normalized_damerau_levenshtein(&lower, &name.to_lowercase());
        // A prefix, such as `lines` for `line_extractor`, has a large edit distance, but is probably meant.
        let starts_alike = strsim::jaro_winkler(&lower, &name.to_lowercase());
        (similarity >= 0.6 || starts_alike >= 0.85).then_some((similarity.max(starts_alike), name))
    });
    let best = near.reduce(|best, other| if other.0 > best.0 { other } else { best });
    best.map(|(_, name)| name)
}

/// "did you mean `...`?", if a name is similar enough.
pub(super) fn did_you_mean<'a>(wrong: &str, names: impl IntoIterator<Item = &'a str>) -> Option<String> {
    nearest(wrong, names).map(|name| format!("did you mean `{name}`?"))
}

/// "did you mean `...`?", or a list of the choices, introduced by `what`.
pub fn suggest(wrong: &str, names: &[&str], what: &str) -> Option<String> {
    let list = || (!names.is_empty()).then(|| format!("{what}: {}", quoted_list(names)));
    did_you_mean(wrong, names.iter().copied()).or_else(list)
}

/// "`a`, `b`, `c`", truncated after the first few.
pub fn quoted_list<S: AsRef<str>>(names: &[S]) -> String {
    const MOST: usize = 12;
    let mut list: Vec<String> = names.iter().take(MOST).map(|name| format!("`{}`", name.as_ref())).collect();
    if names.len() > MOST {
        list.push(format!("and {} more", names.len() - MOST));
    }
    list.join(", ")
}

/// Names as a list in words: "a", "a and b", "a, b and c"; of many the first, and how many others.
pub fn list_in_words<T: ToString>(names: impl IntoIterator<Item = T>) -> String {
    const MOST: usize = 6;
    let mut names: Vec<String> = names.into_iter().map(|name| name.to_string()).collect();
    if names.len() > MOST {
        let others = names.split_off(MOST - 2).len();
        names.push(format!("{others} others"));
    }
    match names.pop() {
        Some(last) if !names.is_empty() => format!("{} and {last}", names.join(", ")),
        last => last.unwrap_or_default(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_listed_in_words_and_many_are_counted() {
        let names = ["a", "b", "c", "d", "e", "f", "g", "h"];
        let of = |count: usize| list_in_words(&names[..count]);
        assert_eq!([of(0), of(1), of(2), of(3)], ["", "a", "a and b", "a, b and c"]);
        assert_eq!([of(6), of(8)], ["a, b, c, d, e and f", "a, b, c, d and 4 others"]);
    }

    #[test]
    fn a_misspelt_name_is_found() {
        let names = ["min_length", "max_length", "mean"];
        assert_eq!(nearest("min_lenght", names), Some("min_length"));
        assert_eq!(nearest("Mean", names), Some("mean"));
        assert_eq!(nearest("line_extracter", ["icp_refiner", "line_extractor"]), Some("line_extractor"));
    }

    #[test]
    fn for_a_name_without_a_similar_one_the_choices_are_listed() {
        let names = ["map", "pose"];
        assert_eq!(nearest("certainty", names), None);
        assert_eq!(suggest("certainty", &names, "its inputs").as_deref(), Some("its inputs: `map`, `pose`"));
        assert_eq!(suggest("certainty", &[], "its inputs"), None);
    }
}
