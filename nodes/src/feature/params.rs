//! Parameters of feature conventions, shared by all nodes that compute features.

use super::conventions::{FeatureConventions, FloorRule};
use crate::choices;
use crate::core::fault::Reject;
use crate::core::params::{Bounds, Datum, Mismatch, Param, ParamKind};
use crate::core::random::Rng;
use crate::core::time::Rate;

/// Longest unit, in samples.
const MAX_SAMPLES: u32 = 1 << 16;

/// Length of a unit: seconds as a fraction or decimal (`"1/240"`), or samples (`"400 samples"`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum UnitLength {
    /// A fraction of seconds.
    Seconds(u32, u32),
    /// Whole samples.
    Samples(u32),
}

impl UnitLength {
    /// Returns the nearest number of samples.
    #[must_use]
    pub fn samples(self, rate: Rate) -> u32 {
        match self {
            Self::Seconds(num, den) => (rate.as_f64() * f64::from(num) / f64::from(den))
                .round()
                .clamp(0.0, f64::from(u32::MAX)) as u32,
            Self::Samples(samples) => samples,
        }
    }

    fn parse(text: &str) -> Option<Self> {
        if let Some(samples) = text.trim().strip_suffix("samples") {
            return samples.trim().parse().ok().filter(|&n| n > 0).map(Self::Samples);
        }
        let (num, den) = text.split_once('/')?;
        let (num, den) = (num.trim().parse().ok()?, den.trim().parse().ok()?);
        (num > 0 && den > 0).then_some(Self::Seconds(num, den))
    }
}

impl std::str::FromStr for UnitLength {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::parse(text).ok_or_else(|| format!("{EXPECTED} was expected"))
    }
}

/// The form of a length.
const EXPECTED: &str = "a fraction of a second such as \"1/240\", or \"400 samples\"";

impl Param for UnitLength {
    const KIND: ParamKind = ParamKind::Text;

    fn read(datum: &Datum, _: Option<Bounds>) -> Result<Self, Mismatch> {
        let parsed = match datum {
            Datum::Text(text) => Self::parse(text),
            _ => None,
        };
        parsed.ok_or_else(|| Mismatch::Type { expected: EXPECTED.into(), found: datum.describe() })
    }

    fn write(&self) -> Datum {
        Datum::Text(match self {
            Self::Seconds(num, den) => format!("{num}/{den}"),
            Self::Samples(samples) => format!("{samples} samples"),
        })
    }

    fn trial(rng: &mut Rng, _: Option<Bounds>) -> Self {
        Self::Samples(2 + rng.below(4) as u32)
    }
}

choices! {
    /// Source of the lowest energy of a band.
    pub enum FloorFrom {
        /// The parameter `floor`.
        Level,
        /// The database: the 5th percentile of its band energies.
        Database,
    }
}

/// The parameters that [`feature_params`](crate::feature_params) declares.
#[derive(Clone, Debug)]
pub struct ConventionParams {
    /// Length of a unit.
    pub unit: UnitLength,
    /// Length of the window.
    pub frame: Option<u32>,
    /// Number of bands.
    pub bands: Option<u32>,
    /// Source of the floor.
    pub floor_from: FloorFrom,
    /// The floor in decibels.
    pub floor: f64,
    /// All other fields.
    pub base: FeatureConventions,
}

impl ConventionParams {
    /// Returns the conventions at a sample rate.
    ///
    /// # Errors
    /// Units of 0 samples, more coefficients than bands, bands whose end is not above their start, and a high-pass at or above half the rate.
    pub fn conventions(self, rate: Rate, joined: u32) -> Result<FeatureConventions, Reject> {
        let refuse = |field: &str, message: String| Err(Reject::new("F051", message).at(field));
        let mut c = self.base;
        c.unit = self.unit.samples(rate);
        if !(1..=MAX_SAMPLES).contains(&c.unit) || rate.divided_by(u64::from(c.unit)).is_none() {
            return refuse(
                "unit",
                format!("a unit has {} samples at {rate}; it takes 1 to {MAX_SAMPLES}", c.unit),
            );
        }
        let twice = matches!(c.window, super::FeatureWindow::Sine2);
        c.frame = self.frame.unwrap_or(if twice { 2 * c.unit } else { c.unit });
        c.bands = self.bands.unwrap_or(c.first + c.n);
        if c.first + c.n > c.bands {
            let (from, to) = (c.first, c.first + c.n - 1);
            let message =
                format!("coefficients {from} to {to} of {} bands; the last is {}", c.bands, c.bands - 1);
            return refuse("n", message);
        }
        if c.f_lo >= c.f_hi {
            return refuse("f_hi", format!("the bands end at {} Hz and begin at {} Hz", c.f_hi, c.f_lo));
        }
        if c.high_pass >= rate.as_f64() / 2.0 {
            let half = rate.as_f64() / 2.0;
            let message =
                format!("the high-pass is at {} Hz; it must be below {half} Hz, half the rate", c.high_pass);
            return refuse("high_pass", message);
        }
        c.floor = match self.floor_from {
            FloorFrom::Level => FloorRule::Level(self.floor),
            FloorFrom::Database => FloorRule::Database,
        };
        (c.rate, c.joined) = (rate, joined.max(1));
        Ok(c)
    }
}

/// Refuses lists of widths that have neither one entry nor one for each coefficient.
pub(crate) fn check_widths(widths: &[f64], n: usize) -> Result<(), Reject> {
    if widths.len() <= 1 || widths.len() == n {
        return Ok(());
    }
    let message = format!("{} widths for {n} coefficients", widths.len());
    Err(Reject::new("F051", message).at("widths").help(format!("give {n}, or one for all")))
}

/// Declares parameters, followed by those of feature conventions, and the method `convention_params`.
#[macro_export]
macro_rules! feature_params {
    ($(#[$($meta:tt)*])+ pub struct $name:ident { $($own:tt)* }) => {
        $crate::params! {
            $(#[$($meta)*])+
            pub struct $name {
                $($own)*
                /// Length of a unit: a fraction of a second such as "1/240", rounded to whole samples, or "400 samples".
                unit: $crate::feature::UnitLength = $crate::feature::UnitLength::Seconds(1, 240);
                /// Coefficients per channel.
                n: usize = 3, unit "", range 1..=32_usize;
                /// Index of the first coefficient; 0 includes the coefficient of loudness.
                first: usize = 0, unit "", range 0..=32_usize;
                /// Number of bands; None is `first + n`.
                bands: Option<usize> = None, unit "", range 1..=256_usize;
                /// Lower edge of the lowest band.
                f_lo: f64 = 0.0, unit "Hz", range 0.0..=100_000.0;
                /// Upper edge of the highest band; above half the rate there is no signal.
                f_hi: f64 = 20_000.0, unit "Hz", range 1.0..=400_000.0;
                /// Shape of the bands.
                shape: $crate::feature::BandShape = $crate::feature::BandShape::Rectangular;
                /// Scale on which the bands have equal width.
                mel: $crate::feature::MelScale = $crate::feature::MelScale::Htk;
                /// Logarithm of the band energies.
                log: $crate::feature::LogScale = $crate::feature::LogScale::Natural;
                /// Lowest energy of a band, as mean square relative to full scale.
                floor: f64 = -100.0, unit "dB", range -300.0..=0.0;
                /// Source of the lowest energy.
                floor_from: $crate::feature::FloorFrom = $crate::feature::FloorFrom::Level;
                /// Window over a unit.
                window: $crate::feature::FeatureWindow = $crate::feature::FeatureWindow::Sine2;
                /// Length of the window, centred on the unit; None is two units for `Sine2` and one for the others.
                frame: Option<usize> = None, unit "samples", range 1..=65_536_usize;
                /// Cutoff of the Butterworth high-pass on the audio before the analysis; 0 for none.
                high_pass: f64 = 100.0, unit "Hz", range 0.0..=20_000.0;
                /// Order of the high-pass.
                high_pass_order: usize = 5, unit "", range 1..=10_usize;
            }
        }

        impl $name {
            /// Returns the parameters of the feature conventions.
            fn convention_params(&self, widths: &[f64], causal: bool) -> $crate::feature::ConventionParams {
                let base = $crate::feature::FeatureConventions {
                    window: self.window,
                    shape: self.shape,
                    mel: self.mel,
                    f_lo: self.f_lo,
                    f_hi: self.f_hi,
                    log: self.log,
                    n: self.n as u32,
                    first: self.first as u32,
                    high_pass: self.high_pass,
                    high_pass_order: self.high_pass_order as u32,
                    widths: widths.to_vec(),
                    causal,
                    ..$crate::feature::FeatureConventions::trial()
                };
                $crate::feature::ConventionParams {
                    unit: self.unit,
                    frame: self.frame.map(|n| n as u32),
                    bands: self.bands.map(|n| n as u32),
                    floor_from: self.floor_from,
                    floor: self.floor,
                    base,
                }
            }
        }
    };
}
