//! Makes a unit database of recordings.

use rayon::prelude::*;
use std::borrow::Cow;
use std::ops::Range;
use thiserror::Error;

use super::units::{DATABASE_VERSION, DatabaseError, Segment, UnitDatabase, UnitSource, Variant};
use crate::core::time::Rate;
use crate::dsp::{Band, Butterworth, Cascade, DspError, Quality, Resampler};
use crate::feature::{FeatureConventions, FloorRule, MelCepstrum, TemporalFilter};

/// A recording at the rate of the conventions.
#[derive(Clone, Debug, Default)]
pub struct Take<'a> {
    /// Samples of each channel, equally many.
    pub channels: Cow<'a, [Vec<f32>]>,
    /// Stretches of samples to use, in order, without overlaps; `None`: as [`Gap`] splits it.
    pub spans: Option<Vec<Range<usize>>>,
    /// The value.
    pub source: UnitSource,
}

impl Take<'_> {
    /// Number of samples of each channel.
    fn len(&self) -> usize {
        self.channels.iter().map(Vec::len).min().unwrap_or(0)
    }

    /// Number of samples of each channel that are used.
    #[must_use]
    pub fn used(&self) -> usize {
        self.spans.as_ref().map_or_else(|| self.len(), |spans| spans.iter().map(ExactSizeIterator::len).sum())
    }
}

/// Copies of all recordings at other speeds and levels. Their units are added to those of the recordings themselves.
///
/// With s speeds and g gains a database has (s + 1) (g + 1) times as many units. A change of speed changes the pitch by the same factor, as on tape.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Augmentation {
    /// Factors on the speed, above 0; thousandths count. 1 adds nothing.
    pub speeds: Vec<f64>,
    /// Gains, dB. 0 adds nothing.
    pub gains: Vec<f64>,
}

/// Number of speeds to the unit that differ.
const SPEED_STEPS: u64 = 1000;

fn speed_steps(speed: f64) -> u64 {
    (speed * SPEED_STEPS as f64).round().max(1.0) as u64
}

/// A recording at another speed.
fn at_speed(take: &Take<'_>, speed: f64, rate: Rate) -> Result<Take<'static>, DspError> {
    let steps = speed_steps(speed);
    let from = Rate::new(rate.num() * steps, rate.den() * SPEED_STEPS).unwrap_or(rate);
    let resampler = Resampler::new(from, rate, Quality::High)?;
    let channels: Result<Vec<Vec<f32>>, DspError> =
        take.channels.par_iter().map(|x| resampler.whole(x)).collect();
    let (spans, source) = (take.spans.clone(), take.source.clone());
    let mut changed = Take { channels: channels?.into(), spans, source };
    let (length, factor) = (changed.len(), SPEED_STEPS as f64 / steps as f64);
    let at = |sample: usize| ((sample as f64 * factor).round() as usize).min(length);
    changed.spans.iter_mut().flatten().for_each(|span| *span = at(span.start)..at(span.end));
    Ok(changed)
}

/// Silence that cuts a recording into segments.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// Samples that it lasts at least.
    pub samples: usize,
    /// Magnitude below which the silence stays.
    pub level: f32,
}

/// Reasons why no database can be made.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum BuildError {
    /// The database would be empty or invalid.
    #[error(transparent)]
    Database(#[from] DatabaseError),
    /// A sample that is not a number.
    #[error("sample {sample} of {recording:?} is {found}; only finite samples can be used")]
    NotFinite {
        /// Provenance of the recording.
        recording: String,
        /// Index of the sample.
        sample: usize,
        /// The value.
        found: f32,
    },
    /// Joint features of a recording with another number of channels.
    #[error("{recording:?} has {found} channels; the database joins {wanted}")]
    Channels {
        /// Provenance of the recording.
        recording: String,
        /// Channels found.
        found: usize,
        /// Channels wanted.
        wanted: usize,
    },
    /// Takes out of order, or beyond the end of the recording.
    #[error("{recording:?}: its takes overlap, are out of order, or lie beyond its end")]
    Spans {
        /// Provenance of the recording.
        recording: String,
    },
    /// The high-pass cannot be made.
    #[error("high-pass: {0}")]
    HighPass(DspError),
    /// A speed that cannot be reached.
    #[error("speed {speed}: {error}")]
    Speed {
        /// The speed.
        speed: f64,
        /// The reason.
        error: DspError,
    },
}

/// One gap-free stretch while it is worked on.
struct Stretch {
    source: u32,
    channel: u32,
    offset: usize,
    variant: Variant,
    /// Filtered samples per joined channel, with those after the last whole unit, which its window reads.
    audio: Vec<Vec<f32>>,
    units: usize,
}

/// Makes a database: each stretch without its DC, high-passed, cut into whole units, with features.
///
/// Channels are stretches of their own, unless the conventions join them.
///
/// # Errors
/// Recordings that hold no whole unit, samples that are not finite, and joint recordings of other channel counts.
///
/// # Complexity
/// One transform per unit and channel, on all cores; the audio is held once beside the recordings while it is built.
///
/// # Source
/// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), sections 4.1 and 4.2. The paper
/// strings recordings end to end; segments separate the units that this would make neighbours.
pub fn build(
    takes: &[Take<'_>],
    c: &FeatureConventions,
    gap: Option<Gap>,
) -> Result<UnitDatabase, BuildError> {
    build_augmented(takes, c, gap, &Augmentation::default())
}

/// Makes a database as [`build`] does, with copies of all recordings after them.
///
/// The level of the floor does not depend on the copies.
///
/// # Errors
/// As [`build`], and for speeds that cannot be reached.
pub fn build_augmented(
    takes: &[Take<'_>],
    c: &FeatureConventions,
    gap: Option<Gap>,
    augmentation: &Augmentation,
) -> Result<UnitDatabase, BuildError> {
    let stretches = stretches(takes, c, gap, augmentation)?;
    let units = stretches.iter().map(|s| s.units).sum::<usize>();
    if units == 0 || c.unit == 0 || c.dims() == 0 {
        return Err(DatabaseError::Empty { unit: c.unit }.into());
    }
    let floor_energy = match c.floor {
        FloorRule::Level(db) => 10f64.powf(db / 10.0),
        FloorRule::Database => percentile(&energies(&stretches, c), 0.05),
    };
    let cepstrum = MelCepstrum::new(c, floor_energy);
    let filter = TemporalFilter::new(&(0..c.dims()).map(|dim| c.width(dim)).collect::<Vec<_>>(), c.causal);
    let features = |s: &Stretch| {
        let made =
            per_unit(s, c, &cepstrum, c.n as usize, |cepstrum, frame, out| cepstrum.process(frame, out));
        let filtered = filter.process_segment(&made);
        (made, filtered)
    };
    let (unfiltered, filtered): (Vec<_>, Vec<_>) = stretches.par_iter().map(features).unzip();
    let db = UnitDatabase {
        version: DATABASE_VERSION,
        conventions: c.clone(),
        floor_energy,
        segments: segments(&stretches),
        sources: takes.iter().map(|take| take.source.clone()).collect(),
        unfiltered: unfiltered.concat(),
        features: filtered.concat(),
        audio: audio(stretches, c),
    };
    db.validate()?;
    Ok(db)
}

fn segments(stretches: &[Stretch]) -> Vec<Segment> {
    let mut start = 0;
    let segment = |s: &Stretch| {
        let units = s.units as u32;
        start += units;
        let Stretch { source, channel, variant, .. } = *s;
        Segment { start: start - units, units, source, channel, offset: s.offset as u64, variant }
    };
    stretches.iter().map(segment).collect()
}

/// Whole units of all stretches, channel after channel.
fn audio(mut stretches: Vec<Stretch>, c: &FeatureConventions) -> Vec<f32> {
    let joined = c.joined.max(1) as usize;
    let samples = stretches.iter().map(|s| s.units * c.unit as usize).sum::<usize>();
    let mut audio = Vec::with_capacity(joined * samples);
    for channel in 0..joined {
        for s in &mut stretches {
            let whole = s.units * c.unit as usize;
            // Freed as it is copied: databases may fill much of the memory.
            let x = s.audio.get_mut(channel).map(std::mem::take).unwrap_or_default();
            audio.extend(x.get(..whole).unwrap_or_default());
        }
    }
    audio
}

fn stretches(
    takes: &[Take<'_>],
    c: &FeatureConventions,
    gap: Option<Gap>,
    augmentation: &Augmentation,
) -> Result<Vec<Stretch>, BuildError> {
    takes.iter().try_for_each(|take| check(take, c.joined.max(1) as usize))?;
    let design = match c.high_pass > 0.0 {
        true => {
            let (order, rate) = (c.high_pass_order as usize, c.rate.as_f64());
            let design = Butterworth::design(Band::HighPass, order, c.high_pass, rate);
            Some(design.map_err(BuildError::HighPass)?)
        }
        false => None,
    };
    let gains: Vec<f64> = augmentation.gains.iter().copied().filter(|gain| *gain != 0.0).collect();
    let mut all = of_takes(takes, 1.0, c, gap, design.as_ref());
    add_gains(&mut all, 0, &gains);
    for speed in augmentation.speeds.iter().map(|speed| speed_steps(*speed) as f64 / SPEED_STEPS as f64) {
        if speed == 1.0 {
            continue;
        }
        let changed: Result<Vec<Take<'_>>, DspError> =
            takes.iter().map(|take| at_speed(take, speed, c.rate)).collect();
        let changed = changed.map_err(|error| BuildError::Speed { speed, error })?;
        let from = all.len();
        all.extend(of_takes(&changed, speed, c, gap, design.as_ref()));
        add_gains(&mut all, from, &gains);
    }
    Ok(all)
}

/// Adds copies of the stretches from an index on, with each of some gains.
fn add_gains(all: &mut Vec<Stretch>, from: usize, gains: &[f64]) {
    let to = all.len();
    for gain in gains {
        for k in from..to {
            let copy = all[k].at_gain(*gain as f32);
            all.push(copy);
        }
    }
}

/// The stretches of recordings that were brought to a speed.
fn of_takes(
    takes: &[Take<'_>],
    speed: f64,
    c: &FeatureConventions,
    gap: Option<Gap>,
    design: Option<&Butterworth>,
) -> Vec<Stretch> {
    let joined = c.joined.max(1) as usize;
    let mut jobs = Vec::new();
    for (source, take) in takes.iter().enumerate() {
        let groups = take.channels.chunks(joined).enumerate();
        for (group, channels) in groups {
            for span in take.spans.clone().unwrap_or_else(|| spans(channels, gap)) {
                if span.len() >= c.unit.max(1) as usize {
                    jobs.push((source as u32, (group * joined) as u32, channels, span));
                }
            }
        }
    }
    let stretch = |(source, channel, channels, span): (u32, u32, &[Vec<f32>], Range<usize>)| Stretch {
        source,
        channel,
        offset: (span.start as f64 * speed).round() as usize,
        variant: Variant { speed: speed as f32, gain: 0.0 },
        units: span.len() / c.unit.max(1) as usize,
        audio: channels.iter().map(|x| clean(&x[span.clone()], design, c.frame as usize)).collect(),
    };
    jobs.into_par_iter().map(stretch).collect()
}

impl Stretch {
    /// A copy with a gain, dB.
    fn at_gain(&self, gain: f32) -> Self {
        let (factor, variant) = (libm::powf(10.0, gain / 20.0), Variant { gain, ..self.variant });
        let scaled = |x: &Vec<f32>| x.iter().map(|x| factor * x).collect();
        Self { variant, audio: self.audio.iter().map(scaled).collect(), ..*self }
    }
}

fn check(take: &Take<'_>, joined: usize) -> Result<(), BuildError> {
    let recording = || take.source.provenance.clone();
    if joined > 1 && take.channels.len() != joined {
        return Err(BuildError::Channels {
            recording: recording(),
            found: take.channels.len(),
            wanted: joined,
        });
    }
    if let Some(spans) = &take.spans {
        let length = take.len();
        let ordered = spans.windows(2).all(|pair| pair[0].end <= pair[1].start);
        if !ordered || spans.iter().any(|span| span.start > span.end || span.end > length) {
            return Err(BuildError::Spans { recording: recording() });
        }
    }
    for channel in take.channels.iter() {
        if let Some((sample, &found)) = channel.iter().enumerate().find(|(_, x)| !x.is_finite()) {
            return Err(BuildError::NotFinite { recording: recording(), sample, found });
        }
    }
    Ok(())
}

/// Stretches between silences.
fn spans(channels: &[Vec<f32>], gap: Option<Gap>) -> Vec<Range<usize>> {
    let len = channels.iter().map(Vec::len).min().unwrap_or(0);
    let Some(gap) = gap else { return std::iter::once(0..len).collect() };
    let silent = |i: usize| channels.iter().all(|x| x[i].abs() < gap.level);
    let (mut spans, mut from, mut quiet) = (Vec::new(), 0, 0);
    for i in 0..len {
        if silent(i) {
            quiet += 1;
            continue;
        }
        if quiet >= gap.samples.max(1) {
            spans.push(from..i - quiet);
            from = i;
        }
        quiet = 0;
    }
    spans.push(from..if quiet >= gap.samples.max(1) { len - quiet } else { len });
    spans
}

/// Removes the mean, high-passes from rest, and appends the output of the filter in `after` more samples.
pub(crate) fn clean(x: &[f32], design: Option<&Butterworth>, after: usize) -> Vec<f32> {
    let mean = x.iter().map(|&x| f64::from(x)).sum::<f64>() / x.len().max(1) as f64;
    let mut out: Vec<f32> = x.iter().map(|&x| (f64::from(x) - mean) as f32).collect();
    out.resize(x.len() + after, 0.0);
    if let Some(design) = design {
        Cascade::new(design, 1).process(&mut out);
    }
    out
}

/// `count` numbers per unit and joined channel.
fn per_unit(
    s: &Stretch,
    c: &FeatureConventions,
    cepstrum: &MelCepstrum,
    count: usize,
    make: impl Fn(&mut MelCepstrum, &[f32], &mut [f32]) + Sync,
) -> Vec<f32> {
    let width = count * s.audio.len();
    let mut out = vec![0.0; s.units * width];
    let work = |(cepstrum, frame): &mut (MelCepstrum, Vec<f32>), (k, out): (usize, &mut [f32])| {
        for (x, out) in s.audio.iter().zip(out.chunks_exact_mut(count)) {
            let lead = (i64::from(c.frame) - i64::from(c.unit)).div_euclid(2);
            let from = k as i64 * i64::from(c.unit) - lead;
            for (i, sample) in (from..).zip(frame.iter_mut()) {
                *sample = usize::try_from(i).ok().and_then(|i| x.get(i)).copied().unwrap_or(0.0);
            }
            make(cepstrum, frame, out);
        }
    };
    let start = || (cepstrum.clone(), vec![0.0; c.frame as usize]);
    out.par_chunks_exact_mut(width.max(1)).enumerate().with_min_len(64).for_each_init(start, work);
    out
}

/// The energies of all bands of all units.
fn energies(stretches: &[Stretch], c: &FeatureConventions) -> Vec<f32> {
    let cepstrum = MelCepstrum::new(c, 0.0);
    let of = |s: &Stretch| {
        per_unit(s, c, &cepstrum, c.bands as usize, |cepstrum, frame, out| {
            out.iter_mut().zip(cepstrum.energies(frame)).for_each(|(out, &e)| *out = e as f32);
        })
    };
    stretches.iter().filter(|s| s.variant == Variant::default()).flat_map(of).collect()
}

/// Energy of a band, as mean square of full scale, that the noise of every recording exceeds: -120 dB.
const LEAST: f64 = 1e-12;

fn percentile(values: &[f32], part: f64) -> f64 {
    // Bands beyond half the rate hold nothing, and digital silence is no noise floor; nor is what the high-pass rings into it.
    let mut sorted: Vec<f32> = values.iter().copied().filter(|x| f64::from(*x) > LEAST).collect();
    sorted.sort_unstable_by(f32::total_cmp);
    let at = (part * sorted.len().saturating_sub(1) as f64).round() as usize;
    sorted.get(at).map_or(1e-10, |&x| f64::from(x))
}

#[cfg(test)]
mod tests;
