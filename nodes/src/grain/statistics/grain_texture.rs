//! The node `GrainTexture`.

use super::generator::{Generator, GeneratorRules};
use super::model::PatternModel;
use super::pattern_generator::check_models;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Channels;
use crate::core::node::{Class, Node, Retune, Summary, same_rate};
use crate::core::params::Params;
use crate::core::ports::{In, Stream, Value};
use crate::core::random::{Random, Rng};
use crate::core::shape::{Build, Ends, Shape};
use crate::core::time::{Rate, ticks};
use crate::dsp::db_to_linear;
use crate::grain::dictionary::GrainDictionary;
use crate::grain::segmentation::spectral_flux::mono;
use crate::grain::synthesis::{GrainSegment, SegmentQueue, check_rate, single};
use crate::{archive_state, params, ports};
use std::sync::Arc;

params! {
    /// Plays grains without end, with the statistics of recordings: a texture that does not repeat.
    ///
    /// Each grain is drawn from the model of a `PatternStatistics`, or from a mixture of two, when the one before begins, so that density, level
    /// and blend can change while it plays. The grains are those of a `PatternGenerator` with the same rules. For steady and transient parts
    /// of recordings, mix two textures.
    ///
    /// # Randomness
    /// Intervals, levels and grains.
    ///
    /// # Source
    /// Picard, Tsingos and Faure, "Retargetting Example Sounds to Interactive Physics-Driven Animations" (AES 35, 2009), section 6, which
    /// names this as future work.
    pub struct GrainTextureParams {
        /// Factor on the number of grains in a time.
        density: f64 = 1.0, unit "", range 0.01..=100.0;
        /// Level relative to the recordings.
        loudness: f64 = 0.0, unit "dB", range -200.0..=60.0;
        /// Share of the second model.
        blend: f64 = 0.0, unit "", range 0.0..=1.0;
        /// Duration of the output; None for no end.
        duration: Option<f64> = Some(10.0), unit "s", range 0.0..=86_400.0;
        /// Channels of the output; recordings of more are averaged to one.
        channels: u16 = 1, unit "", range 1..=8_u16;
        /// Sample rate of the audio, that of the dictionary.
        rate: Rate = Rate::hz(48_000);
    }
}
ports! {
    pub struct GrainTexturePorts / GrainTextureIo {
        in {
            /// The statistics.
            model: Value<PatternModel>,
            /// The model of other recordings, for `blend`.
            second: Option<Value<PatternModel>>,
            /// The grains of both.
            dictionary: Value<GrainDictionary>,
            /// Factor on the number of grains in a time, within 0.01 and 100; replaces the parameter.
            density: Option<Stream<f32>>,
            /// Level relative to the recordings, dB, within -200 and 60; replaces the parameter.
            loudness: Option<Stream<f32>>,
            /// Share of the second model, within 0 and 1; replaces the parameter.
            blend: Option<Stream<f32>>,
        }
        out {
            /// The sound.
            audio: Stream<f32>,
        }
    }
}

/// The node over [`Generator`].
#[derive(Debug)]
pub struct GrainTexture {
    params: GrainTextureParams,
    models: [Arc<PatternModel>; 2],
    dictionary: Arc<GrainDictionary>,
    random: Random,
    generator: Generator,
    queue: SegmentQueue,
    /// True if the next grain would reach beyond the end.
    has_ended: bool,
}

impl Node for GrainTexture {
    type Params = GrainTextureParams;
    type Ports = GrainTexturePorts;
    const NAME: &'static str = "GrainTexture";
    const CLASS: Class = Class::Audio;
    const COST: f64 = 10.0;

    fn shape(p: &GrainTextureParams, s: &mut Shape<'_, '_, GrainTexturePorts>) -> Result<(), Reject> {
        let controls = [
            ("density", s.optional(GrainTexturePorts::density)),
            ("loudness", s.optional(GrainTexturePorts::loudness)),
            ("blend", s.optional(GrainTexturePorts::blend)),
        ];
        for (name, control) in controls {
            let Some(control) = control else { continue };
            s.check(mono(control.format, name));
            same_rate(name, control.rate, "`rate`", p.rate)?;
        }
        s.when_ended(GrainTexturePorts::density, Ends::Hold);
        s.when_ended(GrainTexturePorts::loudness, Ends::Hold);
        s.when_ended(GrainTexturePorts::blend, Ends::Hold);
        s.ends(p.duration.map(ticks));
        s.output(GrainTexturePorts::audio, p.rate, Channels(p.channels));
        Ok(())
    }

    fn build(p: &GrainTextureParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let dictionary = cx.value(GrainTexturePorts::dictionary);
        check_rate(&dictionary, p.rate)?;
        let model = cx.value(GrainTexturePorts::model);
        let second = cx.optional_value(GrainTexturePorts::second);
        check_models(&model, second.as_deref(), &dictionary)?;
        let second = second.unwrap_or_else(|| Arc::clone(&model));
        Ok(Self {
            params: p.clone(),
            models: [model, second],
            dictionary,
            random: cx.random,
            generator: Generator::default(),
            queue: SegmentQueue::default(),
            has_ended: false,
        })
    }

    fn run(&mut self, mut io: GrainTextureIo<'_>) -> Result<(), Fault> {
        let (first, channels) = (io.audio.first(), io.audio.width() as i64);
        let out = io.audio.items();
        out.fill(0.0);
        let at = |control: &Option<In<'_, f32>>, now: i64, fixed: f64| {
            let value = control.as_ref().map(|c| f64::from(c.item((now - c.first()) as isize)[0]));
            value.filter(|x| x.is_finite()).unwrap_or(fixed)
        };
        let Self { params: p, models, dictionary, random, generator, queue, has_ended } = self;
        let models = models.each_ref().map(|model| &**model);
        let frames = p.duration.map(|seconds| p.rate.first_at(ticks(seconds)));
        queue.add(dictionary, [first, channels], out, |_, now| {
            let rules = GeneratorRules {
                density: at(&io.density, now, p.density).clamp(0.01, 100.0),
                gain: db_to_linear(at(&io.loudness, now, p.loudness).clamp(-200.0, 60.0)),
                blend: at(&io.blend, now, p.blend).clamp(0.0, 1.0),
            };
            if *has_ended {
                return None;
            }
            let drawn =
                generator.next(models, dictionary, &rules, |index, lane| random.uniform(0, index, lane));
            let fits = |segment: &GrainSegment| frames.is_none_or(|frames| segment.end() <= frames);
            let segment = single(dictionary, &drawn.step).filter(fits);
            *has_ended = segment.is_none();
            segment
        });
        Ok(())
    }

    fn finish(&mut self, _: GrainTextureIo<'_>) -> Result<Summary, Fault> {
        // The last one that was drawn reaches beyond the end.
        let grains = self.generator.count() - u64::from(self.has_ended);
        Ok(vec![("grains", (grains as usize).into())])
    }

    fn retune(&mut self, new: &GrainTextureParams) -> Retune {
        let p = &mut self.params;
        if (p.duration, p.channels, p.rate) != (new.duration, new.channels, new.rate) {
            return Retune::Rebuild;
        }
        (p.density, p.loudness, p.blend) = (new.density, new.loudness, new.blend);
        Retune::Done
    }

    fn adopt(&mut self, old: &mut Self) {
        if self.models[0].dictionary == old.models[0].dictionary {
            self.generator = old.generator.clone();
            (self.queue, self.has_ended) = (old.queue, old.has_ended);
        }
    }

    archive_state!(generator, queue, has_ended);

    fn trial(rng: &mut Rng) -> (GrainTextureParams, MemoryFiles) {
        let p = GrainTextureParams {
            density: rng.between(0.2, 4.0),
            loudness: rng.between(-20.0, 6.0),
            duration: Some(rng.between(0.1, 0.6)),
            channels: 1 + rng.below(2) as u16,
            rate: Rate::hz(8000),
            ..GrainTextureParams::trial(rng)
        };
        (p, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests;
