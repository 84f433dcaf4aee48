//! The node `TextureSynthesis`.

use super::position::{SourcePosition, SourcePositions};
use super::rules::{PredecessorCount, SynthesisRules, WeightBias};
use super::synthesizer::Synthesizer;
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
use crate::soundtrack::wavelet::{StreamingInverse, TextureModel};
use crate::{archive_state, params, ports};
use std::collections::VecDeque;
use std::sync::Arc;

params! {
    /// Synthesises a sound texture that is similar to recordings, and follows a score.
    ///
    /// A wavelet tree grows node by node. The children of a node are those of the node of the model that matches it best: most of its ancestors,
    /// then most of its predecessors. Among equals the choice is random. Where a score constrains the output, nodes of wanted and of other
    /// intervals of the recordings are matched apart, and one of both kinds is chosen with the probability that the weight states.
    ///
    /// `weights` has a channel for each of the first sounds of the score, in its order: weights that change while the graph plays, from a `LiveControl` or
    /// from motion. Of several weights at a time the greatest counts.
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
    /// longest length.
    pub struct TextureSynthesisParams {
        /// Duration of the output; None for no end.
        duration: Option<f64> = Some(30.0), unit "s", range 0.001..=86_400.0;
        /// Channels of the output: those of the model, or 1 for their mean, or any number for a model of one channel.
        channels: u16 = 1, unit "", range 1..=64_u16;
        /// Sample rate of the audio, that of the model.
        rate: Rate = Rate::hz(48_000);
        /// Number of predecessors that are compared.
        predecessors: usize = 5, unit "", range 0..=64;
        /// Number of predecessors of a root that are compared.
        root_predecessors: usize = 16, unit "", range 0..=64;
        /// How similar predecessors are counted.
        count: PredecessorCount = PredecessorCount::Consecutive;
        /// Longest stretch of a recording that is repeated as it is, unless there is no other choice; None for no limit. Stretches in which one
        /// would go on have random lengths from a quarter of it.
        max_run: Option<f64> = Some(1.0), unit "s", range 0.001..=3600.0;
        /// Factor on the chance of a node for each time that it was chosen within `memory`; 1 for none.
        repetition: f64 = 1.0, unit "", range 0.0..=1.0;
        /// How long a choice counts for `repetition`.
        memory: f64 = 2.0, unit "s", range 0.0..=60.0;
        /// Time by which a wanted sound is prepared by what precedes it in its recording; None for the shorter of 1 s and 5 % of the duration.
        look_ahead: Option<f64> = None, unit "s", range 0.0..=60.0;
        /// How a weight between -1 and 1 acts.
        bias: WeightBias = WeightBias::Probability;
        /// Share of the match of other nodes that a wanted node must reach, and the other way round; 0 for no such rule.
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
            /// Weights of the first sounds of the score, from -1 to 1; what is not finite is 0.
            weights: Option<Stream<f32>>,
        }
        out {
            /// The sound.
            audio: Stream<f32>,
            /// Where the samples come from, an item for two of them.
            positions: Stream<SourcePositions>,
        }
    }
}

/// Longest look-ahead that is taken by default, s, and its share of the duration.
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
            count: self.count,
            look_ahead: self.look_ahead(),
            quality: self.quality,
            bias: self.bias,
            repetition: self.repetition,
            memory: self.memory,
            max_run: self.max_run,
            candidates: self.candidates,
        }
    }
}

/// The node over [`Synthesizer`].
pub struct TextureSynthesis {
    model: Arc<TextureModel>,
    synthesizer: Synthesizer,
    inverses: Vec<StreamingInverse<f32>>,
    /// Audio that is complete, by channel, and the index of its first frame.
    audio: Vec<VecDeque<f32>>,
    first: i64,
    /// Positions of roots that are made, and the index of the first.
    positions: VecDeque<SourcePosition>,
    first_position: i64,
    /// False before the first window.
    has_begun: bool,
    warnings: Summary,
}

impl TextureSynthesis {
    /// Roots on each side of a sample that it depends on.
    fn reach(&self) -> i64 {
        self.model.tree.wavelet.reach() as i64
    }

    /// Begins so that all from frame `first` on is complete.
    fn begin(&mut self, first: i64) {
        let depth = self.model.tree.depth;
        let root = (first >> depth) - self.reach() - 1;
        self.synthesizer.go_to(root);
        self.first = root << depth;
        self.first_position = self.first / 2;
        self.has_begun = true;
    }

    /// Makes one root and what it completes.
    fn advance(&mut self, weights: Option<WeightStream<'_>>) {
        self.synthesizer.advance(weights);
        let tree = &self.model.tree;
        let (channels, depth) = (tree.channels, tree.depth as usize);
        let mut out = Vec::new();
        for (c, (inverse, audio)) in self.inverses.iter_mut().zip(&mut self.audio).enumerate() {
            let of_channel = |level: usize| -> Vec<f32> {
                self.synthesizer.details(level).iter().skip(c).step_by(channels).copied().collect()
            };
            let levels: Vec<Vec<f32>> = (0..depth).map(of_channel).collect();
            inverse.add(self.synthesizer.approximation()[c], |level| &levels[level], &mut out);
            audio.extend(out.drain(..));
        }
        for leaf in self.synthesizer.picks().leaves {
            let recording = tree.source_of(leaf >> (depth - 1));
            let first = tree.sources.get(recording).map_or(0, |s| s.first);
            let frame = 2 * (leaf - (first << (depth - 1)));
            let seconds = (f64::from(frame) / tree.rate) as f32;
            self.positions.push_back(SourcePosition { recording: recording as u32, frame, seconds });
        }
    }
}

/// A certain target that is so many times as long as its sounds repeats them audibly.
const MAX_RATIO: f64 = 4.0;

/// Warnings about targets that are long for their sounds.
fn long_targets(score: &SoundScore) -> Summary {
    let length = |segments: &[(f64, f64)]| segments.iter().map(|(from, to)| to - from).sum::<f64>();
    let of_target = |target: &ScoreTarget| {
        let sounds = target.sources.iter().filter_map(|k| score.sources.get(*k));
        let source: f64 = sounds.map(|s| length(&s.segments)).sum();
        let certain = length(&target.curve.plateaus(1.0));
        let is_long = certain > MAX_RATIO * source;
        is_long.then(|| {
            let names = score.names(&target.sources);
            let text = format!(
                "{names} is certain for {certain:.2} s, and lasts {source:.2} s in the recording: it will repeat audibly"
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

    fn shape(p: &TextureSynthesisParams, s: &mut Shape<'_, '_, TextureSynthesisPorts>) -> Result<(), Reject> {
        if let Some(weights) = s.optional(TextureSynthesisPorts::weights) {
            if !s.linked(TextureSynthesisPorts::score) {
                let reject =
                    Reject::new("F156", "there are weights, and no score that states what they weigh");
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
            Some(score) => Constraints::new(score, tree).map_err(|e| score_error(score, &e))?,
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
        let synthesizer =
            Synthesizer::new(Arc::clone(&model), Arc::new(constraints), p.rules(), cx.random, 0, p.duration);
        let inverse = StreamingInverse::new(tree.wavelet, tree.depth);
        Ok(Self {
            synthesizer,
            inverses: vec![inverse; tree.channels],
            audio: vec![VecDeque::new(); tree.channels],
            first: 0,
            positions: VecDeque::new(),
            first_position: 0,
            has_begun: false,
            warnings,
            model,
        })
    }

    fn run(&mut self, mut io: TextureSynthesisIo<'_>) -> Result<(), Fault> {
        let (first, width) = (io.audio.first(), io.audio.width());
        let frames = io.audio.len();
        let (first_position, positions) = (io.positions.first(), io.positions.len());
        if !self.has_begun {
            self.begin(first);
        }
        let stream = io.weights.as_ref().map(|weights| WeightStream {
            rate: weights.rate().as_f64(),
            first: weights.first() - weights.behind() as i64,
            width: weights.width(),
            items: weights.around(),
        });
        let is_missing = |own: &Self| {
            let audio = own.audio.first().map_or(0, VecDeque::len) as i64;
            own.first + audio < first + frames as i64
                || own.first_position + (own.positions.len() as i64) < first_position + positions as i64
        };
        while is_missing(self) {
            self.advance(stream);
        }
        // What precedes the window was played, or completed the beginning.
        let played = (first - self.first).max(0);
        self.audio.iter_mut().for_each(|x| drop(x.drain(..(played as usize).min(x.len()))));
        self.first += played;
        let played = (first_position - self.first_position).max(0);
        self.positions.drain(..(played as usize).min(self.positions.len()));
        self.first_position += played;
        let channels = self.audio.len();
        for (k, frame) in io.audio.items().chunks_exact_mut(width).enumerate() {
            let at = |c: usize| self.audio.get(c).and_then(|x| x.get(k)).copied().unwrap_or(0.0);
            if width == channels || channels == 1 {
                frame.iter_mut().enumerate().for_each(|(c, x)| *x = at(c.min(channels - 1)));
            } else {
                frame.fill((0..channels).map(at).sum::<f32>() / channels as f32);
            }
        }
        for (out, position) in io.positions.items().iter_mut().zip(&self.positions) {
            *out = *position;
        }
        Ok(())
    }

    fn finish(&mut self, _: TextureSynthesisIo<'_>) -> Result<Summary, Fault> {
        Ok([self.synthesizer.counts.figures(), std::mem::take(&mut self.warnings)].concat())
    }

    fn adopt(&mut self, old: &mut Self) {
        if self.model.tree.sources != old.model.tree.sources || self.model.tree.depth != old.model.tree.depth
        {
            return;
        }
        self.synthesizer.take_past(&old.synthesizer);
        self.inverses.clone_from(&old.inverses);
        self.audio.clone_from(&old.audio);
        self.positions.clone_from(&old.positions);
        (self.first, self.first_position, self.has_begun) = (old.first, old.first_position, old.has_begun);
    }

    archive_state!(synthesizer, each inverses, audio, first, positions, first_position, has_begun);

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
