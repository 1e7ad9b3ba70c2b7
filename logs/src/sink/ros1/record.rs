//! Records of a bag as bytes: a header of named fields, and data.

/// A header that is being built: fields, each with its length, its name, `=`, and its value.
#[derive(Clone, Debug, Default)]
pub(super) struct HeaderBytes(Vec<u8>);

impl HeaderBytes {
    /// The header of a record with an opcode.
    pub(super) fn of(opcode: u8) -> Self {
        Self::default().with("op", &[opcode])
    }

    /// Adds a field.
    pub(super) fn with(mut self, name: &str, value: &[u8]) -> Self {
        push_length(&mut self.0, name.len() + 1 + value.len());
        self.0.extend_from_slice(name.as_bytes());
        self.0.push(b'=');
        self.0.extend_from_slice(value);
        self
    }

    /// Adds a field with a number.
    pub(super) fn with_u32(self, name: &str, value: u32) -> Self {
        self.with(name, &value.to_le_bytes())
    }

    /// The fields.
    pub(super) fn bytes(&self) -> &[u8] {
        &self.0
    }
}

/// Appends a record.
pub(super) fn push_record(bytes: &mut Vec<u8>, header: &HeaderBytes, data: &[u8]) {
    push_length(bytes, header.0.len());
    bytes.extend_from_slice(&header.0);
    push_length(bytes, data.len());
    bytes.extend_from_slice(data);
}

const SECOND: u64 = 1_000_000_000;
/// The last time of ROS 1, in the year 2106, nanoseconds.
pub(super) const LAST_TIME: u64 = u32::MAX as u64 * SECOND + 999_999_999;

/// The bytes of a time in nanoseconds, [`LAST_TIME`] at most: seconds, and nanoseconds of the second.
pub(super) fn time_bytes(time: u64) -> [u8; 8] {
    let (seconds, rest) = ((time.min(LAST_TIME) / SECOND) as u32, (time % SECOND) as u32);
    let mut bytes = [0; 8];
    bytes[..4].copy_from_slice(&seconds.to_le_bytes());
    bytes[4..].copy_from_slice(&rest.to_le_bytes());
    bytes
}

fn push_length(bytes: &mut Vec<u8>, length: usize) {
    // Callers make no record that is longer.
    bytes.extend_from_slice(&u32::try_from(length).unwrap_or(u32::MAX).to_le_bytes());
}
