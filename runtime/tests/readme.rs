//! The example of a stage in the README is the one that the documentation compiles and runs.

#[test]
fn the_stage_in_the_readme_is_that_of_the_documentation() {
    let documentation = include_str!("../src/stage/mod.rs").lines().skip_while(|line| *line != "//! ```").skip(1);
    let example: Vec<&str> = documentation
        .take_while(|line| *line != "//! ```")
        .map(|line| line.trim_start_matches("//!").strip_prefix(' ').unwrap_or_default())
        .filter(|line| !line.starts_with("# "))
        .collect();
    assert!((10..=40).contains(&example.len()), "{example:#?}");
    let readme: Vec<&str> = include_str!("../README.md").lines().collect();
    assert!(readme.windows(example.len()).any(|lines| lines == example), "the README has another example");
}
