//! The links of a run that a user names.

use super::suggest;

/// Those of the links, each a stage and its output, that a text names, by index: `STAGE.PORT`, or `STAGE` for all of the stage. `run`
/// is what to call the run.
///
/// # Errors
/// There is none, for people: with the name that is near, or all there are.
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

/// The same where one is meant.
///
/// # Errors
/// There is none, or the stage has several.
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
    fn a_stage_or_one_of_its_outputs_is_named() {
        assert_eq!(named_links("robots", "the run", &LINKS), Ok(vec![0, 1]));
        assert_eq!(named_links("robots.pose", "the run", &LINKS), Ok(vec![1]));
        assert_eq!(named_link("fuser", "the run", &LINKS), Ok(2));
    }

    #[test]
    fn a_name_of_no_link_or_of_several_is_told_with_what_there_is() {
        let error = named_link("robots", "the run", &LINKS).unwrap_err();
        assert_eq!(error, "`robots` has several outputs: choose one of robots.map, robots.pose");
        let error = named_link("robots.poes", "the run", &LINKS).unwrap_err();
        assert_eq!(error, "the run has no link `robots.poes`; did you mean `robots.pose`?");
        let error = named_link("icp", "the run on `robot1`", &LINKS).unwrap_err();
        assert_eq!(error, "the run on `robot1` has no link `icp`; there are: `robots.map`, `robots.pose`, `fuser.map`");
    }
}
