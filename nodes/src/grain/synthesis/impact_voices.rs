//! Voices of impacts.

use super::repertoire::ImpactSound;
use super::segment::GrainSegment;
use crate::grain::dictionary::GrainDictionary;
use serde::{Deserialize, Serialize};

/// Duration over which a stolen voice fades out, s.
const STOLEN_FADE: f64 = 0.005;

/// A sound that plays.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Voice {
    /// Index of the sound.
    sound: u32,
    /// Segments that it has, from the first on.
    segments: u32,
    start: i64,
    gain: f32,
    /// Frame at which a stolen voice is silent.
    stop: Option<i64>,
}

/// Plays sounds of impacts, up to a number at a time. Nothing is allocated while it plays.
#[derive(Debug)]
pub struct ImpactVoices {
    voices: Vec<Voice>,
    max: usize,
    /// Voices that were stolen.
    pub stolen: u64,
}
crate::impl_state!(ImpactVoices { voices, stolen });

impl ImpactVoices {
    /// At most `max` voices at a time.
    #[must_use]
    pub fn new(max: usize) -> Self {
        // As many may fade out.
        Self { voices: Vec::with_capacity(2 * max.max(1)), max: max.max(1), stolen: 0 }
    }

    /// Copies the voices of another player of the same sounds.
    pub fn take_state(&mut self, old: &Self) {
        self.voices.clear();
        self.voices.extend(old.voices.iter().take(2 * self.max).copied());
        self.stolen = old.stolen;
    }

    /// Starts a sound, or its first segments only; the voice that began first ends for it if there are too many.
    pub fn begin(
        &mut self,
        sounds: &[ImpactSound],
        sound: u32,
        segments: u32,
        start: i64,
        gain: f32,
        rate: f64,
    ) {
        self.forget(sounds, start);
        let sounding = self.voices.iter().filter(|v| v.stop.is_none()).count();
        if sounding >= self.max {
            self.stolen += 1;
            let quietest = self.voices.iter_mut().filter(|v| v.stop.is_none());
            if let Some(voice) = quietest.min_by(|a, b| a.start.cmp(&b.start).then(a.gain.total_cmp(&b.gain)))
            {
                voice.stop = Some(start + (STOLEN_FADE * rate) as i64);
            }
        }
        if self.voices.len() == 2 * self.max {
            let fading = self.voices.iter().position(|v| v.stop.is_some()).unwrap_or(0);
            self.voices.remove(fading);
        }
        self.voices.push(Voice { sound, segments, start, gain, stop: None });
    }

    /// Adds the frames from `first` on.
    ///
    /// # Shapes
    /// `out: [T * channels]`, interleaved; `scratch` likewise.
    pub fn add(
        &mut self,
        dictionary: &GrainDictionary,
        sounds: &[ImpactSound],
        [first, channels]: [i64; 2],
        scratch: &mut [f32],
        out: &mut [f32],
    ) {
        let width = channels.max(1) as usize;
        let end = first + (out.len() / width) as i64;
        for voice in &self.voices {
            let Some(sound) = sounds.get(voice.sound as usize) else { continue };
            let all =
                sound.segments.get(..(voice.segments as usize).min(sound.segments.len())).unwrap_or_default();
            let in_window = |s: &&GrainSegment| voice.start + s.start < end && voice.start + s.end() > first;
            for segment in all.iter().filter(in_window) {
                let placed = GrainSegment {
                    start: voice.start + segment.start,
                    gain: voice.gain * segment.gain,
                    ..*segment
                };
                let Some(stop) = voice.stop else {
                    placed.add(dictionary, first, width, out);
                    continue;
                };
                let part = &mut scratch[..out.len()];
                part.fill(0.0);
                placed.add(dictionary, first, width, part);
                let fade = STOLEN_FADE * dictionary.rate;
                for (k, (out, x)) in out.chunks_exact_mut(width).zip(part.chunks_exact(width)).enumerate() {
                    let left = ((stop - first - k as i64) as f64 / fade).clamp(0.0, 1.0) as f32;
                    out.iter_mut().zip(x).for_each(|(y, x)| *y += left * x);
                }
            }
        }
        self.forget(sounds, end);
    }

    /// Removes the voices that have ended.
    fn forget(&mut self, sounds: &[ImpactSound], now: i64) {
        self.voices.retain(|v| {
            let frames = sounds.get(v.sound as usize).map_or(0, |s| s.frames);
            v.start + frames > now && v.stop.is_none_or(|stop| stop > now)
        });
    }
}
