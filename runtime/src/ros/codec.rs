//! CDR, the encoding of ROS 2 messages: four bytes of encapsulation, then the fields.

use byteorder::{BigEndian, LittleEndian};
use serde::{Deserialize, Serialize};

/// The encapsulation of plain little-endian CDR.
const LITTLE_ENDIAN: [u8; 4] = [0, 1, 0, 0];

/// A message could not be decoded.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DecodeError {
    /// The bytes do not start with a CDR encapsulation.
    #[error("the message does not start with a CDR encapsulation (its first bytes are {0:02x?})")]
    Encapsulation(Vec<u8>),
    /// The fields could not be read: the bytes are truncated, or the type is wrong.
    #[error("the message's bytes do not match its type: {0}")]
    Fields(String),
}

/// A message could not be encoded.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the message could not be encoded as CDR: {0}")]
pub struct EncodeError(pub String);

/// Decodes a message, in either byte order, borrowing strings and arrays of bytes where `T` does.
pub fn decode<'a, T: Deserialize<'a>>(bytes: &'a [u8]) -> Result<T, DecodeError> {
    let Some((encapsulation, body)) = bytes.split_at_checked(4) else {
        return Err(DecodeError::Encapsulation(bytes.to_vec()));
    };
    let decoded = match (encapsulation[0], encapsulation[1]) {
        (0, 1) => cdr_encoding::from_bytes::<T, LittleEndian>(body),
        (0, 0) => cdr_encoding::from_bytes::<T, BigEndian>(body),
        _ => return Err(DecodeError::Encapsulation(encapsulation.to_vec())),
    };
    decoded.map(|(message, _)| message).map_err(|error| DecodeError::Fields(error.to_string()))
}

/// Encodes a message in little-endian CDR.
pub fn encode<T: Serialize>(message: &T) -> Result<Vec<u8>, EncodeError> {
    let mut bytes = Vec::with_capacity(128);
    encode_into(message, &mut bytes)?;
    Ok(bytes)
}

/// Appends a message in little-endian CDR to `bytes`. On an error `bytes` is left as it was.
pub fn encode_into<T: Serialize>(message: &T, bytes: &mut Vec<u8>) -> Result<(), EncodeError> {
    let start = bytes.len();
    bytes.extend_from_slice(&LITTLE_ENDIAN);
    cdr_encoding::to_writer::<T, LittleEndian, _>(&mut *bytes, message).map_err(|error| {
        bytes.truncate(start);
        EncodeError(error.to_string())
    })
}
