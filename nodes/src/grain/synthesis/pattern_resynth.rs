//! The node `PatternResynth`.

use super::gap_noise::gap_noise;
use super::segment::{GrainSegment, segments};
use super::selection::{check_patterns, check_rate, patterns_of};
use super::walk::{GapRule, walk};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Channels;
use crate::core::node::{Class, Node, Retune, Summary};
use crate::core::params::{Params, Text};
use crate::core::ports::{Stream, Value};
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::{Rate, ticks};
use crate::dsp::db_to_linear;
use crate::grain::correlation::CorrelationPatterns;
use crate::grain::dictionary::GrainDictionary;
use crate::grain::recording::Component;
use crate::{params, ports};
use std::sync::Arc;

params! {
    /// Plays a recording from its pattern of grains.
    ///
    /// Each grain is followed by the best one that begins where its last taper begins, or soon after. Each has the power of the recording
    /// under it. Neighbouring grains join seamlessly, others are cross-faded. Steady and transient part are added.
    ///
    /// # Source
    /// Picard, Tsingos and Faure, "Retargetting Example Sounds to Interactive Physics-Driven Animations" (AES 35, 2009), section 4.1. The
    /// amplitude is the square root of the ratio of powers; the ratio itself would square the dynamics.
    pub struct PatternResynthParams {
        /// Part of the name of the recording; the first one by default.
        recording: Text = "".into();
        /// Time at which it begins.
        start: f64 = 0.0, unit "s", range 0.0..=86_400.0;
        /// Play it again at its end.
        repeat: bool = false;
        /// Duration of the output; None for no end.
        duration: Option<f64> = Some(5.0), unit "s", range 0.0..=86_400.0;
        /// Sound after a grain that no other follows soon.
        gap: GapRule = GapRule::Extend;
        /// Factor on the output.
        gain: f32 = 1.0, unit "", range 0.0..=1000.0;
        /// Level of the steady part.
        steady: f64 = 0.0, unit "dB", range -200.0..=60.0;
        /// Level of the transient part.
        transient: f64 = 0.0, unit "dB", range -200.0..=60.0;
        /// Channels of the output; recordings of more are averaged to one.
        channels: u16 = 1, unit "", range 1..=8_u16;
        /// Sample rate of the audio, that of the dictionary.
        rate: Rate = Rate::hz(48_000);
    }
}
ports! {
    pub struct PatternResynthPorts / PatternResynthIo {
        in {
            /// The patterns.
            patterns: Value<CorrelationPatterns>,
            /// The grains.
            dictionary: Value<GrainDictionary>,
        }
        out {
            /// The sound.
            audio: Stream<f32>,
        }
    }
}

/// Segments of one component, by their start.
#[derive(Debug)]
struct Part {
    component: Component,
    /// The dictionary that the segments are parts of.
    dictionary: Arc<GrainDictionary>,
    segments: Vec<GrainSegment>,
    /// Longest segment.
    longest: i64,
    /// True if it fills gaps.
    is_noise: bool,
}

impl Part {
    fn new(component: Component, dictionary: Arc<GrainDictionary>, segments: Vec<GrainSegment>) -> Self {
        let longest = segments.iter().map(|s| i64::from(s.len)).max().unwrap_or(0);
        Self { component, dictionary, segments, longest, is_noise: false }
    }
}

/// The node `PatternResynth`.
#[derive(Debug)]
pub struct PatternResynth {
    params: PatternResynthParams,
    rate: f64,
    parts: Vec<Part>,
    /// Frames of the recording.
    frames: i64,
}

impl PatternResynth {
    fn level(&self, component: Component) -> f32 {
        let db = match component {
            Component::Whole => 0.0,
            Component::Steady => self.params.steady,
            Component::Transient => self.params.transient,
        };
        self.params.gain * db_to_linear(db) as f32
    }
}

impl Node for PatternResynth {
    type Params = PatternResynthParams;
    type Ports = PatternResynthPorts;
    const NAME: &'static str = "PatternResynth";
    const CLASS: Class = Class::Audio;
    const COST: f64 = 10.0;

    fn shape(p: &PatternResynthParams, s: &mut Shape<'_, '_, PatternResynthPorts>) -> Result<(), Reject> {
        s.ends(p.duration.map(ticks));
        s.output(PatternResynthPorts::audio, p.rate, Channels(p.channels));
        Ok(())
    }

    fn build(p: &PatternResynthParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let dictionary = cx.value(PatternResynthPorts::dictionary);
        let patterns = cx.value(PatternResynthPorts::patterns);
        check_rate(&dictionary, p.rate)?;
        check_patterns(&patterns, &dictionary)?;
        let found = patterns_of(&patterns, &p.recording.0)?;
        let mut parts = Vec::with_capacity(found.len());
        for pattern in &found {
            let mut all = segments(&dictionary, &walk(pattern, &dictionary, p.gap));
            all.sort_by_key(|segment| segment.start);
            let noise = (p.gap == GapRule::Noise).then(|| gap_noise(&dictionary, &all)).flatten();
            parts.push(Part::new(pattern.component, Arc::clone(&dictionary), all));
            if let Some((noise, all)) = noise {
                let part = Part::new(pattern.component, Arc::new(noise), all);
                parts.push(Part { is_noise: true, ..part });
            }
        }
        let frames = found.iter().map(|pattern| pattern.frames as i64).max().unwrap_or(0);
        let last = parts.iter().flat_map(|part| part.segments.iter().map(GrainSegment::end)).max();
        let frames = frames.max(last.unwrap_or(0)).max(1);
        Ok(Self { params: p.clone(), rate: dictionary.rate, parts, frames })
    }

    fn run(&mut self, mut io: PatternResynthIo<'_>) -> Result<(), Fault> {
        let channels = io.audio.width().max(1);
        let begins = io.audio.rate().first_at(ticks(self.params.start));
        let first = io.audio.first() - begins;
        let out = io.audio.items();
        out.fill(0.0);
        let frames = (out.len() / channels) as i64;
        // Repetitions that sound in this window.
        let rounds = if self.params.repeat {
            first.div_euclid(self.frames).max(0)..=(first + frames).div_euclid(self.frames)
        } else {
            0..=0
        };
        for round in rounds {
            let at = first - round * self.frames;
            for part in &self.parts {
                let level = self.level(part.component);
                let from = part.segments.partition_point(|s| s.start + part.longest <= at);
                for segment in part.segments[from..].iter().take_while(|s| s.start < at + frames) {
                    let segment = GrainSegment { gain: level * segment.gain, ..*segment };
                    segment.add(&part.dictionary, at, channels, out);
                }
            }
        }
        Ok(())
    }

    fn finish(&mut self, _: PatternResynthIo<'_>) -> Result<Summary, Fault> {
        let of_grains: Vec<&[GrainSegment]> =
            self.parts.iter().filter(|part| !part.is_noise).map(|part| part.segments.as_slice()).collect();
        let gap = |pair: &[GrainSegment]| (pair[1].start - pair[0].end()).max(0);
        let gaps = of_grains.iter().flat_map(|all| all.windows(2).map(gap));
        let longest = gaps.clone().max().unwrap_or(0) as f64 / self.rate;
        let total = self.frames * of_grains.len().max(1) as i64;
        let grains: usize = of_grains.iter().map(|all| all.len()).sum();
        Ok(vec![
            ("grains", grains.into()),
            ("seconds", (self.frames as f64 / self.rate).into()),
            ("gaps", (gaps.sum::<i64>() as f64 / total as f64).into()),
            ("longest_gap_s", longest.into()),
        ])
    }

    fn retune(&mut self, new: &PatternResynthParams) -> Retune {
        let p = &mut self.params;
        let fixed = (p.start, p.repeat, p.duration, p.gap, p.channels, p.rate);
        let new_fixed = (new.start, new.repeat, new.duration, new.gap, new.channels, new.rate);
        if p.recording != new.recording || fixed != new_fixed {
            return Retune::Rebuild;
        }
        (p.gain, p.steady, p.transient) = (new.gain, new.steady, new.transient);
        Retune::Done
    }

    fn trial(rng: &mut Rng) -> (PatternResynthParams, MemoryFiles) {
        let params = PatternResynthParams {
            recording: ["", "trial_1"][rng.below(2)].into(),
            rate: Rate::hz(8000),
            start: rng.between(0.0, 0.1),
            duration: Some(rng.between(0.1, 0.6)),
            gain: rng.between(0.0, 2.0) as f32,
            steady: 0.0,
            transient: 0.0,
            channels: 1 + rng.below(2) as u16,
            ..PatternResynthParams::trial(rng)
        };
        (params, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests;
