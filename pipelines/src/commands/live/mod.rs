//! Commands that connect to a run in progress: play logs into it, and record, print, forward or show its messages.

mod bridge;
mod bridge_settings;
mod link_choice;
mod message_printer;
mod other_machines;
mod pace;
mod play;
mod record;
mod running;
mod tap;
mod tap_remote;
mod top;
mod view;

pub(crate) use bridge::{BridgeArgs, bridge};
pub(crate) use bridge_settings::settings;
pub(crate) use play::{PlayArgs, play};
pub(crate) use record::{RecordArgs, record};
pub(crate) use tap::{TapArgs, tap};
pub(crate) use top::{TopArgs, top};
pub(crate) use view::{ViewArgs, view};

use std::time::Duration;

/// The interval at which messages of a run in progress are read.
const MESSAGE_INTERVAL: Duration = Duration::from_millis(5);
/// The interval at which interrupts are checked.
const INTERRUPT_INTERVAL: Duration = Duration::from_millis(20);
