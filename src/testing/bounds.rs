//! Bounds of a number in a test file.

use crate::lang::{Value, ValueKind};
use crate::probe::figure;
use std::fmt;

/// Relative difference up to which a number equals the written one.
const SAME: f64 = 1e-6;

/// A number, or a range with one or two ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    low: Option<f64>,
    high: Option<f64>,
    /// True if the upper end does not belong to it, as in `0..4` of whole numbers.
    below: bool,
}

impl Bounds {
    /// The number or range of a value: `3`, `3..5`, `3..=5`, `..-1.0`, `0.5..`.
    ///
    /// # Errors
    /// A text that states which values are valid.
    pub fn read(value: &Value) -> Result<Self, String> {
        if let Some(x) = value.as_f64() {
            return Ok(Self { low: Some(x), high: Some(x), below: false });
        }
        let wanted = "a number or a range such as -12.0..-1.0 or ..-1.0".to_owned();
        let ValueKind::Range(range) = &value.value else { return Err(wanted) };
        let number = |end: &Option<Value>| match end {
            None => Ok(None),
            Some(end) => end.as_f64().map(Some).ok_or_else(|| wanted.clone()),
        };
        let (low, high) = (number(&range.start)?, number(&range.end)?);
        if low.is_none() && high.is_none() {
            return Err(wanted);
        }
        if low.zip(high).is_some_and(|(low, high)| low > high) {
            return Err("a range whose end is not below its start".to_owned());
        }
        // The ends of a range of measured numbers belong to it: a difference could not be measured.
        let whole = range.end.as_ref().is_some_and(|end| end.as_int().is_some());
        Ok(Self { low, high, below: whole && !range.inclusive && low != high })
    }

    /// Returns true if a number lies within.
    #[must_use]
    pub fn holds(&self, x: f64) -> bool {
        let room = |end: f64| SAME * end.abs();
        let high = |high: f64| if self.below { x < high } else { x <= high + room(high) };
        // Not a number lies nowhere.
        self.low.is_none_or(|low| x >= low - room(low)) && self.high.is_none_or(high) && !x.is_nan()
    }

    /// The bounds as they are written, as a time in seconds.
    #[must_use]
    pub fn span(&self) -> String {
        let end = |end: Option<f64>| end.map(figure).unwrap_or_default();
        format!("{}..{} s", end(self.low), end(self.high))
    }

    /// The ends of a time, s; the whole piece without ends.
    #[must_use]
    pub fn ends(&self) -> [f64; 2] {
        [self.low.unwrap_or(0.0), self.high.unwrap_or(f64::INFINITY)]
    }
}

impl fmt::Display for Bounds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let below = if self.below { "below" } else { "at most" };
        match (self.low, self.high) {
            (Some(low), Some(high)) if low == high => write!(f, "{}", figure(low)),
            (Some(low), Some(high)) if self.below => {
                write!(f, "from {} to below {}", figure(low), figure(high))
            }
            (Some(low), Some(high)) => write!(f, "from {} to {}", figure(low), figure(high)),
            (Some(low), None) => write!(f, "at least {}", figure(low)),
            (None, Some(high)) => write!(f, "{below} {}", figure(high)),
            (None, None) => f.write_str("anything"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lang::parse;

    fn read(text: &str) -> Result<Bounds, String> {
        Bounds::read(&parse(text).document().value.unwrap())
    }

    #[test]
    fn ranges_have_one_or_two_ends() {
        for (text, shown, within, outside) in [
            ("-12.0..-1.0", "from -12 to -1", -1.0, -0.9),
            ("..-1.0", "at most -1", -50.0, 0.0),
            ("0.5..", "at least 0.5", 0.5, 0.4),
            ("3..5", "from 3 to below 5", 4.0, 5.0),
            ("3..=5", "from 3 to 5", 5.0, 6.0),
            ("8", "8", 8.0, 9.0),
            ("4.0", "4", 4.000_001, 4.01),
        ] {
            let bounds = read(text).unwrap_or_else(|e| panic!("{text}: {e}"));
            assert_eq!(bounds.to_string(), shown);
            assert!(bounds.holds(within) && !bounds.holds(outside) && !bounds.holds(f64::NAN), "{text}");
        }
        for wrong in ["\"a\"", "5..3", "[1, 2]", "true"] {
            assert!(read(wrong).is_err(), "{wrong}");
        }
    }
}
