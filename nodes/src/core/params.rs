//! Parameters of nodes: declared once, and read, checked, documented, completed and varied from that declaration.

use super::random::Rng;
use super::time::Rate;
use serde::{Deserialize, Serialize};
use std::any::Any;
use std::fmt::{self, Debug};

/// A value as it stands in a graph file, before a parameter has taken it.
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
    /// Anything that no parameter takes, by what it is called.
    Other(String),
}

impl Datum {
    /// What it is, for messages.
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

/// Why a parameter does not take a value.
#[derive(Clone, Debug, PartialEq)]
pub enum Mismatch {
    /// Another type of value.
    Type {
        /// What the parameter takes.
        expected: String,
        /// What was there.
        found: String,
    },
    /// A number outside the declared range.
    Range {
        /// What was there.
        found: f64,
        /// The declared range.
        bounds: Bounds,
    },
    /// An infinity or NaN.
    NotFinite {
        /// What was there.
        found: String,
    },
    /// A name that is none of the choices.
    Choice {
        /// What was there.
        found: String,
        /// The names that exist.
        choices: &'static [(&'static str, &'static str)],
    },
    /// Items of a list, each with its place from 0 on: as many as [`Self::MOST`].
    Items(Vec<(usize, Mismatch)>),
}

impl Mismatch {
    /// How many items of a list are told.
    pub const MOST: usize = 100;

    /// What is wrong, with its place in lists of lists: `[2]` for the third item, nothing for the value as a whole.
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

    /// Whether a number lies within.
    #[must_use]
    pub fn holds(&self, x: f64) -> bool {
        (self.min..=self.max).contains(&x)
    }

    /// A number within: an end now and then, otherwise spread over the range's magnitude.
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

/// What kind of value a parameter takes.
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
    /// The path of an output file.
    Output,
    /// Items per second, a number or `"24000/1001"`.
    Rate,
    /// One of several names, each with its explanation.
    Choice(&'static [(&'static str, &'static str)]),
    /// Several of one kind; the count where it is fixed.
    List(&'static ParamKind, Option<usize>),
    /// Nothing (`None`), or one of a kind.
    Maybe(&'static ParamKind),
}

impl ParamKind {
    /// Whether values of it are numbers, which need a unit and a range.
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
    /// What it means.
    pub doc: &'static str,
    /// What it takes.
    pub kind: ParamKind,
    /// Its unit; empty for a pure number.
    pub unit: Option<&'static str>,
    /// Its range, for numbers.
    pub bounds: Option<Bounds>,
    /// Its default; `None` where it has to be given.
    pub default: Option<Datum>,
}

/// A type that a parameter can have.
pub trait Param: Sized {
    /// What graphs write for it.
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

fn mismatch<T>(kind: &ParamKind, found: &Datum) -> Result<T, Mismatch> {
    Err(Mismatch::Type { expected: kind.to_string(), found: found.describe() })
}

fn within(x: f64, bounds: Option<Bounds>) -> Result<f64, Mismatch> {
    if !x.is_finite() {
        return Err(Mismatch::NotFinite { found: format!("{x}") });
    }
    match bounds {
        Some(bounds) if !bounds.holds(x) => Err(Mismatch::Range { found: x, bounds }),
        _ => Ok(x),
    }
}

macro_rules! float_param {
    ($($t:ty),*) => { $(
        impl Param for $t {
            const KIND: ParamKind = ParamKind::Float;
            fn read(datum: &Datum, bounds: Option<Bounds>) -> Result<Self, Mismatch> {
                let x = match datum {
                    Datum::Int(i) => *i as f64,
                    Datum::Float(x) => *x,
                    other => return mismatch(&Self::KIND, other),
                };
                // A bound such as 0.2 in f32 is not 0.2 in f64: an end of the range is compared as it was declared.
                let x = if bounds.is_some_and(|b| (x as $t) as f64 == b.min || (x as $t) as f64 == b.max) {
                    (x as $t) as f64
                } else {
                    x
                };
                let x = within(x, bounds)? as $t;
                within(f64::from(x), None)?;
                Ok(x)
            }
            fn write(&self) -> Datum {
                // Through text, so that 0.05f32 is written 0.05.
                Datum::Float(self.to_string().parse().unwrap_or(f64::from(*self)))
            }
            fn trial(rng: &mut Rng, bounds: Option<Bounds>) -> Self {
                bounds.unwrap_or(Bounds::ALL).trial(rng) as $t
            }
        }
    )* };
}
float_param!(f32, f64);

macro_rules! int_param {
    ($($t:ty),*) => { $(
        impl Param for $t {
            const KIND: ParamKind = ParamKind::Int;
            fn read(datum: &Datum, bounds: Option<Bounds>) -> Result<Self, Mismatch> {
                let i = match datum {
                    Datum::Int(i) => *i,
                    Datum::Float(x) if x.fract() == 0.0 && x.abs() < 9e15 => *x as i64,
                    other => return mismatch(&Self::KIND, other),
                };
                within(i as f64, bounds)?;
                <$t>::try_from(i).map_err(|_| Mismatch::Range {
                    found: i as f64,
                    bounds: Bounds { min: <$t>::MIN as f64, max: <$t>::MAX as f64 },
                })
            }
            fn write(&self) -> Datum {
                Datum::Int(i64::try_from(*self).unwrap_or(i64::MAX))
            }
            fn trial(rng: &mut Rng, bounds: Option<Bounds>) -> Self {
                bounds.unwrap_or(Bounds::ALL).trial(rng).round() as $t
            }
        }
    )* };
}
int_param!(u16, u32, u64, usize, i32, i64);

impl Param for bool {
    const KIND: ParamKind = ParamKind::Bool;
    fn read(datum: &Datum, _: Option<Bounds>) -> Result<Self, Mismatch> {
        match datum {
            Datum::Bool(b) => Ok(*b),
            other => mismatch(&Self::KIND, other),
        }
    }
    fn write(&self) -> Datum {
        Datum::Bool(*self)
    }
    fn trial(rng: &mut Rng, _: Option<Bounds>) -> Self {
        rng.below(2) == 1
    }
}

impl Param for Rate {
    const KIND: ParamKind = ParamKind::Rate;
    fn read(datum: &Datum, _: Option<Bounds>) -> Result<Self, Mismatch> {
        let expected = || Mismatch::Type {
            expected: format!(
                "items per second: a number above zero, {} at most, or a fraction such as \"24000/1001\"",
                Self::MAX_HZ
            ),
            found: datum.describe(),
        };
        let rate = match datum {
            Datum::Int(i) => u64::try_from(*i).ok().and_then(|n| Self::new(n, 1)),
            Datum::Float(x) => Self::from_f64(*x),
            Datum::Text(t) => {
                t.split_once('/').and_then(|(n, d)| Self::new(n.trim().parse().ok()?, d.trim().parse().ok()?))
            }
            _ => None,
        };
        rate.ok_or_else(expected)
    }
    fn write(&self) -> Datum {
        match self.den() {
            1 => Datum::Int(self.num() as i64),
            den => Datum::Text(format!("{}/{den}", self.num())),
        }
    }
    fn trial(rng: &mut Rng, _: Option<Bounds>) -> Self {
        [Self::hz(40), Self::hz(60), Self::hz(100), Self::hz(1000)][rng.below(4)]
    }
}

macro_rules! text_param {
    ($(#[$m:meta])* $name:ident, $kind:expr, $trial:expr) => {
        $(#[$m])*
        #[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
        pub struct $name(pub String);
        impl From<&str> for $name {
            fn from(text: &str) -> Self {
                Self(text.to_owned())
            }
        }
        impl Param for $name {
            const KIND: ParamKind = $kind;
            fn read(datum: &Datum, _: Option<Bounds>) -> Result<Self, Mismatch> {
                match datum {
                    Datum::Text(t) => Ok(Self(t.clone())),
                    other => mismatch(&Self::KIND, other),
                }
            }
            fn write(&self) -> Datum {
                Datum::Text(self.0.clone())
            }
            fn trial(_: &mut Rng, _: Option<Bounds>) -> Self {
                Self($trial.to_owned())
            }
        }
    };
}
text_param!(
    /// Plain text.
    Text, ParamKind::Text, ""
);
text_param!(
    /// The path of an input file, relative to the graph file.
    AssetPath, ParamKind::Asset, "trial"
);
text_param!(
    /// The path of an output file, relative to the output folder.
    OutPath, ParamKind::Output, "trial.out"
);

impl<P: Param> Param for Vec<P> {
    const KIND: ParamKind = ParamKind::List(&P::KIND, None);
    fn read(datum: &Datum, bounds: Option<Bounds>) -> Result<Self, Mismatch> {
        let Datum::List(items) = datum else { return mismatch(&Self::KIND, datum) };
        let (mut taken, mut wrong) = (Vec::with_capacity(items.len()), Vec::new());
        for (k, item) in items.iter().enumerate() {
            match P::read(item, bounds) {
                Ok(item) => taken.push(item),
                Err(e) => wrong.push((k, e)),
            }
            if wrong.len() == Mismatch::MOST {
                break;
            }
        }
        if wrong.is_empty() { Ok(taken) } else { Err(Mismatch::Items(wrong)) }
    }
    fn write(&self) -> Datum {
        Datum::List(self.iter().map(Param::write).collect())
    }
    fn trial(rng: &mut Rng, bounds: Option<Bounds>) -> Self {
        (0..1 + rng.below(3)).map(|_| P::trial(rng, bounds)).collect()
    }
}

impl<P: Param, const N: usize> Param for [P; N] {
    const KIND: ParamKind = ParamKind::List(&P::KIND, Some(N));
    fn read(datum: &Datum, bounds: Option<Bounds>) -> Result<Self, Mismatch> {
        let items = <Vec<P> as Param>::read(datum, bounds)?;
        items.try_into().or_else(|_| mismatch(&Self::KIND, datum))
    }
    fn write(&self) -> Datum {
        Datum::List(self.iter().map(Param::write).collect())
    }
    fn trial(rng: &mut Rng, bounds: Option<Bounds>) -> Self {
        std::array::from_fn(|_| P::trial(rng, bounds))
    }
}

impl<P: Param> Param for Option<P> {
    const KIND: ParamKind = ParamKind::Maybe(&P::KIND);
    fn read(datum: &Datum, bounds: Option<Bounds>) -> Result<Self, Mismatch> {
        match datum {
            Datum::Name(n) if n == "None" => Ok(None),
            other => P::read(other, bounds).map(Some).map_err(|e| match e {
                // The items of a list are not what is optional.
                Mismatch::Type { found, .. } if matches!(P::KIND, ParamKind::List(..)) => {
                    Mismatch::Type { expected: Self::KIND.to_string(), found }
                }
                Mismatch::Type { expected, found } => {
                    Mismatch::Type { expected: format!("{expected}, or None"), found }
                }
                e => e,
            }),
        }
    }
    fn write(&self) -> Datum {
        self.as_ref().map_or_else(|| Datum::Name("None".into()), Param::write)
    }
    fn trial(rng: &mut Rng, bounds: Option<Bounds>) -> Self {
        (rng.below(2) == 1).then(|| P::trial(rng, bounds))
    }
}

/// Reads one choice by its name; used by [`choices!`](crate::choices).
///
/// # Errors
/// When the name is none of the choices.
pub fn read_choice<T: Copy>(
    datum: &Datum,
    choices: &'static [(&'static str, &'static str)],
    all: &[T],
) -> Result<T, Mismatch> {
    let Datum::Name(name) = datum else {
        return mismatch(&ParamKind::Choice(choices), datum);
    };
    let place = choices.iter().position(|(n, _)| n == name);
    place.and_then(|k| all.get(k).copied()).ok_or_else(|| Mismatch::Choice { found: name.clone(), choices })
}

/// What was wrong with one field of a node.
#[derive(Clone, Debug, PartialEq)]
pub enum FieldError {
    /// A parameter without a default was not given.
    Missing(&'static str),
    /// A value was not taken.
    Value(&'static str, Mismatch),
}

/// The parameters of one node type.
pub trait Params: Clone + Debug + PartialEq + Send + Sync + 'static {
    /// What the node does: the first line is its summary.
    const DOC: &'static str;
    /// The declared parameters in order.
    fn specs() -> Vec<ParamSpec>;
    /// Reads all of them, with every error at once.
    ///
    /// # Errors
    /// One per field that is missing or wrong.
    fn read(get: &dyn Fn(&str) -> Option<Datum>) -> Result<Self, Vec<FieldError>>;
    /// All of them as graphs write them.
    fn write(&self) -> Vec<(&'static str, Datum)>;
    /// Valid parameters for trials.
    fn trial(rng: &mut Rng) -> Self;
}

/// Parameters of a node type that only the node knows.
pub trait AnyParams: Debug + Send + Sync {
    /// Downcast.
    fn as_any(&self) -> &dyn Any;
    /// All parameters as graphs write them.
    fn write(&self) -> Vec<(&'static str, Datum)>;
    /// A copy.
    fn boxed(&self) -> Box<dyn AnyParams>;
}

impl<P: Params> AnyParams for P {
    fn as_any(&self) -> &dyn Any {
        self
    }
    fn write(&self) -> Vec<(&'static str, Datum)> {
        Params::write(self)
    }
    fn boxed(&self) -> Box<dyn AnyParams> {
        Box::new(self.clone())
    }
}

/// Reads one field for [`params!`](crate::params).
///
/// # Errors
/// When it is missing without a default, or wrong.
pub fn read_field<P: Param>(
    name: &'static str,
    get: &dyn Fn(&str) -> Option<Datum>,
    bounds: Option<Bounds>,
    default: Option<P>,
) -> Result<P, FieldError> {
    match (get(name), default) {
        (Some(datum), _) => P::read(&datum, bounds).map_err(|e| FieldError::Value(name, e)),
        (None, Some(default)) => Ok(default),
        (None, None) => Err(FieldError::Missing(name)),
    }
}

/// Declares the parameters of a node: `name: Type = default, unit "s", range 0.0..=1.0;` with a doc comment each.
///
/// A parameter without a default has to be given. The doc comment of the struct is the documentation of the node.
#[macro_export]
macro_rules! params {
    (
        $(#[doc = $doc:expr])+
        pub struct $name:ident {
            $( $(#[doc = $fdoc:expr])+ $field:ident : $t:ty $(= $default:expr)? $(, unit $unit:literal)? $(, range $range:expr)? ; )*
        }
    ) => {
        $(#[doc = $doc])+
        #[derive(Clone, Debug, PartialEq)]
        pub struct $name {
            $( $(#[doc = $fdoc])+ pub $field: $t, )*
        }

        impl $crate::core::params::Params for $name {
            const DOC: &'static str = concat!($($doc, "\n",)+);

            fn specs() -> Vec<$crate::core::params::ParamSpec> {
                vec![ $( $crate::core::params::ParamSpec {
                    name: stringify!($field),
                    doc: concat!($($fdoc, "\n",)+),
                    kind: <$t as $crate::core::params::Param>::KIND,
                    unit: $crate::params!(@opt $($unit)?),
                    bounds: $crate::params!(@bounds $($range)?),
                    default: $crate::params!(@default $t $(, $default)?)
                        .map(|d: $t| $crate::core::params::Param::write(&d)),
                }, )* ]
            }

            fn read(
                get: &dyn Fn(&str) -> Option<$crate::core::params::Datum>,
            ) -> Result<Self, Vec<$crate::core::params::FieldError>> {
                let _ = get;
                $( let $field = $crate::core::params::read_field::<$t>(
                    stringify!($field),
                    get,
                    $crate::params!(@bounds $($range)?),
                    $crate::params!(@default $t $(, $default)?),
                ); )*
                #[allow(unused_mut)]
                let mut errors: Vec<$crate::core::params::FieldError> = Vec::new();
                $( if let Err(e) = &$field { errors.push(e.clone()); } )*
                match ($($field,)*) {
                    ($(Ok($field),)*) => Ok(Self { $($field,)* }),
                    #[allow(unreachable_patterns)]
                    _ => Err(errors),
                }
            }

            fn write(&self) -> Vec<(&'static str, $crate::core::params::Datum)> {
                vec![ $( (stringify!($field), $crate::core::params::Param::write(&self.$field)), )* ]
            }

            fn trial(rng: &mut $crate::core::random::Rng) -> Self {
                let _ = &rng;
                Self { $( $field: <$t as $crate::core::params::Param>::trial(rng, $crate::params!(@bounds $($range)?)), )* }
            }
        }
    };
    (@opt) => { None };
    (@opt $unit:literal) => { Some($unit) };
    (@bounds) => { None };
    (@bounds $range:expr) => { Some($crate::core::params::IntoBounds::bounds($range)) };
    (@default $t:ty) => { None::<$t> };
    (@default $t:ty, $default:expr) => { Some::<$t>($default) };
}

/// Declares a choice among names, each with its doc comment, as a parameter type.
#[macro_export]
macro_rules! choices {
    (
        $(#[doc = $doc:expr])+
        pub enum $name:ident { $( $(#[doc = $vdoc:expr])+ $variant:ident, )+ }
    ) => {
        $(#[doc = $doc])+
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $name { $( $(#[doc = $vdoc])+ $variant, )+ }

        $crate::choices!(@param $name { $( $(#[doc = $vdoc])+ $variant, )+ });
    };
    // For an enum that the maths declares already.
    (@param $name:ident { $( $(#[doc = $vdoc:expr])+ $variant:ident, )+ }) => {
        impl $crate::core::params::Param for $name {
            const KIND: $crate::core::params::ParamKind = $crate::core::params::ParamKind::Choice(
                &[ $( (stringify!($variant), concat!($($vdoc, "\n",)+)), )+ ],
            );
            fn read(
                datum: &$crate::core::params::Datum,
                _: Option<$crate::core::params::Bounds>,
            ) -> Result<Self, $crate::core::params::Mismatch> {
                let $crate::core::params::ParamKind::Choice(names) = Self::KIND else { unreachable!() };
                $crate::core::params::read_choice(datum, names, &[ $( Self::$variant, )+ ])
            }
            fn write(&self) -> $crate::core::params::Datum {
                $crate::core::params::Datum::Name(match self { $( Self::$variant => stringify!($variant), )+ }.into())
            }
            fn trial(rng: &mut $crate::core::random::Rng, _: Option<$crate::core::params::Bounds>) -> Self {
                let all = [ $( Self::$variant, )+ ];
                all[rng.below(all.len())]
            }
        }
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_optional_says_what_it_takes() {
        let expected = |e: Mismatch| match e {
            Mismatch::Type { expected, .. } => expected,
            e => panic!("{e:?}"),
        };
        let rate = expected(Option::<Rate>::read(&Datum::Int(0), None).unwrap_err());
        assert!(rate.contains("a number above zero") && rate.ends_with("or None"), "{rate}");
        let number = expected(Option::<f64>::read(&Datum::Text("x".into()), None).unwrap_err());
        assert_eq!(number, "number, or None");
        let list = expected(Option::<Vec<f64>>::read(&Datum::Text("x".into()), None).unwrap_err());
        assert_eq!(list, "list of number, or None");
    }
}
