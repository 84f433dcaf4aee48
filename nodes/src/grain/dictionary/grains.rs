//! Grains of many recordings.

use super::error::{GRAINS_VERSION, GrainError};
use super::grain::Grain;
use super::grain_tracks::SteadyTracks;
use super::taper::TaperShape;
use crate::core::item::Data;
use crate::core::node::Summary;
use crate::core::random::Rng;
use crate::grain::recording::{Component, SourceKind};
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Bytes of a grain beside its samples, as in the budget of a game.
pub const BYTES_PER_GRAIN: usize = 48;

/// A component of a recording that grains come from.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GrainSource {
    /// Provenance of the recording.
    pub name: String,
    /// Licence of the recording.
    pub licence: String,
    /// Words that describe it.
    pub tags: Vec<String>,
    /// Kind of contact.
    pub kind: SourceKind,
    /// The component.
    pub component: Component,
    /// Speed of the recorded motion, m/s, if it is known.
    pub speed: Option<f64>,
    /// Digest of the content of the recording.
    pub content: String,
    /// Samples of the recording.
    pub frames: u64,
}

/// Successive samples of a source: neighbouring grains, and a margin at both ends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Run {
    /// Its first sample in the samples of the dictionary.
    pub offset: u64,
    /// Samples of each channel.
    pub frames: u32,
    /// Number of channels, stored one after the other.
    pub channels: u16,
}

/// Grains of many recordings.
///
/// Neighbouring grains share the samples around their cut, so that nothing is stored twice.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GrainDictionary {
    /// [`GRAINS_VERSION`].
    pub version: u32,
    /// Sample rate, Hz.
    pub rate: f64,
    /// True if the tapers are those of the usual Tukey window, in place of raised cosines at half samples.
    pub symmetric_tapers: bool,
    /// Bits of the samples, 4 to 16, each grain scaled to its own peak; 0 for 32-bit floats.
    pub bits: u16,
    /// Components of the recordings.
    pub sources: Vec<GrainSource>,
    /// The grains, by source and time.
    pub grains: Vec<Grain>,
    /// Runs of samples.
    pub runs: Vec<Run>,
    /// Step of the samples of each block, with `bits`: for each run, its margins and its grains in order.
    pub steps: Vec<f32>,
    /// All samples.
    pub samples: Vec<f32>,
    /// Sinusoids of steady grains.
    pub tracks: Option<SteadyTracks>,
}

impl GrainDictionary {
    /// Returns the number of grains.
    #[must_use]
    pub fn len(&self) -> usize {
        self.grains.len()
    }

    /// Returns true if there are no grains.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.grains.is_empty()
    }

    /// The source of a grain.
    #[must_use]
    pub fn source(&self, grain: &Grain) -> Option<&GrainSource> {
        self.sources.get(grain.source as usize)
    }

    /// Samples of one channel of a run; a mono run has its channel for all.
    #[must_use]
    pub fn run(&self, run: u32, channel: usize) -> &[f32] {
        let Some(run) = self.runs.get(run as usize) else { return &[] };
        let frames = run.frames as usize;
        let start = run.offset as usize + channel.min(usize::from(run.channels).saturating_sub(1)) * frames;
        self.samples.get(start..start + frames).unwrap_or_default()
    }

    /// Channels of a grain.
    #[must_use]
    pub fn channels(&self, grain: &Grain) -> usize {
        self.runs.get(grain.run as usize).map_or(1, |run| usize::from(run.channels).max(1))
    }

    /// The windowed grain, channels averaged.
    #[must_use]
    pub fn windowed(&self, grain: &Grain) -> Vec<f32> {
        let channels = self.channels(grain);
        let mut mono = vec![0.0_f64; grain.window_len()];
        for channel in 0..channels {
            let samples = self.run(grain.run, channel).get(grain.span()).unwrap_or_default();
            mono.iter_mut().zip(samples).for_each(|(sum, x)| *sum += f64::from(*x));
        }
        let window = self.window(grain);
        let scale = f64::from(grain.gain) / channels as f64;
        mono.iter().zip(window).map(|(x, w)| (w * x * scale) as f32).collect()
    }

    /// One channel of the windowed grain.
    #[must_use]
    pub fn windowed_channel(&self, grain: &Grain, channel: usize) -> Vec<f32> {
        let samples = self.run(grain.run, channel).get(grain.span()).unwrap_or_default();
        let window = self.window(grain);
        samples.iter().zip(window).map(|(x, w)| (w * f64::from(*x) * f64::from(grain.gain)) as f32).collect()
    }

    /// The window of a grain.
    pub fn window(&self, grain: &Grain) -> impl Iterator<Item = f64> + use<> {
        let shape = if self.symmetric_tapers { TaperShape::Symmetric } else { TaperShape::HalfSample };
        shape.window(grain.window_len(), grain.taper.map(usize::from))
    }

    /// Samples that a run has before and after a windowed grain.
    #[must_use]
    pub fn margins(&self, grain: &Grain) -> [usize; 2] {
        let (span, frames) =
            (grain.span(), self.runs.get(grain.run as usize).map_or(0, |run| run.frames as usize));
        [span.start, frames.saturating_sub(span.end)]
    }

    /// Returns true if grain `b` follows grain `a` in their source, without a gap.
    #[must_use]
    pub fn are_neighbours(a: &Grain, b: &Grain) -> bool {
        a.run == b.run && a.position + a.len == b.position
    }

    /// Bytes of the dictionary without coding: samples with 2 or 4 bytes, 48 bytes for each grain, and tracks.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let tracks: usize = (0..self.grains.len()).map(|k| self.track_bytes(k)).sum();
        self.samples.len() * self.sample_bytes() + BYTES_PER_GRAIN * self.grains.len() + tracks
    }

    /// Bytes of the tracks of a grain.
    #[must_use]
    pub fn track_bytes(&self, grain: usize) -> usize {
        self.tracks.as_ref().map_or(0, |tracks| tracks.bytes_of(grain))
    }

    /// Median length of the windowed grains, in samples.
    #[must_use]
    pub fn median_len(&self) -> usize {
        let mut lengths: Vec<usize> = self.grains.iter().map(Grain::window_len).collect();
        lengths.sort_unstable();
        lengths.get(lengths.len() / 2).copied().unwrap_or(0)
    }

    /// Mean length of the windowed grains, in samples.
    #[must_use]
    pub fn mean_len(&self) -> f64 {
        let sum: usize = self.grains.iter().map(Grain::window_len).sum();
        sum as f64 / self.grains.len().max(1) as f64
    }

    /// Blocks of equal steps of each run, as samples of one channel of the run: margins, grains, and the samples between them.
    #[must_use]
    pub fn blocks(&self) -> Vec<Vec<Range<usize>>> {
        let mut ends: Vec<Vec<usize>> = self.runs.iter().map(|run| vec![0, run.frames as usize]).collect();
        for grain in &self.grains {
            if let Some(ends) = ends.get_mut(grain.run as usize) {
                ends.extend([grain.position as usize, grain.position as usize + grain.len as usize]);
            }
        }
        for ends in &mut ends {
            ends.sort_unstable();
            ends.dedup();
        }
        ends.iter().map(|ends| ends.windows(2).map(|w| w[0]..w[1]).collect()).collect()
    }

    /// Bytes of a sample without coding.
    #[must_use]
    pub fn sample_bytes(&self) -> usize {
        if self.bits > 0 { 2 } else { 4 }
    }

    /// Rounds all samples to a number of bits, 4 to 16, each block scaled to its own peak.
    pub fn quantise(&mut self, bits: u16) {
        let blocks = self.blocks();
        self.bits = bits.clamp(4, 16);
        let greatest = ((1_u32 << (self.bits - 1)) - 1) as f32;
        self.steps.clear();
        for (run, blocks) in self.runs.iter().zip(blocks) {
            for block in blocks {
                let spans = (0..usize::from(run.channels)).map(|c| {
                    let start = run.offset as usize + c * run.frames as usize;
                    start + block.start..start + block.end
                });
                let spans: Vec<Range<usize>> = spans.collect();
                let peak =
                    spans.iter().flat_map(|s| &self.samples[s.clone()]).fold(0.0_f32, |p, x| p.max(x.abs()));
                let step = peak / greatest;
                self.steps.push(step);
                for x in spans.into_iter().flat_map(|s| s.collect::<Vec<_>>()) {
                    let x = &mut self.samples[x];
                    // Zero has one sign, as in files.
                    *x = if step > 0.0 { (*x / step).round() * step + 0.0 } else { 0.0 };
                }
            }
        }
    }

    /// Checks the invariants that the type does not enforce.
    ///
    /// # Errors
    /// The first thing found.
    pub fn validate(&self) -> Result<(), GrainError> {
        if self.version != GRAINS_VERSION {
            return Err(GrainError::Version { found: self.version });
        }
        if self.grains.is_empty() {
            return Err(GrainError::Empty);
        }
        if self.bits > 16 {
            return Err(GrainError::Length { what: "bits", found: self.bits.into(), wanted: 16 });
        }
        if !(self.rate.is_finite() && self.rate >= 1.0) {
            return Err(GrainError::NotFinite { what: "the rate", index: 0 });
        }
        let mut wanted = 0_usize;
        for run in &self.runs {
            if run.offset != wanted as u64 || run.channels == 0 {
                return Err(GrainError::Length {
                    what: "samples before a run",
                    found: run.offset as usize,
                    wanted,
                });
            }
            wanted = wanted.saturating_add((run.frames as usize).saturating_mul(usize::from(run.channels)));
        }
        if self.samples.len() != wanted {
            return Err(GrainError::Length { what: "samples", found: self.samples.len(), wanted });
        }
        if let Some(index) = self.samples.iter().position(|x| !x.is_finite()) {
            return Err(GrainError::NotFinite { what: "sample", index });
        }
        for (k, grain) in self.grains.iter().enumerate() {
            let wrong = |field, found| Err(GrainError::Grain { grain: k, field, found });
            let Some(run) = self.runs.get(grain.run as usize) else { return wrong("run", grain.run.into()) };
            let Some(source) = self.source(grain) else { return wrong("source", grain.source.into()) };
            let after = u64::from(grain.position) + u64::from(grain.len) + u64::from(grain.reach[1]);
            if grain.len == 0 || after > u64::from(run.frames) {
                return wrong("len", grain.len.into());
            }
            if u32::from(grain.reach[0]) > grain.position || u64::from(grain.reach[0]) > grain.start {
                return wrong("reach", grain.reach[0].into());
            }
            if grain.start.saturating_add(u64::from(grain.len)) > source.frames {
                return wrong("start", grain.start);
            }
            if grain.taper.iter().any(|t| usize::from(*t) > grain.window_len()) {
                return wrong("taper", grain.taper[0].into());
            }
            if !(grain.power.is_finite()
                && grain.power >= 0.0
                && grain.centroid.is_finite()
                && grain.gain.is_finite())
            {
                return Err(GrainError::NotFinite { what: "power of grain", index: k });
            }
        }
        let wanted: usize = if self.bits > 0 { self.blocks().iter().map(Vec::len).sum() } else { 0 };
        if self.steps.len() != wanted {
            return Err(GrainError::Length { what: "steps", found: self.steps.len(), wanted });
        }
        if let Some(index) = self.steps.iter().position(|step| !step.is_finite()) {
            return Err(GrainError::NotFinite { what: "step", index });
        }
        let channels = self.grains.iter().map(|grain| self.channels(grain));
        self.tracks.as_ref().map_or(Ok(()), |tracks| tracks.validate(self.rate, channels))
    }

    /// Digest of all that patterns refer to.
    #[must_use]
    pub fn id(&self) -> String {
        let mut hash = blake3::Hasher::new();
        hash.update(&self.rate.to_le_bytes());
        for grain in &self.grains {
            let numbers = [
                u64::from(grain.source),
                grain.start,
                grain.len.into(),
                grain.run.into(),
                grain.position.into(),
            ];
            for number in
                numbers.into_iter().chain(grain.reach.iter().chain(&grain.taper).map(|x| (*x).into()))
            {
                hash.update(&number.to_le_bytes());
            }
        }
        for sample in &self.samples {
            hash.update(&sample.to_le_bytes());
        }
        hash.finalize().to_hex().chars().take(32).collect()
    }

    /// Figures for the summary of a run.
    #[must_use]
    pub fn summary(&self) -> Summary {
        let of = |kind| {
            self.grains.iter().filter(|g| self.source(g).is_some_and(|source| source.kind == kind)).count()
        };
        vec![
            ("grains", self.grains.len().into()),
            ("impulsive", of(SourceKind::Impulsive).into()),
            ("continuous", of(SourceKind::Continuous).into()),
            ("mean_samples", self.mean_len().into()),
            ("bytes", self.bytes().into()),
        ]
    }
}

impl Data for GrainDictionary {
    const NAME: &'static str = "grain dictionary";
    const FILES: bool = true;

    fn file(&self) -> Option<Vec<u8>> {
        self.to_bytes().ok()
    }

    fn trial(_: &mut Rng) -> Self {
        // One dictionary for all trials, to which the patterns of trials refer.
        crate::grain::trial_dictionary()
    }
}
