//! Active contacts: the current piece of the path of each, and its state in an excitation.

use super::contact_force_params::ContactForceParams;
use super::segment::{CELL, Segment};
use super::strength::Strength;
use crate::archive_state;
use crate::core::node::Summary;
use crate::core::silence::Silence;
use crate::core::state::Stateful;
use crate::core::time::{Rate, Tick};
use crate::core::unmatched::Unmatched;
use crate::dsp::LevelMeter;
use crate::scrape::path::piece::PathPiece;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

#[derive(Clone, Debug, Serialize, Deserialize)]
struct Voice<S> {
    start: Tick,
    /// End of its piece; the voice is free afterwards.
    end: Tick,
    piece: PathPiece,
    state: S,
}

/// A fixed number of contacts that sound at once, each with a state of type `S`.
///
/// A piece continues with the voice of its contact where it touches the piece before it, or cuts it short; otherwise it begins
/// again. One that finds no free voice is left out and counted.
#[derive(Clone, Debug)]
pub struct Voices<S> {
    voices: Vec<Voice<S>>,
    rate: Rate,
    /// Maximum number of simultaneous voices so far.
    pub most: usize,
    /// Pieces without a free voice.
    pub left_out: u64,
    /// Pieces of other objects.
    others: Unmatched<u32>,
    /// Pieces with an amplitude.
    audible: u64,
    meter: LevelMeter,
    /// The sample after the last one made.
    now: i64,
}

impl<S: Serialize + DeserializeOwned> Stateful for Voices<S> {
    archive_state!(voices, most, left_out, others, audible, meter, now);
}

impl<S: Clone> Voices<S> {
    /// Allocates memory for `count` contacts.
    #[must_use]
    pub fn new(count: usize, rate: Rate, blank: S) -> Self {
        let piece = PathPiece {
            contact: 0,
            jump: 0,
            object: 0,
            duration: 1,
            position: [[0.0; 2]; 4],
            other: None,
            force: [0.0; 2],
            gain: [0.0; 2],
            mass: None,
        };
        let voice = Voice { start: Tick::MIN, end: Tick::MIN, piece, state: blank };
        let voices = vec![voice; count.max(1)];
        Self {
            voices,
            rate,
            most: 0,
            left_out: 0,
            others: Unmatched::default(),
            audible: 0,
            meter: LevelMeter::default(),
            now: 0,
        }
    }

    /// Takes a piece; `fresh` makes the state of one that does not continue from another.
    fn begin(&mut self, tick: Tick, piece: &PathPiece, fresh: impl FnOnce(&PathPiece) -> S) {
        let end = tick.saturating_add(piece.duration);
        let same = |v: &Voice<S>| (v.piece.contact, v.piece.jump) == (piece.contact, piece.jump);
        // Rounding may leave a gap of a tick or two between pieces that touch.
        if let Some(voice) = self.voices.iter_mut().find(|v| same(v) && v.end >= tick - 2) {
            (voice.start, voice.end, voice.piece) = (tick, end, *piece);
            return;
        }
        let sample = self.rate.first_at(tick);
        let rate = self.rate;
        let Some(free) = self.voices.iter_mut().find(|v| rate.first_at(v.end) <= sample) else {
            self.left_out += 1;
            return;
        };
        *free = Voice { start: tick, end, piece: *piece, state: fresh(piece) };
        let sounding = self.voices.iter().filter(|v| v.end > tick).count();
        self.most = self.most.max(sounding);
    }

    /// Computes the samples from `first` on of all contacts: `sound` adds those of one segment to its part of `out`.
    ///
    /// `events` are the pieces that begin in the time of these samples.
    pub fn play(
        &mut self,
        events: &[(Tick, PathPiece)],
        object: Option<u32>,
        first: i64,
        out: &mut [f32],
        mut fresh: impl FnMut(&PathPiece) -> S,
        mut sound: impl FnMut(&mut S, &Segment, &mut [f32]),
    ) {
        out.fill(0.0);
        let (mut next, last) = (first, first + out.len() as i64);
        for (tick, piece) in events {
            if object.is_some_and(|o| o != piece.object) {
                self.others.add(piece.object);
                continue;
            }
            if !is_sound(piece) {
                continue;
            }
            self.audible += u64::from(piece.gain != [0.0; 2]);
            let item = self.rate.first_at(*tick).clamp(next, last);
            self.sweep(first, (next, item), out, &mut sound);
            next = item;
            self.begin(*tick, piece, &mut fresh);
        }
        self.sweep(first, (next, last), out, &mut sound);
    }

    /// As [`play`](Self::play), cell by cell: `after` adds to each cell the sound that continues by itself, such as
    /// active pulses, so that only those of one cell are waiting at a time.
    #[allow(clippy::too_many_arguments)]
    pub fn play_cells<F>(
        &mut self,
        events: &[(Tick, PathPiece)],
        object: Option<u32>,
        first: i64,
        out: &mut [f32],
        force: &mut F,
        mut fresh: impl FnMut(&PathPiece) -> S,
        mut sound: impl FnMut(&mut F, &mut S, &Segment, &mut [f32]),
        mut after: impl FnMut(&mut F, i64, &mut [f32]),
    ) {
        let (mut first, mut events, mut left) = (first, events, out);
        while !left.is_empty() {
            let stop = (first.div_euclid(CELL as i64) + 1) * CELL as i64;
            let (out, rest) = left.split_at_mut(((stop - first) as usize).min(left.len()));
            let now = |(tick, _): &(Tick, PathPiece)| self.rate.first_at(*tick) < stop;
            let count = if rest.is_empty() { events.len() } else { events.partition_point(now) };
            let (now, later) = events.split_at(count);
            self.play(now, object, first, out, &mut fresh, |voice, segment, out| {
                sound(force, voice, segment, out);
            });
            after(force, first, out);
            (first, left, events) = (stop, rest, later);
        }
    }

    /// Records the level of the output samples from `first` on.
    pub fn made(&mut self, first: i64, out: &[f32]) {
        self.meter.process(out);
        self.now = first + out.len() as i64;
    }

    /// The first sample to which a change of parameters applies.
    #[must_use]
    pub fn now(&self) -> i64 {
        self.now
    }

    /// Returns the summary of a run: level of the force, and number of contacts.
    #[must_use]
    pub fn summary(&self) -> Summary {
        let level = self.meter.level();
        let mut summary: Summary = vec![
            ("peak_n", level.peak.into()),
            ("rms_n", level.rms.into()),
            ("contacts_at_once", self.most.into()),
        ];
        if self.left_out > 0 {
            summary.push(("left_out", self.left_out.into()));
        }
        summary
    }

    /// Returns why there is no force although the gain and `kappa`, its own or the linked one, are not 0. A linked one of 0 turns the
    /// node off: another representation of the surface sounds.
    #[must_use]
    pub fn silence(
        &self,
        contact: &ContactForceParams,
        kappa: f64,
        linked: Option<Strength>,
    ) -> Option<Silence> {
        if linked.is_some_and(|linked| linked.kappa == 0.0) {
            return Some(Silence::Off);
        }
        let kappa = linked.map_or(kappa, |linked| linked.kappa);
        if self.meter.level().peak > 0.0 || kappa * contact.gain == 0.0 {
            None
        } else if self.audible > 0 {
            Some(Silence::Because(
                "contacts make no force: nothing moves, or the surface is even (an image of one tone?)",
            ))
        } else {
            Silence::no_object("path", contact.object, self.others).filter(|_| self.most == 0)
        }
    }

    /// The samples of all voices between two beginnings.
    fn sweep(
        &mut self,
        first: i64,
        (from, to): (i64, i64),
        out: &mut [f32],
        sound: &mut impl FnMut(&mut S, &Segment, &mut [f32]),
    ) {
        let rate = self.rate;
        for voice in &mut self.voices {
            // A voice never sounds before its piece: all samples before it have been computed.
            if voice.end == Tick::MIN {
                continue;
            }
            let begin = rate.first_at(voice.start);
            let (mut at, end) = (from.max(begin), to.min(rate.first_at(voice.end)));
            while at < end {
                let cell = at.div_euclid(CELL as i64) * CELL as i64;
                let anchor = cell.max(begin);
                let stop = end.min(cell + CELL as i64);
                let mut segment = Segment::new(&voice.piece, voice.start, anchor, rate);
                (segment.from, segment.to) = ((at - anchor) as usize, (stop - anchor) as usize);
                if let Some(out) = out.get_mut((at - first) as usize..(stop - first) as usize) {
                    sound(&mut voice.state, &segment, out);
                }
                at = stop;
            }
        }
    }

    /// Adopts the active contacts of another set of the same size, and combines the figures of both.
    pub fn take_state(&mut self, old: &Self) {
        if (old.voices.len(), old.rate) == (self.voices.len(), self.rate) {
            self.voices.clone_from_slice(&old.voices);
            (self.most, self.left_out) = (old.most, old.left_out);
            (self.others, self.audible) = (old.others, old.audible);
        }
        (self.meter, self.now) = (old.meter, old.now);
    }
}

/// Returns true if all numbers of a piece are finite; other numbers would stay in the filters of an excitation.
fn is_sound(piece: &PathPiece) -> bool {
    let positions = piece.position.iter().chain(piece.other.iter().flatten()).flatten();
    let small = |x: &f64| x.abs() < 1e9;
    let fits = |x: &f32| x.abs() < 1e12;
    piece.duration > 0 && positions.into_iter().all(small) && piece.force.iter().chain(&piece.gain).all(fits)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::time::ticks;
    use crate::scrape::path::piece::position;
    use crate::scrape::testing::piece;

    fn made(pieces: &[(Tick, PathPiece)], windows: &[usize]) -> Vec<f32> {
        let mut voices = Voices::new(2, Rate::hz(1000), 0_u32);
        let (mut all, mut first) = (Vec::new(), 0);
        for n in windows {
            let to = Rate::hz(1000).tick(first + *n as i64);
            let from = Rate::hz(1000).tick(first);
            let now: Vec<_> = pieces.iter().filter(|(t, _)| (from..to).contains(t)).copied().collect();
            let mut out = vec![9.0; *n];
            voices.play(
                &now,
                None,
                first,
                &mut out,
                |_| 0,
                |count, segment, out| {
                    for (k, x) in out.iter_mut().enumerate() {
                        *count += 1;
                        *x += segment.position((segment.from + k) as f64)[0] as f32;
                    }
                },
            );
            all.extend(out);
            first += *n as i64;
        }
        all
    }

    #[test]
    fn a_piece_sounds_from_its_start_to_its_end_whatever_the_windows() {
        let one = piece([0.0, 0.0], [1.0, 0.0], 0.1);
        let two = PathPiece { jump: 1, ..piece([1.0, 0.0], [1.0, 0.0], 0.1) };
        let pieces = [(ticks(0.0205), one), (ticks(0.06), two), (ticks(0.1205), one)];
        let whole = made(&pieces, &[300]);
        assert_eq!(whole[20], 0.0);
        assert!((whole[21] - 0.0005).abs() < 1e-6 && (whole[59] - 0.0385).abs() < 1e-6);
        assert!((whole[60] - 1.0395).abs() < 1e-6, "two at once");
        assert!((whole[121] - 0.0005 - 1.061).abs() < 1e-6 && whole[221..].iter().all(|x| *x == 0.0));
        for windows in [vec![1; 300], vec![7, 93, 64, 36, 100], vec![150; 2]] {
            assert_eq!(made(&pieces, &windows), whole);
        }
    }

    #[test]
    fn a_piece_without_a_voice_is_counted() {
        let mut voices = Voices::new(1, Rate::hz(1000), ());
        let pieces = [1_u64, 2].map(|contact| (0, PathPiece { contact, ..piece([0.0; 2], [1.0; 2], 0.1) }));
        voices.play(&pieces, None, 0, &mut [0.0; 8], |_| (), |(), _, _| {});
        assert_eq!((voices.left_out, voices.most), (1, 1));
    }

    #[test]
    fn even_motion_is_exact() {
        // 3.7 m away at 1.3 m/s.
        let piece = piece([3.7, -2.0], [1.3, 0.7], 0.016);
        let mut worst = 0.0_f64;
        let mut voices = Voices::new(1, Rate::hz(44_100), ());
        voices.play(
            &[(0, piece)],
            None,
            0,
            &mut [0.0; 700],
            |_| (),
            |(), segment, _| {
                let path = segment.path();
                for n in segment.from..segment.to {
                    let t = (segment.anchor + n as i64) as f64 / 44_100.0;
                    let found = position(&path, n as f64);
                    worst = worst.max((found[0] - 3.7 - 1.3 * t).abs()).max((found[1] + 2.0 - 0.7 * t).abs());
                }
            },
        );
        assert!(worst < 1e-9, "{worst}");
    }
}
