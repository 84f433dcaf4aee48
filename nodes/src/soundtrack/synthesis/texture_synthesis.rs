//! The node `TextureSynthesis`.

use super::morph::OverlapMode;
use super::position::SourcePositions;
use super::rules::{CandidateSearch, MatchCount, MatchCriterion, SynthesisRules, WeightBias};
use super::texture_stream::TextureStream;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Channels;
use crate::core::node::{Class, Node, Summary};
use crate::core::params::Params;
use crate::core::ports::{Stream, Value};
use crate::core::random::Rng;
use crate::core::shape::{Build, Ends, Shape};
use crate::core::time::{Rate, ticks};
use crate::soundtrack::score::{Constraints, ScoreTarget, SoundScore, WeightStream};
use crate::soundtrack::wavelet::TextureModel;
use crate::{archive_state, params, ports};
use std::sync::Arc;

params! {
    /// Synthesises a sound texture that is similar to recordings, and follows a score.
    ///
    /// A wavelet tree grows node by node. The children of a node are those of the node of the model that matches it best: most of its ancestors,
    /// then most of its predecessors. Among equals the choice is random. Where a score constrains the output, nodes of wanted and of other
    /// intervals of the recordings are matched apart, and one of both kinds is chosen with the probability that the weight states.
    ///
    /// `weights` has a channel for each of the first sounds of the score, in its order: weights that change while the graph plays, from a `LiveControl` or
    /// from motion. The greatest of several weights at a time counts, or the two greatest are mixed according to `overlap`.
    ///
    /// The output is a function of seed, model and score: a change of the score changes nothing that is earlier than the change by more than
    /// the look-ahead and five blocks.
    ///
    /// # Randomness
    /// The choice among equal nodes, and between wanted and other nodes.
    ///
    /// # Source
    /// Cardle, Brooks, Bar-Joseph and Robinson, "Sound-by-Numbers" (SCA 2003), sections 3 and 4. Differences: a weight between 0 and 1 is a
    /// probability, drawn once for a block; candidates that are not wanted must match as well as wanted ones; stretches of a recording have a
    /// longest length; blocks are joined at similar levels, which continue at joins.
    pub struct TextureSynthesisParams {
        /// Duration of the output; None for no end.
        duration: Option<f64> = Some(30.0), unit "s", range 0.001..=86_400.0;
        /// Channels of the output: those of the model, or 1 for their mean, or any number for a model of one channel.
        channels: u16 = 1, unit "", range 1..=64_u16;
        /// Sample rate of the audio, that of the model.
        rate: Rate = Rate::hz(48_000);
        /// Number of predecessors that are compared.
        predecessors: usize = 5, unit "", range 0..=64;
        /// A block follows the one before it if its predecessor in the recording has similar levels by octave. The value is the difference at which
        /// another block is half as likely, relative to the median difference of consecutive blocks. 0.5 preserves slow modulations of steady
        /// sounds, and may leave out rare events. None: the blocks whose predecessors match most are chosen, as in the paper, whatever their levels.
        continuity: Option<f64> = None, unit "", range 0.001..=1000.0;
        /// Number of predecessors of a block that are compared without `continuity`.
        root_predecessors: usize = 16, unit "", range 0..=64;
        /// Greatest magnitude of the gains at a join of two blocks, which make the levels by octave continue and return to 0 dB within 0.35 s.
        /// Nothing is raised above the end of the block before, and gains of neighbouring octaves differ by 2 dB at most. There is no gain where
        /// the wanted sounds change, or where two are mixed. 0: blocks are heard as they were recorded, as in the paper.
        join_gain: f64 = 15.0, unit "dB", range 0.0..=60.0;
        /// Method of counting similar ancestors and predecessors. Where a score leaves no candidate all of whose ancestors are similar, `Total`
        /// compares all nodes, which takes much longer.
        count: MatchCount = MatchCount::Consecutive;
        /// Criterion by which ancestors are similar. `RunningMean` compares all nodes with `search: Exact`, which takes much longer.
        criterion: MatchCriterion = MatchCriterion::PerCoefficient;
        /// The candidates that are compared. `Narrow` copies longer stretches, because it follows few candidates from level to level.
        search: CandidateSearch = CandidateSearch::Exact;
        /// Longest stretch of a recording that is repeated unchanged, if there is another choice; None for no limit. Stretches that end for this
        /// reason have random lengths: from a quarter of it, or from a block where two fit and the recording has blocks that end before loud sounds;
        /// where three blocks fit, short ones are more likely. Blocks are joined where the recording has similar levels, and rarely where it is loud
        /// above 8 kHz. Of the blocks that match equally well, those that were heard less often lately are preferred, and so are those of
        /// a loudness that was heard less often than in the recording.
        max_run: Option<f64> = Some(1.0), unit "s", range 0.001..=3600.0;
        /// Probability that a node remains a candidate, for each choice of it within `memory`, if there are others; 1 for no preference.
        repetition: f64 = 1.0, unit "", range 0.0..=1.0;
        /// Duration for which a choice counts for `repetition`.
        memory: f64 = 2.0, unit "s", range 0.0..=60.0;
        /// Time by which a wanted sound is prepared by what precedes it in its recording; None for the shorter of 1 s and 5 % of the duration.
        look_ahead: Option<f64> = None, unit "s", range 0.0..=60.0;
        /// Effect of a weight between -1 and 1.
        bias: WeightBias = WeightBias::Probability;
        /// Sound where targets of two sounds overlap, both with positive weights. Mixed, both are made by the same random numbers, and the
        /// shares are those of the weights; with weights whose sum is 1, nothing else is heard. Coarse coefficients are also mixed where one
        /// sound follows another.
        overlap: OverlapMode = OverlapMode::Winner;
        /// Minimum match of a wanted node, as a share of that of other nodes, and of other nodes as a share of that of a wanted node; 0 for no limit.
        quality: f64 = 0.7, unit "", range 0.0..=1.0;
        /// Greatest number of equal candidates that are compared.
        candidates: usize = 4096, unit "", range 1..=16_777_216;
        /// Time by which `weights` are read ahead: the look-ahead and five and a half blocks must fit. It is the latency of the node if they are linked.
        reaction: f64 = 4.0, unit "s", range 0.0..=600.0;
    }
}
ports! {
    pub struct TextureSynthesisPorts / TextureSynthesisIo {
        in {
            /// The model.
            model: Value<TextureModel>,
            /// The sounds that are wanted, or not.
            score: Option<Value<SoundScore>>,
            /// Weights of the first sounds of the score, from -1 to 1; weights that are not finite count as 0.
            weights: Option<Stream<f32>>,
        }
        out {
            /// The sound.
            audio: Stream<f32>,
            /// Positions in recordings that the samples come from, an item for two samples.
            positions: Stream<SourcePositions>,
        }
    }
}

/// Longest default look-ahead, s, and its share of the duration.
const LOOK_AHEAD: (f64, f64) = (1.0, 0.05);

impl TextureSynthesisParams {
    fn look_ahead(&self) -> f64 {
        let default =
            self.duration.map_or(LOOK_AHEAD.0, |duration| (LOOK_AHEAD.1 * duration).min(LOOK_AHEAD.0));
        self.look_ahead.unwrap_or(default)
    }

    fn rules(&self) -> SynthesisRules {
        SynthesisRules {
            predecessors: self.predecessors,
            root_predecessors: self.root_predecessors,
            continuity: self.continuity,
            join_gain: self.join_gain,
            count: self.count,
            criterion: self.criterion,
            search: self.search,
            look_ahead: self.look_ahead(),
            quality: self.quality,
            bias: self.bias,
            overlap: self.overlap,
            repetition: self.repetition,
            memory: self.memory,
            max_run: self.max_run,
            candidates: self.candidates,
        }
    }
}

/// The node over [`TextureStream`].
pub struct TextureSynthesis {
    stream: TextureStream,
    /// Channels of the model, and a window of its audio if the output has others.
    channels: usize,
    window: Vec<f32>,
    warnings: Summary,
}

/// Ratio of the duration of a hard inclusion to that of its sounds at which repetition is audible.
const MAX_RATIO: f64 = 4.0;

/// Warnings about targets that are long for their sounds.
fn long_targets(score: &SoundScore) -> Summary {
    let length = |segments: &[(f64, f64)]| segments.iter().map(|(from, to)| to - from).sum::<f64>();
    let of_target = |target: &ScoreTarget| {
        let sounds = target.sources.iter().filter_map(|k| score.sources.get(*k));
        let source: f64 = sounds.map(|s| length(&s.segments)).sum();
        let hard = length(&target.curve.plateaus(1.0));
        let is_long = hard > MAX_RATIO * source;
        is_long.then(|| {
            let names = score.names(&target.sources);
            let text = format!(
                "{names} has the weight 1 for {hard:.2} s, and lasts {source:.2} s in the recording: it will repeat audibly"
            );
            ("warning", text.into())
        })
    };
    score.targets.iter().filter_map(of_target).collect()
}

fn score_error(score: &SoundScore, e: &dyn std::fmt::Display) -> Fault {
    let file = if score.file.is_empty() { String::new() } else { format!("{:?}, ", score.file) };
    Fault::new("F156", format!("{file}{e}")).at("score")
}

impl Node for TextureSynthesis {
    type Params = TextureSynthesisParams;
    type Ports = TextureSynthesisPorts;
    const NAME: &'static str = "TextureSynthesis";
    const CLASS: Class = Class::Worker;
    const COST: f64 = 100.0;
    const VERSION: u32 = 10;

    fn shape(p: &TextureSynthesisParams, s: &mut Shape<'_, '_, TextureSynthesisPorts>) -> Result<(), Reject> {
        if let Some(weights) = s.optional(TextureSynthesisPorts::weights) {
            if !s.linked(TextureSynthesisPorts::score) {
                let reject = Reject::new(
                    "F156",
                    "there are weights, but no score with the sounds to which they apply",
                );
                return Err(reject
                    .at("weights")
                    .help("link a score with sounds, with or without targets, to `score`"));
            }
            let ahead = (p.reaction * weights.rate.as_f64()).ceil() as usize;
            s.lookaround(TextureSynthesisPorts::weights, 1, ahead);
            s.when_ended(TextureSynthesisPorts::weights, Ends::Hold);
        }
        s.ends(p.duration.map(ticks));
        let Some(half) = p.rate.divided_by(2) else {
            return Err(Reject::new("F155", format!("the rate is {}", p.rate)).at("rate"));
        };
        s.output(TextureSynthesisPorts::audio, p.rate, Channels(p.channels));
        s.output(TextureSynthesisPorts::positions, half, ());
        Ok(())
    }

    fn build(p: &TextureSynthesisParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let model = cx.value(TextureSynthesisPorts::model);
        let tree = &model.tree;
        if (tree.rate - p.rate.as_f64()).abs() > 1e-6 {
            let message = format!("the model has {} Hz, `rate` is {}", tree.rate, p.rate);
            return Err(Fault::new("F155", message).at("rate").help("give both the same rate"));
        }
        let wanted = usize::from(p.channels);
        if wanted != tree.channels && wanted != 1 && tree.channels != 1 {
            let message = format!("the model has {} channels, `channels` is {wanted}", tree.channels);
            return Err(Fault::new("F155", message)
                .at("channels")
                .help(format!("give {} or 1", tree.channels)));
        }
        let score = cx.optional_value(TextureSynthesisPorts::score);
        let constraints = match &score {
            Some(score) => {
                Constraints::new(score, tree, p.overlap.is_mixed()).map_err(|e| score_error(score, &e))?
            }
            None => Constraints::default(),
        };
        let warnings = score.as_deref().map(long_targets).unwrap_or_default();
        if let Some(weights) = cx.optional(TextureSynthesisPorts::weights) {
            let sounds = score.map_or(0, |score| score.sources.len());
            if usize::from(weights.format.0) > sounds {
                let message =
                    format!("there are {} weights, and the score has {sounds} sounds", weights.format.0);
                return Err(Fault::new("F156", message)
                    .at("weights")
                    .help("give at most one channel for each sound, in order"));
            }
            // The look-ahead is rounded to whole blocks.
            let blocks = tree.wavelet.reach() as f64 + 1.5;
            let needed = blocks * tree.span(0) as f64 / tree.rate + p.look_ahead();
            if needed > p.reaction + 1e-9 {
                let message =
                    format!("weights act by {needed:.3} s early, and `reaction` is {} s", p.reaction);
                let help = "give a longer `reaction`, or a shorter `block` of the WaveletTree, `look_ahead` or wavelet";
                return Err(Fault::new("F155", message).at("reaction").help(help));
            }
        }
        let channels = tree.channels;
        let stream =
            TextureStream::new(Arc::clone(&model), Arc::new(constraints), p.rules(), cx.random, p.duration);
        Ok(Self { stream, channels, window: Vec::new(), warnings })
    }

    fn run(&mut self, mut io: TextureSynthesisIo<'_>) -> Result<(), Fault> {
        let (first, width, channels) = (io.audio.first(), io.audio.width(), self.channels);
        let weights = io.weights.as_ref().map(|weights| WeightStream {
            rate: weights.rate().as_f64(),
            first: weights.first() - weights.behind() as i64,
            width: weights.width(),
            items: weights.around(),
        });
        let positions = io.positions.items();
        if width == channels {
            self.stream.fill(first, weights, io.audio.items(), positions);
            return Ok(());
        }
        self.window.resize(io.audio.len() * channels, 0.0);
        self.stream.fill(first, weights, &mut self.window, positions);
        for (out, frame) in io.audio.items().chunks_exact_mut(width).zip(self.window.chunks_exact(channels)) {
            // Either side has one channel.
            out.fill(frame.iter().sum::<f32>() / channels as f32);
        }
        Ok(())
    }

    fn finish(&mut self, _: TextureSynthesisIo<'_>) -> Result<Summary, Fault> {
        Ok([self.stream.counts().figures(), std::mem::take(&mut self.warnings)].concat())
    }

    fn adopt(&mut self, old: &mut Self) {
        self.stream.follow(&old.stream);
    }

    archive_state!(stream);

    fn trial(rng: &mut Rng) -> (TextureSynthesisParams, MemoryFiles) {
        // Models of trials have blocks of 8 ms: all of `reaction` is needed.
        let look_ahead = 0.004 + 0.008 * rng.below(8) as f64;
        let p = TextureSynthesisParams {
            duration: Some(rng.between(0.05, 0.6)),
            channels: 1,
            rate: Rate::hz(8000),
            look_ahead: Some(look_ahead),
            max_run: Some(rng.between(0.05, 0.5)),
            candidates: 100,
            reaction: look_ahead + 0.044,
            ..TextureSynthesisParams::trial(rng)
        };
        (p, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests;
