//! A texture as audio.

use super::position::SourcePosition;
use super::rules::{SynthesisCounts, SynthesisRules};
use super::synthesizer::Synthesizer;
use crate::core::random::Random;
use crate::impl_state;
use crate::soundtrack::score::{Constraints, WeightStream};
use crate::soundtrack::wavelet::{StreamingInverse, TextureModel};
use std::collections::VecDeque;
use std::sync::Arc;

/// The audio of a [`Synthesizer`], from any frame on, and its positions in recordings.
///
/// # Example
/// ```
/// use foley_nodes::core::random::Random;
/// use foley_nodes::prelude::soundtrack::*;
/// use std::sync::Arc;
///
/// let noise: Vec<f32> = (0..8000).map(|k| ((k * k) as f32).sin()).collect();
/// let recording = TreeRecording { name: "noise".into(), content: String::new(), channels: vec![noise] };
/// let tree = WaveletTree::analyse(8000.0, &[recording], &TreeRules::default())?;
/// let model = Arc::new(TextureModel::new(tree, &ThresholdRules::default()));
/// let mut texture = TextureStream::new(model, Arc::default(), SynthesisRules::default(), Random::new(1, "a"), None);
/// let mut audio = vec![0.0; 16_000];
/// texture.fill(0, None, &mut audio, &mut []);
/// assert!(audio.iter().any(|x| x.abs() > 0.1));
/// # Ok::<(), foley_nodes::soundtrack::wavelet::TreeError>(())
/// ```
#[derive(Clone, Debug)]
pub struct TextureStream {
    model: Arc<TextureModel>,
    synthesizer: Synthesizer,
    inverses: Vec<StreamingInverse<f32>>,
    /// Audio that is complete, by channel, and the index of its first frame.
    audio: Vec<VecDeque<f32>>,
    first: i64,
    /// Positions of roots that are made, and the index of the first.
    positions: VecDeque<SourcePosition>,
    first_position: i64,
    /// False before the first frame.
    has_begun: bool,
}

impl TextureStream {
    /// A texture that ends at `end`, in s; the constraints of the end hold after it.
    #[must_use]
    pub fn new(
        model: Arc<TextureModel>,
        constraints: Arc<Constraints>,
        rules: SynthesisRules,
        random: Random,
        end: Option<f64>,
    ) -> Self {
        let tree = &model.tree;
        // What is made before the first frame of a window, and beyond its last.
        let frames = (2 * tree.wavelet.reach() + 4) << tree.depth;
        Self {
            synthesizer: Synthesizer::new(Arc::clone(&model), constraints, rules, random, 0, end),
            inverses: vec![StreamingInverse::new(tree.wavelet, tree.depth); tree.channels],
            audio: vec![VecDeque::with_capacity(frames); tree.channels],
            first: 0,
            positions: VecDeque::with_capacity(frames / 2),
            first_position: 0,
            has_begun: false,
            model,
        }
    }

    /// Counts so far.
    #[must_use]
    pub fn counts(&self) -> SynthesisCounts {
        self.synthesizer.counts
    }

    /// Begins early enough for all frames from `first` on to be complete.
    fn begin(&mut self, first: i64) {
        let depth = self.model.tree.depth;
        let root = (first >> depth) - self.model.tree.wavelet.reach() as i64 - 1;
        self.synthesizer.go_to(root);
        self.first = root << depth;
        self.first_position = self.first / 2;
        self.has_begun = true;
    }

    /// Makes one root and the samples that it completes.
    fn advance(&mut self, weights: Option<WeightStream<'_>>) {
        self.synthesizer.advance(weights);
        let tree = &self.model.tree;
        let (channels, depth) = (tree.channels, tree.depth as usize);
        let mut out = Vec::new();
        for (c, (inverse, audio)) in self.inverses.iter_mut().zip(&mut self.audio).enumerate() {
            let of_channel = |level: usize| -> Vec<f32> {
                let mut details: Vec<f32> =
                    self.synthesizer.details(level).iter().skip(c).step_by(channels).copied().collect();
                self.synthesizer.join(level, &mut details);
                details
            };
            let levels: Vec<Vec<f32>> = (0..depth).map(of_channel).collect();
            inverse.add(self.synthesizer.approximation()[c], |level| &levels[level], &mut out);
            audio.extend(out.drain(..));
        }
        for leaf in self.synthesizer.leaves() {
            let recording = tree.source_of(leaf >> (depth - 1));
            let first = tree.sources.get(recording).map_or(0, |s| s.first);
            let frame = 2 * (leaf - (first << (depth - 1)));
            let seconds = (f64::from(frame) / tree.rate) as f32;
            self.positions.push_back(SourcePosition { recording: recording as u32, frame, seconds });
        }
    }

    /// Writes interleaved frames from `first` on, the end of the last call, and the positions of pairs of samples.
    ///
    /// # Shapes
    /// `audio`: whole frames of the channels of the model. `positions`: those that begin within these frames, or none.
    ///
    /// # Complexity
    /// As [`Synthesizer`], and linear in the samples.
    pub fn fill(
        &mut self,
        first: i64,
        weights: Option<WeightStream<'_>>,
        audio: &mut [f32],
        positions: &mut [SourcePosition],
    ) {
        if !self.has_begun {
            self.begin(first);
        }
        let channels = self.audio.len().max(1);
        let frames = (audio.len() / channels) as i64;
        let first_position = (first + 1).div_euclid(2);
        let is_missing = |own: &Self| {
            own.first + (own.audio.first().map_or(0, VecDeque::len) as i64) < first + frames
                || own.first_position + (own.positions.len() as i64) < first_position + positions.len() as i64
        };
        while is_missing(self) {
            self.advance(weights);
        }
        // What precedes was played, or completed the beginning.
        let played = (first - self.first).max(0);
        self.audio.iter_mut().for_each(|x| drop(x.drain(..(played as usize).min(x.len()))));
        self.first += played;
        let played = (first_position - self.first_position).max(0);
        self.positions.drain(..(played as usize).min(self.positions.len()));
        self.first_position += played;
        for (k, frame) in audio.chunks_exact_mut(channels).enumerate() {
            frame.iter_mut().zip(&self.audio).for_each(|(out, x)| *out = x.get(k).copied().unwrap_or(0.0));
        }
        positions.iter_mut().zip(&self.positions).for_each(|(out, position)| *out = *position);
    }

    /// Continues from another stream, if its model has the same shape; otherwise it begins anew. Allocates nothing.
    pub fn follow(&mut self, other: &Self) {
        let (own, model) = (&self.model.tree, &other.model.tree);
        let is_same = (own.depth, own.channels, own.wavelet) == (model.depth, model.channels, model.wavelet)
            && own.rate == model.rate
            && own.sources == model.sources;
        if !is_same {
            return;
        }
        self.synthesizer.follow(&other.synthesizer);
        self.inverses.iter_mut().zip(&other.inverses).for_each(|(own, other)| own.follow(other));
        for (own, other) in self.audio.iter_mut().zip(&other.audio) {
            own.clear();
            own.extend(other);
        }
        self.positions.clear();
        self.positions.extend(&other.positions);
        (self.first, self.first_position, self.has_begun) =
            (other.first, other.first_position, other.has_begun);
    }
}

impl_state!(TextureStream { synthesizer, each inverses, audio, first, positions, first_position, has_begun });
