//! Recordings at one rate, split into components.

use super::kind::SourceKind;
use super::label::Component;
use crate::core::item::Data;
use crate::core::node::Summary;
use crate::core::random::Rng;
use serde::{Deserialize, Serialize};

/// One component of a recording: samples of each channel, and their mean, in which grains are found.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Part {
    /// The component.
    pub component: Component,
    /// Samples of each channel, equally many.
    pub channels: Vec<Vec<f32>>,
}

impl Part {
    /// The mean of the channels.
    #[must_use]
    pub fn mono(&self) -> Vec<f32> {
        let [first, others @ ..] = &self.channels[..] else { return Vec::new() };
        let mut mono = first.clone();
        for channel in others {
            mono.iter_mut().zip(channel).for_each(|(sum, x)| *sum += x);
        }
        let scale = 1.0 / self.channels.len() as f32;
        mono.iter_mut().for_each(|x| *x *= scale);
        mono
    }
}

/// A recording with its metadata.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GrainRecording {
    /// Provenance: its path by default.
    pub name: String,
    /// Licence.
    pub licence: String,
    /// Words that describe it.
    pub tags: Vec<String>,
    /// Kind of contact.
    pub kind: SourceKind,
    /// True if the kind is a guess.
    pub guessed: bool,
    /// Speed of the recorded motion, m/s, if it is known.
    pub speed: Option<f64>,
    /// Digest of its content.
    pub content: String,
    /// The recording as a whole, or its steady and its transient part.
    pub parts: Vec<Part>,
}

impl GrainRecording {
    /// Number of samples of each channel.
    #[must_use]
    pub fn len(&self) -> usize {
        self.parts.first().and_then(|part| part.channels.first()).map_or(0, Vec::len)
    }

    /// Returns true if there is no sample.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// All components and channels in one.
    #[must_use]
    pub fn mono(&self) -> Vec<f32> {
        let mut sum = vec![0.0; self.len()];
        for part in &self.parts {
            sum.iter_mut().zip(part.mono()).for_each(|(sum, x)| *sum += x);
        }
        sum
    }
}

/// Recordings at one rate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GrainRecordings {
    /// Sample rate, Hz.
    pub rate: f64,
    /// The recordings.
    pub recordings: Vec<GrainRecording>,
}

impl GrainRecordings {
    /// Figures for the summary of a run.
    #[must_use]
    pub fn summary(&self) -> Summary {
        let of = |kind| self.recordings.iter().filter(|r| r.kind == kind).count();
        let samples: usize = self.recordings.iter().map(GrainRecording::len).sum();
        vec![
            ("recordings", self.recordings.len().into()),
            ("impulsive", of(SourceKind::Impulsive).into()),
            ("continuous", of(SourceKind::Continuous).into()),
            ("seconds", (samples as f64 / self.rate).into()),
        ]
    }
}

impl Data for GrainRecordings {
    const NAME: &'static str = "recordings for grains";

    fn trial(rng: &mut Rng) -> Self {
        let mut recording = |k: usize| {
            let n = 1500 + rng.below(1000);
            let mut x: Vec<f32> = (0..n).map(|_| rng.between(-0.3, 0.3) as f32).collect();
            for (i, y) in x.iter_mut().enumerate() {
                *y *= (-(i as f64) / 900.0).exp() as f32;
            }
            GrainRecording {
                name: format!("trial_{k}.wav"),
                tags: vec!["trial".into()],
                parts: vec![Part { component: Component::Whole, channels: vec![x] }],
                ..GrainRecording::default()
            }
        };
        Self { rate: 8000.0, recordings: (0..2).map(&mut recording).collect() }
    }
}
