//! What is wrong with a pipeline, shown where it is wrong.

use annotate_snippets::{AnnotationKind, Group, Level, Renderer, Snippet};
use std::fmt;
use std::ops::Range;

/// A stretch of one of the texts that a pipeline is made of.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Location {
    /// Which text: 0 is the pipeline file, the rest are settings of the command line.
    source: usize,
    start: usize,
    end: usize,
}

impl Location {
    pub(super) fn new(source: usize, span: Range<usize>) -> Self {
        Self { source, start: span.start, end: span.end.max(span.start) }
    }

    /// The place of a part of the text value that stands here. The whole value where the two differ in length, which
    /// means that the value is written with escapes.
    pub(super) fn part(&self, value: &str, part: Range<usize>) -> Self {
        let quoted = self.end - self.start == value.len() + 2;
        let inside = part.start < part.end && part.end <= value.len();
        match quoted && inside {
            true => Self::new(self.source, self.start + 1 + part.start..self.start + 1 + part.end),
            false => self.clone(),
        }
    }
}

/// A text that a pipeline is made of, and what it is called.
#[derive(Clone, Debug)]
struct SourceText {
    name: String,
    text: String,
}

/// One error: what is wrong, where, and what would mend it.
#[derive(Clone, Debug)]
pub(super) struct Diagnostic {
    title: String,
    /// The places that it is about, each with its label: first the one that is wrong.
    marks: Vec<(Location, String)>,
    notes: Vec<String>,
    helps: Vec<String>,
}

impl Diagnostic {
    /// An error about the pipeline as a whole.
    pub(super) fn new(title: impl Into<String>) -> Self {
        Self { title: title.into(), marks: Vec::new(), notes: Vec::new(), helps: Vec::new() }
    }

    /// Underlines the place, with what is wrong with it or what was expected there.
    pub(super) fn at(mut self, location: &Location, label: impl Into<String>) -> Self {
        self.marks.insert(0, (location.clone(), label.into()));
        self
    }

    /// Underlines another place that has to do with it.
    pub(super) fn context(mut self, location: &Location, label: impl Into<String>) -> Self {
        self.marks.push((location.clone(), label.into()));
        self
    }

    /// Adds a fact.
    pub(super) fn note(mut self, text: impl Into<String>) -> Self {
        self.notes.push(text.into());
        self
    }

    /// Adds what would mend it, if there is something.
    pub(super) fn help(mut self, text: impl Into<Option<String>>) -> Self {
        self.helps.extend(text.into());
        self
    }
}

/// Everything that is wrong with a pipeline so far.
#[derive(Debug)]
pub(super) struct Problems(PipelineErrors);

impl Problems {
    /// None yet, with the pipeline file.
    pub(super) fn new(name: impl Into<String>, text: impl Into<String>) -> Self {
        let file = SourceText { name: name.into(), text: text.into() };
        Self(PipelineErrors { sources: vec![file], list: Vec::new() })
    }

    /// Adds a text that is no file, such as a setting of the command line. Gives its number, for [`Location`].
    pub(super) fn add_source(&mut self, name: impl Into<String>, text: impl Into<String>) -> usize {
        self.0.sources.push(SourceText { name: name.into(), text: text.into() });
        self.0.sources.len() - 1
    }

    pub(super) fn push(&mut self, diagnostic: Diagnostic) {
        self.0.list.push(diagnostic);
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.list.is_empty()
    }

    /// The errors in the order of the file.
    pub(super) fn into_errors(mut self) -> PipelineErrors {
        let place = |diagnostic: &Diagnostic| diagnostic.marks.first().map(|(location, _)| location.clone());
        self.0.list.sort_by_cached_key(place);
        self.0
    }
}

/// Everything that is wrong with a pipeline: one error or more, in the order of the file.
#[derive(Clone, Debug)]
pub struct PipelineErrors {
    sources: Vec<SourceText>,
    list: Vec<Diagnostic>,
}

impl PipelineErrors {
    /// One error of a pipeline as a whole, which is called `name`.
    pub fn of_whole(name: &str, problem: impl Into<String>) -> Self {
        let mut problems = Problems::new(name, "");
        problems.push(Diagnostic::new(problem.into()));
        problems.into_errors()
    }

    /// How many errors there are.
    pub fn count(&self) -> usize {
        self.list.len()
    }

    /// The errors as text: for each what is wrong, the line it is in with the place underlined, what was expected, and
    /// the nearest right name. `color` adds the escape codes of a terminal.
    pub fn render(&self, color: bool) -> String {
        let renderer = if color { Renderer::styled() } else { Renderer::plain() };
        let mut text = String::new();
        for diagnostic in &self.list {
            text.push_str(&renderer.render(&[self.group(diagnostic)]));
            text.push_str("\n\n");
        }
        let name = self.sources.first().map_or("the pipeline", |file| file.name.as_str());
        let count = match self.list.len() {
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
        // The text that holds the primary mark comes first.
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

/// Names come from the file, and a terminal must not obey what stands in it.
fn printable(text: &str) -> String {
    text.chars().map(|char| if char.is_control() && char != '\n' { '\u{fffd}' } else { char }).collect()
}

/// The part of a place that lies in its first line, on whole characters.
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
