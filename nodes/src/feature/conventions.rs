//! Conventions of features: features are comparable only if they were computed alike.

use serde::{Deserialize, Serialize};

use crate::choices;
use crate::core::fault::Reject;
use crate::core::time::Rate;

/// Window over one unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum FeatureWindow {
    /// Half a sine over two units: its squares add up to one, so that the energies of units add up to that of the signal.
    Sine2,
    /// Rectangular: the unit itself.
    Rect,
    /// Raised cosine.
    Hann,
}

choices! { @param FeatureWindow {
    /// Half a sine over two units, centred on the unit: the energies of units add up to that of the signal.
    Sine2,
    /// Rectangular: the unit itself.
    Rect,
    /// Raised cosine; with the length of a unit it ignores clicks at the edges of units.
    Hann,
} }

/// Shape of the frequency bands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum BandShape {
    /// Disjoint bands that count every frequency once.
    Rectangular,
    /// Overlapping triangles with a peak of one.
    Triangular,
    /// Overlapping triangles of equal area (Slaney's normalisation).
    TriangularArea,
}

choices! { @param BandShape {
    /// Disjoint bands that count every frequency once.
    Rectangular,
    /// Triangles that overlap by half, with a peak of one.
    Triangular,
    /// Triangles that overlap by half, with a peak of two over their width.
    TriangularArea,
} }

/// The scale on which bands have equal width.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum MelScale {
    /// 2595 log10(1 + f / 700).
    Htk,
    /// Linear below 1 kHz, logarithmic above.
    Slaney,
}

choices! { @param MelScale {
    /// 2595 log10(1 + f / 700).
    Htk,
    /// Linear below 1 kHz and logarithmic above, as in Slaney's Auditory Toolbox.
    Slaney,
} }

/// The logarithm of band energies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum LogScale {
    /// Natural: 1 dB is 0.23.
    Natural,
    /// Ten times the decimal logarithm.
    Decibel,
}

choices! { @param LogScale {
    /// Natural logarithm: one decibel is 0.23.
    Natural,
    /// Decibels.
    Decibel,
} }

/// Lowest energy of a band.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum FloorRule {
    /// A level in decibels, as mean square relative to full scale.
    Level(f64),
    /// The 5th percentile of the band energies of the database.
    Database,
}

/// All settings that define the numbers of a feature vector.
///
/// Distances between features depend on every setting, so all must be equal in a comparison.
///
/// # Source
/// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 4.2, which leaves most
/// settings open.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FeatureConventions {
    /// Sample rate of the audio.
    pub rate: Rate,
    /// Length of a unit in samples; a unit has one feature vector.
    pub unit: u32,
    /// Window over one unit.
    pub window: FeatureWindow,
    /// Length of the window in samples, centred on the unit.
    pub frame: u32,
    /// Shape of the bands.
    pub shape: BandShape,
    /// Scale on which the bands have equal width.
    pub mel: MelScale,
    /// Number of bands.
    pub bands: u32,
    /// Lower edge of the lowest band, in Hz.
    pub f_lo: f64,
    /// Upper edge of the highest band, in Hz.
    pub f_hi: f64,
    /// Logarithm of the energies.
    pub log: LogScale,
    /// Lowest energy of a band.
    pub floor: FloorRule,
    /// Cepstral coefficients per channel.
    pub n: u32,
    /// Index of the first coefficient; 0 includes the coefficient of loudness.
    pub first: u32,
    /// Cutoff of the Butterworth high-pass on the audio, in Hz; 0 for none.
    pub high_pass: f64,
    /// Order of the high-pass.
    pub high_pass_order: u32,
    /// Number of channels whose coefficients are joined in one vector: 1, or all for joint features.
    pub joined: u32,
    /// Widths of the Gaussian over time, in units, per dimension or one for all; empty for none.
    pub widths: Vec<f64>,
    /// True if the Gaussian has no look-ahead.
    pub causal: bool,
}

/// A field in which two conventions differ.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Difference {
    /// Name of the field.
    pub field: &'static str,
    /// The value that was found.
    pub found: String,
    /// The expected value.
    pub expected: String,
}

impl std::fmt::Display for Difference {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "`{}` is {}, not {}", self.field, self.found, self.expected)
    }
}

impl FeatureConventions {
    /// Returns the change of the first coefficient by 1 dB in all bands, and its value for bands with a mean square of `energy`. Returns
    /// `None` without the coefficient of loudness.
    #[must_use]
    pub fn loudness(&self, energy: f64) -> Option<(f64, f64)> {
        let decibel = match self.log {
            LogScale::Natural => std::f64::consts::LN_10 / 10.0,
            LogScale::Decibel => 1.0,
        };
        let step = f64::from(self.bands).sqrt() * decibel;
        (self.first == 0).then(|| (step, step * 10.0 * energy.max(f64::MIN_POSITIVE).log10()))
    }

    /// Returns the conventions of the cloth paper, with settings that it leaves open: three rectangular mel bands up to 20 kHz, natural
    /// logarithm, floor at -100 dB, coefficients from 0 on, high-pass at 100 Hz, no Gaussian.
    #[must_use]
    pub fn cloth(rate: Rate, unit: u32) -> Self {
        Self {
            rate,
            unit,
            window: FeatureWindow::Sine2,
            frame: 2 * unit,
            shape: BandShape::Rectangular,
            mel: MelScale::Htk,
            bands: 3,
            f_lo: 0.0,
            f_hi: 20_000.0,
            log: LogScale::Natural,
            floor: FloorRule::Level(-100.0),
            n: 3,
            first: 0,
            high_pass: 100.0,
            high_pass_order: 5,
            joined: 1,
            widths: Vec::new(),
            causal: false,
        }
    }

    /// Returns the number of dimensions of a feature vector.
    #[must_use]
    pub fn dims(&self) -> usize {
        self.n as usize * self.joined.max(1) as usize
    }

    /// Returns the number of units per second.
    #[must_use]
    pub fn unit_rate(&self) -> Option<Rate> {
        self.rate.divided_by(u64::from(self.unit))
    }

    /// Returns the width of the Gaussian for dimension `dim`, in units; 0 for none.
    #[must_use]
    pub fn width(&self, dim: usize) -> f64 {
        match self.widths.as_slice() {
            [] => 0.0,
            [one] => *one,
            widths => widths.get(dim % self.n.max(1) as usize).copied().unwrap_or(0.0),
        }
    }

    /// Returns every field by name, as text. Texts are equal only for equal fields.
    fn fields(&self) -> Vec<(&'static str, String)> {
        let text = |x: &dyn std::fmt::Debug| format!("{x:?}");
        vec![
            ("rate", self.rate.to_string()),
            ("unit", format!("{} samples", self.unit)),
            ("window", text(&self.window)),
            ("frame", format!("{} samples", self.frame)),
            ("shape", text(&self.shape)),
            ("mel", text(&self.mel)),
            ("bands", self.bands.to_string()),
            ("f_lo", format!("{} Hz", self.f_lo)),
            ("f_hi", format!("{} Hz", self.f_hi)),
            ("log", text(&self.log)),
            (
                "floor",
                match self.floor {
                    FloorRule::Level(db) => format!("{db} dB"),
                    FloorRule::Database => "that of the database".into(),
                },
            ),
            ("n", self.n.to_string()),
            ("first", self.first.to_string()),
            ("high_pass", format!("{} Hz", self.high_pass)),
            ("high_pass_order", self.high_pass_order.to_string()),
            (
                "channels",
                if self.joined > 1 { format!("{} joined", self.joined) } else { "one by one".into() },
            ),
            ("widths", text(&(0..self.dims()).map(|dim| self.width(dim)).collect::<Vec<_>>())),
            ("causal", self.causal.to_string()),
        ]
    }

    /// Returns the first field that differs from expected conventions.
    ///
    /// Widths are compared by their effect: no widths equal widths of 0, and one width equals the same width for every dimension. Without
    /// a Gaussian, `causal` is ignored.
    #[must_use]
    pub fn differs_from(&self, expected: &Self) -> Option<Difference> {
        let smoothed = |c: &Self| (0..c.dims()).any(|dim| c.width(dim) > 1.0);
        let either = smoothed(self) || smoothed(expected);
        let pairs = self.fields().into_iter().zip(expected.fields());
        pairs
            .filter(|((field, _), _)| either || !matches!(*field, "widths" | "causal"))
            .find(|((_, found), (_, expected))| found != expected)
            .map(|((field, found), (_, expected))| Difference { field, found, expected })
    }

    /// Returns a digest of all fields.
    #[must_use]
    pub fn hash(&self) -> [u8; 32] {
        let mut hasher = blake3::Hasher::new();
        for (field, value) in self.fields() {
            hasher.update(field.as_bytes()).update(&[0]).update(value.as_bytes()).update(&[0]);
        }
        *hasher.finalize().as_bytes()
    }

    /// Refuses features at input `port` whose conventions differ from those of `what`.
    ///
    /// # Errors
    /// The first field that differs.
    pub fn check(&self, port: &str, expected: &Self, what: &str) -> Result<(), Reject> {
        let Some(difference) = self.differs_from(expected) else { return Ok(()) };
        let Difference { field, found, expected } = difference;
        let message = format!("`{field}` of the features is {found}, that of the {what} {expected}");
        let help = match field {
            "widths" | "causal" => "give TemporalGaussian the same as UnitDatabase".to_owned(),
            _ => format!("give Mfcc and UnitDatabase the same `{field}`"),
        };
        Err(Reject::new("F100", message).at(port).help(help))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cloth() -> FeatureConventions {
        FeatureConventions::cloth(Rate::hz(96_000), 400)
    }

    #[test]
    fn the_first_field_that_differs_is_named() {
        assert_eq!(cloth().differs_from(&cloth()), None);
        let other = FeatureConventions { f_hi: 24_000.0, ..cloth() };
        let difference = cloth().differs_from(&other).unwrap();
        assert_eq!(difference.to_string(), "`f_hi` is 20000 Hz, not 24000 Hz");
        assert_ne!(cloth().hash(), other.hash());
        let reject = cloth().check("features", &other, "database").unwrap_err();
        assert!(reject.code == "F100" && reject.message.contains("`f_hi`"), "{reject}");
        let floors = FeatureConventions { floor: FloorRule::Level(-99.0), ..cloth() };
        assert_eq!(cloth().differs_from(&floors).unwrap().field, "floor");
    }

    #[test]
    fn every_field_that_differs_is_named() {
        let base = FeatureConventions { widths: vec![20.0, 50.0, 10.0], ..cloth() };
        let other = |change: &dyn Fn(&mut FeatureConventions)| {
            let mut other = base.clone();
            change(&mut other);
            assert_ne!(other.hash(), base.hash());
            other.differs_from(&base).unwrap().field
        };
        let found = [
            other(&|c| c.rate = Rate::hz(48_000)),
            other(&|c| c.unit = 200),
            other(&|c| c.window = FeatureWindow::Hann),
            other(&|c| c.frame = 200),
            other(&|c| c.shape = BandShape::Triangular),
            other(&|c| c.mel = MelScale::Slaney),
            other(&|c| c.bands = 13),
            other(&|c| c.f_lo = 20.0),
            other(&|c| c.f_hi = 16_000.0),
            other(&|c| c.log = LogScale::Decibel),
            other(&|c| c.floor = FloorRule::Level(-300.0)),
            other(&|c| c.floor = FloorRule::Database),
            other(&|c| c.n = 2),
            other(&|c| c.first = 1),
            other(&|c| c.high_pass = 20.0),
            other(&|c| c.high_pass_order = 10),
            other(&|c| c.joined = 2),
            other(&|c| c.widths = vec![10.0, 50.0, 20.0]),
            other(&|c| c.causal = true),
        ];
        let expected = [
            "rate",
            "unit",
            "window",
            "frame",
            "shape",
            "mel",
            "bands",
            "f_lo",
            "f_hi",
            "log",
            "floor",
            "floor",
            "n",
            "first",
            "high_pass",
            "high_pass_order",
            "channels",
            "widths",
            "causal",
        ];
        assert_eq!(found, expected);
        // By default the first coefficient is that of loudness, logarithms are natural, and the floor is -100 dB.
        assert_eq!(
            (base.first, base.n, base.log, base.floor),
            (0, 3, LogScale::Natural, FloorRule::Level(-100.0))
        );
    }

    #[test]
    fn widths_are_compared_by_their_effect() {
        let with = |widths: &[f64], causal| FeatureConventions { widths: widths.to_vec(), causal, ..cloth() };
        assert_eq!(with(&[20.0], false).differs_from(&with(&[20.0; 3], false)), None);
        assert_eq!(with(&[], false).differs_from(&with(&[0.0], true)), None);
        assert_eq!(with(&[20.0], true).differs_from(&with(&[20.0], false)).unwrap().field, "causal");
        assert_eq!(
            with(&[20.0, 50.0, 10.0], false).differs_from(&with(&[20.0], false)).unwrap().field,
            "widths"
        );
        let joint = FeatureConventions { joined: 2, ..with(&[20.0, 50.0, 10.0], false) };
        assert_eq!((joint.dims(), joint.width(4)), (6, 50.0));
    }
}
