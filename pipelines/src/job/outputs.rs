//! Check of the outputs before a run: no input is overwritten, no file is written twice or by another run, and all are
//! writable.

use super::options::RunOptions;
use crate::status::BadUse;
use crate::trace;
use anyhow::{Result, bail};
use gridweave_logs::file::{check_writable, is_same_file, is_same_name, part_of, resolve};
use gridweave_logs::map_file;
use gridweave_logs::names::Input;
use gridweave_logs::sink::is_ros1_bag;
use gridweave_runtime::pipeline::Pipeline;
use std::path::{Path, PathBuf};

/// Checks all files that the sinks of a pipeline and the options name, and the trace. `file` is that of the pipeline,
/// if it has one.
///
/// # Errors
///
/// A log has the ending of another format. An output is an input, under whatever name, or is in the folder of one; two
/// are the same; one is not writable, or is being written by another run.
pub(crate) fn check(pipeline: &Pipeline, file: Option<&Path>, options: &RunOptions) -> Result<()> {
    let inputs: Vec<PathBuf> = inputs(pipeline).into_iter().chain(file.map(Path::to_owned)).collect();
    // First, as a map with the ending of an image has that of its own image.
    let maps = files_of(pipeline, "map_file_sink", "file");
    maps.iter().chain(&options.map).try_for_each(|map| check_ending(map, "a map", &["yaml", "yml"]))?;
    let mut outputs = outputs(pipeline, options);
    let files = outputs.len();
    outputs.extend(trace::file().cloned());
    for (index, output) in outputs.iter().enumerate() {
        if inputs.iter().any(|input| is_or_holds(input, output)) {
            return Err(is_an_input(output));
        }
        if outputs[..index].iter().any(|other| is_same_name(other, output)) {
            let text = format!("{} would be written twice: choose another name for one of them", output.display());
            return Err(BadUse(text).into());
        }
        if let Some(other) = outputs.iter().chain(&inputs).find(|other| is_part(other, output)) {
            return Err(is_the_part(other, output));
        }
        let folder = output.parent().filter(|folder| !folder.as_os_str().is_empty());
        if let Some(folder) = folder.filter(|folder| !folder.is_dir()) {
            bail!("cannot write {}: there is no folder {}; make it first", output.display(), folder.display());
        }
    }
    logs(pipeline).iter().try_for_each(|log| check_log_ending(log))?;
    let summaries = files_of(pipeline, "summary_sink", "file");
    summaries
        .iter()
        .chain(&options.summary)
        .try_for_each(|summary| check_ending(summary, "a summary", &["json", "yaml", "yml"]))?;
    // The last check, as it removes what killed runs have left. The trace is being written.
    outputs[..files].iter().try_for_each(|output| check_writable(output))?;
    Ok(())
}

/// Checks that a file that a command writes is none of its inputs, under whatever name, nor the image of one that is a
/// map.
///
/// # Errors
///
/// It is one.
pub(crate) fn check_is_no_input<'a>(inputs: impl IntoIterator<Item = &'a PathBuf>, output: &Path) -> Result<()> {
    let files = inputs.into_iter().flat_map(|input| {
        let path = Input::new(input).path;
        // A map that cannot be read is an error of the command.
        map_file::image_of(&path).ok().into_iter().chain([path])
    });
    for input in files {
        if is_or_holds(&input, output) {
            return Err(is_an_input(output));
        }
        if is_part(&input, output) {
            return Err(is_the_part(&input, output));
        }
    }
    Ok(())
}

/// Whether a file is the one as which an output is written until it is whole, also through links.
fn is_part(file: &Path, output: &Path) -> bool {
    resolve(output).is_ok_and(|place| is_same_name(&part_of(&place), file))
}

fn is_the_part(file: &Path, output: &Path) -> anyhow::Error {
    let ending = output.extension().map_or_else(String::new, |ending| format!(".{}", ending.display()));
    let stem = output.file_stem().unwrap_or_default().display();
    let numbered = (2..).map(|number| output.with_file_name(format!("{stem}_{number}{ending}")));
    let free = numbered.take(1000).find(|path| !path.exists()).unwrap_or_default();
    let (file, output, free) = (file.display(), output.display(), free.display());
    BadUse(format!("{output} is written as {file} until it is whole: choose another output, such as {free}")).into()
}

fn is_an_input(output: &Path) -> anyhow::Error {
    BadUse(format!("{} is an input, and would be overwritten: choose another output", output.display())).into()
}

/// Checks that the file of a log, which is written as MCAP or as a ROS 1 bag, does not have the ending of another
/// format.
///
/// # Errors
///
/// It does; the error names the option that writes that format.
pub(crate) fn check_log_ending(log: &Path) -> Result<()> {
    if log == Path::new("-") {
        return Err(
            BadUse("a log cannot be written to standard output: give a file, such as merged.mcap".into()).into()
        );
    }
    let ending = log.extension().and_then(|ending| ending.to_str()).unwrap_or_default().to_ascii_lowercase();
    let instead = match ending.as_str() {
        "png" | "pdf" | "svg" | "jpg" | "jpeg" => format!(
            "give a log as merged.mcap, and draw it by `gridweave render merged.mcap -o {picture}`; a merge draws its map by \
             --picture {picture} as well",
            picture = log.display()
        ),
        "pgm" | "yaml" | "yml" | "bmp" => {
            format!(
                "a merge writes its map by --map {}, and a log as merged.mcap",
                log.with_extension("yaml").display()
            )
        }
        "json" => format!("give --summary {}, and a log as merged.mcap", log.display()),
        "html" | "htm" => {
            format!("give a log as merged.mcap, and then `gridweave report merged.mcap -o {}`", log.display())
        }
        "zst" | "zstd" | "gz" | "lz4" | "zip" | "tar" | "7z" | "xz" => {
            "give a log as merged.mcap, whose chunks are compressed already".to_owned()
        }
        "txt" | "csv" => format!("give --summary {}, and a log as merged.mcap", log.with_extension("json").display()),
        "db3" => format!("give {}: rosbag2 and Foxglove read MCAP", log.with_extension("mcap").display()),
        _ => return Ok(()),
    };
    Err(BadUse(format!("a log is written as MCAP or as a ROS 1 bag, and not as {}: {instead}", log.display())).into())
}

/// Checks that a file that holds `what` does not have the ending of another format than that of `endings`.
///
/// # Errors
///
/// It does; the error says which ending it has to have.
pub(crate) fn check_ending(file: &Path, what: &str, endings: &[&str]) -> Result<()> {
    const KNOWN: [&str; 19] = [
        "bag", "bmp", "csv", "db3", "gif", "htm", "html", "jpeg", "jpg", "json", "mcap", "md", "pdf", "pgm", "png",
        "svg", "txt", "yaml", "yml",
    ];
    let Some(ending) = file.extension().and_then(|ending| ending.to_str()).map(str::to_ascii_lowercase) else {
        return Ok(());
    };
    match KNOWN.contains(&&*ending) && !endings.contains(&&*ending) {
        true => {
            let right = file.with_extension(endings[0]);
            Err(BadUse(format!("{what} is not written as {}: give {}", file.display(), right.display())).into())
        }
        false => Ok(()),
    }
}

/// Checks the same of a log that is written as MCAP only.
///
/// # Errors
///
/// It has the ending of another format; the error says how to get that.
pub(crate) fn check_mcap_ending(log: &Path) -> Result<()> {
    if is_ros1_bag(log) {
        let mcap = log.with_extension("mcap");
        let (mcap, log) = (mcap.display(), log.display());
        let text = format!("this log is written as MCAP: give {mcap}, and then `gridweave convert {mcap} -o {log}`");
        return Err(BadUse(text).into());
    }
    check_log_ending(log)
}

/// Lists the logs that a pipeline writes.
pub(crate) fn logs(pipeline: &Pipeline) -> Vec<PathBuf> {
    files_of(pipeline, "mcap_sink", "file")
}

/// Lists the files that the sources read.
pub(super) fn inputs(pipeline: &Pipeline) -> Vec<PathBuf> {
    let logs = files_of(pipeline, "mcap_source", "files");
    let mut inputs: Vec<PathBuf> = logs.iter().map(|log| Input::new(log).path).collect();
    inputs.extend(files_of(pipeline, "topology_file_source", "files"));
    for map in files_of(pipeline, "map_file_source", "files") {
        let map = Input::new(&map).path;
        // A map that cannot be read is an error of the run.
        inputs.extend(map_file::image_of(&map));
        inputs.push(map);
    }
    inputs
}

/// Lists the files that the sinks and the command write.
fn outputs(pipeline: &Pipeline, options: &RunOptions) -> Vec<PathBuf> {
    let mut outputs = logs(pipeline);
    for kind in ["picture_sink", "summary_sink", "truth_sink"] {
        outputs.extend(files_of(pipeline, kind, "file"));
    }
    for map in files_of(pipeline, "map_file_sink", "file") {
        outputs.extend([map_file::image_beside(&map), map]);
    }
    let image = options.map.as_deref().map(map_file::image_beside);
    outputs.extend([&options.map, &image, &options.picture, &options.summary].into_iter().flatten().cloned());
    outputs
}

/// Lists the files in a parameter of the stages of a kind: one, or a list.
pub(super) fn files_of(pipeline: &Pipeline, kind: &str, parameter: &str) -> Vec<PathBuf> {
    let stages = pipeline.stages.iter().filter(|stage| stage.kind.name == kind);
    let values = stages.filter_map(|stage| stage.parameters.get(parameter));
    let texts = values.flat_map(|value| match value {
        toml::Value::Array(values) => values.iter().filter_map(|value| value.as_str()).collect(),
        value => Vec::from_iter(value.as_str()),
    });
    texts.filter(|text| !text.is_empty()).map(PathBuf::from).collect()
}

/// Whether two paths lead to the same file, or the first to a folder that contains the second, also through links.
fn is_or_holds(input: &Path, output: &Path) -> bool {
    let (Ok(input), Ok(output)) = (input.canonicalize(), output.canonicalize()) else { return false };
    output.starts_with(&input) || is_same_file(&input, &output)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shipped;
    use gridweave_runtime::pipeline::Overrides;

    #[test]
    fn the_part_of_an_output_is_neither_another_output_nor_an_input() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str| folder.path().join(name);
        let pipeline = shipped::load(Path::new("auto_merge"), &Overrides::default(), &shipped::registry([])).unwrap();
        let with = |summary: &str| RunOptions {
            summary: Some(file(summary)),
            picture: Some(file("a.svg")),
            ..Default::default()
        };
        check(&pipeline, None, &with("s.json")).unwrap();
        let error = check(&pipeline, None, &with("a.svg.part")).unwrap_err();
        assert!(crate::is_bad_use(&error), "{error}");
        let text = format!("{} is written as {}", file("a.svg").display(), file("a.svg.part").display());
        assert!(error.to_string().contains(&text), "{error}");
        std::fs::write(file("o.mcap.part"), "").unwrap();
        let error = check_is_no_input([&file("o.mcap.part")], &file("o.mcap")).unwrap_err();
        assert!(crate::is_bad_use(&error), "{error}");
        check_is_no_input([&file("o.mcap.part")], &file("other.mcap")).unwrap();
    }

    #[test]
    fn a_map_and_a_summary_have_the_endings_of_their_formats() {
        for (file, endings, right) in [
            ("m.png", &["yaml", "yml"][..], "give m.yaml"),
            ("m.json", &["yaml", "yml"], "give m.yaml"),
            ("a/s.PNG", &["json"], "give a/s.json"),
            ("r.pdf", &["html", "htm"], "give r.html"),
        ] {
            let error = check_ending(Path::new(file), "a map", endings).unwrap_err().to_string();
            assert!(error.contains(right), "{error}");
        }
        for file in ["m.yaml", "m.YML", "m", "m.old"] {
            assert!(check_ending(Path::new(file), "a map", &["yaml", "yml"]).is_ok(), "{file}");
        }
    }

    #[test]
    fn a_log_with_the_ending_of_another_format_is_refused_with_the_option_that_writes_it() {
        for (log, option) in [
            ("a/merged.png", "--picture a/merged.png"),
            ("merged.PDF", "--picture merged.PDF"),
            ("merged.pgm", "--map merged.yaml"),
            ("merged.json", "--summary merged.json"),
            ("merged.db3", "give merged.mcap"),
        ] {
            let error = check_log_ending(Path::new(log)).unwrap_err().to_string();
            assert!(error.contains(option), "{error}");
        }
        for log in ["merged.mcap", "merged", "merged.part", ".png", "a.png/merged.mcap"] {
            assert!(check_mcap_ending(Path::new(log)).is_ok(), "{log}");
        }
        assert!(check_log_ending(Path::new("merged.bag")).is_ok());
        let error = check_mcap_ending(Path::new("part.BAG")).unwrap_err().to_string();
        assert!(error.contains("`gridweave convert part.mcap -o part.BAG`"), "{error}");
    }
}
