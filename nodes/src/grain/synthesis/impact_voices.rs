//! Voices of impacts.

use super::repertoire::ImpactSound;
use super::segment::GrainSegment;
use crate::grain::dictionary::GrainDictionary;
use serde::{Deserialize, Serialize};

/// Duration over which a stolen voice fades out, s.
const STOLEN_FADE: f64 = 0.005;

/// A sound that plays.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Voice {
    /// Index of the list of sounds.
    pub list: u32,
    /// Index of the sound in its list.
    pub sound: u32,
    /// Segments that it has, from the first on.
    pub segments: u32,
    /// Frame at which it begins.
    pub start: i64,
    /// Amplitude factor.
    pub gain: f32,
    /// Speed of playback as a factor.
    pub ratio: f32,
    /// Frame at which a stolen voice is silent.
    pub stop: Option<i64>,
}

impl Voice {
    /// Its sound in the lists that it was started with.
    fn sound<'a>(&self, lists: &'a [Vec<ImpactSound>]) -> Option<&'a ImpactSound> {
        lists.get(self.list as usize)?.get(self.sound as usize)
    }
}

/// Plays sounds of impacts, up to a number at a time, each of one of several lists. Nothing is allocated while it plays.
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

    /// Copies the voices of another player of the same lists.
    pub fn take_state(&mut self, old: &Self) {
        self.voices.clear();
        self.voices.extend(old.voices.iter().take(2 * self.max).copied());
        self.stolen = old.stolen;
    }

    /// Starts a voice; the one that began first ends for it if there are too many.
    pub fn begin(&mut self, lists: &[Vec<ImpactSound>], voice: Voice, rate: f64) {
        let start = voice.start;
        self.forget(lists, start);
        let sounding = self.voices.iter().filter(|v| v.stop.is_none()).count();
        if sounding >= self.max {
            self.stolen += 1;
            let sounding = self.voices.iter_mut().filter(|v| v.stop.is_none());
            let first = sounding.min_by(|a, b| a.start.cmp(&b.start).then(a.gain.total_cmp(&b.gain)));
            if let Some(voice) = first {
                voice.stop = Some(start + (STOLEN_FADE * rate) as i64);
            }
        }
        if self.voices.len() == 2 * self.max {
            let fading = self.voices.iter().position(|v| v.stop.is_some()).unwrap_or(0);
            self.voices.remove(fading);
        }
        self.voices.push(voice);
    }

    /// Adds the frames from `first` on.
    ///
    /// # Shapes
    /// `out: [T * channels]`, interleaved; `scratch` likewise.
    pub fn add(
        &mut self,
        dictionary: &GrainDictionary,
        lists: &[Vec<ImpactSound>],
        [first, channels]: [i64; 2],
        scratch: &mut [f32],
        out: &mut [f32],
    ) {
        let width = channels.max(1) as usize;
        let end = first + (out.len() / width) as i64;
        for voice in &self.voices {
            let Some(sound) = voice.sound(lists) else { continue };
            let all =
                sound.segments.get(..(voice.segments as usize).min(sound.segments.len())).unwrap_or_default();
            let in_window = |s: &GrainSegment| voice.start + s.start < end && voice.start + s.end() > first;
            for segment in all.iter().map(|s| s.at_speed(voice.ratio)).filter(in_window) {
                let placed = GrainSegment {
                    start: voice.start + segment.start,
                    gain: voice.gain * segment.gain,
                    ..segment
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
        self.forget(lists, end);
    }

    /// Removes the voices that have ended.
    fn forget(&mut self, lists: &[Vec<ImpactSound>], now: i64) {
        self.voices.retain(|v| {
            let frames = v.sound(lists).map_or(0, |s| s.frames);
            let end = v.start + (frames as f64 / f64::from(v.ratio)).round() as i64;
            end > now && v.stop.is_none_or(|stop| stop > now)
        });
    }
}
