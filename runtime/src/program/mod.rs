//! Stages that are separate programs, in any language.
//!
//! The stage runs in the thread of an engine like any other, with the same links: credits, watermarks, order, end and
//! abort are those of every stage, on every engine, in replays and live. It delegates the handling of messages to its
//! program, which it starts, calls with one message at a time, and ends. So no decision of the program depends on
//! timing, and the output is the same on every engine, byte for byte. A message is copied once, into memory that both
//! share, and the program reads it there.
//!
//! # The protocol of a call, version 1
//!
//! The program is started with the folder of the run as its last argument. Standard input and standard output are
//! doorbells, standard error is that of the run. The name of the folder is the prefix of iceoryx2's names, and the
//! folder is its root.
//!
//! 1. **Services.** Two publish-subscribe services with one publisher and one subscriber each: `PREFIX/call/to` towards
//!    the program, `PREFIX/call/from` back. The payload is `[u8]`, the user header a [`CallHeader`]. The stage creates
//!    both before it starts the program. Neither overflows.
//! 2. **Doorbells.** The sender of a sample writes one byte per sample: the stage `m` to the program's standard input,
//!    the program `s` to its standard output. A closed pipe means that the other side has died: a program whose
//!    standard input is closed exits, and a stage whose program ends has failed.
//! 3. **Ready.** The program opens the services, creates its ports, receives once so that it is connected, and writes
//!    `r`.
//! 4. **Calls.** The stage sends `START`, `MESSAGE`, `FINISH` or `ABORT` and waits. The program answers with any number
//!    of `OUTPUT` and `WARNING`, and finally `DONE` or `FAILED`. It sends nothing while it is not called. A program
//!    without inputs is a source: it receives `NEXT` instead of `MESSAGE` and `FINISH`, until it answers with `END`,
//!    and sets the log time of each `OUTPUT`, which never decreases.
//! 5. **Credits.** The program has [`CREDITS`] credits, spends one with each sample that it sends, and waits when it
//!    has none. The stage returns one for each sample that it has taken, as a byte `c`.
//!
//! | what | number | payload |
//! | --- | --- | --- |
//! | `START` | 1 | JSON: `stage`, `parameters`, `seed`, `reference`, `robots`, `inputs`, and `interface` as the stage knows it |
//! | `MESSAGE` | 2 | the bytes of a message received on the input `port`; `message` is its header |
//! | `FINISH` | 3 | nothing: all inputs have ended |
//! | `ABORT` | 4 | text: why the run has failed |
//! | `NEXT` | 5 | nothing: requests the next message of a source, or the next few |
//! | `OUTPUT` | 16 | the bytes of a message for the output `port`; of `message` only `robot` is read, and for a source `log_time` |
//! | `WARNING` | 17 | text: a problem with skipped input; counted |
//! | `DONE` | 18 | nothing |
//! | `FAILED` | 19 | text: why the stage cannot continue |
//! | `END` | 20 | nothing: a source has no more messages; `DONE` follows |
//!
//! Before that, a program describes its ports and parameters by its [`Interface`].

mod call;
mod header;
mod interface;
mod kind;
mod process;
mod source;
mod stage;

pub use call::CREDITS;
pub use header::{CALL_VERSION, CallHeader};
pub use interface::Interface;
pub use kind::kind_of;
pub use process::Launch;
