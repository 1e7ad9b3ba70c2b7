//! What is told while a command runs, beside its results: events of the libraries as lines on standard error, and a trace of what
//! every stage did when, for a viewer.

use crate::status::BadUse;
use crate::terminal::say;
use anyhow::{Context, Result};
use clap::{Args, ValueEnum};
use gridweave_runtime::engine::processes::Launch;
use std::fs::File;
use std::io::{self, BufWriter, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use tracing::field::{Field, Visit};
use tracing::span;
use tracing::{Level, Subscriber};
use tracing_chrome::{ChromeLayerBuilder, EventOrSpan, FlushGuard};
use tracing_subscriber::filter::{EnvFilter, LevelFilter, filter_fn};
use tracing_subscriber::layer::{self, Layer};
use tracing_subscriber::prelude::*;
use tracing_subscriber::registry::LookupSpan;

/// What all commands are told of that.
#[derive(Debug, Args)]
pub(crate) struct TellingArgs {
    /// Say on standard error what the stages do; twice: with every message. `RUST_LOG` says it in more detail.
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    verbose: u8,
    /// How that is written.
    #[arg(long, global = true, value_enum, default_value_t = LogFormat::Text, value_name = "FORMAT")]
    log_format: LogFormat,
    /// Write what every stage did when, with every message, for Perfetto (ui.perfetto.dev) or chrome://tracing. Not with the
    /// engine `processes`.
    #[arg(long, global = true, value_name = "FILE.json")]
    pub(crate) trace: Option<PathBuf>,
}

/// How this program writes events.
static FORMAT: OnceLock<LogFormat> = OnceLock::new();

/// How the processes of a run are started, so that they write events as this program does.
///
/// # Errors
/// The program cannot find itself.
pub(crate) fn launch() -> Result<Launch> {
    let mut launch = Launch::this_program().context("cannot find the program itself")?;
    if FORMAT.get() == Some(&LogFormat::Json) {
        let format = ["--log-format", "json"].map(str::to_owned);
        launch.arguments = format.into_iter().chain(launch.arguments).collect();
    }
    Ok(launch)
}

/// How events are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum LogFormat {
    /// A line of text each.
    Text,
    /// A JSON object each, in a line.
    Json,
}

impl TellingArgs {
    /// Begins to tell. A trace is complete when what is given is dropped. `hear` hears each warning: its module, and its words.
    pub(crate) fn start(&self, hear: fn(&str, &str)) -> Result<Option<FlushGuard>> {
        let (trace, guard) = self.trace_layer()?.unzip();
        // Set once, as the subscriber is.
        let _ = FORMAT.set(self.log_format);
        tracing_subscriber::registry().with(self.lines()).with(StageNames).with(trace).with(warnings(hear)).init();
        Ok(guard)
    }

    /// Events as lines: warnings, or all that `RUST_LOG` or the user asks for.
    fn lines<S: Subscriber + for<'a> LookupSpan<'a>>(&self) -> impl Layer<S> {
        let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(usual_filter(self.verbose)));
        let lines = tracing_subscriber::fmt::layer()
            .with_writer(std::io::stderr)
            .with_ansi(std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none())
            .without_time()
            .with_target(false)
            // It would say on standard error that standard error cannot be written to.
            .log_internal_errors(false);
        match self.log_format {
            LogFormat::Text => lines.with_filter(filter).boxed(),
            LogFormat::Json => lines.json().with_span_list(false).with_filter(filter).boxed(),
        }
    }

    /// Spans as a trace in the format of Chrome, if one is asked for.
    fn trace_layer<S>(&self) -> Result<Option<(impl Layer<S>, FlushGuard)>>
    where
        S: Subscriber + for<'a> LookupSpan<'a> + Send + Sync,
    {
        let Some(path) = &self.trace else { return Ok(None) };
        let file = TraceFile::create(path)?;
        let name_of = |spoken: &EventOrSpan<'_, '_, S>| match spoken {
            EventOrSpan::Span(span) => {
                let stage = span.extensions().get::<StageName>().map(|StageName(name)| name.clone());
                stage.unwrap_or_else(|| span.name().to_owned())
            }
            EventOrSpan::Event(event) => event.metadata().name().to_owned(),
        };
        let (layer, guard) = ChromeLayerBuilder::new()
            .writer(BufWriter::new(file))
            .include_args(true)
            .include_locations(false)
            .name_fn(Box::new(name_of))
            .build();
        let is_work = filter_fn(|what| what.is_span() && *what.level() <= Level::DEBUG);
        Ok(Some((layer.with_filter(is_work), guard)))
    }
}

/// Which events are told where `RUST_LOG` says nothing, by how often the user has asked for more.
fn usual_filter(verbose: u8) -> &'static str {
    // Without a router, which nobody needs, Zenoh warns of what it has waited for in vain.
    ["warn,zenoh=error", "info", "debug"].get(usize::from(verbose)).copied().unwrap_or("trace")
}

/// Hands on what is warned of, as it is said: the user may not be told it in these words.
fn warnings<S: Subscriber + for<'a> LookupSpan<'a>>(hear: fn(&str, &str)) -> impl Layer<S> {
    // Of a filter that is a function, nobody could say that it asks for no more than warnings.
    Listener(hear).with_filter(LevelFilter::WARN)
}

struct Listener(fn(&str, &str));

impl<S: Subscriber> Layer<S> for Listener {
    fn on_event(&self, event: &tracing::Event<'_>, _: layer::Context<'_, S>) {
        let mut words = Words(String::new());
        event.record(&mut words);
        (self.0)(event.metadata().target(), &words.0);
    }
}

/// The message of an event.
struct Words(String);

impl Visit for Words {
    fn record_debug(&mut self, field: &Field, value: &dyn std::fmt::Debug) {
        if field.name() == "message" {
            self.0 = format!("{value:?}");
        }
    }
}

/// The file of a trace. What cannot be written is told once and left out: the run goes on.
struct TraceFile {
    path: PathBuf,
    file: File,
    has_failed: bool,
}

impl TraceFile {
    /// A new file, in the place of an earlier trace. Another kind of file is not overwritten, as a log may be meant to be read.
    fn create(path: &Path) -> Result<Self> {
        if path.extension().is_none_or(|ending| ending != "json") {
            let text = format!("cannot write the trace {}: its name must end in .json", path.display());
            return Err(BadUse(text).into());
        }
        let file = File::create(path).with_context(|| format!("cannot write the trace {}", path.display()))?;
        Ok(Self { path: path.to_owned(), file, has_failed: false })
    }

    fn note(&mut self, written: io::Result<()>) {
        if let Err(error) = written {
            self.has_failed = true;
            say(format_args!("the trace {} is not complete: {error}", self.path.display()));
        }
    }
}

impl Write for TraceFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if !self.has_failed {
            let written = self.file.write_all(bytes);
            self.note(written);
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Keeps with each span the name of the stage that it belongs to.
struct StageNames;

/// The name of a stage.
struct StageName(String);

impl<S: Subscriber + for<'a> LookupSpan<'a>> Layer<S> for StageNames {
    fn on_new_span(&self, attributes: &span::Attributes<'_>, id: &span::Id, context: layer::Context<'_, S>) {
        let mut found = StageField(None);
        attributes.record(&mut found);
        if let (Some(span), Some(name)) = (context.span(id), found.0) {
            span.extensions_mut().insert(StageName(name));
        }
    }

    fn max_level_hint(&self) -> Option<LevelFilter> {
        // It asks for no span by itself.
        Some(LevelFilter::OFF)
    }
}

/// The value of the field `stage`.
struct StageField(Option<String>);

impl Visit for StageField {
    fn record_str(&mut self, field: &Field, value: &str) {
        if field.name() == "stage" {
            self.0 = Some(value.to_owned());
        }
    }

    fn record_debug(&mut self, _: &Field, _: &dyn std::fmt::Debug) {}
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::{Arc, Mutex};

    struct Lines(Arc<Mutex<Vec<u8>>>);

    impl Write for Lines {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0.lock().unwrap().write(bytes)
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn zenoh_tells_errors_alone_until_the_user_asks_for_more() {
        let told = |verbose: u8| {
            let lines = Arc::new(Mutex::new(Vec::new()));
            let (writer, filter) = (Arc::clone(&lines), EnvFilter::new(usual_filter(verbose)));
            let layer = tracing_subscriber::fmt::layer().with_writer(move || Lines(Arc::clone(&writer)));
            tracing::subscriber::with_default(tracing_subscriber::registry().with(layer.with_filter(filter)), || {
                tracing::warn!(target: "zenoh::net::runtime::orchestrator", "scouting");
                tracing::error!(target: "zenoh::net::runtime", "gone");
                tracing::warn!(target: "gridweave_logs::sink", "own");
            });
            let text = String::from_utf8(lines.lock().unwrap().clone()).unwrap();
            ["scouting", "gone", "own"].map(|word| text.contains(word))
        };
        assert_eq!(told(0), [false, true, true]);
        assert_eq!(told(1), [true, true, true]);
    }

    #[test]
    fn warnings_are_heard_in_the_words_of_their_module() {
        static HEARD: Mutex<Vec<String>> = Mutex::new(Vec::new());
        let layer = warnings(|module, words| HEARD.lock().unwrap().push(format!("{module}: {words}")));
        tracing::subscriber::with_default(tracing_subscriber::registry().with(layer), || {
            tracing::warn!(target: "zenoh_link_tls::unicast", "{} was not let in", "somebody");
            tracing::info!(target: "zenoh_link_tls::unicast", "all is well");
        });
        assert_eq!(*HEARD.lock().unwrap(), ["zenoh_link_tls::unicast: somebody was not let in"]);
    }
}
