//! The values that parameters take: as a graph file writes them, their types and their ranges.

use crate::core::random::Rng;
use serde::{Deserialize, Serialize};
use std::fmt::{self, Debug};

/// A value of a graph file, before a parameter has read it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Datum {
    /// `()`.
    Unit,
    /// `true`.
    Bool(bool),
    /// A whole number.
    Int(i64),
    /// A decimal number.
    Float(f64),
    /// Quoted text.
    Text(String),
    /// A bare name.
    Name(String),
    /// `[a, b]` or `(a, b)`.
    List(Vec<Datum>),
    /// A value that no parameter takes, by its name.
    Other(String),
}

impl Datum {
    /// Returns true for 0, and for a list of nothing but 0.
    #[must_use]
    pub fn is_zero(&self) -> bool {
        match self {
            Self::Int(i) => *i == 0,
            Self::Float(x) => *x == 0.0,
            Self::List(all) => !all.is_empty() && all.iter().all(Self::is_zero),
            _ => false,
        }
    }

    /// Describes the value, for messages.
    #[must_use]
    pub fn describe(&self) -> String {
        match self {
            Self::Unit => "()".into(),
            Self::Bool(b) => b.to_string(),
            Self::Int(i) => i.to_string(),
            Self::Float(x) => format!("{x:?}"),
            Self::Text(t) => format!("{t:?}"),
            Self::Name(n) => n.clone(),
            Self::List(l) => format!("a list of {}", l.len()),
            Self::Other(what) => what.clone(),
        }
    }
}

impl fmt::Display for Datum {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::List(items) => {
                f.write_str("[")?;
                for (k, item) in items.iter().enumerate() {
                    write!(f, "{}{item}", if k > 0 { ", " } else { "" })?;
                }
                f.write_str("]")
            }
            other => f.write_str(&other.describe()),
        }
    }
}

/// Reason why a parameter rejects a value.
#[derive(Clone, Debug, PartialEq)]
pub enum Mismatch {
    /// Another type of value.
    Type {
        /// The expected kind of value.
        expected: String,
        /// The value that was found.
        found: String,
    },
    /// A number outside the declared range.
    Range {
        /// The value that was found.
        found: f64,
        /// The declared range.
        bounds: Bounds,
    },
    /// An infinity or NaN.
    NotFinite {
        /// The value that was found.
        found: String,
    },
    /// A name that is none of the choices.
    Choice {
        /// The value that was found.
        found: String,
        /// The names that exist.
        choices: &'static [(&'static str, &'static str)],
    },
    /// Items of a list, each with its index from 0 on: at most [`Self::MAX_COUNT`].
    Items(Vec<(usize, Mismatch)>),
}

impl Mismatch {
    /// Maximum number of reported items of a list.
    pub const MAX_COUNT: usize = 100;

    /// Returns all mismatches with their positions in lists of lists: `[2]` for the third item, empty for the complete value.
    #[must_use]
    pub fn each(&self) -> Vec<(String, &Self)> {
        let Self::Items(items) = self else { return vec![(String::new(), self)] };
        items
            .iter()
            .flat_map(|(k, item)| item.each().into_iter().map(move |(at, e)| (format!("[{k}]{at}"), e)))
            .collect()
    }
}

/// A range of numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Least value that is accepted.
    pub min: f64,
    /// Greatest value that is accepted.
    pub max: f64,
}

impl Bounds {
    /// Any finite number.
    pub const ALL: Self = Self { min: f64::MIN, max: f64::MAX };

    /// Returns true for a number in the range.
    #[must_use]
    pub fn holds(&self, x: f64) -> bool {
        (self.min..=self.max).contains(&x)
    }

    /// A random number in the range: sometimes an end, otherwise spread over the range's magnitude.
    pub fn trial(&self, rng: &mut Rng) -> f64 {
        let (min, max) = (self.min.max(-1e6), self.max.min(1e6));
        match rng.below(8) {
            0 => min,
            1 => max,
            2..=4 if min > 0.0 => (rng.between(min.ln(), max.ln())).exp().clamp(min, max),
            _ => rng.between(min, max),
        }
    }
}

impl fmt::Display for Bounds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} to {}", self.min, self.max)
    }
}

/// Makes [`Bounds`] of a range expression.
pub trait IntoBounds {
    /// The bounds.
    fn bounds(self) -> Bounds;
}

macro_rules! into_bounds {
    ($($t:ty),*) => { $(
        impl IntoBounds for std::ops::RangeInclusive<$t> {
            fn bounds(self) -> Bounds {
                Bounds { min: *self.start() as f64, max: *self.end() as f64 }
            }
        }
    )* };
}
into_bounds!(f32, f64, u16, u32, u64, usize, i32, i64);

/// Kind of value of a parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ParamKind {
    /// `true` or `false`.
    Bool,
    /// A whole number.
    Int,
    /// A number.
    Float,
    /// Text.
    Text,
    /// The path of an input file.
    Asset,
    /// The path of a folder of input files.
    Folder,
    /// The path of an output file.
    Output,
    /// Items per second, a number or `"24000/1001"`.
    Rate,
    /// One of several names, each with its explanation.
    Choice(&'static [(&'static str, &'static str)]),
    /// Several values of one kind, with their count if it is fixed.
    List(&'static ParamKind, Option<usize>),
    /// `None`, or a value of one kind.
    Maybe(&'static ParamKind),
}

impl ParamKind {
    /// Returns true if values of it are numbers, which need a unit and a range.
    #[must_use]
    pub fn is_number(&self) -> bool {
        match self {
            Self::Int | Self::Float => true,
            Self::List(kind, _) | Self::Maybe(kind) => kind.is_number(),
            _ => false,
        }
    }

    /// The innermost kind, inside lists and options.
    #[must_use]
    pub fn innermost(&self) -> &ParamKind {
        match self {
            Self::List(kind, _) | Self::Maybe(kind) => kind.innermost(),
            other => other,
        }
    }
}

impl fmt::Display for ParamKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bool => f.write_str("true or false"),
            Self::Int => f.write_str("whole number"),
            Self::Float => f.write_str("number"),
            Self::Text => f.write_str("text"),
            Self::Asset => f.write_str("path of an input file"),
            Self::Folder => f.write_str("path of a folder of input files"),
            Self::Output => f.write_str("path of an output file"),
            Self::Rate => f.write_str("rate"),
            Self::Choice(names) => {
                f.write_str(&names.iter().map(|(n, _)| *n).collect::<Vec<_>>().join(" or "))
            }
            Self::List(kind, Some(n)) => write!(f, "{n} times {kind}"),
            Self::List(kind, None) => write!(f, "list of {kind}"),
            Self::Maybe(kind) => write!(f, "{kind}, or None"),
        }
    }
}

/// One declared parameter.
#[derive(Debug)]
pub struct ParamSpec {
    /// Its name in graphs.
    pub name: &'static str,
    /// Its documentation.
    pub doc: &'static str,
    /// Its kind of value.
    pub kind: ParamKind,
    /// Its unit; empty for a pure number.
    pub unit: Option<&'static str>,
    /// Its range, for numbers.
    pub bounds: Option<Bounds>,
    /// Its default; `None` if it is required.
    pub default: Option<Datum>,
}

/// A type that a parameter can have.
pub trait Param: Sized {
    /// Its kind of value in graphs.
    const KIND: ParamKind;
    /// Takes a value.
    ///
    /// # Errors
    /// When it is of another type, not finite or out of range.
    fn read(datum: &Datum, bounds: Option<Bounds>) -> Result<Self, Mismatch>;
    /// The value as graphs write it.
    fn write(&self) -> Datum;
    /// A valid value for trials.
    fn trial(rng: &mut Rng, bounds: Option<Bounds>) -> Self;
}
