//! The node `AdditiveResynth`.

use super::item::{FrameFormat, TrackFrames};
use super::synthesis::TrackSynthesis;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Channels;
use crate::core::node::{Class, Node, Retune, same_rate};
use crate::core::ports::{Events, EventsIn, In, Stream};
use crate::core::random::Rng;
use crate::core::shape::{Build, Ends, Shape};
use crate::core::time::{Rate, Tick};
use crate::dsp::Trigger;
use crate::grain::segmentation::spectral_flux::mono;
use crate::{archive_state, params, ports};

/// Most attacks within a window of the analysis.
const MAX_ATTACKS: usize = 64;
/// Ratios that a control can set.
const RATIOS: [f64; 2] = [0.01, 100.0];

params! {
    /// Plays the tracks of sinusoids: the steady part of a sound, at its own frequencies or at others.
    ///
    /// With a `ratio` of 1 each track has its measured phases, so that the sound without its steady part is the output of
    /// `TransientResidual`. Another ratio multiplies the frequencies and leaves the duration unchanged. From then on the phase of a track
    /// follows from its frequencies, also where the ratio is 1 again. The ratio is read at each frame, and reached at the
    /// next one. Tracks fade in and out over one hop, also where they exceed 0.45 times the rate.
    ///
    /// Tracks that begin around one of the `attacks` are silent before it and rise within 2 ms: without them the window of the analysis
    /// spreads an attack over half its length ahead.
    ///
    /// # Source
    /// McAulay and Quatieri, "Speech analysis/synthesis based on a sinusoidal representation" (IEEE TASSP 34(4), 1986), section IV.
    pub struct AdditiveResynthParams {
        /// Factor of the frequencies.
        ratio: f64 = 1.0, unit "", range 0.01..=100.0;
    }
}
ports! {
    /// Ports of `AdditiveResynth`.
    pub struct AdditiveResynthPorts / AdditiveResynthIo {
        in {
            /// The tracks.
            tracks: Stream<TrackFrames>,
            /// Factor of the frequencies at the rate of the sound, within 0.01 and 100; replaces the parameter.
            ratio: Option<Stream<f32>>,
            /// Attacks, such as the onsets of `FluxSegmenter`.
            attacks: Option<Events<Trigger>>,
        }
        out {
            /// The sound, mono.
            steady: Stream<f32>,
        }
    }
}

/// The node over [`TrackSynthesis`].
pub struct AdditiveResynth {
    synthesis: TrackSynthesis,
    rate: Rate,
    hop: i64,
    half_window: i64,
    /// The ratio of the parameter.
    ratio: f64,
    /// The ratio at the frame at the end of the hop.
    reached: Option<f64>,
    /// The samples of a hop, and its frame.
    samples: Vec<f32>,
    frame: Option<i64>,
    attacks: Vec<usize>,
}

fn audio_rate(format: FrameFormat, frames: Rate) -> Result<Rate, Reject> {
    let too_fast =
        || Reject::new("F051", format!("frames of {} samples at {frames} are too fast", format.hop));
    format.audio_rate(frames).ok_or_else(too_fast)
}

impl Node for AdditiveResynth {
    type Params = AdditiveResynthParams;
    type Ports = AdditiveResynthPorts;
    const NAME: &'static str = "AdditiveResynth";
    const CLASS: Class = Class::Audio;
    const COST: f64 = 200.0;

    fn shape(_: &AdditiveResynthParams, s: &mut Shape<'_, '_, AdditiveResynthPorts>) -> Result<(), Reject> {
        let tracks = s.input(AdditiveResynthPorts::tracks);
        let rate = audio_rate(tracks.format, tracks.rate)?;
        if let Some(ratio) = s.optional(AdditiveResynthPorts::ratio) {
            s.check(mono(ratio.format, "ratio"));
            same_rate("ratio", ratio.rate, "the sound of `tracks`", rate)?;
        }
        let FrameFormat { hop, window, .. } = tracks.format;
        s.lookaround(AdditiveResynthPorts::tracks, 1, 1);
        s.lookaround(AdditiveResynthPorts::ratio, hop, 0);
        s.when_ended(AdditiveResynthPorts::ratio, Ends::Hold);
        let ticks = |samples| usize::try_from(rate.span(samples)).unwrap_or_default();
        s.lookaround(AdditiveResynthPorts::attacks, ticks(hop), ticks(hop + window / 2));
        // The last frame is centred on the end.
        s.ends(tracks.end.map(|end| (end - 1).max(0)));
        s.output(AdditiveResynthPorts::steady, rate, Channels(1));
        Ok(())
    }

    fn build(p: &AdditiveResynthParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let tracks = cx.input(AdditiveResynthPorts::tracks);
        let rate = audio_rate(tracks.format, tracks.rate)?;
        let FrameFormat { count, hop, window } = tracks.format;
        Ok(Self {
            synthesis: TrackSynthesis::new(count, [hop, window / 2], rate.as_f64()),
            rate,
            hop: hop as i64,
            half_window: (window / 2) as i64,
            ratio: p.ratio,
            reached: None,
            samples: vec![0.0; hop],
            frame: None,
            attacks: Vec::with_capacity(MAX_ATTACKS),
        })
    }

    fn run(&mut self, mut io: AdditiveResynthIo<'_>) -> Result<(), Fault> {
        let mut at = io.steady.first();
        let mut out = io.steady.items();
        while !out.is_empty() {
            let (frame, from) = (at.div_euclid(self.hop), at.rem_euclid(self.hop) as usize);
            if self.frame != Some(frame) {
                self.fill(frame, &io.tracks, io.ratio.as_ref(), io.attacks.as_ref());
            }
            let count = out.len().min(self.samples.len() - from);
            let (now, rest) = out.split_at_mut(count);
            now.copy_from_slice(&self.samples[from..from + count]);
            (out, at) = (rest, at + count as i64);
        }
        Ok(())
    }

    fn retune(&mut self, new: &AdditiveResynthParams) -> Retune {
        self.ratio = new.ratio;
        Retune::Done
    }

    archive_state!(synthesis, reached, samples, frame);

    fn trial(rng: &mut Rng) -> (AdditiveResynthParams, MemoryFiles) {
        let ratio = if rng.below(3) == 0 { 1.0 } else { rng.between(0.01, 3.0) };
        (AdditiveResynthParams { ratio }, MemoryFiles::default())
    }
}

impl AdditiveResynth {
    /// Computes the samples of the hop after a frame.
    fn fill(
        &mut self,
        frame: i64,
        tracks: &In<'_, TrackFrames>,
        ratio: Option<&In<'_, f32>>,
        attacks: Option<&EventsIn<'_, Trigger>>,
    ) {
        let start = frame * self.hop;
        let ratio =
            ratio.map_or(self.ratio, |ratio| f64::from(ratio.item((start - ratio.first()) as isize)[0]));
        let ratio = ratio.clamp(RATIOS[0], RATIOS[1]);
        let ratios = [self.reached.replace(ratio).unwrap_or(ratio), ratio];
        self.attacks.clear();
        let sample = |tick: &Tick| self.rate.first_at(*tick);
        let reach = start - self.hop..start + self.hop + self.half_window;
        let near = attacks.map_or(&[][..], EventsIn::events).iter().map(|(tick, _)| sample(tick));
        let near = near.filter(|at| reach.contains(at)).take(MAX_ATTACKS);
        self.attacks.extend(near.map(|at| at as usize));
        let at = (frame - tracks.first()) as isize;
        self.samples.fill(0.0);
        let points = [tracks.item(at), tracks.item(at + 1)];
        self.synthesis.add(frame as usize, points, ratios, &self.attacks, &mut self.samples);
        self.frame = Some(frame);
    }
}

#[cfg(test)]
mod tests;
