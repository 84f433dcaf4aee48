//! Damping fitted to knocks in a stream, while it plays, as a node.

use crate::core::computation::Background;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node, Summary};
use crate::core::ports::{Events, Stream};
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::Rate;
use crate::dsp::db_to_linear;
use crate::material::DampingModel;
use crate::material::damping::Family;
use crate::material::estimation::fit::FitOptions;
use crate::material::estimation::mixture::{MixtureFit, MixtureOptions, fit_mixture};
use crate::material::estimation::point::DampingPoint;
use crate::material::points::gate::Gate;
use crate::modal::mode::damping_curve::DampingCurve;
use crate::modal::{ExtractParams, FeatureSet, extract};
use crate::{archive_state, params, ports};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::fmt;
use std::sync::mpsc::{Receiver, channel};

/// Duration of a block whose energy is compared with that before it, s.
const BLOCK: f64 = 0.001;
/// Time over which the energy before a block is averaged, s.
const BEFORE: f64 = 0.05;
/// Sound before a knock that its analysis includes, s: it gives the noise.
const LEAD: f64 = 0.1;
/// Shortest time between two knocks, s.
const APART: f64 = 0.05;
/// Shortest time between two events, s.
const INTERVAL: f64 = 0.2;
/// Fall of the log-likelihood of a point that rejects a knock, nats.
const MAX_FALL: f64 = 1.0;

params! {
    /// Fits the damping of a material to knocks in a stream, while it plays.
    ///
    /// A knock is a rise of the level by `rise` to at least `floor`. Its modes are extracted from the sound until `capture` or the next knock,
    /// and join those of the last `knocks`; a Rayleigh curve with a background of spurious features is fitted to all, as `DampingFit`
    /// does. The fit is an event `delay` after the end of the captured sound, at most every 200 ms: link it to `material` of a `ModalBank`.
    /// A knock after which the log-likelihood of a point is lower by more than 1 nat, such as one on another object, is left out.
    ///
    /// The extraction runs in the background. The time of each event depends on the stream alone; if an extraction is not ready then, the
    /// node waits for it, so `delay` has to be longer than it takes: else the windows of a graph that plays are missed, and the event
    /// comes with the first window after them.
    ///
    /// # Source
    /// Sterling et al., "Audio-material reconstruction for virtualized reality using a probabilistic damping model" (IEEE TVCG 25(5),
    /// 2019), section 4.
    pub struct DampingFromStreamParams {
        /// Longest sound that is analysed.
        capture: f64 = 1.0, unit "s", range 0.05..=10.0;
        /// Rise of the level within 1 ms that is a knock.
        rise: f64 = 20.0, unit "dB", range 3.0..=100.0;
        /// Minimum level of a knock.
        floor: f64 = -45.0, unit "dB", range -120.0..=0.0;
        /// Time from the end of a captured sound to the event: longer than the analysis takes, or a graph that plays misses windows and the
        /// event is late.
        delay: f64 = 1.0, unit "s", range 0.0..=10.0;
        /// Number of knocks that are fitted: the latest.
        knocks: usize = 50, unit "", range 1..=1000;
    }
}
ports! {
    pub struct DampingFromStreamPorts / DampingFromStreamIo {
        in {
            /// The sound; channels are averaged.
            audio: Stream<f32>,
        }
        out {
            /// The damping: an event for each fit.
            damping: Events<DampingCurve>,
        }
    }
}

/// Points of knocks and their latest fit.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Knocks {
    /// Points of each knock.
    points: VecDeque<Vec<DampingPoint>>,
    /// Log-likelihood of a point in the latest fit.
    log_likelihood: Option<f64>,
    /// Number of knocks that contradicted the others.
    rejected: u64,
}

/// The points of damping of one knock.
fn points(sound: &[f32], rate: f64) -> Vec<DampingPoint> {
    let found = extract(sound, rate, &ExtractParams::default());
    let features = found.map_or_else(|_| Vec::new(), |found| found.features);
    Gate::default().points(&[FeatureSet { features, ..FeatureSet::default() }]).points
}

impl Knocks {
    /// The mixture fit of all points; `None` if they are too few.
    fn fit(&self) -> Option<MixtureFit> {
        let each = self.points.iter().enumerate();
        let all =
            each.flat_map(|(k, own)| own.iter().map(move |p| DampingPoint { recording: k as u32, ..*p }));
        let all: Vec<DampingPoint> = all.collect();
        fit_mixture(&all, &MixtureOptions::new(FitOptions::new(Family::Rayleigh))).ok()
    }

    /// Adds a knock, unless it contradicts the others, and fits the last `most`; `None` if there is no new fit.
    fn add(&mut self, points: Vec<DampingPoint>, most: usize) -> Option<DampingModel> {
        if points.is_empty() {
            return None;
        }
        let earlier = self.points.clone();
        self.points.push_back(points);
        while self.points.len() > most {
            self.points.pop_front();
        }
        let found = self.fit()?.fit;
        let likelihood = found.physical_log_likelihood() / found.sample.len() as f64;
        if self.log_likelihood.is_some_and(|before| likelihood < before - MAX_FALL) {
            self.points = earlier;
            self.rejected += 1;
            return None;
        }
        self.log_likelihood = Some(likelihood);
        Some(Family::Rayleigh.model(&found.physical(), &[]))
    }
}

/// A captured knock whose fit is due.
#[derive(Debug, Serialize, Deserialize)]
struct Pending {
    /// Sample at which the event is due.
    due: i64,
    sound: Vec<f32>,
    /// The points, once they are computed; none if the analysis has not begun, as after a checkpoint.
    #[serde(skip)]
    points: Option<Receiver<Vec<DampingPoint>>>,
}

/// The node `DampingFromStream`.
pub struct DampingFromStream {
    rate: Rate,
    params: DampingFromStreamParams,
    /// Samples of a block, and of the sound before a knock.
    block: usize,
    lead: usize,
    /// Energy of the block so far and its number of samples, and mean energy of a block before it.
    energy: (f64, usize),
    before: f64,
    /// The latest sound: before a knock, `lead` samples of it; after one, all since then.
    sound: VecDeque<f32>,
    /// True while a knock is captured.
    capturing: bool,
    /// Samples since the latest knock.
    since: usize,
    pending: VecDeque<Pending>,
    /// Sample of the latest event that was planned.
    planned: i64,
    knocks: Knocks,
    /// Parameters of the latest fit.
    latest: Vec<f64>,
    /// Number of knocks, and of fits.
    counts: [u64; 2],
    background: Background,
}

impl fmt::Debug for DampingFromStream {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "DampingFromStream({:?})", self.knocks)
    }
}

impl DampingFromStream {
    /// Ends the capture of a knock: its fit is due after the delay.
    fn captured(&mut self, now: i64) {
        let rate = self.rate.as_f64();
        let delay = (self.params.delay * rate).round() as i64;
        let due = (now + delay).max(self.planned.saturating_add((INTERVAL * rate).ceil() as i64));
        self.planned = due;
        self.capturing = false;
        self.counts[0] += 1;
        let sound = self.sound.iter().copied().collect();
        self.pending.push_back(Pending { due, sound, points: None });
        while self.sound.len() > self.lead {
            self.sound.pop_front();
        }
    }

    /// Takes one sample; `now` is the number of the next one.
    fn sample(&mut self, x: f32, now: i64) {
        let longest = (self.params.capture * self.rate.as_f64()).round() as usize;
        self.sound.push_back(x);
        self.since = self.since.saturating_add(1);
        if self.capturing && self.since >= longest {
            self.captured(now);
        } else if !self.capturing && self.sound.len() > self.lead {
            self.sound.pop_front();
        }
        self.energy.0 += f64::from(x) * f64::from(x);
        self.energy.1 += 1;
        if self.energy.1 < self.block {
            return;
        }
        let energy = self.energy.0 / self.block as f64;
        self.energy = (0.0, 0);
        let (floor, rise) = (db_to_linear(self.params.floor), db_to_linear(self.params.rise));
        let apart = self.since as f64 >= APART * self.rate.as_f64();
        if energy > floor * floor && energy > rise * rise * self.before && apart {
            if self.capturing {
                self.captured(now);
            }
            (self.capturing, self.since) = (true, 0);
        }
        self.before += (energy - self.before) * (BLOCK / BEFORE);
    }

    /// Begins the analysis of captured knocks.
    fn analyse(&mut self) {
        let rate = self.rate.as_f64();
        for pending in self.pending.iter_mut().filter(|pending| pending.points.is_none()) {
            let (sender, receiver) = channel();
            let sound = pending.sound.clone();
            (self.background)(Box::new(move || {
                // Nobody waits for it if the node is gone.
                let _ = sender.send(points(&sound, rate));
            }));
            pending.points = Some(receiver);
        }
    }
}

impl Node for DampingFromStream {
    type Params = DampingFromStreamParams;
    type Ports = DampingFromStreamPorts;
    const NAME: &'static str = "DampingFromStream";
    const VERSION: u32 = 2;
    const CLASS: Class = Class::Worker;
    const COST: f64 = 10.0;

    fn shape(
        _: &DampingFromStreamParams,
        s: &mut Shape<'_, '_, DampingFromStreamPorts>,
    ) -> Result<(), Reject> {
        let _ = s.input(DampingFromStreamPorts::audio);
        Ok(())
    }

    fn build(p: &DampingFromStreamParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let rate = cx.input(DampingFromStreamPorts::audio).rate;
        let samples = |seconds: f64| ((seconds * rate.as_f64()) as usize).max(1);
        Ok(Self {
            rate,
            params: p.clone(),
            block: samples(BLOCK),
            lead: samples(LEAD),
            energy: (0.0, 0),
            before: 0.0,
            sound: VecDeque::new(),
            capturing: false,
            since: usize::MAX / 2,
            pending: VecDeque::new(),
            planned: i64::MIN / 2,
            knocks: Knocks::default(),
            latest: Vec::new(),
            counts: [0; 2],
            background: cx.background.clone(),
        })
    }

    fn run(&mut self, mut io: DampingFromStreamIo<'_>) -> Result<(), Fault> {
        let (first, width) = (io.audio.first(), io.audio.width().max(1));
        let mut now = first;
        for frame in io.audio.items().chunks_exact(width) {
            let x = frame.iter().map(|x| f64::from(*x)).sum::<f64>() / width as f64;
            now += 1;
            self.sample(x as f32, now);
        }
        self.analyse();
        while let Some(pending) = self.pending.pop_front_if(|pending| pending.due < now) {
            let points = pending.points.and_then(|points| points.recv().ok()).unwrap_or_default();
            if let Some(model) = self.knocks.add(points, self.params.knocks) {
                self.counts[1] += 1;
                self.latest = model.parameters();
                io.damping.push(self.rate.tick(pending.due), DampingCurve::new(|f| model.decay(f)));
            }
        }
        Ok(())
    }

    fn finish(&mut self, _: DampingFromStreamIo<'_>) -> Result<Summary, Fault> {
        let mut summary = vec![
            ("knocks", self.counts[0].into()),
            ("fits", self.counts[1].into()),
            ("left_out", self.knocks.rejected.into()),
            ("points", self.knocks.points.iter().map(Vec::len).sum::<usize>().into()),
        ];
        if let [a1, a2] = self.latest[..] {
            summary.push(("a1_per_s", a1.into()));
            summary.push(("a2_s", a2.into()));
        }
        Ok(summary)
    }

    archive_state!(energy, before, sound, capturing, since, pending, planned, knocks, latest, counts);

    fn trial(rng: &mut Rng) -> (DampingFromStreamParams, MemoryFiles) {
        let p = DampingFromStreamParams {
            capture: rng.between(0.05, 0.2),
            rise: rng.between(3.0, 20.0),
            floor: rng.between(-80.0, -30.0),
            delay: rng.between(0.0, 0.1),
            knocks: 1 + rng.below(5),
        };
        (p, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::Channels;
    use crate::core::params::Params;
    use crate::core::standalone::Standalone;
    use crate::core::time::ticks;
    use std::f64::consts::TAU;

    const RATE: u32 = 22_050;
    const TRUTH: [f64; 2] = [8.0, 4e-8];

    /// Knocks at times on an object of known damping, with a little noise.
    fn knocks(times: &[f64], seconds: f64) -> Vec<f32> {
        let mut rng = Rng::new(5);
        let rate = f64::from(RATE);
        let mut out: Vec<f64> = (0..(seconds * rate) as usize).map(|_| rng.between(-1e-5, 1e-5)).collect();
        for (k, time) in times.iter().enumerate() {
            let start = (time * rate) as usize;
            for mode in 0..12 {
                let f = 300.0 * 1.33_f64.powi(mode) + 10.0 * k as f64;
                let d = 0.5 * (TRUTH[0] + TRUTH[1] * (TAU * f).powi(2));
                let amp = 0.05 * (1.0 + ((mode * 7 + k as i32 * 3) % 5) as f64);
                for (n, x) in out[start..].iter_mut().enumerate() {
                    let t = n as f64 / rate;
                    *x += amp * (-d * t).exp() * (TAU * f * t).sin();
                }
            }
        }
        out.into_iter().map(|x| x as f32).collect()
    }

    fn run(sound: &[f32], window: f64) -> Vec<(i64, DampingCurve)> {
        let params = DampingFromStreamParams::read(&|_| None).unwrap();
        let node = Standalone::new::<DampingFromStream>(params);
        let node = node.input(DampingFromStreamPorts::audio, Rate::hz(RATE), Channels(1), sound.to_vec());
        node.window(ticks(window)).run().unwrap().events(DampingFromStreamPorts::damping)
    }

    #[test]
    fn each_knock_is_followed_by_the_damping_of_its_material() {
        let sound = knocks(&[0.3, 1.9, 3.1], 5.5);
        let found = run(&sound, 0.1);
        // One second of sound, cut by no other knock, and one for the fit.
        let times: Vec<f64> = found.iter().map(|(tick, _)| crate::core::time::seconds(*tick)).collect();
        assert!(times.len() == 3, "{times:?}");
        for (time, knock) in times.iter().zip([0.3, 1.9, 3.1]) {
            assert!((time - knock - 2.0).abs() < 0.01, "{times:?}");
        }
        let curve = &found[2].1;
        for f in [400.0, 2000.0, 6000.0] {
            let truth = 0.5 * (TRUTH[0] + TRUTH[1] * (TAU * f).powi(2));
            assert!((curve.decay(f) / truth - 1.0).abs() < 0.1, "{f} Hz: {} {truth}", curve.decay(f));
        }
        assert!(found == run(&sound, 0.013), "for any window");
    }

    #[test]
    fn silence_and_noise_are_no_knocks() {
        assert!(run(&vec![0.0; 30_000], 0.1).is_empty());
        let mut rng = Rng::new(2);
        let noise: Vec<f32> = (0..60_000).map(|_| rng.between(-0.1, 0.1) as f32).collect();
        // Its start is a rise, without modes.
        assert!(run(&noise, 0.1).len() <= 1);
    }
}
