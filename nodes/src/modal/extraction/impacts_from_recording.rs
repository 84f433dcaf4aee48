//! Impacts at the onsets of a recording, as a node.

use super::onset::{impacts, loudest_impact, onset};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node};
use crate::core::params::{AssetPath, Params};
use crate::core::ports::Events;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::{Rate, Tick};
use crate::io::{MaxLength, RecordingParam, trial_wav};
use crate::modal::impact::event::{Body, Impact};
use crate::{choices, params, ports};

choices! {
    /// The impacts of a recording that count.
    pub enum Onsets {
        /// The loudest one, whose modes `ModalFromRecording` finds.
        Loudest,
        /// The first one.
        First,
        /// All of them.
        All,
    }
}

params! {
    /// Impacts at the onsets of a recording: the impacts that made its sound, so that modes can reproduce the recording.
    ///
    /// At an onset most octave bands rise at once by 9 dB above the 50 ms before it. The loudest impact has the impulse `impulse`, the
    /// others less, in proportion to their peaks. With `ImpactForce(shape: Impulse)` and a `ModalBank` of `output: Displacement` and
    /// `reference: Absolute` the modes of `ModalFromRecording` return the recording without its residual.
    pub struct ImpactsFromRecordingParams {
        /// The recording, of at most a minute.
        recording: AssetPath;
        /// The impacts that count.
        onsets: Onsets = Onsets::All;
        /// Impulse of the loudest impact.
        impulse: f64 = 0.05, unit "N s", range 0.000000001..=1_000_000.0;
        /// Number of the object that is struck.
        object: u32 = 0, unit "", range 0..=4_294_967_295_u32;
    }
}
ports! {
    pub struct ImpactsFromRecordingPorts / ImpactsFromRecordingIo {
        in {}
        out {
            /// The impacts.
            impacts: Events<Impact>,
        }
    }
}

/// The node over [`impacts`].
#[derive(Debug)]
pub struct ImpactsFromRecording {
    impacts: Vec<(Tick, Impact)>,
}

const RECORDING: RecordingParam =
    RecordingParam { name: "recording", code: "F077", max: MaxLength::Seconds(60) };

/// Index of the first sample and peak of each impact that counts.
fn found(samples: &[f32], rate: f64, which: Onsets) -> Vec<(usize, f32)> {
    if samples.iter().all(|x| *x == 0.0) {
        return Vec::new();
    }
    let mut parts = impacts(samples, rate);
    match which {
        Onsets::All => {}
        Onsets::First => parts.truncate(1),
        Onsets::Loudest => parts = vec![loudest_impact(samples, rate)],
    }
    let each = |part: std::ops::Range<usize>| {
        let sound = &samples[part.clone()];
        (part.start + onset(sound, rate), sound.iter().fold(0.0_f32, |m, x| m.max(x.abs())))
    };
    parts.into_iter().map(each).collect()
}

impl ImpactsFromRecording {
    fn read(p: &ImpactsFromRecordingParams, samples: &[f32], rate: Rate) -> Vec<(Tick, Impact)> {
        let found = found(samples, rate.as_f64(), p.onsets);
        let peak = samples.iter().fold(f32::MIN_POSITIVE, |m, x| m.max(x.abs()));
        let impact = |(sample, size): &(usize, f32)| {
            let body = Body { mass: 0.1, restitution: 0.5 };
            let impulse = p.impulse * f64::from(size / peak);
            (rate.tick(*sample as i64), Impact { object: p.object, ..Impact::from_impulse(impulse, body) })
        };
        found.iter().map(impact).collect()
    }
}

impl Node for ImpactsFromRecording {
    type Params = ImpactsFromRecordingParams;
    type Ports = ImpactsFromRecordingPorts;
    const NAME: &'static str = "ImpactsFromRecording";
    const VERSION: u32 = 2;
    const CLASS: Class = Class::Audio;

    fn shape(
        p: &ImpactsFromRecordingParams,
        s: &mut Shape<'_, '_, ImpactsFromRecordingPorts>,
    ) -> Result<(), Reject> {
        let path = &p.recording.0;
        let reader = RECORDING.open(path, s.open("recording", path)?)?;
        s.hold("recording", path, reader.info().bytes())?;
        let rate = Rate::hz(reader.info().rate);
        s.ends(Some(rate.tick(reader.info().frames as i64)));
        Ok(())
    }

    fn build(p: &ImpactsFromRecordingParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let (samples, info) = RECORDING.read_mono(cx, &p.recording.0)?;
        Ok(Self { impacts: Self::read(p, &samples, Rate::hz(info.rate)) })
    }

    fn run(&mut self, mut io: ImpactsFromRecordingIo<'_>) -> Result<(), Fault> {
        let (from, to) = io.impacts.window();
        let first = self.impacts.partition_point(|(tick, _)| *tick < from);
        for (tick, impact) in self.impacts.iter().skip(first).take_while(|(tick, _)| *tick < to) {
            io.impacts.push(*tick, *impact);
        }
        Ok(())
    }

    fn trial(rng: &mut Rng) -> (ImpactsFromRecordingParams, MemoryFiles) {
        let mut files = MemoryFiles::default();
        let d = rng.between(20.0, 200.0);
        let mut noise = Rng::new(rng.below(1000) as u64);
        let sample = |n: usize| {
            let t = (n % 2000) as f64 / 8000.0;
            (0.5 * (-d * t).exp() * noise.between(-1.0, 1.0)) as f32
        };
        files.insert("hits.wav", trial_wav(&(0..6000).map(sample).collect::<Vec<_>>(), 8000));
        let p = ImpactsFromRecordingParams::trial(rng);
        (ImpactsFromRecordingParams { recording: "hits.wav".into(), ..p }, files)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn impacts_lie_at_the_onsets_and_are_as_strong_as_their_peaks() {
        let mut samples = vec![0.0_f32; 60_000];
        let mut rng = Rng::new(1);
        for (at, size) in [(5000, 0.5), (25_000, 1.0), (45_000, 0.25)] {
            for n in 0..10_000 {
                samples[at + n] += (size * (-(n as f64) / 800.0).exp() * rng.between(-1.0, 1.0)) as f32;
            }
        }
        let read = |onsets| {
            let p = ImpactsFromRecordingParams { onsets, ..ImpactsFromRecording::trial(&mut Rng::new(1)).0 };
            ImpactsFromRecording::read(
                &ImpactsFromRecordingParams { impulse: 2.0, ..p },
                &samples,
                Rate::hz(44_100),
            )
        };
        let all = read(Onsets::All);
        assert_eq!(all.len(), 3, "{all:?}");
        for ((tick, impact), (sample, impulse)) in all.iter().zip([(5000, 1.0), (25_000, 2.0), (45_000, 0.5)])
        {
            assert!((Rate::hz(44_100).first_at(*tick) - sample).abs() < 40, "{all:?}");
            assert!((impact.impulse - impulse).abs() < 0.2 * impulse, "{all:?}");
        }
        assert_eq!((read(Onsets::First), read(Onsets::Loudest)), (vec![all[0]], vec![all[1]]));
    }
}
