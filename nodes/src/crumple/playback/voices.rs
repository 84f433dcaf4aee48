//! Voices: samples of a bank that play at the same time.

use crate::archive_state;
use crate::core::state::Stateful;
use crate::crumple::bank::CrumpleBank;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

/// Frames over which a stolen voice fades out.
const FADE: i64 = 64;
/// Samples per entry of the table of energies.
const BLOCK: usize = 64;

/// A filter from a sample to the channels of the output.
pub trait VoiceFilter: Clone {
    /// Channels of the output.
    const CHANNELS: usize;

    /// Returns the gain of the filter.
    fn level(&self) -> f32;

    /// Adds frames of a sample to the output, from frame `from` relative to its beginning, which may be negative.
    ///
    /// Calls are in order of frames without gaps.
    ///
    /// # Shapes
    /// `out: [T * CHANNELS]`, interleaved.
    fn add(&mut self, sample: &[f32], from: i64, level: Level, out: &mut [f32]);
}

/// One channel without a filter.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Mono;

impl VoiceFilter for Mono {
    const CHANNELS: usize = 1;

    fn level(&self) -> f32 {
        1.0
    }

    fn add(&mut self, sample: &[f32], from: i64, level: Level, out: &mut [f32]) {
        let samples = sample.iter().skip(from.max(0) as usize);
        for ((y, x), frame) in out.iter_mut().zip(samples).zip(from..) {
            *y += level.of(*x, frame);
        }
    }
}

/// Gain of a voice, and the end of its fade-out.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Level {
    gain: f32,
    /// End of the fade-out of a stolen voice, in frames.
    stop: Option<i64>,
}

impl Level {
    /// Returns a sample at a frame with the gain.
    #[inline]
    #[must_use]
    pub fn of(&self, x: f32, frame: i64) -> f32 {
        let x = self.gain * x;
        self.stop.map_or(x, |stop| x * ((stop - frame) as f32 / FADE as f32).min(1.0))
    }
}

/// The beginning of a sample.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Onset {
    /// Index of the sample in the bank.
    pub sample: usize,
    /// First frame in the output.
    pub start: i64,
    /// Gain.
    pub gain: f32,
    /// Position, m.
    pub position: [f32; 3],
}

/// A sample that sounds or is about to sound.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Voice<F> {
    /// Start in the samples of the bank, and length.
    from: usize,
    len: usize,
    onset: Onset,
    /// End of the fade-out of a stolen voice, in frames.
    stop: Option<i64>,
    filter: F,
}

/// Plays samples of a bank, each with its own onset and filter.
///
/// Frame numbers are absolute, and voices are added in the order of their onsets, so blocks of any length produce the
/// same bits. Nothing is allocated while it plays.
#[derive(Clone, Debug)]
pub struct Player<F> {
    samples: Vec<f32>,
    offsets: Vec<u32>,
    /// Sum of squares of the samples before each block.
    energy: Vec<f64>,
    voices: Vec<Voice<F>>,
    max_voices: usize,
    /// Frames of output before the beginning of a sample and after its end.
    lead: i64,
    ring: i64,
    stolen: u64,
    max_sounding: usize,
}

impl<F: Serialize + DeserializeOwned> Stateful for Player<F> {
    archive_state!(voices, stolen, max_sounding);
}

impl<F: VoiceFilter> Player<F> {
    /// Creates a player with at most `voices` simultaneous voices, each with output from `lead` frames before its
    /// beginning to `ring` frames after its end.
    #[must_use]
    pub fn new(bank: &CrumpleBank, voices: usize, [lead, ring]: [usize; 2]) -> Self {
        let mut energy = vec![0.0];
        let mut sum = 0.0;
        for block in bank.samples.chunks(BLOCK) {
            sum += block.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
            energy.push(sum);
        }
        let max_voices = voices.max(1);
        Self {
            samples: bank.samples.clone(),
            offsets: bank.offsets.clone(),
            energy,
            // The same number of stolen voices may be fading out.
            voices: Vec::with_capacity(2 * max_voices),
            max_voices,
            lead: lead as i64,
            ring: ring as i64,
            stolen: 0,
            max_sounding: 0,
        }
    }

    /// Returns the number of stolen voices, and the maximum number of simultaneous voices.
    #[must_use]
    pub fn statistics(&self) -> (u64, usize) {
        (self.stolen, self.max_sounding)
    }

    /// Copies the voices of another player of the same bank.
    pub fn take_state(&mut self, old: &Self) {
        if self.offsets == old.offsets {
            self.voices.clear();
            self.voices.extend(old.voices.iter().take(2 * self.max_voices).cloned());
            (self.stolen, self.max_sounding) = (old.stolen, old.max_sounding);
        }
    }

    /// Returns the approximate remaining energy of a voice at frame `now`.
    fn remaining(&self, voice: &Voice<F>, now: i64) -> f64 {
        let played = (now - voice.onset.start).clamp(0, voice.len as i64) as usize;
        let energy_before = |index: usize| self.energy[index.div_ceil(BLOCK).min(self.energy.len() - 1)];
        let level = f64::from(voice.onset.gain * voice.filter.level());
        (energy_before(voice.from + voice.len) - energy_before(voice.from + played)).max(0.0) * level.powi(2)
    }

    /// Starts a sample at its onset. `now` is the frame up to which the output was read.
    ///
    /// Above the maximum number of voices, the one with the least remaining energy is stolen, or the new one is
    /// dropped.
    pub fn begin(&mut self, onset: Onset, now: i64, filter: F) {
        let Onset { sample, start, .. } = onset;
        let (Some(from), Some(to)) = (self.offsets.get(sample), self.offsets.get(sample + 1)) else { return };
        let voice = Voice {
            from: *from as usize,
            len: (to - from) as usize,
            onset: Onset { start: start.max(now), ..onset },
            stop: None,
            filter,
        };
        let sounding = self.voices.iter().filter(|v| v.stop.is_none()).count();
        if sounding >= self.max_voices {
            self.stolen += 1;
            let weakest = (0..self.voices.len())
                .filter(|j| self.voices[*j].stop.is_none())
                .map(|j| (self.remaining(&self.voices[j], now), j))
                .min_by(|a, b| a.0.total_cmp(&b.0));
            match weakest {
                Some((energy, j)) if energy <= self.remaining(&voice, now) => {
                    if self.voices[j].onset.start - self.lead >= now {
                        self.voices.remove(j);
                    } else {
                        self.voices[j].stop = Some(now + FADE);
                    }
                }
                _ => return,
            }
        }
        if self.voices.len() == 2 * self.max_voices {
            // The first fading voice is nearly silent.
            let fading = self.voices.iter().position(|v| v.stop.is_some()).unwrap_or(0);
            self.voices.remove(fading);
        }
        self.voices.push(voice);
        self.max_sounding = self.max_sounding.max(self.voices.iter().filter(|v| v.stop.is_none()).count());
    }

    /// Adds the frames from `first` to `out`. `filter` returns the filter of a position at the frame at which a sample
    /// begins.
    ///
    /// # Shapes
    /// `out: [T * CHANNELS]`, interleaved.
    ///
    /// # Complexity
    /// O(voices) and O(1) per frame of each voice.
    pub fn read(&mut self, first: i64, out: &mut [f32], filter: impl Fn([f32; 3], i64) -> F) {
        let end = first + (out.len() / F::CHANNELS) as i64;
        for voice in &mut self.voices {
            let Onset { start, gain, position, .. } = voice.onset;
            let end_of_voice = voice.stop.unwrap_or(i64::MAX).min(start + voice.len as i64 + self.ring);
            let (begin, last) = ((start - self.lead).max(first), end_of_voice.min(end));
            if begin >= last {
                continue;
            }
            if begin == start - self.lead {
                voice.filter = filter(position, start);
            }
            let sample = &self.samples[voice.from..voice.from + voice.len];
            let out = &mut out[(begin - first) as usize * F::CHANNELS..(last - first) as usize * F::CHANNELS];
            let level = Level { gain, stop: voice.stop.map(|stop| stop - start) };
            voice.filter.add(sample, begin - start, level, out);
        }
        let ring = self.ring;
        self.voices
            .retain(|v| v.onset.start + v.len as i64 + ring > end && v.stop.is_none_or(|stop| stop > end));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crumple::bank::{Cut, Extraction, Origin, Recorded};

    /// Samples of constant level: 0.1 for 1000, 0.2 for 500, 0.4 for 300 frames.
    fn bank() -> CrumpleBank {
        let cut = |level: f32, n: usize| Cut { samples: vec![level; n], origin: Origin::default() };
        let cuts = vec![cut(0.1, 1000), cut(0.2, 500), cut(0.4, 300)];
        CrumpleBank::new("", 48e3, cuts, vec![Recorded::default()], Extraction::default())
    }

    fn play(voices: usize, onsets: &[(usize, i64, f32)], n: usize, block: usize) -> (Vec<f32>, Player<Mono>) {
        let mut player = Player::new(&bank(), voices, [0; 2]);
        let mut out = vec![0.0; n];
        let mut at = 0;
        let mut read = |player: &mut Player<Mono>, to: usize| {
            while at < to {
                let end = to.min(at + block);
                player.read(at as i64, &mut out[at..end], |_, _| Mono);
                at = end;
            }
        };
        for &(sample, frame, gain) in onsets {
            read(&mut player, frame as usize);
            player.begin(Onset { sample, start: frame, gain, ..Onset::default() }, frame, Mono);
        }
        read(&mut player, n);
        (out, player)
    }

    #[test]
    fn samples_begin_and_end_to_the_frame_and_add_up() {
        let (out, player) = play(8, &[(0, 10, 1.0), (1, 200, 0.5), (0, 400, 1.0)], 2000, 64);
        let want = |n: usize| {
            let on = |from: usize, len: usize| if (from..from + len).contains(&n) { 1.0 } else { 0.0 };
            0.1 * on(10, 1000) + 0.1 * on(200, 500) + 0.1 * on(400, 1000)
        };
        assert!(out.iter().enumerate().all(|(n, x)| (x - want(n)).abs() < 1e-6));
        assert_eq!(player.statistics(), (0, 3));
        assert!(player.voices.is_empty());
    }

    #[test]
    fn blocks_of_any_length_give_the_same_bits() {
        let onsets: Vec<(usize, i64, f32)> =
            (0..60).map(|k| (k % 3, 37 * k as i64, 0.1 + 0.013 * k as f32)).collect();
        for voices in [2, 5, 100] {
            let whole = play(voices, &onsets, 4000, 4000).0;
            assert!([1, 37, 64].iter().all(|block| play(voices, &onsets, 4000, *block).0 == whole));
        }
    }

    #[test]
    fn the_voice_with_the_least_remaining_energy_is_stolen_and_fades() {
        // The second sample is nearly over when the third begins.
        let (out, player) = play(2, &[(0, 0, 1.0), (2, 0, 0.1), (1, 250, 1.0)], 1200, 64);
        assert_eq!(player.statistics(), (1, 2));
        assert!(
            (out[249] - 0.14).abs() < 1e-6 && (out[251] - 0.3 - 0.04 * 63.0 / 64.0).abs() < 1e-6,
            "{}",
            out[251]
        );
        assert!((out[314] - 0.3).abs() < 1e-6);
        let step =
            out[240..299].windows(2).map(|w| (w[1] - w[0]).abs()).filter(|d| *d < 0.1).fold(0.0, f32::max);
        assert!(step < 0.001, "{step}");
        // A voice weaker than all others does not begin.
        let (out, player) = play(1, &[(2, 0, 1.0), (0, 10, 0.01)], 400, 400);
        assert_eq!((player.statistics(), out[20], out[350]), ((1, 1), 0.4, 0.0));
    }

    #[test]
    fn onsets_may_be_in_the_future_and_unknown_samples_are_silent() {
        let mut player = Player::new(&bank(), 4, [0; 2]);
        let onset = Onset { gain: 1.0, ..Onset::default() };
        player.begin(Onset { sample: 1, start: 100, ..onset }, 0, Mono);
        player.begin(Onset { sample: 77, ..onset }, 0, Mono);
        let mut out = vec![0.0; 200];
        player.read(0, &mut out, |_, _| Mono);
        assert_eq!((out[99], out[100]), (0.0, 0.2));
    }
}
