//! Plays samples of a bank, each from its own moment on.

use crate::archive_state;
use crate::core::state::Stateful;
use crate::crumple::bank::CrumpleBank;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

/// Samples over which a stolen voice fades out.
const FADE: i64 = 64;
/// Samples between two entries of the table of energies.
const BLOCK: usize = 64;

/// What becomes of a sample on its way to the output.
pub trait Hearing: Clone {
    /// Channels of the output.
    const CHANNELS: usize;

    /// Factor that it puts on the level.
    fn level(&self) -> f32;

    /// Adds frames of a sample to the output, from frame `at` on, which counts from the sample's beginning and may lie before it.
    ///
    /// Frames come one after the other, and each is asked for once.
    ///
    /// # Shapes
    /// `out: [T * CHANNELS]`, interleaved.
    fn add(&mut self, sample: &[f32], at: i64, level: Level, out: &mut [f32]);
}

/// Heard as recorded, in one channel.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Mono;

impl Hearing for Mono {
    const CHANNELS: usize = 1;

    fn level(&self) -> f32 {
        1.0
    }

    fn add(&mut self, sample: &[f32], at: i64, level: Level, out: &mut [f32]) {
        let samples = sample.iter().skip(at.max(0) as usize);
        for ((y, x), frame) in out.iter_mut().zip(samples).zip(at..) {
            *y += level.of(*x, frame);
        }
    }
}

/// How loud a voice is, and when it has faded out.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Level {
    gain: f32,
    /// Frame at which it has faded out, for a voice that was stolen.
    stop: Option<i64>,
}

impl Level {
    /// A sample as loud as it is at a frame.
    #[inline]
    #[must_use]
    pub fn of(&self, x: f32, frame: i64) -> f32 {
        let x = self.gain * x;
        self.stop.map_or(x, |stop| x * ((stop - frame) as f32 / FADE as f32).min(1.0))
    }
}

/// A sample that is to sound.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Onset {
    /// Its number in the bank.
    pub sample: usize,
    /// Frame of the output at which it begins.
    pub start: i64,
    /// Factor of its level.
    pub gain: f32,
    /// Where it sounds, m.
    pub place: [f32; 3],
}

/// One sample that sounds, or is about to.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Voice<H> {
    /// Its place among all samples of the bank, and its length.
    from: usize,
    len: usize,
    onset: Onset,
    /// Frame at which it has faded out, for one that was stolen.
    stop: Option<i64>,
    heard: H,
}

/// Adds samples up as they begin, go on and end, each heard in its own way.
///
/// Frame numbers are absolute, and voices are added in the order in which they came, so that blocks of any length give the same bits.
/// Memory is fixed: nothing is allocated while it plays.
#[derive(Clone, Debug)]
pub struct Player<H> {
    samples: Vec<f32>,
    offsets: Vec<u32>,
    /// Sum of squares of all samples before each block.
    energy: Vec<f64>,
    voices: Vec<Voice<H>>,
    most: usize,
    /// Frames in which a sample is heard before its beginning and after its end.
    lead: i64,
    ring: i64,
    stolen: u64,
    at_once: usize,
}

impl<H: Serialize + DeserializeOwned> Stateful for Player<H> {
    archive_state!(voices, stolen, at_once);
}

impl<H: Hearing> Player<H> {
    /// A player of a bank with at most `voices` voices at once, each heard from `lead` frames before its beginning to `ring` frames
    /// after its end.
    #[must_use]
    pub fn new(bank: &CrumpleBank, voices: usize, [lead, ring]: [usize; 2]) -> Self {
        let mut energy = vec![0.0];
        let mut sum = 0.0;
        for block in bank.samples.chunks(BLOCK) {
            sum += block.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
            energy.push(sum);
        }
        let most = voices.max(1);
        Self {
            samples: bank.samples.clone(),
            offsets: bank.offsets.clone(),
            energy,
            // As many again may be fading out.
            voices: Vec::with_capacity(2 * most),
            most,
            lead: lead as i64,
            ring: ring as i64,
            stolen: 0,
            at_once: 0,
        }
    }

    /// Voices that gave way to others, and the most that sounded at once.
    #[must_use]
    pub fn told(&self) -> (u64, usize) {
        (self.stolen, self.at_once)
    }

    /// Goes on with the voices of another player of the same bank.
    pub fn take_state(&mut self, old: &Self) {
        if self.offsets == old.offsets {
            self.voices.clear();
            self.voices.extend(old.voices.iter().take(2 * self.most).cloned());
            (self.stolen, self.at_once) = (old.stolen, old.at_once);
        }
    }

    /// About the energy that a voice still has to give at frame `now`.
    fn remaining(&self, voice: &Voice<H>, now: i64) -> f64 {
        let done = (now - voice.onset.start).clamp(0, voice.len as i64) as usize;
        let at = |place: usize| self.energy[place.div_ceil(BLOCK).min(self.energy.len() - 1)];
        let level = f64::from(voice.onset.gain * voice.heard.level());
        (at(voice.from + voice.len) - at(voice.from + done)).max(0.0) * level.powi(2)
    }

    /// Lets a sample begin, as decided at frame `now`, up to which all has been read.
    ///
    /// When too many sound, the one with the least energy left gives way, be it this one.
    pub fn begin(&mut self, onset: Onset, now: i64, heard: H) {
        let Onset { sample, start, .. } = onset;
        let (Some(from), Some(to)) = (self.offsets.get(sample), self.offsets.get(sample + 1)) else { return };
        let voice = Voice {
            from: *from as usize,
            len: (to - from) as usize,
            onset: Onset { start: start.max(now), ..onset },
            stop: None,
            heard,
        };
        let sounding = self.voices.iter().filter(|v| v.stop.is_none()).count();
        if sounding >= self.most {
            self.stolen += 1;
            let quietest = (0..self.voices.len())
                .filter(|j| self.voices[*j].stop.is_none())
                .map(|j| (self.remaining(&self.voices[j], now), j))
                .min_by(|a, b| a.0.total_cmp(&b.0));
            match quietest {
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
        if self.voices.len() == 2 * self.most {
            // The one that has faded the longest is nearly gone.
            let faded = self.voices.iter().position(|v| v.stop.is_some()).unwrap_or(0);
            self.voices.remove(faded);
        }
        self.voices.push(voice);
        self.at_once = self.at_once.max(self.voices.iter().filter(|v| v.stop.is_none()).count());
    }

    /// Adds the frames from `first` on to `out`; of a voice that begins among them, `heard` tells how it is heard from its place when
    /// its sample begins.
    ///
    /// # Shapes
    /// `out: [T * CHANNELS]`, interleaved.
    ///
    /// # Complexity
    /// O(voices) and O(1) per frame of each voice.
    pub fn read(&mut self, first: i64, out: &mut [f32], heard: impl Fn([f32; 3], i64) -> H) {
        let end = first + (out.len() / H::CHANNELS) as i64;
        for voice in &mut self.voices {
            let Onset { start, gain, place, .. } = voice.onset;
            let over = voice.stop.unwrap_or(i64::MAX).min(start + voice.len as i64 + self.ring);
            let (begin, last) = ((start - self.lead).max(first), over.min(end));
            if begin >= last {
                continue;
            }
            if begin == start - self.lead {
                voice.heard = heard(place, start);
            }
            let sample = &self.samples[voice.from..voice.from + voice.len];
            let out = &mut out[(begin - first) as usize * H::CHANNELS..(last - first) as usize * H::CHANNELS];
            let level = Level { gain, stop: voice.stop.map(|stop| stop - start) };
            voice.heard.add(sample, begin - start, level, out);
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

    fn play(voices: usize, blows: &[(usize, i64, f32)], n: usize, block: usize) -> (Vec<f32>, Player<Mono>) {
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
        for &(sample, frame, gain) in blows {
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
        assert_eq!(player.told(), (0, 3));
        assert!(player.voices.is_empty());
    }

    #[test]
    fn blocks_of_any_length_give_the_same_bits() {
        let blows: Vec<(usize, i64, f32)> =
            (0..60).map(|k| (k % 3, 37 * k as i64, 0.1 + 0.013 * k as f32)).collect();
        for voices in [2, 5, 100] {
            let whole = play(voices, &blows, 4000, 4000).0;
            assert!([1, 37, 64].iter().all(|block| play(voices, &blows, 4000, *block).0 == whole));
        }
    }

    #[test]
    fn the_voice_with_the_least_left_gives_way_and_fades() {
        // The second is nearly over when the third comes.
        let (out, player) = play(2, &[(0, 0, 1.0), (2, 0, 0.1), (1, 250, 1.0)], 1200, 64);
        assert_eq!(player.told(), (1, 2));
        assert!(
            (out[249] - 0.14).abs() < 1e-6 && (out[251] - 0.3 - 0.04 * 63.0 / 64.0).abs() < 1e-6,
            "{}",
            out[251]
        );
        assert!((out[314] - 0.3).abs() < 1e-6);
        let step =
            out[240..299].windows(2).map(|w| (w[1] - w[0]).abs()).filter(|d| *d < 0.1).fold(0.0, f32::max);
        assert!(step < 0.001, "{step}");
        // One that is weaker than all others is not begun.
        let (out, player) = play(1, &[(2, 0, 1.0), (0, 10, 0.01)], 400, 400);
        assert_eq!((player.told(), out[20], out[350]), ((1, 1), 0.4, 0.0));
    }

    #[test]
    fn what_waits_may_begin_later_and_what_is_no_sample_is_silent() {
        let mut player = Player::new(&bank(), 4, [0; 2]);
        let onset = Onset { gain: 1.0, ..Onset::default() };
        player.begin(Onset { sample: 1, start: 100, ..onset }, 0, Mono);
        player.begin(Onset { sample: 77, ..onset }, 0, Mono);
        let mut out = vec![0.0; 200];
        player.read(0, &mut out, |_, _| Mono);
        assert_eq!((out[99], out[100]), (0.0, 0.2));
    }
}
