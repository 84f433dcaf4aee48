//! The bytes of each way to store a texture, and the cost of each way to play it.

use crate::core::item::Data;
use crate::core::random::Rng;
use serde::{Deserialize, Serialize};

/// One way to store a part of a texture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SizeEntry {
    /// What is stored, and how.
    pub what: String,
    /// Bytes that it takes.
    pub bytes: u64,
}

/// What one way to play a texture takes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CostEntry {
    /// What is played.
    pub what: String,
    /// Microseconds for each millisecond of a contact at 1 m/s, at 44.1 kHz on a core of a server: a figure, no measurement, so that
    /// the same comes out everywhere.
    pub us_per_ms: f64,
}

/// Microseconds for each millisecond of a contact, as `benches/scrape.rs` finds them: what is read of a map, and a line of noise.
pub const MAP_COST: f64 = 0.42;
/// The same of noise.
pub const NOISE_COST: f64 = 0.53;

/// The bytes of every way to store a texture, and what it takes to play.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SizeReport {
    /// Columns and rows.
    pub pixels: [usize; 2],
    /// Bytes of the image in 8 bits of red, green and blue.
    pub image: u64,
    /// The ways.
    pub entries: Vec<SizeEntry>,
    /// What a contact costs.
    pub costs: Vec<CostEntry>,
}

impl SizeReport {
    /// A report on an image that has no entry yet.
    #[must_use]
    pub fn new(pixels: [usize; 2]) -> Self {
        Self {
            pixels,
            image: 3 * pixels[0] as u64 * pixels[1] as u64,
            entries: Vec::new(),
            costs: Vec::new(),
        }
    }

    /// Adds a way.
    pub fn add(&mut self, what: &str, bytes: usize) {
        self.entries.push(SizeEntry { what: what.into(), bytes: bytes as u64 });
    }

    /// Adds a way to play it.
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
