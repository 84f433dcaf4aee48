//! The node around [`NoiseForce`].

use super::bands::{NoiseBands, NoiseInterp};
use super::item::PathPiece;
use super::noise::{NoiseForce, NoiseVoice};
use super::strength::{self, Strength, linked, silent};
use super::voices::Voices;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Channels;
use crate::core::node::{Class, Node, Retune, Summary};
use crate::core::params::Params;
use crate::core::ports::{Events, Stream, Value};
use crate::core::random::{Random, Rng};
use crate::core::shape::{Build, Shape};
use crate::core::time::Rate;
use crate::texture::NoiseProfile;
use crate::{archive_state, choices, params, ports};

/// Longest loop that is taken: 17 times its memory is needed.
const LONGEST: usize = 1 << 21;

choices! { @param NoiseInterp {
    /// A sinc of 32 taps: 108 dB above what the line cannot hold, and nearly all that it holds.
    Sinc32,
    /// Straight lines between samples: 25 dB.
    Linear,
    /// A cubic through the samples: 43 dB.
    Catmull,
    /// A cubic B-spline: 52 dB, and half of what is finest in the line.
    Bspline3,
} }

params! {
    /// Turns the ways of contacts into the noise of a surface that has no features to be told apart.
    ///
    /// A contact passes over the loop of noise at its speed, backwards where it turns back, and the force is
    /// `gain kappa (f/1 N)^a (v/1 m/s)^b` times what stands there, added up over all contacts. With the default exponents the
    /// amplitude goes with the square root of the power of friction. A contact at rest fades out in 5 ms. At any speed
    /// all is there up to 0.4 of the sample rate, and nothing folds down from above half of it.
    ///
    /// `gain`, `kappa`, `a`, `b` and `scale` can be changed while it sounds: they are reached in 20 ms. A link to
    /// `kappa` takes the place of the number. This node makes audio from
    /// something that is none, so it has a sample rate of its own.
    ///
    /// # Randomness
    /// Where on the loop a contact begins follows from the seed, its number and how often it has jumped.
    ///
    /// # Source
    /// Picard, Tsingos and Faure, "Audio texture synthesis for complex contact interactions" (VRIPHYS 2008), section 4.2; the
    /// exponents are a choice. Reading at another speed than that of the recording as in van den Doel, Kry and Pai, "FoleyAutomatic"
    /// (SIGGRAPH 2001).
    pub struct NoiseExcitationParams {
        /// How the line is read between its samples.
        interp: NoiseInterp = NoiseInterp::Sinc32;
        /// Force in N that a noise of 1 gives at 1 N and 1 m/s.
        kappa: f64 = 1.0, unit "N", range -1_000_000.0..=1_000_000.0;
        /// Exponent of the normal force.
        a: f64 = 0.5, unit "", range 0.0..=2.0;
        /// Exponent of the speed.
        b: f64 = 0.5, unit "", range 0.0..=2.0;
        /// Factor of the force.
        gain: f64 = 1.0, unit "", range -1000.0..=1000.0;
        /// Size of the surface: with 2 all that is on it is twice as large.
        scale: f64 = 1.0, unit "", range 0.001..=1000.0;
        /// Number of the object whose contacts are taken; None takes all.
        object: Option<u32> = None, unit "", range 0..=4_294_967_295_u32;
        /// Contacts that can sound at once.
        contacts: u16 = 64, unit "contacts", range 1..=1024_u16;
        /// Samples per second.
        rate: Rate = Rate::hz(48_000);
    }
}
ports! {
    pub struct NoiseExcitationPorts / NoiseExcitationIo {
        in {
            /// The ways of the contacts over the surface.
            paths: Events<PathPiece>,
            /// The noise of the surface.
            noise: Value<NoiseProfile>,
            /// Strength in place of the number, as LevelMatcher finds it.
            kappa: Option<Value<Strength>>,
        }
        out {
            /// Force, mono, N.
            force: Stream<f32>,
        }
    }
}

/// The node `NoiseExcitation`.
#[derive(Debug)]
pub struct NoiseExcitation {
    params: NoiseExcitationParams,
    /// Strength that is linked.
    kappa: Option<Strength>,
    noise: NoiseBands,
    random: Random,
    force: NoiseForce,
    voices: Voices<NoiseVoice>,
}

/// The law of the parameters, with the strength that is linked in place of the number.
fn law(p: &NoiseExcitationParams, kappa: Option<Strength>) -> [f64; 3] {
    [kappa.map_or(p.kappa, |s| s.kappa) * p.gain, p.a, p.b]
}

pub(super) fn check(noise: &NoiseProfile) -> Result<(), Reject> {
    let count = noise.samples.len();
    let message = if count == 0 || count > LONGEST {
        format!("`noise` has {count} samples; 1 to {LONGEST} can be read")
    } else if !noise.samples.iter().all(|x| x.abs() < 1e9) {
        "`noise` holds numbers beyond 1e9 or none at all".into()
    } else if !(1e-9..1e3).contains(&noise.spacing) {
        format!("`noise` has a sample every {} m; 1e-9 to 1000 m can be read", noise.spacing)
    } else {
        return Ok(());
    };
    Err(Reject::new("F128", message).at("noise"))
}

impl Node for NoiseExcitation {
    type Params = NoiseExcitationParams;
    type Ports = NoiseExcitationPorts;
    const NAME: &'static str = "NoiseExcitation";
    const VERSION: u32 = 4;
    const CLASS: Class = Class::Audio;
    const COST: f64 = 15.0;

    fn shape(p: &NoiseExcitationParams, s: &mut Shape<'_, '_, NoiseExcitationPorts>) -> Result<(), Reject> {
        s.output(NoiseExcitationPorts::force, p.rate, Channels(1));
        Ok(())
    }

    fn build(p: &NoiseExcitationParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let noise = cx.value(NoiseExcitationPorts::noise);
        check(&noise)?;
        let kappa = linked(cx.optional_value(NoiseExcitationPorts::kappa))?;
        let rate = p.rate.as_f64();
        Ok(Self {
            kappa,
            noise: NoiseBands::read_by(&noise, p.interp),
            random: cx.random,
            force: NoiseForce::new(strength::law(law(p, kappa), kappa, rate), p.scale, rate),
            voices: Voices::new(p.contacts.into(), p.rate, NoiseVoice::default()),
            params: p.clone(),
        })
    }

    fn run(&mut self, mut io: NoiseExcitationIo<'_>) -> Result<(), Fault> {
        let (first, out) = (io.force.first(), io.force.items());
        if silent(self.kappa, out) {
            return Ok(());
        }
        let Self { noise, force, voices, random, .. } = self;
        let start = |piece: &PathPiece| {
            let part = random.uniform(piece.jump, piece.contact, 0);
            NoiseVoice::at(part * noise.round())
        };
        voices.play(io.paths.events(), self.params.object, first, out, start, |voice, stretch, out| {
            force.add(noise, voice, stretch, out);
        });
        self.voices.made(first, out);
        Ok(())
    }

    fn finish(&mut self, _: NoiseExcitationIo<'_>) -> Result<Summary, Fault> {
        Ok(self.voices.summary())
    }

    fn retune(&mut self, new: &NoiseExcitationParams) -> Retune {
        let old = &self.params;
        let fixed = |p: &NoiseExcitationParams| (p.interp, p.object, p.contacts, p.rate);
        if fixed(new) != fixed(old) {
            return Retune::Rebuild;
        }
        self.force.law.go_to(law(new, self.kappa), self.voices.now());
        self.force.scale.go_to(new.scale, self.voices.now());
        self.params = new.clone();
        Retune::Done
    }

    fn adopt(&mut self, old: &mut Self) {
        // A place on a loop of another length means nothing.
        if self.noise.round() == old.noise.round() {
            self.voices.take_state(&old.voices);
        }
    }

    archive_state!(voices);

    fn trial(rng: &mut Rng) -> (NoiseExcitationParams, MemoryFiles) {
        let params = NoiseExcitationParams::trial(rng);
        let object = params.object.map(|_| rng.below(2) as u32);
        let contacts = 1 + rng.below(5) as u16;
        (NoiseExcitationParams { object, contacts, ..params }, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::standalone::Standalone;
    use crate::core::time::{Tick, ticks};
    use crate::scrape::testing::{piece, rates_apart, rms};

    fn params() -> NoiseExcitationParams {
        NoiseExcitationParams { rate: Rate::hz(44_100), ..NoiseExcitationParams::read(&|_| None).unwrap() }
    }

    fn white(n: usize) -> NoiseProfile {
        let mut rng = Rng::new(4);
        NoiseProfile {
            samples: (0..n).map(|_| rng.between(-1.0, 1.0) as f32).collect(),
            spacing: 1.0 / 4096.0,
        }
    }

    fn standalone(p: NoiseExcitationParams, paths: Vec<(Tick, PathPiece)>, end: f64) -> Standalone {
        let standalone =
            Standalone::new::<NoiseExcitation>(p).events(NoiseExcitationPorts::paths, paths, ticks(end));
        standalone.value(NoiseExcitationPorts::noise, white(8192))
    }

    fn force(paths: Vec<(Tick, PathPiece)>, end: f64) -> Vec<f32> {
        standalone(params(), paths, end).run().unwrap().stream(NoiseExcitationPorts::force)
    }

    /// Mean frequency by power.
    fn centroid(x: &[f32]) -> f64 {
        use rustfft::num_complex::Complex;
        let mut z: Vec<_> = x.iter().map(|x| Complex::new(f64::from(*x), 0.0)).collect();
        rustfft::FftPlanner::new().plan_fft_forward(z.len()).process(&mut z);
        let half = &z[..z.len() / 2];
        let sum = half.iter().enumerate().map(|(k, z)| k as f64 * z.norm_sqr()).sum::<f64>();
        sum / half.iter().map(|z| z.norm_sqr()).sum::<f64>() * 44_100.0 / z.len() as f64
    }

    #[test]
    fn twice_as_fast_is_an_octave_higher() {
        let at = |v: f64| force(vec![(0, piece([0.0; 2], [v, 0.0], 1.0))], 1.0);
        let (slow, fast) = (at(0.5), at(1.0));
        let ratio = centroid(&fast) / centroid(&slow);
        assert!((ratio - 2.0).abs() < 0.1, "{ratio}");
        // Amplitude with the square root of the speed.
        let level = rms(&fast) / rms(&slow);
        assert!((level - 2_f64.sqrt()).abs() < 0.03, "{level}");
    }

    #[test]
    fn a_reversal_reads_the_loop_backwards() {
        let there = piece([0.0; 2], [0.5, 0.0], 0.2);
        let back = piece([0.1, 0.0], [-0.5, 0.0], 0.2);
        let out = force(vec![(0, there), (ticks(0.2), back)], 0.4);
        for k in (20..8000).step_by(37) {
            let (a, b) = (out[8820 - k], out[8820 + k]);
            assert!((a - b).abs() < 1e-3, "{k}: {a} {b}");
        }
        assert!(rms(&out) > 0.1);
    }

    #[test]
    fn contacts_begin_at_places_of_their_own_that_the_seed_decides() {
        let path = |contact| vec![(0, PathPiece { contact, ..piece([0.0; 2], [0.3, 0.0], 0.1) })];
        let (one, two) = (force(path(1), 0.1), force(path(2), 0.1));
        assert_ne!(one, two);
        assert_eq!(one, force(path(1), 0.1));
        let mut other = standalone(params(), path(1), 0.1);
        other.seed += 1;
        assert_ne!(one, other.run().unwrap().stream(NoiseExcitationPorts::force));
    }

    #[test]
    fn windows_change_no_bit() {
        let there = piece([0.0; 2], [0.5, 0.0], 0.11);
        let back = piece([0.05, 0.0], [-40.5, 0.1], 0.09);
        let paths = vec![
            (ticks(0.0123), there),
            (ticks(0.05), PathPiece { contact: 5, ..back }),
            (ticks(0.1223), back),
        ];
        let run = |n: usize| {
            let window = Rate::hz(44_100).span(n);
            standalone(params(), paths.clone(), 0.3)
                .window(window)
                .run()
                .unwrap()
                .stream(NoiseExcitationPorts::force)
        };
        let whole = run(20_000);
        for n in [32, 100, 1024, 4096] {
            assert!(run(n) == whole, "{n}");
        }
    }

    #[test]
    fn edits_while_it_sounds_do_not_click() {
        let path = vec![(0, piece([0.0; 2], [0.1, 0.0], 1.0))];
        let edits = [
            NoiseExcitationParams { kappa: 5.0, ..params() },
            NoiseExcitationParams { gain: 0.0, ..params() },
            NoiseExcitationParams { a: 1.5, b: 0.0, ..params() },
            NoiseExcitationParams { scale: 0.5, ..params() },
            NoiseExcitationParams { scale: 9.0, ..params() },
        ];
        for edit in edits {
            let standalone = standalone(params(), path.clone(), 1.0).window(Rate::hz(44_100).span(256));
            let mut run = standalone.start().unwrap();
            let mut count = 0;
            while run.step().unwrap() {
                count += 1;
                if count == 60 {
                    assert_eq!(run.node().retune(&edit), Retune::Done);
                }
            }
            let out = run.stream(NoiseExcitationPorts::force);
            let step = |x: &[f32]| x.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max);
            let before = step(&out[2000..15_000]).max(step(&out[18_000..]));
            let during = step(&out[15_000..17_000]);
            assert!(before > 0.0 && during < 4.0 * before, "{edit:?}: {during} against {before}");
        }
    }

    #[test]
    fn the_sample_rate_changes_nothing_that_is_heard() {
        // Read as it is, and where it is passed so fast at one rate that less of it is left.
        for speed in [1.1, 7.0] {
            let at = |rate: u32| {
                let p = NoiseExcitationParams { rate: Rate::hz(rate), ..params() };
                let path = vec![(0, piece([0.0; 2], [speed, 0.0], 1.0))];
                standalone(p, path, 1.0).run().unwrap().stream(NoiseExcitationPorts::force)
            };
            let (low, high) = (at(44_100), at(88_200));
            let heard = rates_apart(&low, &high);
            assert!(heard < 0.5, "{speed} m/s: {heard} dB");
        }
    }

    #[test]
    fn rest_and_no_force_are_silent() {
        let p = NoiseExcitationParams { a: 0.0, b: 0.0, ..params() };
        let play =
            |paths| standalone(p.clone(), paths, 0.4).run().unwrap().stream(NoiseExcitationPorts::force);
        let go = piece([0.0; 2], [0.5, 0.0], 0.2);
        let rest = piece([0.1, 0.0], [0.0; 2], 0.2);
        let out = play(vec![(0, go), (ticks(0.2), rest)]);
        assert!(rms(&out[..8820]) > 0.1);
        assert!(out[8820 + 225..].iter().all(|x| *x == 0.0), "it goes on at rest");
        assert!(play(vec![(0, rest)]).iter().all(|x| *x == 0.0));
        assert!(play(vec![(0, PathPiece { force: [0.0; 2], ..go })]).iter().all(|x| *x == 0.0));
    }

    #[test]
    fn a_loop_without_samples_is_an_error() {
        let empty = NoiseProfile { samples: Vec::new(), spacing: 1.0 };
        let standalone = Standalone::new::<NoiseExcitation>(params()).events::<PathPiece>(
            NoiseExcitationPorts::paths,
            vec![],
            1,
        );
        let error = standalone.value(NoiseExcitationPorts::noise, empty).run().map(|_| ()).unwrap_err();
        assert!(error.code == "F128" && error.to_string().contains("0 samples"), "{error}");
    }
}
