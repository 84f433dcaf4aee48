//! Peaks and tracks as items of streams.

use super::peaks::SinePeak;
use crate::core::item::Item;
use crate::core::random::Rng;
use crate::core::time::Rate;
use serde::{Deserialize, Serialize};

/// The sinusoids in each frame of a sound.
///
/// # Shapes
/// An item holds as many peaks as the format says, the largest first; unused ones have the amplitude 0.
#[derive(Debug)]
pub struct PeakFrames;

/// The sinusoids of each frame with the tracks that they belong to.
///
/// # Shapes
/// An item holds as many slots as the format says. A track stays in its slot from its first to its last frame.
#[derive(Debug)]
pub struct TrackFrames;

/// Format of a stream of frames; frame `k` is centred on sample `k hop`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameFormat {
    /// Peaks or slots of a frame.
    pub count: usize,
    /// Samples from one frame to the next.
    pub hop: usize,
    /// Samples of the window.
    pub window: usize,
}

impl FrameFormat {
    /// Rate of the sound.
    #[must_use]
    pub fn audio_rate(&self, frames: Rate) -> Option<Rate> {
        frames.times(self.hop as u64)
    }

    fn text(&self, what: &str) -> String {
        format!("{} {what} every {} samples", self.count, self.hop)
    }

    fn trial(rng: &mut Rng) -> Self {
        Self { count: 1 + rng.below(5), hop: 1 + rng.below(9), window: 1 + 2 * rng.below(20) }
    }
}

/// A sinusoid of a track at the centre of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TrackPoint {
    /// Number of the track, from 1 on; 0 for an empty slot.
    pub track: u32,
    /// The sinusoid.
    pub peak: SinePeak,
}

impl SinePeak {
    fn is_finite(&self) -> bool {
        [self.frequency, self.amplitude, self.phase].iter().all(|x| x.is_finite())
    }

    fn trial(rate: f64, rng: &mut Rng) -> Self {
        let amplitude = if rng.below(4) == 0 { 0.0 } else { rng.between(0.0, 1.0) };
        Self { frequency: rng.between(0.0, 0.5 * rate), amplitude, phase: rng.between(-3.1, 3.1) }
    }

    fn poison() -> Self {
        Self { frequency: f64::NAN, ..Self::default() }
    }

    fn numbers(&self) -> [f32; 3] {
        [self.frequency, self.amplitude, self.phase].map(|x| x as f32)
    }
}

impl Item for PeakFrames {
    type Elem = SinePeak;
    type Format = FrameFormat;
    const NAME: &'static str = "peaks";
    const COLUMNS: &'static [&'static str] = &["frequency", "amplitude", "phase"];

    fn width(format: &FrameFormat) -> usize {
        format.count
    }

    fn describe(format: &FrameFormat) -> String {
        format.text("peaks")
    }

    fn trial_format(rng: &mut Rng) -> FrameFormat {
        FrameFormat::trial(rng)
    }

    fn trial(_: &FrameFormat, _: usize, rng: &mut Rng) -> SinePeak {
        SinePeak::trial(200.0, rng)
    }

    fn finite(peak: &SinePeak) -> bool {
        peak.is_finite()
    }

    fn poison() -> SinePeak {
        SinePeak::poison()
    }

    fn numbers(peak: &SinePeak, out: &mut Vec<f32>) {
        out.extend(peak.numbers());
    }
}

impl Item for TrackFrames {
    type Elem = TrackPoint;
    type Format = FrameFormat;
    const NAME: &'static str = "tracks";
    const COLUMNS: &'static [&'static str] = &["track", "frequency", "amplitude", "phase"];

    fn width(format: &FrameFormat) -> usize {
        format.count
    }

    fn describe(format: &FrameFormat) -> String {
        format.text("slots")
    }

    fn trial_format(rng: &mut Rng) -> FrameFormat {
        FrameFormat::trial(rng)
    }

    fn trial(_: &FrameFormat, place: usize, rng: &mut Rng) -> TrackPoint {
        let track = if rng.below(5) == 0 { 0 } else { 1 + place as u32 + 100 * u32::from(rng.below(9) == 0) };
        TrackPoint { track, peak: SinePeak::trial(1000.0, rng) }
    }

    fn finite(point: &TrackPoint) -> bool {
        point.peak.is_finite()
    }

    fn poison() -> TrackPoint {
        TrackPoint { track: 0, peak: SinePeak::poison() }
    }

    fn numbers(point: &TrackPoint, out: &mut Vec<f32>) {
        out.push(point.track as f32);
        out.extend(point.peak.numbers());
    }
}
