//! Parameters of nodes: declared once, and read, checked, documented, completed and varied from that declaration.

mod types;
mod value;

pub use types::{AssetPath, FolderPath, OutPath, Text};
pub use value::{Bounds, Datum, IntoBounds, Mismatch, Param, ParamKind, ParamSpec};

use super::random::Rng;
use std::any::Any;
use std::fmt::Debug;
use types::mismatch;

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

/// An error in one field of a node.
#[derive(Clone, Debug, PartialEq)]
pub enum FieldError {
    /// A parameter without a default is missing.
    Missing(&'static str),
    /// A value was not taken.
    Value(&'static str, Mismatch),
}

/// The source file in which a node is declared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SourceFile {
    /// Its crate.
    pub package: &'static str,
    /// Its path as passed to the compiler; made by [`params!`](crate::params).
    pub file: &'static str,
}

impl SourceFile {
    /// The path inside the repository of a node of this library, or inside the crate of any other.
    #[must_use]
    pub fn path(&self) -> String {
        let file = self.file.replace('\\', "/");
        let start = file.rfind("/src/").map_or(0, |at| at + 1);
        let folder = if self.package == env!("CARGO_PKG_NAME") { "nodes/" } else { "" };
        format!("{folder}{}", &file[start..])
    }
}

/// The parameters of one node type.
pub trait Params: Clone + Debug + PartialEq + Send + Sync + 'static {
    /// Documentation of the node; the first line is the summary.
    const DOC: &'static str;
    /// The file in which they are declared, which is that of their node.
    const SOURCE: SourceFile;
    /// The declared parameters in order.
    fn specs() -> Vec<ParamSpec>;
    /// Reads all of them, with every error at once.
    ///
    /// # Errors
    /// One per field that is missing or wrong.
    fn read(get: &dyn Fn(&str) -> Option<Datum>) -> Result<Self, Vec<FieldError>>;
    /// All parameters, as graphs write them.
    fn write(&self) -> Vec<(&'static str, Datum)>;
    /// Valid parameters for trials.
    fn trial(rng: &mut Rng) -> Self;
}

/// Parameters of an erased type, which only the node reads.
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
/// A parameter without a default is required. The doc comment of the struct is the documentation of the node.
/// `[group] name: Group;` includes all parameters of `Group`, which `params!` declares as well, at this position:
/// graphs write them as parameters of the node itself.
#[macro_export]
macro_rules! params {
    (
        $(#[doc = $doc:expr])+
        pub struct $name:ident {
            $( $(#[doc = $fdoc:expr])+ $([$group:ident])? $field:ident : $t:ty $(= $default:expr)? $(, unit $unit:literal)? $(, range $range:expr)? ; )*
        }
    ) => {
        $(#[doc = $doc])+
        #[derive(Clone, Debug, PartialEq)]
        pub struct $name {
            $( $(#[doc = $fdoc])+ pub $field: $t, )*
        }

        impl $crate::core::params::Params for $name {
            const DOC: &'static str = concat!($($doc, "\n",)+);
            const SOURCE: $crate::core::params::SourceFile =
                $crate::core::params::SourceFile { package: env!("CARGO_PKG_NAME"), file: file!() };

            #[allow(clippy::vec_init_then_push)]
            fn specs() -> Vec<$crate::core::params::ParamSpec> {
                #[allow(unused_mut)]
                let mut specs = Vec::new();
                $( $crate::params!(@specs specs, $([$group])? $t, $crate::core::params::ParamSpec {
                    name: stringify!($field),
                    doc: concat!($($fdoc, "\n",)+),
                    kind: <$t as $crate::core::params::Param>::KIND,
                    unit: $crate::params!(@opt $($unit)?),
                    bounds: $crate::params!(@bounds $($range)?),
                    default: $crate::params!(@default $t $(, $default)?)
                        .map(|d: $t| $crate::core::params::Param::write(&d)),
                }); )*
                specs
            }

            fn read(
                get: &dyn Fn(&str) -> Option<$crate::core::params::Datum>,
            ) -> Result<Self, Vec<$crate::core::params::FieldError>> {
                let _ = get;
                $( let $field = $crate::params!(@read $([$group])? $t, $crate::core::params::read_field::<$t>(
                    stringify!($field),
                    get,
                    $crate::params!(@bounds $($range)?),
                    $crate::params!(@default $t $(, $default)?),
                ), get); )*
                #[allow(unused_mut)]
                let mut errors: Vec<$crate::core::params::FieldError> = Vec::new();
                $( if let Err(e) = &$field { errors.extend(e.iter().cloned()); } )*
                match ($($field,)*) {
                    ($(Ok($field),)*) => Ok(Self { $($field,)* }),
                    #[allow(unreachable_patterns)]
                    _ => Err(errors),
                }
            }

            #[allow(clippy::vec_init_then_push)]
            fn write(&self) -> Vec<(&'static str, $crate::core::params::Datum)> {
                #[allow(unused_mut)]
                let mut all = Vec::new();
                $( $crate::params!(@write all, $([$group])? stringify!($field), &self.$field); )*
                all
            }

            fn trial(rng: &mut $crate::core::random::Rng) -> Self {
                let _ = &rng;
                Self { $( $field: $crate::params!(@trial $([$group])? $t, rng, $crate::params!(@bounds $($range)?)), )* }
            }
        }
    };
    (@specs $specs:ident, [$group:ident] $t:ty, $spec:expr) => {
        $specs.extend(<$t as $crate::core::params::Params>::specs());
    };
    (@specs $specs:ident, $t:ty, $spec:expr) => { $specs.push($spec); };
    (@read [$group:ident] $t:ty, $field:expr, $get:ident) => { <$t as $crate::core::params::Params>::read($get) };
    (@read $t:ty, $field:expr, $get:ident) => { $field.map_err(|error| [error]) };
    (@write $all:ident, [$group:ident] $name:expr, $field:expr) => {
        $all.extend($crate::core::params::Params::write($field));
    };
    (@write $all:ident, $name:expr, $field:expr) => {
        $all.push(($name, $crate::core::params::Param::write($field)));
    };
    (@trial [$group:ident] $t:ty, $rng:ident, $bounds:expr) => { <$t as $crate::core::params::Params>::trial($rng) };
    (@trial $t:ty, $rng:ident, $bounds:expr) => { <$t as $crate::core::params::Param>::trial($rng, $bounds) };
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
    // With more traits, such as those of serde.
    (
        $(#[doc = $doc:expr])+
        #[derive($($derive:path),+)]
        pub enum $name:ident { $( $(#[doc = $vdoc:expr])+ $variant:ident, )+ }
    ) => {
        $(#[doc = $doc])+
        #[derive(Clone, Copy, Debug, PartialEq, Eq, $($derive),+)]
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
    use crate::core::time::Rate;

    params! {
        /// Shared by two nodes.
        pub struct Common {
            /// Level.
            level: f64 = 0.5, range 0.0..=1.0;
            /// Count.
            count: u32;
        }
    }

    params! {
        /// A node.
        pub struct Own {
            /// Before the group.
            first: bool = true;
            /// Shared parameters.
            [group] common: Common;
            /// After the group.
            last: f64 = 2.0;
        }
    }

    #[test]
    fn a_group_stands_in_place_of_its_parameters() {
        let names: Vec<_> = Own::specs().iter().map(|spec| spec.name).collect();
        assert_eq!(names, ["first", "level", "count", "last"]);
        let given = |name: &str| match name {
            "level" => Some(Datum::Float(0.25)),
            "count" => Some(Datum::Int(3)),
            _ => None,
        };
        let own = Own::read(&given).unwrap();
        assert_eq!(own, Own { first: true, common: Common { level: 0.25, count: 3 }, last: 2.0 });
        let written: Vec<_> = Params::write(&own).into_iter().map(|(name, _)| name).collect();
        assert_eq!(written, names);
        let wrong = |name: &str| match name {
            "level" => Some(Datum::Float(7.0)),
            "first" => Some(Datum::Int(1)),
            _ => None,
        };
        let errors = Own::read(&wrong).unwrap_err();
        assert_eq!(
            errors.len(),
            3,
            "a wrong type, a value out of range, and one that is missing: {errors:?}"
        );
    }

    #[test]
    fn optional_parameters_state_their_values() {
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
