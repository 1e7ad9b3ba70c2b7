//! The header of every sample between a stage and its program.

use crate::message::MessageHeader;
use iceoryx2::prelude::ZeroCopySend;

/// The version of the protocol of a call.
pub const CALL_VERSION: u32 = 1;

/// The user header of a sample between a stage and its program, 256 bytes, little-endian.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ZeroCopySend)]
#[type_name("gridweave_call_header_1")]
#[repr(C)]
pub struct CallHeader {
    /// [`CALL_VERSION`].
    pub version: u32,
    /// The kind of the sample, as a number.
    pub what: u32,
    /// The index of the input or output port in the interface.
    pub port: u32,
    /// The wire that a message was received on.
    pub wire: u32,
    /// The header of the message.
    pub message: MessageHeader,
}

/// The kind of a sample to a program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Request {
    Start = 1,
    Message = 2,
    Finish = 3,
    Abort = 4,
    Next = 5,
}

/// The kind of a sample from a program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Reply {
    Output,
    Warning,
    Done,
    Failed,
    End,
}

impl Reply {
    /// The reply with the given number.
    pub(super) fn of(what: u32) -> Option<Self> {
        Some(match what {
            16 => Self::Output,
            17 => Self::Warning,
            18 => Self::Done,
            19 => Self::Failed,
            20 => Self::End,
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_layout_is_that_of_the_protocol() {
        assert_eq!(std::mem::size_of::<CallHeader>(), 256);
        assert_eq!(std::mem::offset_of!(CallHeader, message), 16);
    }
}
