//! Trees of wavelet coefficients of recordings.

use super::family::Wavelet;
use super::transform::{Coefficients, forward, inverse};
use crate::choices;
use crate::core::item::Data;
use crate::core::random::Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use thiserror::Error;

choices! {
    /// Method by which a recording becomes a whole number of spans of the coarsest level.
    #[derive(Serialize, Deserialize)]
    pub enum TreeFit {
        /// Its end is faded into its beginning, so that its last node precedes its first.
        Circular,
        /// It is continued by its mirror image, which is never chosen.
        PadReflect,
        /// Its end is cut off.
        Trim,
    }
}

/// The least number of samples of a recording.
pub const MIN_SAMPLES: usize = 16;
/// Minimum number of roots at which those at the ends of a recording without wrap are never chosen.
const MANY_ROOTS: u32 = 16;
/// Coefficients below this share of the peak are rounding errors of zeros.
const ZERO: f64 = 1e-10;
/// Longest span of a root, s: shorter events can be copied as a whole.
const BLOCK: f64 = 0.5;

/// The reason why a recording has no tree.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum TreeError {
    /// It is shorter than the coarsest span.
    #[error("{name:?} has {found} samples; at least {wanted} are needed")]
    Short {
        /// The recording.
        name: String,
        /// Its samples.
        found: usize,
        /// Samples needed.
        wanted: usize,
    },
    /// Recordings of several channel counts.
    #[error("{name:?} has {found} channels; the first recording has {wanted}")]
    Channels {
        /// The recording.
        name: String,
        /// Its channels.
        found: usize,
        /// Channels of the first.
        wanted: usize,
    },
    /// Nothing to analyse.
    #[error("there is no recording")]
    Empty,
    /// A recording that the tree does not have.
    #[error("there is no recording {name:?}; recordings are {recordings}")]
    Unknown {
        /// Its name.
        name: String,
        /// The recordings of the tree.
        recordings: String,
    },
    /// A field of a file that does not fit the others.
    #[error("the field `{0}` does not fit the others")]
    Field(&'static str),
}

/// A recording of a tree.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TreeSource {
    /// Its name.
    pub name: String,
    /// Digest of its samples.
    pub content: String,
    /// Its first root.
    pub first: u32,
    /// Its number of roots.
    pub roots: u32,
    /// Its samples; those of its roots may be fewer, or more.
    pub frames: u64,
    /// True if its last node precedes its first.
    pub wraps: bool,
}

/// Rules by which a tree is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TreeRules {
    /// The wavelet.
    pub wavelet: Wavelet,
    /// Longest span of a root, s; `None` for the shorter of 0.5 s and an eighth of the shortest recording.
    pub block: Option<f64>,
    /// Method by which recordings become whole numbers of spans.
    pub fit: TreeFit,
    /// Length of the fade of `Circular`, s.
    pub crossfade: f64,
}

impl Default for TreeRules {
    fn default() -> Self {
        Self { wavelet: Wavelet::Db5, block: None, fit: TreeFit::Circular, crossfade: 0.02 }
    }
}

/// A recording to analyse.
#[derive(Clone, Debug, PartialEq)]
pub struct TreeRecording {
    /// Its name.
    pub name: String,
    /// Digest of its samples.
    pub content: String,
    /// Its channels.
    pub channels: Vec<Vec<f32>>,
}

/// The wavelet coefficients of recordings, as binary trees whose roots are in order of time.
///
/// Node `m` of level `l` covers the samples `[m 2^(J - l), (m + 1) 2^(J - l))`, counted from the first root, with the depth `J`; its children
/// are the nodes `2m` and `2m + 1` of the next level. A root has the value of the approximation too.
///
/// # Source
/// Cardle, Brooks, Bar-Joseph and Robinson, "Sound-by-Numbers" (SCA 2003), section 3, after Dubnov et al., "Synthesizing sound textures
/// through wavelet tree learning" (IEEE CG&A 22(4), 2002).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WaveletTree {
    /// Samples per second.
    pub rate: f64,
    /// Channels of all recordings.
    pub channels: usize,
    /// The wavelet.
    pub wavelet: Wavelet,
    /// Number of levels.
    pub depth: u32,
    /// The recordings, in order of their roots.
    pub sources: Vec<TreeSource>,
    /// Values of the approximation by root and channel.
    pub approximation: Vec<f32>,
    /// Details by level, node and channel.
    pub details: Vec<Vec<f32>>,
}

impl WaveletTree {
    /// Analyses recordings of one rate.
    ///
    /// # Errors
    /// Recordings that are too short, or that differ in channels.
    ///
    /// # Complexity
    /// Linear in the samples.
    pub fn analyse(rate: f64, recordings: &[TreeRecording], rules: &TreeRules) -> Result<Self, TreeError> {
        let Some(first) = recordings.first() else { return Err(TreeError::Empty) };
        let channels = first.channels.len();
        let frames = |recording: &TreeRecording| recording.channels.first().map_or(0, Vec::len);
        for recording in recordings {
            let (name, found) = (recording.name.clone(), recording.channels.len());
            if found != channels {
                return Err(TreeError::Channels { name, found, wanted: channels });
            }
            if frames(recording) < MIN_SAMPLES {
                return Err(TreeError::Short { name, found: frames(recording), wanted: MIN_SAMPLES });
            }
        }
        let shortest = recordings.iter().map(frames).min().unwrap_or(0);
        let block =
            rules.block.map_or_else(|| (BLOCK * rate).min(shortest as f64 / 8.0), |block| block * rate);
        let depth = libm::log2(block.max(2.0)).floor().clamp(1.0, 24.0) as u32;
        let mut tree = Self {
            rate,
            channels,
            wavelet: rules.wavelet,
            depth,
            sources: Vec::new(),
            approximation: Vec::new(),
            details: vec![Vec::new(); depth as usize],
        };
        for recording in recordings {
            tree.add(recording, rules)?;
        }
        Ok(tree)
    }

    /// Adds the roots of a recording.
    fn add(&mut self, recording: &TreeRecording, rules: &TreeRules) -> Result<(), TreeError> {
        let span = 1_usize << self.depth;
        let frames = recording.channels.first().map_or(0, Vec::len);
        let fade = ((rules.crossfade * self.rate) as usize).min(frames / 8);
        let roots = match rules.fit {
            TreeFit::Circular => (frames - fade) / span,
            TreeFit::PadReflect => frames.div_ceil(span),
            TreeFit::Trim => frames / span,
        };
        if roots == 0 {
            let wanted = span + if rules.fit == TreeFit::Circular { fade } else { 0 };
            return Err(TreeError::Short { name: recording.name.clone(), found: frames, wanted });
        }
        let peak = recording.channels.iter().flatten().fold(0.0_f32, |peak, x| peak.max(x.abs()));
        let zero = f64::from(peak) * ZERO;
        let (wavelet, depth) = (self.wavelet, self.depth);
        let all: Vec<Coefficients<f64>> = recording
            .channels
            .par_iter()
            .map(|x| forward(wavelet, depth, &fitted(x, roots * span, fade, rules.fit)))
            .collect();
        let append = |out: &mut Vec<f32>, of: &dyn Fn(&Coefficients<f64>) -> &[f64]| {
            let n = all.first().map_or(0, |c| of(c).len());
            out.reserve(n * all.len());
            for k in 0..n {
                out.extend(all.iter().map(|c| of(c)[k]).map(|x| if x.abs() < zero { 0.0 } else { x as f32 }));
            }
        };
        append(&mut self.approximation, &|c| &c.approximation);
        for (l, level) in self.details.iter_mut().enumerate() {
            append(level, &|c| &c.details[l]);
        }
        self.sources.push(TreeSource {
            name: recording.name.clone(),
            content: recording.content.clone(),
            first: self.sources.last().map_or(0, |s| s.first + s.roots),
            roots: roots as u32,
            frames: frames as u64,
            wraps: rules.fit == TreeFit::Circular,
        });
        Ok(())
    }

    /// The number of roots of all recordings.
    #[must_use]
    pub fn roots(&self) -> usize {
        self.sources.last().map_or(0, |s| (s.first + s.roots) as usize)
    }

    /// The number of nodes of a level.
    #[must_use]
    pub fn nodes(&self, level: usize) -> usize {
        self.roots() << level
    }

    /// The samples that a node of a level covers.
    #[must_use]
    pub fn span(&self, level: usize) -> usize {
        1 << (self.depth as usize - level)
    }

    /// The recording with a name, or whose path ends in it; the first for an empty name.
    ///
    /// # Errors
    /// There is none.
    pub fn find(&self, name: &str) -> Result<usize, TreeError> {
        let is_named = |s: &TreeSource| {
            let before = s.name.strip_suffix(name);
            name.is_empty() || before.is_some_and(|before| before.is_empty() || before.ends_with('/'))
        };
        self.sources.iter().position(is_named).ok_or_else(|| {
            let names: Vec<&str> = self.sources.iter().map(|s| s.name.as_str()).collect();
            TreeError::Unknown { name: name.to_owned(), recordings: names.join(", ") }
        })
    }

    /// The audio of all channels of a recording.
    #[must_use]
    pub fn channels_of(&self, source: usize) -> Vec<Vec<f32>> {
        (0..self.channels).map(|c| self.audio(source, c)).collect()
    }

    /// The recording of a root.
    #[must_use]
    pub fn source_of(&self, root: u32) -> usize {
        self.sources.partition_point(|s| s.first <= root).saturating_sub(1)
    }

    /// True if a node is never chosen: it is padding, or part of an end that the transform mixes with the other end.
    #[must_use]
    pub fn is_masked(&self, level: usize, node: u32) -> bool {
        let Some(source) = self.sources.get(self.source_of(node >> level)) else { return true };
        if source.wraps {
            return false;
        }
        let own = u64::from(node - (source.first << level));
        let nodes = u64::from(source.roots) << level;
        let reach = self.wavelet.reach() as u64;
        let is_end = source.roots >= MANY_ROOTS && (own < reach || own + reach + 1 > nodes);
        is_end || (own + 1) * self.span(level) as u64 > source.frames
    }

    /// The audio of one channel of a recording, from its coefficients.
    #[must_use]
    pub fn audio(&self, source: usize, channel: usize) -> Vec<f32> {
        let Some(source) = self.sources.get(source) else { return Vec::new() };
        let (first, roots) = (source.first as usize, source.roots as usize);
        let of = |values: &[f32], level: usize| -> Vec<f64> {
            let nodes = first << level..(first + roots) << level;
            nodes.map(|m| values.get(m * self.channels + channel).map_or(0.0, |x| f64::from(*x))).collect()
        };
        let coefficients = Coefficients {
            approximation: of(&self.approximation, 0),
            details: self.details.iter().enumerate().map(|(l, d)| of(d, l)).collect(),
        };
        inverse(self.wavelet, &coefficients).into_iter().map(|x| x as f32).collect()
    }

    /// Checks that all fields fit each other.
    ///
    /// # Errors
    /// The first that does not.
    pub fn validate(&self) -> Result<(), TreeError> {
        let wrong = |field| Err(TreeError::Field(field));
        if !(self.rate.is_finite() && self.rate > 0.0) {
            return wrong("rate");
        }
        if !(1..=64).contains(&self.channels) {
            return wrong("channels");
        }
        if !(1..=24).contains(&self.depth) {
            return wrong("depth");
        }
        let mut next = 0_u32;
        for source in &self.sources {
            match next.checked_add(source.roots) {
                Some(end) if source.first == next && source.roots > 0 && end <= u32::MAX >> self.depth => {
                    next = end
                }
                _ => return wrong("sources"),
            }
        }
        let fits = |values: &Vec<f32>, level: usize| {
            values.len() == ((next as usize) << level) * self.channels && values.iter().all(|x| x.is_finite())
        };
        if next == 0 || !fits(&self.approximation, 0) {
            return wrong("approximation");
        }
        let details = self.details.len() == self.depth as usize
            && self.details.iter().enumerate().all(|(l, d)| fits(d, l));
        if details { Ok(()) } else { wrong("details") }
    }
}

/// The samples of a channel for a whole number of spans.
fn fitted(x: &[f32], samples: usize, fade: usize, fit: TreeFit) -> Vec<f64> {
    let at = |k: usize| x.get(k).map_or(0.0, |x| f64::from(*x));
    match fit {
        TreeFit::Trim => (0..samples).map(at).collect(),
        TreeFit::PadReflect => {
            // The mirror image of a half sample: the last sample comes twice.
            let period = 2 * x.len().max(1);
            let mirrored = |k: usize| at((k % period).min(period - 1 - k % period));
            (0..samples).map(mirrored).collect()
        }
        TreeFit::Circular => {
            let faded = |k: usize| {
                let phase = std::f64::consts::FRAC_PI_2 * (k as f64 + 0.5) / fade as f64;
                at(k) * phase.sin() + at(samples + k) * phase.cos()
            };
            (0..samples).map(|k| if k < fade { faded(k) } else { at(k) }).collect()
        }
    }
}

impl Data for WaveletTree {
    const NAME: &'static str = "wavelet tree";

    fn trial(rng: &mut Rng) -> Self {
        let channels = 1 + rng.below(2);
        let mut noise =
            || (0..channels).map(|_| (0..700).map(|_| rng.between(-0.5, 0.5) as f32).collect()).collect();
        let recording =
            |name: &str, channels| TreeRecording { name: name.to_owned(), content: "trial".into(), channels };
        let recordings = [recording("a.wav", noise()), recording("b.wav", noise())];
        Self::analyse(8000.0, &recordings, &TreeRules::default()).unwrap_or_else(|_| Self {
            rate: 8000.0,
            channels: 1,
            wavelet: Wavelet::Haar,
            depth: 1,
            sources: vec![TreeSource {
                name: "a.wav".into(),
                content: "trial".into(),
                first: 0,
                roots: 1,
                frames: 2,
                wraps: true,
            }],
            approximation: vec![0.0],
            details: vec![vec![0.5]],
        })
    }
}

#[cfg(test)]
mod tests;
