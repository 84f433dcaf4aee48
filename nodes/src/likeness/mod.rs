//! The likeness of a sound and the recordings that it was made of: repeats, lines of the envelope, joins, and statistics.
//!
//! [`compare`] measures a sound and each recording (a *take*) alike, and sets the values of the sound beside their range over the takes.

mod active;
mod bands;
mod comparison;
mod envelope_lines;
mod figure;
mod joins;
pub mod likeness_report;
pub mod likeness_table;
mod modulation;
mod repeats;
mod report;
mod spectrogram;
mod statistics;
mod takes;

pub use active::ActiveSound;
pub(crate) use active::power_db;
pub use bands::{Band, Moments, band_energies, octaves, third_octaves};
pub use comparison::{LikenessRules, compare};
pub use envelope_lines::{EnvelopeSpectrum, HarmonicLine};
pub use joins::{JoinPlace, JoinReport};
pub use modulation::{MODULATION_EDGES, modulation_spectrum};
pub use repeats::{FrameRepeat, RepeatRules, RepeatStretch, frame_repeats, stretches};
pub use report::{Likeness, LineReport, RepeatReport, Statistic, TakeFigures};
pub use statistics::SoundStatistics;
pub use takes::Take;
