//! Decoding by schema.
