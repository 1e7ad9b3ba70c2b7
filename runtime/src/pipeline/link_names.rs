//! Selection of links of a run by name.

use super::suggest;

/// The indexes of the links, given as (stage, output), that match a name: `STAGE.PORT`, or `STAGE` for all outputs of
/// the stage. Errors call the run `run`.
///
/// # Errors
/// No link matches; the text suggests a similar name, or lists all.
pub fn named_links(name: &str, run: &str, links: &[(&str, &str)]) -> Result<Vec<usize>, String> {
    let names: Vec<String> = links.iter().map(|(stage, port)| format!("{stage}.{port}")).collect();
    let is_named = |&index: &usize| names[index] == name || links[index].0 == name;
    let named: Vec<usize> = (0..links.len()).filter(is_named).collect();
    if named.is_empty() {
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let help = suggest(name, &names, "there are").map_or_else(String::new, |help| format!("; {help}"));
        return Err(format!("{run} has no link `{name}`{help}"));
    }
    Ok(named)
}

/// The index of the only link that matches a name.
///
/// # Errors
/// No link matches, or the stage has several.
pub fn named_link(name: &str, run: &str, links: &[(&str, &str)]) -> Result<usize, String> {
    let named = named_links(name, run, links)?;
    match named.as_slice() {
        [link] => Ok(*link),
        several => {
            let names: Vec<String> =
                several.iter().map(|&link| format!("{}.{}", links[link].0, links[link].1)).collect();
            Err(format!("`{name}` has several outputs: choose one of {}", names.join(", ")))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LINKS: [(&str, &str); 3] = [("robots", "map"), ("robots", "pose"), ("fuser", "map")];

    #[test]
    fn a_name_is_a_stage_or_one_of_its_outputs() {
        assert_eq!(named_links("robots", "the run", &LINKS), Ok(vec![0, 1]));
        assert_eq!(named_links("robots.pose", "the run", &LINKS), Ok(vec![1]));
        assert_eq!(named_link("fuser", "the run", &LINKS), Ok(2));
    }

    #[test]
    fn the_error_of_an_unknown_or_ambiguous_name_lists_the_choices() {
        let error = named_link("robots", "the run", &LINKS).unwrap_err();
        assert_eq!(error, "`robots` has several outputs: choose one of robots.map, robots.pose");
        let error = named_link("robots.poes", "the run", &LINKS).unwrap_err();
        assert_eq!(error, "the run has no link `robots.poes`; did you mean `robots.pose`?");
        let error = named_link("icp", "the run on `robot1`", &LINKS).unwrap_err();
        assert_eq!(error, "the run on `robot1` has no link `icp`; there are: `robots.map`, `robots.pose`, `fuser.map`");
    }
}
