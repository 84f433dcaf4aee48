//! Reasons for which a node has given nothing.

use super::unmatched::Unmatched;
use std::fmt::{self, Display};

/// Maximum number of kinds of frames.
const MAX_KINDS: usize = 6;

/// Reason for which a node has given nothing so far, although it received something.
///
/// It owns no memory, so that a node can return it in an audio callback; [`Display`] puts it into words for the one who reads it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Silence {
    /// A reason without figures.
    Because(&'static str),
    /// A linked strength is 0: another representation of the same thing is to sound.
    Off,
    /// It reads one object, and nothing was of that.
    NoObject {
        /// Name of what it reads, in the singular.
        item: &'static str,
        /// The object.
        object: u32,
        /// Objects that there are.
        others: Unmatched<u32>,
    },
    /// It reads the contacts of a pair, or of one body, and there were others alone.
    NoPair {
        /// The first body; `None` for any.
        a: Option<u32>,
        /// The second body; `None` for any.
        b: Option<u32>,
        /// Pairs that there are.
        others: Unmatched<[u32; 2]>,
    },
    /// It reads the contacts of one body, as the first or the second.
    NoBody {
        /// The body.
        object: u32,
        /// Pairs that there are.
        others: Unmatched<[u32; 2]>,
    },
    /// All frames were of kinds that are not heard.
    Unheard(Frames),
}

/// Numbers of frames by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Frames {
    /// Kind, number, and true if a parameter of this name has turned it off.
    kinds: [Option<(&'static str, u64, bool)>; MAX_KINDS],
}

impl FromIterator<(&'static str, u64, bool)> for Frames {
    /// The first six kinds; those without frames are left out.
    fn from_iter<I: IntoIterator<Item = (&'static str, u64, bool)>>(kinds: I) -> Self {
        let mut frames = Self::default();
        let some = kinds.into_iter().filter(|(_, count, _)| *count > 0);
        frames.kinds.iter_mut().zip(some).for_each(|(slot, kind)| *slot = Some(kind));
        frames
    }
}

impl Silence {
    /// For a node that reads one object (`None` for all) and has refused others; None if there was nothing at all.
    #[must_use]
    pub fn no_object(item: &'static str, object: Option<u32>, others: Unmatched<u32>) -> Option<Self> {
        Some(Self::NoObject { item, object: object.filter(|_| !others.is_empty())?, others })
    }
}

fn pairs(others: Unmatched<[u32; 2]>) -> String {
    others.list(|[a, b]| format!("{a}-{b}"))
}

impl Display for Silence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Because(text) => f.write_str(text),
            Self::Off => f.write_str("a linked strength is 0"),
            Self::NoObject { item, object, others } => {
                write!(f, "no {item} has object {object}; there are {}", others.list(|other| other))
            }
            Self::NoPair { a, b, others } => {
                match (a, b) {
                    (Some(a), Some(b)) => write!(f, "no contact between {a} and {b}"),
                    (Some(a), None) => write!(f, "no contact of {a} as the first body"),
                    (None, Some(b)) => write!(f, "no contact of {b} as the second body"),
                    (None, None) => write!(f, "no contact"),
                }?;
                write!(f, "; there are {}", pairs(others))?;
                match (a, b) {
                    (Some(a), Some(b)) if a > b => write!(f, "; the smaller number is `a`"),
                    _ => Ok(()),
                }
            }
            Self::NoBody { object, others } => {
                write!(f, "no contact is of {object}; there are {}", pairs(others))
            }
            Self::Unheard(frames) => {
                let kinds = frames.kinds.into_iter().flatten();
                let all: u64 = kinds.clone().map(|(_, count, _)| count).sum();
                write!(f, "none of {all} frames is audible: ")?;
                for (k, (kind, count, off)) in kinds.enumerate() {
                    let separator = if k > 0 { ", " } else { "" };
                    write!(f, "{separator}{count} {kind}")?;
                    if off {
                        write!(f, " (`{kind}` is 0)")?;
                    }
                }
                Ok(())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_reason_names_what_there_is() {
        let mut objects = Unmatched::default();
        assert_eq!(Silence::no_object("impact", Some(7), objects), None);
        [4, 1, 4].into_iter().for_each(|object| objects.add(object));
        assert_eq!(Silence::no_object("impact", None, objects), None);
        let mut others = Unmatched::default();
        [[1, 2], [2, 3]].into_iter().for_each(|pair| others.add(pair));
        let kinds = [("static", 602, false), ("sliding", 0, true), ("unsteady", 90, true)];
        for (silence, text) in [
            (
                Silence::no_object("impact", Some(7), objects).unwrap(),
                "no impact has object 7; there are 4, 1",
            ),
            (
                Silence::NoPair { a: Some(2), b: Some(99), others },
                "no contact between 2 and 99; there are 1-2, 2-3",
            ),
            (
                Silence::NoPair { a: Some(3), b: Some(2), others },
                "no contact between 3 and 2; there are 1-2, 2-3; the smaller number is `a`",
            ),
            (
                Silence::NoPair { a: None, b: Some(9), others },
                "no contact of 9 as the second body; there are 1-2, 2-3",
            ),
            (Silence::NoBody { object: 9, others }, "no contact is of 9; there are 1-2, 2-3"),
            (
                Silence::Unheard(kinds.into_iter().collect()),
                "none of 692 frames is audible: 602 static, 90 unsteady (`unsteady` is 0)",
            ),
            (Silence::Off, "a linked strength is 0"),
        ] {
            assert_eq!(silence.to_string(), text);
        }
    }
}
