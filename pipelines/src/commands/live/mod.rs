//! Commands that meet a run that is going on: play into it, record, print and carry elsewhere what passes, show what it does.

mod bridge;
mod bridge_settings;
mod link_choice;
mod other_machines;
mod play;
mod record;
mod running;
mod tap;
mod tap_elsewhere;
mod top;
mod view;

pub(crate) use bridge::{BridgeArgs, bridge};
pub(crate) use play::{PlayArgs, play};
pub(crate) use record::{RecordArgs, record};
pub(crate) use tap::{TapArgs, tap};
pub(crate) use top::{TopArgs, top};
pub(crate) use view::{ViewArgs, view};
