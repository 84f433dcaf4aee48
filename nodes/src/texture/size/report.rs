//! A report of the sizes of all codes of a texture, and of the costs of contacts on them.

use crate::core::item::Data;
use crate::core::random::Rng;
use serde::{Deserialize, Serialize};

/// Size of one code of a texture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SizeEntry {
    /// The code.
    pub what: String,
    /// Its size in bytes.
    pub bytes: u64,
}

/// Cost of contacts on one code of a texture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CostEntry {
    /// The code.
    pub what: String,
    /// Microseconds per millisecond of a contact at 1 m/s and 44.1 kHz on one core of a server. It is a constant from a benchmark, not a
    /// measurement, so that reports are reproducible.
    pub us_per_ms: f64,
}

/// Microseconds per millisecond of a contact on a map, by `benches/scrape.rs`.
pub const MAP_COST: f64 = 0.42;
/// Microseconds per millisecond of a contact on a noise profile, by `benches/scrape.rs`.
pub const NOISE_COST: f64 = 0.53;

/// Sizes and costs of the codes of a texture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SizeReport {
    /// Columns and rows.
    pub pixels: [usize; 2],
    /// Size of the image in bytes, at 8 bits of red, green and blue.
    pub image: u64,
    /// Sizes of the codes.
    pub entries: Vec<SizeEntry>,
    /// Costs of contacts.
    pub costs: Vec<CostEntry>,
}

impl SizeReport {
    /// An empty report of an image.
    #[must_use]
    pub fn new(pixels: [usize; 2]) -> Self {
        Self {
            pixels,
            image: 3 * pixels[0] as u64 * pixels[1] as u64,
            entries: Vec::new(),
            costs: Vec::new(),
        }
    }

    /// Adds the size of a code.
    pub fn add(&mut self, what: &str, bytes: usize) {
        self.entries.push(SizeEntry { what: what.into(), bytes: bytes as u64 });
    }

    /// Adds the cost of contacts on a code.
    pub fn add_cost(&mut self, what: &str, us_per_ms: f64) {
        self.costs.push(CostEntry { what: what.into(), us_per_ms });
    }
}

impl Data for SizeReport {
    const NAME: &'static str = "size report";

    fn trial(rng: &mut Rng) -> Self {
        let mut report = Self::new([1 + rng.below(100), 1 + rng.below(100)]);
        report.add("trial", rng.below(1000));
        report
    }
}
