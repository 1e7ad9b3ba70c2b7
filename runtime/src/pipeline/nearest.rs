//! The right name nearest to a wrong one.

/// The name among `names` that `wrong` was probably meant to be, if one is near enough; of equally near ones the first.
pub(super) fn nearest<'a>(wrong: &str, names: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let lower = wrong.to_lowercase();
    let near = names.into_iter().filter_map(|name| {
        let similarity = strsim::normalized_damerau_levenshtein(&lower, &name.to_lowercase());
        // A short form, such as `lines` for `line_extractor`, is far by distance and yet clear.
        let starts_alike = strsim::jaro_winkler(&lower, &name.to_lowercase());
        (similarity >= 0.6 || starts_alike >= 0.85).then_some((similarity.max(starts_alike), name))
    });
    let best = near.reduce(|best, other| if other.0 > best.0 { other } else { best });
    best.map(|(_, name)| name)
}

/// "did you mean `...`?", if a name is near enough.
pub(super) fn did_you_mean<'a>(wrong: &str, names: impl IntoIterator<Item = &'a str>) -> Option<String> {
    nearest(wrong, names).map(|name| format!("did you mean `{name}`?"))
}

/// "did you mean `...`?", or else what there is to choose from.
pub fn suggest(wrong: &str, names: &[&str], what: &str) -> Option<String> {
    let list = || (!names.is_empty()).then(|| format!("{what}: {}", quoted_list(names)));
    did_you_mean(wrong, names.iter().copied()).or_else(list)
}

/// "`a`, `b`, `c`", cut after the first few.
pub fn quoted_list<S: AsRef<str>>(names: &[S]) -> String {
    const MOST: usize = 12;
    let mut list: Vec<String> = names.iter().take(MOST).map(|name| format!("`{}`", name.as_ref())).collect();
    if names.len() > MOST {
        list.push(format!("and {} more", names.len() - MOST));
    }
    list.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slip_of_the_keys_finds_its_name() {
        let names = ["min_length", "max_length", "mean"];
        assert_eq!(nearest("min_lenght", names), Some("min_length"));
        assert_eq!(nearest("Mean", names), Some("mean"));
        assert_eq!(nearest("line_extracter", ["icp_refiner", "line_extractor"]), Some("line_extractor"));
    }

    #[test]
    fn a_name_that_is_like_no_other_gets_the_list() {
        let names = ["map", "pose"];
        assert_eq!(nearest("certainty", names), None);
        assert_eq!(suggest("certainty", &names, "its inputs").as_deref(), Some("its inputs: `map`, `pose`"));
        assert_eq!(suggest("certainty", &[], "its inputs"), None);
    }
}
