//! Banks from recordings and from files, as value nodes.

use super::crumple_bank::{CrumpleBank, Cut, Origin, Recorded, resample};
use super::extraction::{Extraction, cut, extents, windowed_energy};
use super::report::bank_summary;
use crate::core::fault::{Fault, Reject};
use crate::core::files::{MemoryFiles, ReadSeek};
use crate::core::node::{Func, Summary};
use crate::core::params::{AssetPath, Params, Text};
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::Rate;
use crate::dsp::{Quality, Resampler};
use crate::io::look_at;
use crate::io::{AudioReader, oddities, trial_wav};
use crate::{params, ports};

params! {
    /// Cuts recordings of crumpling cloth into micro-sounds.
    ///
    /// Where the mean square over `window` exceeds `threshold` there is a sound; its ends move outwards to the nearest zero crossing. Of
    /// several channels the mean is taken, and every recording is brought to `rate` first. The summary tells how many samples were
    /// found, how strong they are and how much of the recordings they hold. It warns of fewer than 30 samples, and of one that holds
    /// more than a fifth of all recordings: then the threshold is too low. `--tap NODE=bank.svg` draws what was taken.
    ///
    /// # Source
    /// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 3. Their thresholds 0.50
    /// (cotton), 0.25 (polyester) and 0.025 (windbreaker) are sums over 1920 samples: 2.6e-4, 1.3e-4 and 1.3e-5 as mean squares.
    pub struct CrumpleExtractorParams {
        /// The recordings, of any rates, ten minutes each at most.
        recordings: Vec<AssetPath>;
        /// Mean square above which there is a sound, relative to full scale.
        threshold: f64 = 0.00026, unit "full scale^2", range 0.0..=1.0;
        /// Window of the mean.
        window: f64 = 0.02, unit "s", range 0.001..=1.0;
        /// Shorter sounds are left out.
        min_len: f64 = 0.001, unit "s", range 0.0..=1.0;
        /// Longer sounds are split where they are quietest.
        max_len: f64 = 0.5, unit "s", range 0.005..=10.0;
        /// Sounds with no more than this between them are one.
        merge_gap: f64 = 0.0, unit "s", range 0.0..=1.0;
        /// Whether every recording is scaled until its loudest window is as loud as that of the loudest recording, as recordings of different gains need.
        match_levels: bool = false;
        /// Rate of the samples.
        rate: Rate = Rate::hz(48_000);
        /// What crumples.
        material: Text = "cloth".into();
        /// The licence of the recordings; their paths stand as their provenance.
        licence: Text = "".into();
    }
}
ports! {
    pub struct CrumpleExtractorPorts / CrumpleExtractorIo {
        in {}
        out {
            /// The samples.
            bank: Value<CrumpleBank>,
        }
    }
}

/// The node over [`extents`].
#[derive(Debug)]
pub struct CrumpleExtractor;

/// Longest recording, in frames: ten minutes at 192 kHz.
const LONGEST: u64 = 600 * 192_000;
/// Parts of the outline of a recording.
const OUTLINE: usize = 480;
/// Share of all recordings above which one sound is no event.
const TOO_LONG: f64 = 0.2;

fn unusable(path: &str, what: impl std::fmt::Display) -> Reject {
    Reject::new("F077", format!("{path:?}: {what}")).at("recordings")
}

fn reader<'a>(path: &str, file: Box<dyn ReadSeek + 'a>) -> Result<AudioReader<'a>, Reject> {
    let reader = AudioReader::open(Box::new(file)).map_err(|e| unusable(path, e))?;
    let frames = reader.info().frames;
    if frames > LONGEST {
        return Err(unusable(path, format!("{frames} frames; at most {LONGEST} are read")));
    }
    Ok(reader)
}

/// A recording at the bank's rate.
struct Take {
    samples: Vec<f32>,
    told: Recorded,
    odd: Summary,
}

impl Take {
    fn read(p: &CrumpleExtractorParams, cx: &Build<'_>, path: &str) -> Result<Self, Fault> {
        let mut reader = reader(path, cx.open("recordings", path)?)?;
        let samples = reader.read_mono().map_err(|e| unusable(path, e))?;
        let odd = oddities(path, reader.info(), &samples);
        if let Some(at) = samples.iter().position(|x| !x.is_finite()) {
            return Err(unusable(path, format!("sample {at} is not finite")).into());
        }
        let (from, to) = (reader.info().rate, p.rate);
        let samples = if Rate::new(from.into(), 1) == Some(to) {
            samples
        } else {
            let resampler = Rate::new(from.into(), 1).map(|from| Resampler::new(from, to, Quality::High));
            let resampler = resampler.ok_or_else(|| unusable(path, "its rate is 0"))?;
            let ratio = to.as_f64() / f64::from(from);
            resampler.and_then(|r| resample(&r, &samples, ratio)).map_err(|e| unusable(path, e))?
        };
        let told = Recorded {
            provenance: path.to_owned(),
            licence: p.licence.0.clone(),
            seconds: samples.len() as f64 / to.as_f64(),
            fs: f64::from(from),
            gain: 1.0,
            outline: Vec::new(),
        };
        Ok(Self { samples, told, odd })
    }

    /// Sum of squares in the loudest window.
    fn loudest(&self, window: usize) -> f64 {
        windowed_energy(&self.samples, window).into_iter().fold(0.0, f64::max)
    }

    fn amplify(&mut self, gain: f64) {
        self.told.gain = gain;
        self.samples.iter_mut().for_each(|x| *x = (f64::from(*x) * gain) as f32);
    }

    fn outline(&self) -> Vec<f32> {
        let part = self.samples.len().div_ceil(OUTLINE).max(1);
        self.samples
            .chunks(part)
            .map(|part| part.iter().fold(0.0, |most: f32, x| most.max(x.abs())))
            .collect()
    }
}

fn extraction(p: &CrumpleExtractorParams) -> Extraction {
    let CrumpleExtractorParams { threshold, window, min_len, max_len, merge_gap, .. } = *p;
    Extraction { threshold, window, min_len, max_len, merge_gap }
}

impl Func for CrumpleExtractor {
    type Params = CrumpleExtractorParams;
    type Ports = CrumpleExtractorPorts;
    const NAME: &'static str = "CrumpleExtractor";
    const VERSION: u32 = 2;
    // They are the provenance of the bank's recordings.
    const EXPOSES_PATHS: bool = true;

    fn check(p: &CrumpleExtractorParams, s: &mut Shape<'_, '_, CrumpleExtractorPorts>) -> Result<(), Reject> {
        if p.recordings.is_empty() {
            s.wrong(Reject::new("F077", "there is no recording").at("recordings"));
        }
        if !(1000.0..=768_000.0).contains(&p.rate.as_f64()) {
            let message = format!("samples at {} cannot be played; 1000 to 768000 Hz are", p.rate);
            s.wrong(Reject::new("F106", message).at("rate"));
        }
        look_at(s, "recordings", &p.recordings, |path, file| Ok(reader(path, file)?.info().clone()));
        Ok(())
    }

    fn eval(
        p: &CrumpleExtractorParams,
        cx: &Build<'_>,
        mut io: CrumpleExtractorIo<'_>,
    ) -> Result<Summary, Fault> {
        let (fs, how) = (p.rate.as_f64(), extraction(p));
        let mut takes =
            p.recordings.iter().map(|path| Take::read(p, cx, &path.0)).collect::<Result<Vec<_>, _>>()?;
        let window = ((how.window * fs).round() as usize).max(1);
        let levels: Vec<f64> = takes.iter().map(|take| take.loudest(window)).collect();
        let most = levels.iter().copied().fold(0.0, f64::max);
        if p.match_levels {
            let loud = takes.iter_mut().zip(&levels).filter(|(_, level)| **level > 0.0);
            loud.for_each(|(take, level)| take.amplify((most / level).sqrt()));
        }
        let (mut cuts, mut longest) = (Vec::new(), 0);
        for (recording, take) in (0..).zip(&mut takes) {
            take.told.outline = take.outline();
            let runs = extents(&take.samples, fs, &Extraction { max_len: f64::MAX, ..how });
            longest = runs.iter().map(|run| run.end - run.start).fold(longest, usize::max);
            cuts.extend(extents(&take.samples, fs, &how).iter().map(|extent| Cut {
                samples: cut(&take.samples, fs, extent),
                origin: Origin { recording, start: extent.start as f64 / fs },
            }));
        }
        if cuts.is_empty() {
            let message = format!(
                "no window of the recordings exceeds `threshold` {:e}; the loudest has a mean square of {:.2e}",
                p.threshold,
                most / window as f64
            );
            return Err(Fault::new("F077", message)
                .at("threshold")
                .help("lower it, or give louder recordings"));
        }
        let whole: usize = takes.iter().map(|take| take.samples.len()).sum();
        let odd: Summary = takes.iter().flat_map(|take| take.odd.clone()).collect();
        let recordings = takes.into_iter().map(|take| take.told).collect();
        let bank = CrumpleBank::new(&p.material.0, fs, cuts, recordings, how);
        bank.validate().map_err(|e| Fault::new("F077", e.to_string()).at("recordings"))?;
        let mut told = [bank_summary(&bank), odd].concat();
        told.push(("share_of_recordings", (bank.samples.len() as f64 / whole.max(1) as f64).into()));
        if longest as f64 > TOO_LONG * whole as f64 {
            let share = 100.0 * longest as f64 / whole as f64;
            let text = format!("one sound holds {share:.0} % of all recordings: `threshold` may be too low");
            told.push(("warning", text.into()));
        }
        io.bank.set(bank);
        Ok(told)
    }

    fn trial(rng: &mut Rng) -> (CrumpleExtractorParams, MemoryFiles) {
        let mut files = MemoryFiles::default();
        for name in ["a.wav", "b.wav"] {
            let sample = |i: usize| {
                let burst = (-((i % 1000) as f64) / 100.0).exp();
                (burst * rng.between(-0.8, 0.8)) as f32
            };
            files.insert(name, trial_wav(&(0..4000).map(sample).collect::<Vec<_>>(), 8000));
        }
        let params = CrumpleExtractorParams {
            recordings: vec!["a.wav".into(), "b.wav".into()],
            threshold: rng.between(0.0, 0.01),
            window: rng.between(0.005, 0.03),
            min_len: rng.between(0.0, 0.01),
            max_len: rng.between(0.05, 0.2),
            merge_gap: rng.between(0.0, 0.01),
            rate: Rate::hz([8000, 8820, 4000][rng.below(3)]),
            ..CrumpleExtractorParams::trial(rng)
        };
        (params, files)
    }
}

#[cfg(test)]
mod tests;
