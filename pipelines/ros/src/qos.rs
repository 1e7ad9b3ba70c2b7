//! Quality of service, as far as it applies to Zenoh, and its encoding in liveliness tokens.

use std::fmt;
use std::str::FromStr;

/// The default depth of `rmw_zenoh`.
const DEFAULT_DEPTH: usize = 42;

/// The quality of service of a publisher or a subscriber.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Qos {
    /// Whether messages are delivered reliably.
    pub is_reliable: bool,
    /// Whether the last messages are retained for late joiners: `transient_local`.
    pub is_latched: bool,
    /// The number of retained messages; `None` for all.
    pub depth: Option<usize>,
}

impl Qos {
    /// Reliable, with the last messages retained for late joiners, as for maps and static transforms.
    pub const fn latched(depth: usize) -> Self {
        Self { is_reliable: true, is_latched: true, depth: Some(depth) }
    }

    /// Reliable, with nothing retained for late joiners.
    pub const fn reliable(depth: usize) -> Self {
        Self { is_reliable: true, is_latched: false, depth: Some(depth) }
    }
}

/// `RELIABILITY:DURABILITY:HISTORY,DEPTH:DEADLINE:LIFESPAN:LIVELINESS`. An omitted part has its default: reliable,
/// volatile, the last 42, without time limits.
impl fmt::Display for Qos {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let reliability = if self.is_reliable { "" } else { "2" };
        let durability = if self.is_latched { "1" } else { "" };
        match self.depth {
            Some(DEFAULT_DEPTH) => write!(f, "{reliability}:{durability}:,:,:,:,,"),
            Some(depth) => write!(f, "{reliability}:{durability}:,{depth}:,:,:,,"),
            None => write!(f, "{reliability}:{durability}:2,:,:,:,,"),
        }
    }
}

impl FromStr for Qos {
    type Err = ();

    fn from_str(text: &str) -> Result<Self, ()> {
        let parts: Vec<&str> = text.split(':').collect();
        let [reliability, durability, history, _, _, _, ..] = parts.as_slice() else { return Err(()) };
        let (history, depth) = history.split_once(',').ok_or(())?;
        let one_of = |text: &str, default: u32| match text {
            "" => Ok(default),
            number => number.parse().map_err(|_| ()),
        };
        let depth = match (one_of(history, 1)?, depth) {
            (2, _) => None,
            (_, "" | "0") => Some(DEFAULT_DEPTH),
            (_, depth) => Some(depth.parse().map_err(|_| ())?),
        };
        Ok(Self { is_reliable: one_of(reliability, 1)? != 2, is_latched: one_of(durability, 2)? == 1, depth })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quality_of_service_is_written_and_read_back() {
        for (text, qos) in [
            ("::,10:,:,:,,", Qos::reliable(10)),
            ("::,:,:,:,,", Qos::reliable(42)),
            (":1:,1:,:,:,,", Qos::latched(1)),
            ("2::,5:,:,:,,", Qos { is_reliable: false, is_latched: false, depth: Some(5) }),
            ("::2,:,:,:,,", Qos { depth: None, ..Qos::reliable(1) }),
        ] {
            assert_eq!(text.parse(), Ok(qos), "{text}");
            assert_eq!(qos.to_string(), text);
        }
        assert_eq!("1:2:1,10:,:,:,,".parse(), Ok(Qos::reliable(10)), "with parts that could be omitted");
    }

    #[test]
    fn invalid_text_is_an_error() {
        for text in ["", ":", "::,x:,:,:,,", "x::,1:,:,:,,", "::1:,:,:,,", "::,1:,:"] {
            assert_eq!(text.parse::<Qos>(), Err(()), "{text}");
        }
    }
}
