//! Feature vectors as items of streams.

use std::sync::Arc;

use super::conventions::{BandShape, FeatureConventions, FeatureWindow, FloorRule, LogScale, MelScale};
use crate::core::item::Item;
use crate::core::random::Rng;
use crate::core::time::Rate;

/// One or more feature vectors per unit of sound.
///
/// # Shapes
/// An item holds `vectors` vectors of `conventions.dims()` numbers in sequence: one vector per channel if channels are independent,
/// otherwise one vector.
#[derive(Debug)]
pub struct Features;

/// The format of a stream of features.
///
/// It holds the conventions, so that a database or a warp of other conventions is refused.
#[derive(Clone, Debug, PartialEq)]
pub struct FeatureFormat {
    /// Vectors per unit.
    pub vectors: usize,
    /// Conventions of the features.
    pub conventions: Arc<FeatureConventions>,
}

impl FeatureFormat {
    /// Returns the format with other conventions of the same number of dimensions.
    #[must_use]
    pub fn with(&self, conventions: FeatureConventions) -> Self {
        Self { vectors: self.vectors, conventions: Arc::new(conventions) }
    }

    /// Returns the number of dimensions of a vector.
    #[must_use]
    pub fn dims(&self) -> usize {
        self.conventions.dims()
    }
}

impl FeatureConventions {
    /// Returns the conventions of trials. They are the same in every stream and artefact, so that those of one trial are compatible.
    #[must_use]
    pub fn trial() -> Self {
        Self {
            rate: Rate::hz(8000),
            unit: 4,
            window: FeatureWindow::Sine2,
            frame: 8,
            shape: BandShape::Rectangular,
            mel: MelScale::Htk,
            bands: 3,
            f_lo: 0.0,
            f_hi: 4000.0,
            log: LogScale::Natural,
            floor: FloorRule::Level(-100.0),
            n: 3,
            first: 0,
            high_pass: 0.0,
            high_pass_order: 5,
            joined: 1,
            widths: Vec::new(),
            causal: false,
        }
    }
}

impl Item for Features {
    type Elem = f32;
    type Format = FeatureFormat;
    const NAME: &'static str = "features";
    const COLUMNS: &'static [&'static str] = &[""];

    fn width(format: &FeatureFormat) -> usize {
        format.vectors * format.dims()
    }

    fn describe(format: &FeatureFormat) -> String {
        let dims = format.dims();
        match format.vectors {
            1 => format!("vectors of {dims}"),
            n => format!("{n} channels of vectors of {dims}"),
        }
    }

    fn trial_format(rng: &mut Rng) -> FeatureFormat {
        FeatureFormat { vectors: 1 + rng.below(2), conventions: Arc::new(FeatureConventions::trial()) }
    }

    fn trial(_: &FeatureFormat, _: usize, rng: &mut Rng) -> f32 {
        rng.between(-3.0, 3.0) as f32
    }

    fn finite(elem: &f32) -> bool {
        elem.is_finite()
    }

    fn poison() -> f32 {
        f32::NAN
    }

    fn numbers(elem: &f32, out: &mut Vec<f32>) {
        out.push(*elem);
    }
}
