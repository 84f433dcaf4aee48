//! A bank from recordings, as a value node.

use super::crumple_bank::{CrumpleBank, Cut, Origin, Recorded};
use super::extraction::{Extraction, cut, extents, windowed_energy};
use super::report::bank_summary;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::{AssetPath, Params, Text};
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::Rate;
use crate::dsp::{Quality, Resampler};
use crate::io::{MaxLength, RecordingParam, recording_warnings, trial_wav};
use crate::take::{CutRecording, Takes};
use crate::unit::UnitSource;
use crate::{params, ports};

params! {
    /// Cuts recordings of crumpling cloth into micro-sounds.
    ///
    /// The channels of a recording are averaged, and it is resampled to `rate`. A sound is where the mean square over
    /// `window` exceeds `threshold`; its ends move outwards to the nearest zero crossing. The summary reports the
    /// number of samples, their energies and their share of the recordings. It warns of fewer than 30 samples, and of a
    /// sample longer than a fifth of all recordings, which shows that the threshold is too low. `--tap NODE=bank.svg`
    /// draws the samples in the recordings.
    ///
    /// # Source
    /// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 3.
    /// Their thresholds 0.50 (cotton), 0.25 (polyester) and 0.025 (windbreaker) are sums over 1920 samples: 2.6e-4,
    /// 1.3e-4 and 1.3e-5 as mean squares.
    pub struct CrumpleExtractorParams {
        /// Recordings of any rates, up to ten minutes at 192 kHz each.
        recordings: Vec<AssetPath> = Vec::new();
        /// Mean square above which there is a sound, relative to full scale.
        threshold: f64 = 0.00026, unit "full scale^2", range 0.0..=1.0;
        /// Window of the mean.
        window: f64 = 0.02, unit "s", range 0.001..=1.0;
        /// Minimum length; shorter sounds are dropped.
        min_len: f64 = 0.001, unit "s", range 0.0..=1.0;
        /// Maximum length; longer sounds are split where they are quietest.
        max_len: f64 = 0.5, unit "s", range 0.005..=10.0;
        /// Maximum gap between sounds that are joined.
        merge_gap: f64 = 0.0, unit "s", range 0.0..=1.0;
        /// Scales every recording until its loudest window is as loud as that of the loudest recording, for recordings
        /// of different gains.
        match_levels: bool = false;
        /// Sample rate of the bank.
        rate: Rate = Rate::hz(48_000);
        /// Name of the material.
        material: Text = "cloth".into();
        /// Licence of the recordings; their paths are stored as their provenance.
        licence: Text = "".into();
    }
}
ports! {
    pub struct CrumpleExtractorPorts / CrumpleExtractorIo {
        in {
            /// Takes of recordings, in addition to `recordings`.
            takes: Option<Value<Takes>>,
        }
        out {
            /// The bank.
            bank: Value<CrumpleBank>,
        }
    }
}

/// The node over [`extents`].
#[derive(Debug)]
pub struct CrumpleExtractor;

/// Maximum length of a recording in frames: ten minutes at 192 kHz.
const MAX_FRAMES: u64 = 600 * 192_000;
/// Number of parts of the outline of a recording.
const OUTLINE_PARTS: usize = 480;
/// Share of all recordings above which one sound is too long.
const MAX_SHARE: f64 = 0.2;

const RECORDINGS: RecordingParam =
    RecordingParam { name: "recordings", code: "F077", max: MaxLength::Frames(MAX_FRAMES) };

/// A recording at the rate of the bank.
struct Recording {
    samples: Vec<f32>,
    description: Recorded,
    notices: Summary,
}

impl Recording {
    fn read(p: &CrumpleExtractorParams, cx: &Build<'_>, path: &str) -> Result<Self, Fault> {
        let (samples, info) = RECORDINGS.read_mono(cx, path)?;
        let notices = recording_warnings(path, &info, &samples);
        let (from, to) = (info.rate, p.rate);
        let samples = if Rate::new(from.into(), 1) == Some(to) {
            samples
        } else {
            let resampler = Rate::new(from.into(), 1).map(|from| Resampler::new(from, to, Quality::High));
            let resampler = resampler.ok_or_else(|| RECORDINGS.unusable(path, "its rate is 0"))?;
            resampler.and_then(|r| r.whole(&samples)).map_err(|e| RECORDINGS.unusable(path, e))?
        };
        let description = Recorded {
            provenance: path.to_owned(),
            licence: p.licence.0.clone(),
            seconds: samples.len() as f64 / to.as_f64(),
            fs: f64::from(from),
            gain: 1.0,
            outline: Vec::new(),
        };
        Ok(Self { samples, description, notices })
    }

    /// A recording that is silent outside of its takes.
    fn of_takes(recording: &CutRecording, fs: f64) -> Self {
        let samples = recording.gated_mono();
        let UnitSource { provenance, licence, .. } = recording.source.clone();
        let seconds = samples.len() as f64 / fs;
        let description = Recorded { provenance, licence, seconds, fs, gain: 1.0, outline: Vec::new() };
        Self { samples, description, notices: Summary::new() }
    }

    /// Returns the sum of squares in the loudest window.
    fn loudest(&self, window: usize) -> f64 {
        windowed_energy(&self.samples, window).into_iter().fold(0.0, f64::max)
    }

    /// Scales the samples.
    fn amplify(&mut self, gain: f64) {
        self.description.gain = gain;
        self.samples.iter_mut().for_each(|x| *x = (f64::from(*x) * gain) as f32);
    }

    /// Returns the peak of each part.
    fn outline(&self) -> Vec<f32> {
        let part = self.samples.len().div_ceil(OUTLINE_PARTS).max(1);
        self.samples
            .chunks(part)
            .map(|part| part.iter().fold(0.0, |peak: f32, x| peak.max(x.abs())))
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
    // Paths are the provenance of the bank's recordings.
    const EXPOSES_PATHS: bool = true;

    fn check(p: &CrumpleExtractorParams, s: &mut Shape<'_, '_, CrumpleExtractorPorts>) -> Result<(), Reject> {
        if p.recordings.is_empty() && !s.linked(CrumpleExtractorPorts::takes) {
            let reject = Reject::new("F077", "no recording is given").at("recordings");
            s.wrong(reject.help("give `recordings`, or link the `takes` of a TakeCutter"));
        }
        if !(1000.0..=768_000.0).contains(&p.rate.as_f64()) {
            let message = format!("`rate` is {}; 1000 to 768000 Hz is needed", p.rate);
            s.wrong(Reject::new("F106", message).at("rate"));
        }
        RECORDINGS.check(s, &p.recordings);
        Ok(())
    }

    fn eval(
        p: &CrumpleExtractorParams,
        cx: &Build<'_>,
        mut io: CrumpleExtractorIo<'_>,
    ) -> Result<Summary, Fault> {
        let (fs, params) = (p.rate.as_f64(), extraction(p));
        let mut recordings =
            p.recordings.iter().map(|path| Recording::read(p, cx, &path.0)).collect::<Result<Vec<_>, _>>()?;
        if let Some(takes) = &io.takes {
            let takes = takes.at_rate(p.rate).map_err(|e| Fault::new("F077", e.to_string()).at("takes"))?;
            recordings.extend(takes.recordings.iter().map(|recording| Recording::of_takes(recording, fs)));
        }
        let window = ((params.window * fs).round() as usize).max(1);
        let levels: Vec<f64> = recordings.iter().map(|recording| recording.loudest(window)).collect();
        let loudest = levels.iter().copied().fold(0.0, f64::max);
        if p.match_levels {
            let loud = recordings.iter_mut().zip(&levels).filter(|(_, level)| **level > 0.0);
            loud.for_each(|(recording, level)| recording.amplify((loudest / level).sqrt()));
        }
        let (mut cuts, mut longest) = (Vec::new(), 0);
        for (index, recording) in (0..).zip(&mut recordings) {
            recording.description.outline = recording.outline();
            let runs = extents(&recording.samples, fs, &Extraction { max_len: f64::MAX, ..params });
            longest = runs.iter().map(|run| run.end - run.start).fold(longest, usize::max);
            cuts.extend(extents(&recording.samples, fs, &params).iter().map(|extent| Cut {
                samples: cut(&recording.samples, fs, extent),
                origin: Origin { recording: index, start: extent.start as f64 / fs },
            }));
        }
        if cuts.is_empty() {
            let message = format!(
                "no window of the recordings exceeds `threshold` {:e}; the loudest has a mean square of {:.2e}",
                p.threshold,
                loudest / window as f64
            );
            return Err(Fault::new("F077", message)
                .at("threshold")
                .help("lower it, or give louder recordings"));
        }
        let total: usize = recordings.iter().map(|recording| recording.samples.len()).sum();
        let notices: Summary = recordings.iter().flat_map(|recording| recording.notices.clone()).collect();
        let recordings = recordings.into_iter().map(|recording| recording.description).collect();
        let bank = CrumpleBank::new(&p.material.0, fs, cuts, recordings, params);
        bank.validate().map_err(|e| Fault::new("F077", e.to_string()).at("recordings"))?;
        let mut summary = [bank_summary(&bank), notices].concat();
        summary.push(("share_of_recordings", (bank.samples.len() as f64 / total.max(1) as f64).into()));
        if longest as f64 > MAX_SHARE * total as f64 {
            let share = 100.0 * longest as f64 / total as f64;
            let text = format!("one sound is {share:.0} % of all recordings: `threshold` may be too low");
            summary.push(("warning", text.into()));
        }
        io.bank.set(bank);
        Ok(summary)
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
