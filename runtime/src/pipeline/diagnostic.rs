//! The errors of a pipeline file, shown at their locations.

use annotate_snippets::{AnnotationKind, Group, Level, Renderer, Snippet};
use std::fmt;
use std::ops::Range;

/// A span of one of the texts of a pipeline.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Location {
    /// The index of the text: 0 is the pipeline file, the others are settings of the command line.
    source: usize,
    start: usize,
    end: usize,
}

impl Location {
    pub(super) fn new(source: usize, span: Range<usize>) -> Self {
        Self { source, start: span.start, end: span.end.max(span.start) }
    }

    /// The location of a part of the string value at this location; the whole value if it contains escapes, because
    /// then the offsets differ.
    pub(super) fn part(&self, value: &str, part: Range<usize>) -> Self {
        let quoted = self.end - self.start == value.len() + 2;
        let inside = part.start < part.end && part.end <= value.len();
        match quoted && inside {
            true => Self::new(self.source, self.start + 1 + part.start..self.start + 1 + part.end),
            false => self.clone(),
        }
    }
}

/// A text of a pipeline, and its name in errors.
#[derive(Clone, Debug)]
struct SourceText {
    name: String,
    text: String,
}

/// An error: what is wrong, where, and what would fix it.
#[derive(Clone, Debug)]
pub(super) struct Diagnostic {
    title: String,
    /// The locations with their labels: the wrong one first.
    marks: Vec<(Location, String)>,
    notes: Vec<String>,
    helps: Vec<String>,
}

impl Diagnostic {
    /// An error about the pipeline as a whole.
    pub(super) fn new(title: impl Into<String>) -> Self {
        Self { title: title.into(), marks: Vec::new(), notes: Vec::new(), helps: Vec::new() }
    }

    /// Sets the wrong location, with what is wrong or what was expected there.
    pub(super) fn at(mut self, location: &Location, label: impl Into<String>) -> Self {
        self.marks.insert(0, (location.clone(), label.into()));
        self
    }

    /// Adds another location that is related.
    pub(super) fn context(mut self, location: &Location, label: impl Into<String>) -> Self {
        self.marks.push((location.clone(), label.into()));
        self
    }

    /// Adds a note.
    pub(super) fn note(mut self, text: impl Into<String>) -> Self {
        self.notes.push(text.into());
        self
    }

    /// Adds what would fix it, if known.
    pub(super) fn help(mut self, text: impl Into<Option<String>>) -> Self {
        self.helps.extend(text.into());
        self
    }
}

/// The maximum number of errors that are shown. Each shows its line, and one line of a file can have any number of
/// them.
pub(super) const MOST_SHOWN: usize = 100;

/// The errors of a pipeline collected so far.
#[derive(Debug)]
pub(super) struct Problems(PipelineErrors);

impl Problems {
    /// No errors yet, for a pipeline file.
    pub(super) fn new(name: impl Into<String>, text: impl Into<String>) -> Self {
        let file = SourceText { name: name.into(), text: text.into() };
        Self(PipelineErrors { sources: vec![file], list: Vec::new(), has_more: false, is_unreadable: false })
    }

    /// Adds another text, such as a setting of the command line. Returns its index, for [`Location`].
    pub(super) fn add_source(&mut self, name: impl Into<String>, text: impl Into<String>) -> usize {
        self.0.sources.push(SourceText { name: name.into(), text: text.into() });
        self.0.sources.len() - 1
    }

    pub(super) fn push(&mut self, diagnostic: Diagnostic) {
        match self.is_full() {
            true => self.0.has_more = true,
            false => self.0.list.push(diagnostic),
        }
    }

    /// Whether no further error will be shown.
    pub(super) fn is_full(&self) -> bool {
        self.0.list.len() >= MOST_SHOWN
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.list.is_empty()
    }

    /// The errors in the order of the file.
    pub(super) fn into_errors(mut self) -> PipelineErrors {
        let location = |diagnostic: &Diagnostic| diagnostic.marks.first().map(|(location, _)| location.clone());
        self.0.list.sort_by_cached_key(location);
        self.0
    }
}

/// The errors of a pipeline, one or more, in the order of the file: all, up to the maximum that is shown.
#[derive(Clone, Debug)]
pub struct PipelineErrors {
    sources: Vec<SourceText>,
    list: Vec<Diagnostic>,
    /// Whether there are more than these.
    has_more: bool,
    /// Whether the only error is that the pipeline cannot be read.
    is_unreadable: bool,
}

impl PipelineErrors {
    /// The error that the pipeline called `name` cannot be read. `problem` is all that is shown.
    pub fn of_whole(name: &str, problem: impl Into<String>) -> Self {
        let mut problems = Problems::new(name, "");
        problems.push(Diagnostic::new(problem.into()));
        Self { is_unreadable: true, ..problems.into_errors() }
    }

    /// The number of errors that are shown.
    pub fn count(&self) -> usize {
        self.list.len()
    }

    /// The errors as text: for each the problem, its line with the wrong part underlined, what was expected, and the
    /// most similar valid name. `color` adds the escape codes of a terminal.
    pub fn render(&self, color: bool) -> String {
        let renderer = if color { Renderer::styled() } else { Renderer::plain() };
        let mut text = String::new();
        for diagnostic in &self.list {
            text.push_str(&renderer.render(&[self.group(diagnostic)]));
            text.push_str("\n\n");
        }
        if self.is_unreadable {
            return text.trim_end().to_owned();
        }
        let name = self.sources.first().map_or("the pipeline", |file| file.name.as_str());
        let count = match self.list.len() {
            count if self.has_more => format!("more errors than these {count}: fix these first"),
            1 => "an error".to_owned(),
            count => format!("{count} errors"),
        };
        text.push_str(
            &renderer.render(&[Group::with_title(Level::ERROR.primary_title(format!("{name} has {count}")))]),
        );
        text
    }

    fn group<'a>(&'a self, diagnostic: &'a Diagnostic) -> Group<'a> {
        let mut group = Group::with_title(Level::ERROR.primary_title(diagnostic.title.as_str()));
        let kinds = std::iter::once(AnnotationKind::Primary).chain(std::iter::repeat(AnnotationKind::Context));
        let marks: Vec<_> = diagnostic.marks.iter().zip(kinds).collect();
        // The text with the primary mark comes first.
        let mut order: Vec<usize> = marks.iter().map(|((location, _), _)| location.source).collect();
        let mut seen = std::collections::BTreeSet::new();
        order.retain(|&source| seen.insert(source));
        for source in order {
            let Some(SourceText { name, text }) = self.sources.get(source) else { continue };
            let here = marks.iter().filter(|((location, _), _)| location.source == source);
            let annotations = here.map(|((location, label), kind)| {
                let label = (!label.is_empty()).then_some(label.as_str());
                kind.span(within_one_line(text, location)).label(label)
            });
            group = group.element(Snippet::source(text.as_str()).path(name.as_str()).annotations(annotations));
        }
        let notes = diagnostic.notes.iter().map(|note| Level::NOTE.message(printable(note)));
        let helps = diagnostic.helps.iter().map(|help| Level::HELP.message(printable(help)));
        group.elements(notes.chain(helps))
    }
}

/// Replaces control characters: names come from the file, and must not control the terminal.
fn printable(text: &str) -> String {
    text.chars().map(|char| if char.is_control() && char != '\n' { '\u{fffd}' } else { char }).collect()
}

/// The part of a location in its first line, at character boundaries.
fn within_one_line(text: &str, location: &Location) -> Range<usize> {
    let boundary = |at: usize| (0..=at.min(text.len())).rev().find(|&at| text.is_char_boundary(at)).unwrap_or(0);
    let start = boundary(location.start);
    let line = text.get(start..).unwrap_or_default();
    let length = line.find(['\n', '\r']).unwrap_or(line.len());
    start..boundary(location.end.min(start + length)).max(start)
}

impl fmt::Display for PipelineErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.render(false))
    }
}

impl std::error::Error for PipelineErrors {}
