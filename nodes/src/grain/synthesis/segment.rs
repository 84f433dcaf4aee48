//! Grains in time: pieces of runs with fades, and the joins between them.

use crate::grain::dictionary::{Grain, GrainDictionary};
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_PI_2;
use std::ops::Range;

/// Frames that are computed at a time from tracks.
const BLOCK: usize = 256;

/// Shortest fade between grains that are not neighbours, s.
const SHORTEST_FADE: f64 = 0.002;

/// Shape of a fade.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum FadeShape {
    /// A raised cosine at half samples: the taper of a grain.
    #[default]
    RaisedCosine,
    /// With its counterpart it preserves the power of two sounds of this correlation, 0 to 1: sine and cosine at 0, and a constant sum at 1.
    EqualPower(f32),
}

/// A fade at an end of a segment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Fade {
    /// Samples of the fade.
    pub len: u32,
    /// Its shape.
    pub shape: FadeShape,
}

impl Fade {
    /// Value at sample `i` of a rising fade.
    #[inline]
    fn at(self, i: f64) -> f64 {
        let x = (i + 0.5) / f64::from(self.len.max(1));
        if i >= f64::from(self.len) {
            return 1.0;
        }
        match self.shape {
            FadeShape::RaisedCosine => 0.5 - 0.5 * (2.0 * FRAC_PI_2 * x).cos(),
            FadeShape::EqualPower(correlation) => {
                let (sin, cos) = (FRAC_PI_2 * x).sin_cos();
                sin / (1.0 + 2.0 * f64::from(correlation) * sin * cos).sqrt()
            }
        }
    }
}

/// A piece of a run of a dictionary at a time of the output.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GrainSegment {
    /// Index of the grain.
    pub grain: u32,
    /// The run.
    pub run: u32,
    /// First sample in the run.
    pub from: u32,
    /// First frame of the output.
    pub start: i64,
    /// Frames of the output.
    pub len: u32,
    /// Fades at the beginning and at the end.
    pub fades: [Fade; 2],
    /// Amplitude; negative for the opposite sign.
    pub gain: f32,
    /// Samples of the run for each frame.
    pub ratio: f32,
    /// Shift of the frequency at the same duration, octaves: a shift other than 0 is played by the tracks of the grain.
    pub octaves: f32,
}

/// Third-order interpolation between the samples around a position.
#[inline]
fn interpolated(x: &[f32], position: f64) -> f32 {
    let k = position as usize;
    let at = |k: usize| x.get(k).copied().unwrap_or(0.0);
    let (a, b, c, d) = (at(k.saturating_sub(1)), at(k), at(k + 1), at(k + 2));
    let t = (position - k as f64) as f32;
    let (m, n) = (0.5 * (c - a), 0.5 * (d - b));
    let (t2, t3) = (t * t, t * t * t);
    b * (2.0 * t3 - 3.0 * t2 + 1.0) + m * (t3 - 2.0 * t2 + t) + c * (3.0 * t2 - 2.0 * t3) + n * (t3 - t2)
}

impl GrainSegment {
    /// First frame of the output after it.
    #[must_use]
    pub fn end(&self) -> i64 {
        self.start + i64::from(self.len)
    }

    /// The segment in a sound that begins at frame 0 and is played `ratio` times as fast.
    ///
    /// Ends and fades are rounded in the time of the output, so that segments that overlap in a fade also overlap after rounding.
    #[must_use]
    pub fn at_speed(&self, ratio: f32) -> Self {
        if ratio == 1.0 {
            return *self;
        }
        let ratio = f64::from(ratio);
        let output = |frame: i64| (frame as f64 / ratio).round() as i64;
        let (start, end) = (output(self.start), output(self.end()));
        let [fade_in, fade_out] = self.fades;
        let lens = [
            output(self.start + i64::from(fade_in.len)) - start,
            end - output(self.end() - i64::from(fade_out.len)),
        ];
        // The sample that belongs to the rounded start.
        let moved = (start as f64 * ratio - self.start as f64) * f64::from(self.ratio);
        Self {
            from: (i64::from(self.from) + moved.round() as i64).max(0) as u32,
            start,
            len: (end - start).max(0) as u32,
            fades: [Fade { len: lens[0] as u32, ..fade_in }, Fade { len: lens[1] as u32, ..fade_out }],
            ratio: (f64::from(self.ratio) * ratio) as f32,
            ..*self
        }
    }

    /// Adds the frames from `first` on to the output. Grains of more channels than the output are averaged.
    ///
    /// # Shapes
    /// `out: [T * channels]`, interleaved.
    pub fn add(&self, dictionary: &GrainDictionary, first: i64, channels: usize, out: &mut [f32]) {
        let frames = (out.len() / channels.max(1)) as i64;
        let (from, to) = (self.start.max(first), self.end().min(first + frames));
        if from >= to {
            return;
        }
        let stored = dictionary.runs.get(self.run as usize).map_or(1, |run| usize::from(run.channels).max(1));
        let out = &mut out[(from - first) as usize * channels..(to - first) as usize * channels];
        let mut add = |stored: usize, gain: f32, place: [usize; 2]| {
            if self.octaves == 0.0 {
                self.add_channel(dictionary.run(self.run, stored), from, gain, out, place);
            } else {
                self.add_shifted(dictionary, stored, from, gain, out, place);
            }
        };
        if channels == 1 && stored > 1 {
            (0..stored).for_each(|channel| add(channel, self.gain / stored as f32, [1, 0]));
        } else {
            (0..channels).for_each(|channel| add(channel % stored, self.gain, [channels, channel]));
        }
    }

    /// Adds one channel by the tracks of the grain.
    fn add_shifted(
        &self,
        dictionary: &GrainDictionary,
        stored: usize,
        from: i64,
        gain: f32,
        out: &mut [f32],
        [step, channel]: [usize; 2],
    ) {
        let grain = dictionary.grains.get(self.grain as usize);
        let Some((tracks, grain)) = dictionary.tracks.as_ref().zip(grain) else { return };
        let factors = [f64::from(self.octaves).exp2(), dictionary.rate];
        let mut offset = (from - self.start) as usize;
        let mut block = [0.0; BLOCK];
        for out in out.chunks_mut(BLOCK * step) {
            let block = &mut block[..out.len() / step];
            block.fill(0.0);
            let at = i64::from(self.from) + offset as i64;
            tracks.add((self.grain, grain), stored, factors, at, block);
            let frames = out.iter_mut().skip(channel).step_by(step).zip(block.iter()).enumerate();
            frames.for_each(|(n, (y, x))| *y += gain * self.envelope(offset + n) * x);
            offset += block.len();
        }
    }

    fn add_channel(&self, x: &[f32], from: i64, gain: f32, out: &mut [f32], [step, channel]: [usize; 2]) {
        let offset = (from - self.start) as usize;
        let frames = out.iter_mut().skip(channel).step_by(step).enumerate();
        let is_plain = self.ratio == 1.0;
        let plain = x.get(self.from as usize + offset..).unwrap_or_default();
        for (n, y) in frames {
            let i = offset + n;
            let sample = if is_plain {
                plain.get(n).copied().unwrap_or(0.0)
            } else {
                interpolated(x, f64::from(self.from) + i as f64 * f64::from(self.ratio))
            };
            *y += gain * self.envelope(i) * sample;
        }
    }

    /// The fades at frame `i`.
    #[inline]
    fn envelope(&self, i: usize) -> f32 {
        let (i, last) = (i as u32, self.len.saturating_sub(1));
        let [fade_in, fade_out] = self.fades;
        let mut value = 1.0;
        if i < fade_in.len {
            value *= fade_in.at(f64::from(i));
        }
        if last.saturating_sub(i) < fade_out.len {
            value *= fade_out.at(f64::from(last - i));
        }
        value as f32
    }
}

/// A grain at its time: `t` is the frame at which its window begins.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GrainStep {
    /// Index of the grain.
    pub grain: u32,
    /// Frame at which the windowed grain begins.
    pub t: i64,
    /// Amplitude; negative for the opposite sign.
    pub gain: f32,
}

/// The segment of a single grain, with its own tapers.
#[must_use]
pub fn single(dictionary: &GrainDictionary, step: &GrainStep) -> Option<GrainSegment> {
    let grain = dictionary.grains.get(step.grain as usize)?;
    let [fade_in, fade_out] = grain.taper.map(|len| Fade { len: len.into(), ..Fade::default() });
    Some(GrainSegment {
        grain: step.grain,
        run: grain.run,
        from: grain.span().start as u32,
        start: step.t,
        len: grain.window_len() as u32,
        fades: [fade_in, fade_out],
        gain: step.gain * grain.gain,
        ratio: 1.0,
        octaves: 0.0,
    })
}

/// Joins two successive segments of grains.
///
/// Neighbours at their distance in the recording overlap in their common taper, and join seamlessly. Others are cross-faded over at least 2 ms,
/// in the middle of the interval between them, where the sound around both suffices; otherwise a gap remains. The fade
/// preserves the power for the correlation of both sounds within it: grains that replace neighbours sum up to the same level.
pub fn join(dictionary: &GrainDictionary, before: &mut GrainSegment, after: &mut GrainSegment) {
    let (Some(a), Some(b)) =
        (dictionary.grains.get(before.grain as usize), dictionary.grains.get(after.grain as usize))
    else {
        return;
    };
    let a_window_end = before.end();
    let apart = after.start - before_window_start(a, before);
    let in_source = b.window_start() as i64 - a.window_start() as i64;
    if GrainDictionary::are_neighbours(a, b)
        && apart == in_source
        && before.ratio == 1.0
        && after.ratio == 1.0
        && before.octaves == after.octaves
    {
        return;
    }
    let shortest = (SHORTEST_FADE * dictionary.rate).round() as i64;
    let fade = shortest.max(i64::from(a.taper[1].min(b.taper[0])));
    let margin = |samples: usize, ratio: f32| (samples as f64 / f64::from(ratio.max(1e-3))) as i64;
    let after_margin = margin(dictionary.margins(a)[1], before.ratio);
    let before_margin = margin(dictionary.margins(b)[0], after.ratio);
    let middle = if a_window_end > after.start + fade {
        after.start
    } else {
        (a_window_end + after.start).div_euclid(2)
    };
    let earliest = (after.start - before_margin).max(before.start);
    let latest = (a_window_end + after_margin).min(after.end());
    let (mut low, mut high) = ((middle - fade / 2).max(earliest), (middle + (fade + 1) / 2).min(latest));
    if high - low < fade {
        // As much of the fade as fits, on either side.
        low = low.min(high - fade).max(earliest);
        high = high.max(low + fade).min(latest);
    }
    if high > low {
        let correlation = correlation_of(dictionary, before, after, low..high);
        let fade = Fade { len: (high - low) as u32, shape: FadeShape::EqualPower(correlation) };
        set_end(before, high, fade);
        set_start(after, low, fade);
    } else {
        let (end, start) = (latest.min(low.max(before.start + 1)), earliest.max(high.min(after.end() - 1)));
        set_end(before, end.max(before.start + 1), Fade { len: fade as u32, ..Fade::default() });
        set_start(after, start.min(after.end() - 1), Fade { len: fade as u32, ..Fade::default() });
    }
}

/// Normalised correlation of the first channels of two segments in a range of frames, 0 to 1; 0 where one of them is played at another speed or frequency.
fn correlation_of(
    dictionary: &GrainDictionary,
    before: &GrainSegment,
    after: &GrainSegment,
    frames: Range<i64>,
) -> f32 {
    if [before, after].iter().any(|s| s.ratio != 1.0 || s.octaves != 0.0) {
        return 0.0;
    }
    let samples = |segment: &GrainSegment| -> &[f32] {
        let from = i64::from(segment.from) + frames.start - segment.start;
        let run = dictionary.run(segment.run, 0);
        let from = (from.max(0) as usize).min(run.len());
        &run[from..run.len().min(from + (frames.end - frames.start).max(0) as usize)]
    };
    let (mut product, mut energies) = (0.0_f32, [0.0_f32; 2]);
    for (x, y) in samples(before).iter().zip(samples(after)) {
        product += x * y;
        energies = [energies[0] + x * x, energies[1] + y * y];
    }
    let norm = (energies[0] * energies[1]).sqrt();
    if norm > 0.0 { (product / norm * (before.gain * after.gain).signum()).clamp(0.0, 1.0) } else { 0.0 }
}

/// Frame at which the windowed grain of a segment begins, without the sound added before it.
fn before_window_start(grain: &Grain, segment: &GrainSegment) -> i64 {
    let added = grain.span().start as i64 - i64::from(segment.from);
    segment.start + (added as f64 / f64::from(segment.ratio.max(1e-3))).round() as i64
}

fn set_end(segment: &mut GrainSegment, end: i64, fade: Fade) {
    segment.len = (end - segment.start).max(1) as u32;
    segment.fades[1] = Fade { len: fade.len.min(segment.len), ..fade };
}

fn set_start(segment: &mut GrainSegment, start: i64, fade: Fade) {
    let moved = start - segment.start;
    let samples = (moved as f64 * f64::from(segment.ratio)).round() as i64;
    segment.from = (i64::from(segment.from) + samples).max(0) as u32;
    segment.len = (i64::from(segment.len) - moved).max(1) as u32;
    segment.start = start;
    segment.fades[0] = Fade { len: fade.len.min(segment.len), ..fade };
}

/// The segments of grains in order of time, joined.
#[must_use]
pub fn segments(dictionary: &GrainDictionary, steps: &[GrainStep]) -> Vec<GrainSegment> {
    let mut all: Vec<GrainSegment> = Vec::with_capacity(steps.len());
    for step in steps {
        let Some(mut next) = single(dictionary, step) else { continue };
        if let Some(before) = all.last_mut() {
            join(dictionary, before, &mut next);
        }
        all.push(next);
    }
    all
}

/// The sound of walks, each of grains in order of time, joined, with all channels averaged.
pub fn sound_of(
    dictionary: &GrainDictionary,
    walks: impl IntoIterator<Item = impl AsRef<[GrainStep]>>,
    frames: usize,
) -> Vec<f32> {
    let mut out = vec![0.0; frames];
    for steps in walks {
        segments(dictionary, steps.as_ref())
            .iter()
            .for_each(|segment| segment.add(dictionary, 0, 1, &mut out));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grain::trial_dictionary;

    fn step(grain: usize, t: i64) -> GrainStep {
        GrainStep { grain: grain as u32, t, gain: 1.0 }
    }

    fn render(dictionary: &GrainDictionary, segments: &[GrainSegment], n: usize, block: usize) -> Vec<f32> {
        let mut out = vec![0.0; n];
        for (k, out) in out.chunks_mut(block).enumerate() {
            segments.iter().for_each(|s| s.add(dictionary, (k * block) as i64, 1, out));
        }
        out
    }

    #[test]
    fn neighbours_join_without_a_trace() {
        let dictionary = trial_dictionary();
        let of_first = dictionary.grains.iter().filter(|g| g.source == 0 && g.run == 0);
        let steps: Vec<GrainStep> =
            of_first.enumerate().map(|(k, g)| step(k, g.window_start() as i64)).collect();
        assert!(steps.len() > 3);
        let all = segments(&dictionary, &steps);
        let end = all.last().unwrap().end() as usize;
        let whole = render(&dictionary, &all, end, end);
        let (first, x) = (dictionary.grains[0], dictionary.run(0, 0));
        let inner = first.start as usize + 20..end - 60;
        for t in inner {
            let want = x[t - first.start as usize + first.position as usize];
            assert!((whole[t] - want).abs() < 1e-6, "{t}: {} {want}", whole[t]);
        }
        assert_eq!(whole, render(&dictionary, &all, end, 37));
    }

    #[test]
    fn others_are_faded_over_with_equal_power() {
        let dictionary = trial_dictionary();
        let second = dictionary.grains.iter().position(|g| g.source == 1).unwrap() + 1;
        let a = dictionary.grains[1].window_len() as i64;
        for apart in [-3, 0, 20] {
            let all = segments(&dictionary, &[step(1, 0), step(second, a + apart)]);
            let [fade_out, fade_in] = [all[0].fades[1], all[1].fades[0]];
            let FadeShape::EqualPower(correlation) = fade_in.shape else { panic!("{all:?}") };
            assert!(fade_out == fade_in && fade_in.len >= 16, "{all:?}");
            assert_eq!(all[0].end() - i64::from(fade_out.len), all[1].start);
            for i in 0..fade_in.len {
                let (x, y) = (fade_in.at(f64::from(i)), fade_out.at(f64::from(fade_out.len - 1 - i)));
                let power = x * x + y * y + 2.0 * f64::from(correlation) * x * y;
                assert!((power - 1.0).abs() < 1e-9);
            }
        }
        // Too far apart for what is stored around both: a gap.
        let (last, first) = (second - 2, second - 1);
        let apart = dictionary.grains[last].window_len() as i64 + 400;
        let all = segments(&dictionary, &[step(last, 0), step(first, apart)]);
        assert!(all[0].end() < all[1].start);
    }

    #[test]
    fn a_copy_in_place_of_a_neighbour_joins_without_a_bump() {
        let mut dictionary = trial_dictionary();
        // The grain after the first one, with the same sound around it, in a run of its own.
        let (first, second) = (dictionary.grains[0], dictionary.grains[1]);
        let run = dictionary.runs[first.run as usize];
        let samples = dictionary.run(first.run, 0).to_vec();
        dictionary
            .runs
            .push(crate::grain::dictionary::Run { offset: dictionary.samples.len() as u64, ..run });
        dictionary.samples.extend(samples);
        let index = dictionary.runs.len() as u32 - 1;
        dictionary.grains.push(Grain { run: index, ..second });
        let copy = dictionary.len() - 1;
        let [a, b] = [&first, &second].map(|g| g.window_start() as i64);
        let play = |index: usize| {
            let all = segments(&dictionary, &[step(0, a), step(index, b)]);
            let end = all[1].end() as usize;
            render(&dictionary, &all, end, end)
        };
        let (own, copied) = (play(1), play(copy));
        assert!(own.iter().zip(&copied).all(|(x, y)| (x - y).abs() < 1e-6));
        assert!(!GrainDictionary::are_neighbours(&first, &dictionary.grains[copy]));
    }

    #[test]
    fn a_joined_sound_at_twice_the_speed_has_every_second_sample() {
        let dictionary = trial_dictionary();
        let of_first = dictionary.grains.iter().filter(|g| g.source == 0 && g.run == 0);
        let first = dictionary.grains[0].window_start() as i64;
        let steps: Vec<GrainStep> =
            of_first.enumerate().map(|(k, g)| step(k, g.window_start() as i64 - first)).collect();
        let all = segments(&dictionary, &steps);
        let end = all.last().unwrap().end() as usize;
        let plain = render(&dictionary, &all, end, end);
        let fast: Vec<GrainSegment> = all.iter().map(|s| s.at_speed(2.0)).collect();
        let half = end.div_ceil(2);
        assert!(fast.iter().all(|s| s.end() <= half as i64));
        let sound = render(&dictionary, &fast, half, half);
        let inner = 20..half - 30;
        assert!(inner.clone().any(|k| sound[k].abs() > 0.01));
        for k in inner {
            assert!((sound[k] - plain[2 * k]).abs() < 1e-5, "{k}: {} {}", sound[k], plain[2 * k]);
        }
        assert_eq!(all.iter().map(|s| s.at_speed(1.0)).collect::<Vec<_>>(), all);
        for pair in all.windows(2) {
            for ratio in [0.3, 0.7, 1.4, 3.0] {
                let [a, b] = [&pair[0], &pair[1]].map(|s| s.at_speed(ratio));
                assert_eq!(a.end() - i64::from(a.fades[1].len), b.start, "{ratio}");
                assert_eq!(a.fades[1].len, b.fades[0].len, "{ratio}");
            }
        }
    }

    #[test]
    fn a_ratio_of_one_half_plays_an_octave_lower() {
        let dictionary = trial_dictionary();
        let mut segment = single(&dictionary, &step(1, 0)).unwrap();
        segment.fades = [Fade::default(); 2];
        let plain = render(&dictionary, &[segment], 60, 60);
        let slow = render(&dictionary, &[GrainSegment { ratio: 0.5, ..segment }], 120, 120);
        assert!((0..50).all(|k| (slow[2 * k] - plain[k]).abs() < 1e-6));
    }
}
