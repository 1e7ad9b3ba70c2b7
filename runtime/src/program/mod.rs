//! Stages that are programs of their own, in any language.
//!
//! The stage runs in the thread of an engine as any other, with the same links: their credits, watermarks, order, end and abort
//! are those of every stage, on every engine, in replays and live. What it does with a message it leaves to its program, which
//! the stage starts, calls with one message at a time, and ends. So the program decides nothing that hangs on time, and the
//! output is the same on every engine, byte for byte. A message is copied once into the memory that both share, and the program
//! reads it there.
//!
//! # The protocol of a call, version 1
//!
//! The program is started with the folder of the run as its last argument, standard input and standard output as bells, and
//! standard error as that of the run. The name of the folder is the prefix of iceoryx2's names, the folder its root.
//!
//! 1. **Services.** Two publish-subscribe services with one publisher and one subscriber each: `PREFIX/call/to` towards the
//!    program, `PREFIX/call/from` back. The payload is `[u8]`, the user header a [`CallHeader`]. The stage makes both
//!    before it starts the program. Neither overflows.
//! 2. **Bells.** Who has sent a sample writes a byte: the stage `m` to the program's standard input, the program `s` to its
//!    standard output. Each byte stands for one sample. The end of a pipe is the death of the other side: a program whose
//!    standard input ends exits, and a stage whose program ends has failed.
//! 3. **Ready.** The program opens the services, makes its ports, receives once so that it is connected, and writes `r`.
//! 4. **Calls.** The stage sends `START`, `MESSAGE`, `FINISH` or `ABORT` and waits. The program answers with any number of
//!    `OUTPUT` and `WARNING`, and with `DONE` or `FAILED` as the last. It sends nothing while it is not called. A program without
//!    inputs is a source: it gets `NEXT` instead of `MESSAGE` and `FINISH`, until it answers with `END`, and says the log time of
//!    each `OUTPUT`, which never falls.
//! 5. **Credits.** The program has [`CREDITS`] of them, gives one away with each sample it sends, and waits when it has none.
//!    The stage gives one back for each sample that it has taken, as a byte `c`.
//!
//! | what | number | payload |
//! | --- | --- | --- |
//! | `START` | 1 | JSON: `stage`, `parameters`, `seed`, `reference`, `robots`, `inputs`, and `interface` as the stage knows it |
//! | `MESSAGE` | 2 | the bytes of a message that has come on the input `port`; `message` is its header |
//! | `FINISH` | 3 | nothing: all inputs have ended |
//! | `ABORT` | 4 | text: why the run has failed |
//! | `NEXT` | 5 | nothing: the next message of a source is wanted, or the next few |
//! | `OUTPUT` | 16 | the bytes of a message for the output `port`; of `message` only `robot` is read, and of a source `log_time` |
//! | `WARNING` | 17 | text: what is wrong with the input and left out; counted |
//! | `DONE` | 18 | nothing |
//! | `FAILED` | 19 | text: why the stage cannot go on |
//! | `END` | 20 | nothing: a source has no more messages; `DONE` follows |
//!
//! What a program says of itself before all that is its [`Interface`].

mod call;
mod header;
mod interface;
mod process;
mod source;
mod stage;

pub use call::CREDITS;
pub use header::{CALL_VERSION, CallHeader};
pub use interface::Interface;
pub use process::Launch;
pub use stage::kind_of;
