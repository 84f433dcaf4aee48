//! The kinds of checks, and the fields of each.

use super::bounds::Bounds;
use crate::diag::{Diagnostic, SourceLocation};
use crate::graph::suggestion;
use crate::lang::ast::Field as AstField;
use crate::lang::{Span, Value, ValueKind};
use std::collections::BTreeMap;

/// Code of mistakes in a test file.
pub(super) const CODE: &str = "F086";

/// Quantity that a check compares.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Largest magnitude of audio.
    Peak,
    /// Root mean square of audio.
    Rms,
    /// Integrated loudness.
    Loudness,
    /// Centroid of the power spectrum.
    Centroid,
    /// Nothing is heard, or all numbers are 0.
    Silent,
    /// Something is heard, or a number is not 0.
    Sounds,
    /// Onsets of audio.
    Onsets,
    /// Events.
    Events,
    /// Length of a stream.
    Duration,
    /// Channels of audio, or elements of an item.
    Channels,
    /// Items per second.
    Rate,
    /// All numbers are finite.
    Finite,
    /// No sample is beyond full scale.
    NoClipping,
    /// Range of all numbers.
    Numbers,
    /// A field of a value.
    Value,
    /// The samples of a file.
    SameAs,
    /// The result of an earlier run.
    Stored,
    /// A second run with another window gives the same.
    Repeats,
    /// Runs with other seeds give the same.
    SameForSeeds,
}

/// Type of a field of a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Given {
    /// A number or range.
    Bounds,
    /// A number above 0.
    Number,
    /// Any number, such as a level in dB.
    Level,
    /// A list of numbers.
    Numbers,
    /// A list of whole numbers from 0 on.
    Seeds,
    /// A text.
    Text,
    /// A number, range, text or truth value.
    Any,
}

/// A field of a check.
#[derive(Clone, Debug, PartialEq)]
pub enum Field {
    /// A number or range.
    Bounds(Bounds),
    /// A number.
    Number(f64),
    /// A list of numbers.
    Numbers(Vec<f64>),
    /// A text.
    Text(String),
    /// A truth value.
    Truth(bool),
}

/// One kind of check.
#[derive(Debug)]
pub struct CheckSpec {
    /// Its name in a test file.
    pub name: &'static str,
    /// Quantity that it compares.
    pub kind: Kind,
    /// Names, types, and true for fields that must be given.
    pub fields: &'static [(&'static str, Given, bool)],
    /// Its description, in one line.
    pub text: &'static str,
}

const DURING: (&str, Given, bool) = ("during", Given::Bounds, false);

macro_rules! checks {
    ($($kind:ident, $text:literal: [$($field:expr),*];)*) => {
        &[$(CheckSpec { name: stringify!($kind), kind: Kind::$kind, fields: &[$($field),*], text: $text }),*]
    };
}

/// All checks.
pub const CHECKS: &[CheckSpec] = checks![
    Peak, "largest magnitude, dB of full scale": [("db", Given::Bounds, true), DURING];
    Rms, "root mean square, dB of full scale": [("db", Given::Bounds, true), DURING];
    Loudness, "integrated loudness, LUFS": [("lufs", Given::Bounds, true), DURING];
    Centroid, "centroid of the power spectrum, Hz": [("hz", Given::Bounds, true), DURING];
    Silent, "no sample above -80 dB of full scale, or no number other than 0": [("below", Given::Level, false), DURING];
    Sounds, "a sample above -80 dB of full scale, or a number other than 0": [("above", Given::Level, false), DURING];
    Onsets, "onsets of audio": [("count", Given::Bounds, false), ("times", Given::Numbers, false), ("within", Given::Number, false), DURING];
    Events, "events": [("count", Given::Bounds, false), ("times", Given::Numbers, false), ("within", Given::Number, false), DURING];
    Duration, "length, s": [("seconds", Given::Bounds, true)];
    Channels, "channels, or elements of an item": [("count", Given::Bounds, true)];
    Rate, "items per second": [("hz", Given::Bounds, true)];
    Finite, "every number is finite": [];
    NoClipping, "no sample beyond full scale": [];
    Numbers, "smallest and largest number": [("between", Given::Bounds, true), DURING];
    Value, "a field of a value": [("at", Given::Text, false), ("is", Given::Any, true)];
    SameAs, "the samples of a file": [("file", Given::Text, true), ("below", Given::Level, false)];
    Stored, "the result stored by `foley test --write`": [("digest", Given::Text, false), ("file", Given::Text, false), ("below", Given::Level, false)];
    Repeats, "a second run with another window and one thread gives the same": [];
    SameForSeeds, "other seeds give the same": [("seeds", Given::Seeds, true), ("below", Given::Level, false)];
];

/// A check of a test file.
#[derive(Clone, Debug)]
pub struct Check {
    /// Quantity that it compares.
    pub kind: Kind,
    /// Its name.
    pub name: &'static str,
    /// Its location in the file.
    pub span: Span,
    /// Its fields.
    pub fields: BTreeMap<&'static str, Field>,
}

impl Check {
    /// Reads a check.
    ///
    /// # Errors
    /// Every mistake in it.
    pub(super) fn read(value: &Value, file: usize) -> Result<Self, Vec<Diagnostic>> {
        let at = |span: Span| SourceLocation { file, span };
        let names = || CHECKS.iter().map(|spec| spec.name);
        let Some((Some(name), given)) = value.as_struct() else {
            let message = format!("a check is Name(field: value, ...), found {}", value.describe());
            let found = Diagnostic::error(CODE, message, at(value.span()));
            return Err(vec![found.help(suggestion("", "checks", names()))]);
        };
        let Some(spec) = CHECKS.iter().find(|spec| spec.name == name.value) else {
            let found =
                Diagnostic::error(CODE, format!("there is no check `{}`", name.value), at(name.span()));
            return Err(vec![found.help(suggestion(&name.value, "checks", names()))]);
        };
        let (mut fields, mut errors) = (BTreeMap::new(), Vec::new());
        for AstField { name: field, value, .. } in given {
            let Some((own, wanted, _)) = spec.fields.iter().find(|(own, ..)| *own == field.value) else {
                let message = format!("{} has no field `{}`", spec.name, field.value);
                let own = spec.fields.iter().map(|(own, ..)| *own);
                errors.push(Diagnostic::error(CODE, message, at(field.span())).help(suggestion(
                    &field.value,
                    "fields",
                    own,
                )));
                continue;
            };
            match wanted.read(value) {
                Ok(read) => drop(fields.insert(*own, read)),
                Err(expected) => {
                    let message = format!("`{own}` takes {expected}, found {}", value.describe());
                    errors.push(Diagnostic::error(CODE, message, at(value.span())));
                }
            }
        }
        let given = |name: &str| given.iter().any(|field| field.name.value == name);
        // What seems to be missing may be a field that is misspelt.
        let misspelt = !errors.is_empty();
        for (missing, ..) in
            spec.fields.iter().filter(|(name, _, required)| *required && !misspelt && !given(name))
        {
            errors.push(Diagnostic::error(
                CODE,
                format!("{} needs `{missing}`", spec.name),
                at(value.span()),
            ));
        }
        if !misspelt && matches!(spec.kind, Kind::Onsets | Kind::Events) && !given("count") && !given("times")
        {
            let message = format!("{} needs `count` or `times`", spec.name);
            errors.push(Diagnostic::error(CODE, message, at(value.span())));
        }
        if errors.is_empty() {
            Ok(Self { kind: spec.kind, name: spec.name, span: value.span(), fields })
        } else {
            Err(errors)
        }
    }

    /// A field that is a number or range.
    #[must_use]
    pub fn bounds(&self, name: &str) -> Option<Bounds> {
        match self.fields.get(name) {
            Some(Field::Bounds(bounds)) => Some(*bounds),
            _ => None,
        }
    }

    /// A field that is a number.
    #[must_use]
    pub fn number(&self, name: &str) -> Option<f64> {
        match self.fields.get(name) {
            Some(Field::Number(x)) => Some(*x),
            _ => None,
        }
    }

    /// A field that is a list of numbers.
    #[must_use]
    pub fn numbers(&self, name: &str) -> Option<&[f64]> {
        match self.fields.get(name) {
            Some(Field::Numbers(all)) => Some(all),
            _ => None,
        }
    }

    /// A field that is a text.
    #[must_use]
    pub fn text(&self, name: &str) -> Option<&str> {
        match self.fields.get(name) {
            Some(Field::Text(text)) => Some(text),
            _ => None,
        }
    }

    /// The time that is checked, s.
    #[must_use]
    pub fn during(&self) -> [f64; 2] {
        self.bounds("during").map_or([0.0, f64::INFINITY], |during| during.ends())
    }

    /// Its name and its time.
    #[must_use]
    pub fn label(&self) -> String {
        match self.bounds("during") {
            Some(during) => format!("{} {}", self.name, during.span()),
            None => self.name.to_owned(),
        }
    }
}

impl Given {
    /// Reads a field.
    ///
    /// # Errors
    /// A text that states which values are valid.
    fn read(self, value: &Value) -> Result<Field, String> {
        let numbers = || value.as_list()?.iter().map(Value::as_f64).collect::<Option<Vec<f64>>>();
        match self {
            Self::Bounds => Bounds::read(value).map(Field::Bounds),
            Self::Number => {
                let number = value.as_f64().filter(|x| *x > 0.0).map(Field::Number);
                number.ok_or_else(|| "a number above 0".to_owned())
            }
            Self::Level => value.as_f64().map(Field::Number).ok_or_else(|| "a level in dB".to_owned()),
            Self::Numbers => {
                numbers().map(Field::Numbers).ok_or_else(|| "a list of numbers such as [0.0, 0.5]".to_owned())
            }
            Self::Seeds => {
                let seeds = numbers().filter(|all| all.iter().all(|x| *x >= 0.0 && x.fract() == 0.0));
                seeds.map(Field::Numbers).ok_or_else(|| "a list of whole numbers such as [1, 2]".to_owned())
            }
            Self::Text => value
                .as_str()
                .map(|text| Field::Text(text.to_owned()))
                .ok_or_else(|| "text in quotes".to_owned()),
            Self::Any => match &value.value {
                ValueKind::Str(text) => Ok(Field::Text(text.clone())),
                ValueKind::Bool(truth) => Ok(Field::Truth(*truth)),
                _ => {
                    Bounds::read(value).map(Field::Bounds).map_err(|e| format!("{e}, text or a truth value"))
                }
            },
        }
    }
}
