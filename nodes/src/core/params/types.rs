//! The types that a parameter can have.

use super::value::{Bounds, Datum, Mismatch, Param, ParamKind};
use crate::core::random::Rng;
use crate::core::time::Rate;
use serde::{Deserialize, Serialize};

pub(super) fn mismatch<T>(kind: &ParamKind, found: &Datum) -> Result<T, Mismatch> {
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
    /// The path of a folder of input files, relative to the graph file.
    FolderPath, ParamKind::Folder, "trial"
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
            if wrong.len() == Mismatch::MAX_COUNT {
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
