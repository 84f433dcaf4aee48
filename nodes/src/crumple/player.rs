//! Plays samples of a bank, each from its own moment on.

use super::CrumpleBank;

/// Samples over which a stolen voice fades out.
const FADE: i64 = 64;
/// Samples between two entries of the table of energies.
const BLOCK: usize = 64;

/// One sample that sounds, or is about to.
#[derive(Clone, Copy, Debug)]
struct Voice {
    /// Its place among all samples of the bank, and its length.
    from: usize,
    len: usize,
    /// Frame of the output at which it begins.
    start: i64,
    gain: f32,
    /// Frame at which it has faded out, for one that was stolen.
    stop: Option<i64>,
}

/// Adds samples up as they begin, go on and end.
///
/// Frame numbers are absolute, and voices are added in the order in which they came, so that blocks of any length give the same bits.
/// Memory is fixed: nothing is allocated while it plays.
#[derive(Clone, Debug)]
pub struct Player {
    samples: Vec<f32>,
    offsets: Vec<u32>,
    /// Sum of squares of all samples before each block.
    energy: Vec<f64>,
    voices: Vec<Voice>,
    most: usize,
    stolen: u64,
    at_once: usize,
}

impl Player {
    /// A player of a bank with at most `voices` voices at once.
    #[must_use]
    pub fn new(bank: &CrumpleBank, voices: usize) -> Self {
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
            self.voices.extend(old.voices.iter().take(2 * self.most));
            (self.stolen, self.at_once) = (old.stolen, old.at_once);
        }
    }

    /// About the energy that a voice still has to give at frame `now`.
    fn remaining(&self, voice: &Voice, now: i64) -> f64 {
        let done = (now - voice.start).clamp(0, voice.len as i64) as usize;
        let at = |place: usize| self.energy[place.div_ceil(BLOCK).min(self.energy.len() - 1)];
        (at(voice.from + voice.len) - at(voice.from + done)).max(0.0) * f64::from(voice.gain).powi(2)
    }

    /// Lets sample `k` begin at frame `start`, decided at frame `now`, up to which all has been read.
    ///
    /// When too many sound, the one with the least energy left gives way, be it this one.
    pub fn begin(&mut self, k: usize, start: i64, gain: f32, now: i64) {
        let (Some(from), Some(to)) = (self.offsets.get(k), self.offsets.get(k + 1)) else { return };
        let voice = Voice {
            from: *from as usize,
            len: (to - from) as usize,
            start: start.max(now),
            gain,
            stop: None,
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
                    if self.voices[j].start >= now {
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

    /// Adds the frames from `first` on to `out`.
    ///
    /// # Complexity
    /// O(voices) and O(1) per frame of each voice.
    pub fn read(&mut self, first: i64, out: &mut [f32]) {
        let end = first + out.len() as i64;
        for voice in &self.voices {
            let last = voice.stop.unwrap_or(i64::MAX).min(voice.start + voice.len as i64).min(end);
            let begin = voice.start.max(first);
            if begin >= last {
                continue;
            }
            let from = voice.from + (begin - voice.start) as usize;
            let samples = &self.samples[from..from + (last - begin) as usize];
            let out = &mut out[(begin - first) as usize..(last - first) as usize];
            match voice.stop {
                None => out.iter_mut().zip(samples).for_each(|(y, x)| *y += voice.gain * x),
                Some(stop) => {
                    for ((y, x), frame) in out.iter_mut().zip(samples).zip(begin..) {
                        *y += voice.gain * x * ((stop - frame) as f32 / FADE as f32).min(1.0);
                    }
                }
            }
        }
        self.voices.retain(|v| v.start + v.len as i64 > end && v.stop.is_none_or(|stop| stop > end));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crumple::bank::{Cut, Origin, Recorded};
    use crate::crumple::extract::Extraction;

    /// Samples of constant level: 0.1 for 1000, 0.2 for 500, 0.4 for 300 frames.
    fn bank() -> CrumpleBank {
        let cut = |level: f32, n: usize| Cut { samples: vec![level; n], origin: Origin::default() };
        let cuts = vec![cut(0.1, 1000), cut(0.2, 500), cut(0.4, 300)];
        CrumpleBank::new("", 48e3, cuts, vec![Recorded::default()], Extraction::default())
    }

    fn play(voices: usize, blows: &[(usize, i64, f32)], n: usize, block: usize) -> (Vec<f32>, Player) {
        let mut player = Player::new(&bank(), voices);
        let mut out = vec![0.0; n];
        let mut at = 0;
        let mut read = |player: &mut Player, to: usize| {
            while at < to {
                let end = to.min(at + block);
                player.read(at as i64, &mut out[at..end]);
                at = end;
            }
        };
        for &(sample, frame, gain) in blows {
            read(&mut player, frame as usize);
            player.begin(sample, frame, gain, frame);
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
        let mut player = Player::new(&bank(), 4);
        player.begin(1, 100, 1.0, 0);
        player.begin(77, 0, 1.0, 0);
        let mut out = vec![0.0; 200];
        player.read(0, &mut out);
        assert_eq!((out[99], out[100]), (0.0, 0.2));
    }
}
