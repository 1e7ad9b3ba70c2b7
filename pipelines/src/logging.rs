//! Logging of a command: events of the libraries as lines on standard error, and a trace of the work of every stage for
//! a viewer.

use crate::terminal::eprint_line;
use crate::trace::{Trace, TraceWriter};
use anyhow::{Context, Result};
use clap::{Args, ValueEnum};
use gridweave_runtime::engine::processes::Launch;
use std::ffi::OsString;
use std::io::{BufWriter, IsTerminal};
use std::path::PathBuf;
use std::sync::{Once, OnceLock};
use tracing::field::{Field, Visit};
use tracing::span;
use tracing::{Level, Subscriber};
use tracing_chrome::{ChromeLayerBuilder, EventOrSpan, FlushGuard};
use tracing_subscriber::filter::{EnvFilter, LevelFilter, filter_fn};
use tracing_subscriber::layer::{self, Layer};
use tracing_subscriber::prelude::*;
use tracing_subscriber::registry::LookupSpan;

/// The heading of the logging options in the help, where they come last.
const HEADING: &str = "Logging";

/// Logging options of all commands.
#[derive(Debug, Args)]
pub(crate) struct LoggingArgs {
    /// Log the work of the stages to standard error; twice: with every message. `RUST_LOG` sets it in detail.
    #[arg(short, long, global = true, action = clap::ArgAction::Count, help_heading = HEADING)]
    verbose: u8,
    /// The format of the log lines: `text`, or `json` with an object on each line.
    #[arg(long, global = true, value_enum, default_value_t = LogFormat::Text, value_name = "FORMAT")]
    #[arg(hide_possible_values = true, help_heading = HEADING)]
    log_format: LogFormat,
    /// Write a trace of the work of every stage, with every message, for Perfetto (ui.perfetto.dev) or
    /// chrome://tracing. Not with the engine `processes`.
    #[arg(long, global = true, value_name = "FILE.json", help_heading = HEADING)]
    pub(crate) trace: Option<PathBuf>,
}

/// The format in which this program writes events.
static FORMAT: OnceLock<LogFormat> = OnceLock::new();

/// Arguments by which the processes of a run are started, so that they write events in the format of this program.
///
/// # Errors
/// The program cannot find itself.
pub(crate) fn launch() -> Result<Launch> {
    let launch = Launch::this_program().context("cannot find the program itself")?.with("stage");
    Ok(match FORMAT.get() {
        Some(LogFormat::Json) => launch.with("--log-format").with("json"),
        _ => launch,
    })
}

/// Format of events.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum LogFormat {
    /// One line of text for each event.
    Text,
    /// One line with a JSON object for each event.
    Json,
}

impl LoggingArgs {
    /// Starts logging for a command line of these words. `on_warning` is called for each warning with its module and
    /// text.
    pub(crate) fn start(&self, words: &[OsString], on_warning: fn(&str, &str)) -> Result<Option<Trace>> {
        let (trace, writer) = self.trace.as_deref().map(|path| Trace::create(path, words)).transpose()?.unzip();
        let (layer, guard) = writer.map(trace_layer).unzip();
        // Set once, as the subscriber is.
        let _ = FORMAT.set(self.log_format);
        tracing_subscriber::registry()
            .with(self.lines())
            .with(StageNames)
            .with(layer)
            .with(warnings(on_warning))
            .init();
        Ok(trace.zip(guard).map(|(trace, guard): (Trace, FlushGuard)| trace.written_by(guard)))
    }

    /// Layer that writes events as lines: warnings, or whatever `RUST_LOG` or the user asks for.
    fn lines<S: Subscriber + for<'a> LookupSpan<'a>>(&self) -> impl Layer<S> {
        let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(default_filter(self.verbose)));
        let lines = tracing_subscriber::fmt::layer()
            .with_writer(std::io::stderr)
            .with_ansi(std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none())
            .without_time()
            .with_target(false)
            // It would report on standard error that standard error cannot be written to.
            .log_internal_errors(false);
        match self.log_format {
            LogFormat::Text => lines.with_filter(filter).boxed(),
            LogFormat::Json => lines.json().with_span_list(false).with_filter(filter).boxed(),
        }
    }
}

/// Layer that writes spans as a trace in the format of Chrome. The trace is whole when the guard is dropped.
fn trace_layer<S>(writer: TraceWriter) -> (impl Layer<S>, FlushGuard)
where
    S: Subscriber + for<'a> LookupSpan<'a> + Send + Sync,
{
    let name_of = |recorded: &EventOrSpan<'_, '_, S>| match recorded {
        EventOrSpan::Span(span) => {
            let stage = span.extensions().get::<StageName>().map(|StageName(name)| name.clone());
            stage.unwrap_or_else(|| span.name().to_owned())
        }
        EventOrSpan::Event(event) => event.metadata().name().to_owned(),
    };
    let (layer, guard) = ChromeLayerBuilder::new()
        .writer(BufWriter::new(writer))
        .include_args(true)
        .include_locations(false)
        .name_fn(Box::new(name_of))
        .build();
    let is_work = filter_fn(|what| what.is_span() && *what.level() <= Level::DEBUG);
    (layer.with_filter(is_work), guard)
}

/// The filter of events where `RUST_LOG` is not set, by the number of `-v`.
fn default_filter(verbose: u8) -> &'static str {
    // Zenoh warns that it has found no router, which is not needed.
    ["warn,zenoh=error", "info", "debug"].get(usize::from(verbose)).copied().unwrap_or("trace")
}

/// Layer that calls `on_warning` for each warning, also for those that the filter of the log lines leaves out.
fn warnings<S: Subscriber + for<'a> LookupSpan<'a>>(on_warning: fn(&str, &str)) -> impl Layer<S> {
    // A `LevelFilter`, unlike a function, lets `tracing` disable all events below warnings.
    WarningLayer(on_warning).with_filter(LevelFilter::WARN)
}

struct WarningLayer(fn(&str, &str));

impl<S: Subscriber> Layer<S> for WarningLayer {
    fn on_event(&self, event: &tracing::Event<'_>, _: layer::Context<'_, S>) {
        let mut text = MessageText(String::new());
        event.record(&mut text);
        (self.0)(event.metadata().target(), &text.0);
        if let Some(advice) = refused_viewer(event.metadata().target(), &text.0) {
            ADVISED.call_once(|| eprint_line(advice));
        }
    }
}

/// Viewers that were refused try again and again; they are advised once.
static ADVISED: Once = Once::new();

/// What to do about a viewer that the server of the stage `foxglove_sink` has refused, if a warning is about one. The
/// server does not report the reason to the viewer.
fn refused_viewer(module: &str, text: &str) -> Option<&'static str> {
    let is_refusal = module.starts_with("foxglove::") && text.ends_with(": handshake failed");
    is_refusal.then_some(
        "a viewer was refused: `--view` needs one that speaks the protocol `foxglove.sdk.v1`, which the Foxglove app does since \
         2025; Lichtblick up to 1.21 and others that only speak the older `foxglove.websocket.v1` can open the written log instead",
    )
}

/// The message of an event.
struct MessageText(String);

impl Visit for MessageText {
    fn record_debug(&mut self, field: &Field, value: &dyn std::fmt::Debug) {
        if field.name() == "message" {
            self.0 = format!("{value:?}");
        }
    }
}

/// Layer that keeps with each span the name of its stage.
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
        // It needs no span by itself.
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
    use std::io::{self, Write};
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
    fn only_errors_of_zenoh_are_logged_unless_verbose() {
        let logged = |verbose: u8| {
            let lines = Arc::new(Mutex::new(Vec::new()));
            let (writer, filter) = (Arc::clone(&lines), EnvFilter::new(default_filter(verbose)));
            let layer = tracing_subscriber::fmt::layer().with_writer(move || Lines(Arc::clone(&writer)));
            tracing::subscriber::with_default(tracing_subscriber::registry().with(layer.with_filter(filter)), || {
                tracing::warn!(target: "zenoh::net::runtime::orchestrator", "scouting");
                tracing::error!(target: "zenoh::net::runtime", "gone");
                tracing::warn!(target: "gridweave_logs::sink", "own");
            });
            let text = String::from_utf8(lines.lock().unwrap().clone()).unwrap();
            ["scouting", "gone", "own"].map(|word| text.contains(word))
        };
        assert_eq!(logged(0), [false, true, true]);
        assert_eq!(logged(1), [true, true, true]);
    }

    #[test]
    fn the_advice_on_a_refused_viewer_names_the_protocol() {
        let text = "Dropping client 127.0.0.1:4000: handshake failed";
        assert!(refused_viewer("foxglove::websocket::server", text).unwrap().contains("foxglove.sdk.v1"));
        assert_eq!(refused_viewer("foxglove::websocket::server", "Dropping client: too slow"), None);
        assert_eq!(refused_viewer("zenoh", text), None);
    }

    #[test]
    fn warnings_are_passed_on_with_their_module() {
        static RECEIVED: Mutex<Vec<String>> = Mutex::new(Vec::new());
        let layer = warnings(|module, text| RECEIVED.lock().unwrap().push(format!("{module}: {text}")));
        tracing::subscriber::with_default(tracing_subscriber::registry().with(layer), || {
            tracing::warn!(target: "zenoh_link_tls::unicast", "{} was not let in", "a client");
            tracing::info!(target: "zenoh_link_tls::unicast", "all is well");
        });
        assert_eq!(*RECEIVED.lock().unwrap(), ["zenoh_link_tls::unicast: a client was not let in"]);
    }
}
