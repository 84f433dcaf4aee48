//! The node around [`PairForce`] and the map of a rolling ball.

use super::item::PathPiece;
use super::law::{Heading, Law};
use super::map::{MapForce, MapVoice, SurfaceMap};
use super::map_node::check_grid;
use super::pair::PairForce;
use super::plane::Interp;
use super::relief::{Relief, ball_map, heights};
use super::voices::Voices;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Channels;
use crate::core::node::{Class, Node, Retune, Summary};
use crate::core::params::Params;
use crate::core::ports::{Events, Stream, Value};
use crate::core::random::Draw;
use crate::core::shape::{Build, Shape};
use crate::core::time::Rate;
use crate::texture::Luma;
use crate::{params, ports};

params! {
    /// Turns the ways of contacts between two surfaces, both with a relief, into the force between them.
    ///
    /// The surfaces touch along a short line in the direction of the way, and only what stands out most is felt:
    /// `z = max over xi of hA(uA + xi t) + hB(uB - xi t) - xi^2/2R` is how far they hold each other apart, and the force is
    /// `gain kappa (f/1 N)^a (dz/dt)/(1 m/s)`. Heights follow from luminance by the `depth` of each image. So teeth of both
    /// catch in each other, which a sum of two forces cannot do.
    ///
    /// Without `b` the other surface is smooth: a ball of the radius, or a tip, that rolls or slides over `a`. It reaches the bottom of
    /// no gap narrower than itself, and knocks at each. This is worked out before the sound starts and costs no more than
    /// MapExcitation.
    ///
    /// Where ways do not tell of the other surface, the same place of it touches all the time. `gain`, `kappa` and `a` can be changed
    /// while it sounds: they are reached in 20 ms.
    ///
    /// # Source
    /// Picard, Tsingos and Faure, "Audio texture synthesis for complex contact interactions" (VRIPHYS 2008), section 6, leave two
    /// textures to future work; the joint envelope is a choice.
    pub struct TwoTexturesParams {
        /// Common radius of curvature at the contact: 1/R = 1/R_A + 1/R_B.
        radius: f64 = 0.02, unit "m", range 0.0001..=10.0;
        /// Points of the line of contact; an odd number.
        taps: u16 = 33, unit "points", range 3..=129_u16;
        /// Force in N at 1 N where the surfaces part at 1 m/s.
        kappa: f64 = 1.0, unit "N", range -1_000_000.0..=1_000_000.0;
        /// Exponent of the normal force.
        a_exponent: f64 = 1.0, unit "", range 0.0..=2.0;
        /// Factor of the force.
        gain: f64 = 1.0, unit "", range -1000.0..=1000.0;
        /// Number of the object whose contacts are taken; None takes all.
        object: Option<u32> = None, unit "", range 0..=4_294_967_295_u32;
        /// Contacts that can sound at once.
        contacts: u16 = 64, unit "contacts", range 1..=1024_u16;
        /// Samples per second.
        rate: Rate = Rate::hz(48_000);
    }
}
ports! {
    pub struct TwoTexturesPorts / TwoTexturesIo {
        in {
            /// The ways of the contacts over both surfaces.
            paths: Events<PathPiece>,
            /// The relief of the surface that is followed.
            a: Value<Luma>,
            /// The relief of the other.
            b: Option<Value<Luma>>,
        }
        out {
            /// Force, mono, N.
            force: Stream<f32>,
        }
    }
}

/// How the force is found.
#[derive(Debug)]
enum Way {
    Ball(Box<(SurfaceMap, MapForce)>),
    Pair(Box<([Relief; 2], PairForce)>),
}

/// The node `TwoTextures`.
#[derive(Debug)]
pub struct TwoTextures {
    params: TwoTexturesParams,
    way: Way,
    voices: Voices<(Heading, MapVoice)>,
}

fn law(p: &TwoTexturesParams, ball: bool) -> [f64; 3] {
    // The map of a ball holds changes per metre, which its speed turns into changes in time.
    [p.kappa * p.gain, p.a_exponent, if ball { 1.0 } else { 0.0 }]
}

fn check(field: &'static str, luma: &Luma) -> Result<(), Reject> {
    check_grid(field, &luma.grid, &luma.surface)?;
    if (0.0..=1.0).contains(&luma.surface.depth) {
        return Ok(());
    }
    let message = format!("`{field}` is {} m deep; 0 to 1 m can be felt", luma.surface.depth);
    Err(Reject::new("F128", message).at(field))
}

impl Node for TwoTextures {
    type Params = TwoTexturesParams;
    type Ports = TwoTexturesPorts;
    const NAME: &'static str = "TwoTextures";
    const CLASS: Class = Class::Audio;
    const COST: f64 = 100.0;

    fn shape(p: &TwoTexturesParams, s: &mut Shape<'_, '_, TwoTexturesPorts>) -> Result<(), Reject> {
        s.output(TwoTexturesPorts::force, p.rate, Channels(1));
        Ok(())
    }

    fn build(p: &TwoTexturesParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let (a, b) = (cx.value(TwoTexturesPorts::a), cx.optional_value(TwoTexturesPorts::b));
        check("a", &a)?;
        let rate = p.rate.as_f64();
        let law = Law::new(law(p, b.is_none()), rate);
        let way = if let Some(b) = b {
            check("b", &b)?;
            let reliefs = [&a, &b].map(|luma| Relief::new(&heights(luma), &luma.surface));
            let range = reliefs[0].range() + reliefs[1].range();
            let force = PairForce::new(law, p.taps.into(), p.radius, range);
            Way::Pair(Box::new((reliefs, force)))
        } else {
            let map = ball_map(&heights(&a), &a.surface, p.radius);
            Way::Ball(Box::new((map, MapForce::new(law, 1.0, Interp::Bspline3, rate))))
        };
        let blank = (Heading::default(), MapVoice::default());
        let voices = Voices::new(p.contacts.into(), p.rate, blank);
        Ok(Self { way, voices, params: p.clone() })
    }

    fn run(&mut self, mut io: TwoTexturesIo<'_>) -> Result<(), Fault> {
        let (first, out) = (io.force.first(), io.force.items());
        let (object, way) = (self.params.object, &mut self.way);
        self.voices.play(
            io.paths.events(),
            object,
            first,
            out,
            |_| Default::default(),
            |(heading, voice), stretch, out| match way {
                Way::Ball(ball) => ball.1.add(&ball.0, voice, stretch, out),
                Way::Pair(pair) => {
                    let ([a, b], force) = &mut **pair;
                    force.add([a, b], heading, stretch, out);
                }
            },
        );
        self.voices.made(first, out);
        Ok(())
    }

    fn finish(&mut self, _: TwoTexturesIo<'_>) -> Result<Summary, Fault> {
        Ok(self.voices.summary())
    }

    fn retune(&mut self, new: &TwoTexturesParams) -> Retune {
        let fixed = |p: &TwoTexturesParams| (p.radius, p.taps, p.object, p.contacts, p.rate);
        if fixed(new) != fixed(&self.params) {
            return Retune::Rebuild;
        }
        match &mut self.way {
            Way::Ball(ball) => ball.1.law.go_to(law(new, true), self.voices.now()),
            Way::Pair(pair) => pair.1.law.go_to(law(new, false), self.voices.now()),
        }
        self.params = new.clone();
        Retune::Done
    }

    fn adopt(&mut self, old: &mut Self) {
        self.voices.take_state(&old.voices);
    }

    fn trial(draw: &mut Draw) -> (TwoTexturesParams, MemoryFiles) {
        let params = TwoTexturesParams::trial(draw);
        let object = params.object.map(|_| draw.below(2) as u32);
        let contacts = 1 + draw.below(5) as u16;
        (TwoTexturesParams { object, contacts, ..params }, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::AnyValue;
    use crate::core::solo::{Feed, Solo};
    use crate::core::time::{Tick, ticks};
    use crate::scrape::testing::{db, piece, rms};
    use crate::texture::{Grid, LumaKind, Surface};

    const FS: f64 = 44_100.0;

    fn params() -> TwoTexturesParams {
        TwoTexturesParams { rate: Rate::hz(44_100), ..TwoTexturesParams::read(&|_| None).unwrap() }
    }

    fn luma(density: f64, depth: f64, width: usize, at: impl Fn(usize) -> f32) -> Luma {
        Luma {
            grid: Grid::from_fn(width, 6, |x, _| at(x)),
            holes: Vec::new(),
            kind: LumaKind::Lstar,
            surface: Surface { density: [density; 2], depth, ..Surface::default() },
        }
    }

    fn solo(a: Luma, b: Option<Luma>, paths: Vec<(Tick, PathPiece)>, end: f64) -> Solo {
        let solo = Solo::new::<TwoTextures>(params()).events(TwoTexturesPorts::paths, paths, ticks(end));
        let solo = solo.value(TwoTexturesPorts::a, a);
        match b {
            Some(b) => solo.feed(TwoTexturesPorts::b.index(), Feed::value(AnyValue::new(b))),
            None => solo,
        }
    }

    fn force(a: Luma, b: Option<Luma>, paths: Vec<(Tick, PathPiece)>, end: f64) -> Vec<f32> {
        solo(a, b, paths, end).run().unwrap().stream(TwoTexturesPorts::force)
    }

    #[test]
    fn a_flat_partner_is_the_same_as_none() {
        let rough = || {
            luma(2000.0, 1e-4, 512, |x| 50.0 + 50.0 * (x as f32 * std::f32::consts::TAU * 24.0 / 512.0).cos())
        };
        let flat = luma(2000.0, 1e-4, 512, |_| 0.0);
        let path = vec![(0, piece([0.01, 0.0], [0.3, 0.0], 0.3))];
        let one = force(rough(), None, path.clone(), 0.3);
        let two = force(rough(), Some(flat), path, 0.3);
        let difference: Vec<f32> = one.iter().zip(&two).skip(200).map(|(a, b)| a - b).collect();
        let level = db(rms(&difference) / rms(&two));
        assert!(level < -15.0, "{level} dB");
    }

    /// Times between knocks: the first peak of the autocorrelation of the envelope, s.
    fn period(x: &[f32], around: [f64; 2]) -> f64 {
        let hop = 44;
        let envelope: Vec<f64> = x.chunks(hop).map(|c| c.iter().map(|x| f64::from(x.abs())).sum()).collect();
        let mean = envelope.iter().sum::<f64>() / envelope.len() as f64;
        let at = |lag: usize| {
            let pairs = envelope.iter().zip(&envelope[lag..]);
            pairs.map(|(a, b)| (a - mean) * (b - mean)).sum::<f64>()
        };
        let lags = around.map(|t| (t * FS / hop as f64) as usize);
        let best = (lags[0]..lags[1]).max_by(|a, b| at(*a).total_cmp(&at(*b))).unwrap();
        best as f64 * hop as f64 / FS
    }

    #[test]
    fn a_ball_over_tiles_knocks_at_each_joint() {
        // Tiles of 0.1 m with joints of 4 mm, at 1000 pixels a metre.
        let tiles = || luma(1000.0, 1e-3, 400, |x| if x % 100 < 4 { 0.0 } else { 100.0 });
        for (v, time) in [(0.5, 0.2), (1.0, 0.1)] {
            let x = force(tiles(), None, vec![(0, piece([0.05, 0.0], [v, 0.0], 2.0))], 2.0);
            let found = period(&x, [0.5 * time, 1.6 * time]);
            assert!((found - time).abs() < 0.002, "{v} m/s: {found} s");
            // As many knocks as joints: 30 ms of quiet between them.
            let loud = x.iter().fold(0.0_f32, |m, x| m.max(x.abs())) * 0.5;
            let (mut knocks, mut last) = (0, -FS);
            for (n, _) in x.iter().enumerate().filter(|(_, x)| x.abs() > loud) {
                knocks += i32::from(n as f64 - last > 0.03 * FS);
                last = n as f64;
            }
            assert_eq!(knocks, (2.0 / time) as i32, "{v} m/s");
        }
    }

    #[test]
    fn windows_change_no_bit() {
        let rough = |k: usize| luma(2000.0, 1e-4, 256, move |x| ((x * k * x) % 101) as f32);
        let one = PathPiece {
            other: Some([[0.1, 0.0], [0.02, 0.01], [0.0; 2], [0.01, 0.0]]),
            ..piece([0.0; 2], [0.4, 0.1], 0.1)
        };
        let two = PathPiece { contact: 9, ..piece([0.0; 2], [-0.8, 0.1], 0.12) };
        let paths = vec![(ticks(0.0111), one), (ticks(0.05), two)];
        for b in [None, Some(rough(5))] {
            let run = |n: usize| {
                let solo = solo(rough(3), b.clone(), paths.clone(), 0.2).window(Rate::hz(44_100).span(n));
                solo.run().unwrap().stream(TwoTexturesPorts::force)
            };
            let whole = run(10_000);
            assert!(rms(&whole) > 0.0);
            for n in [32, 100, 1024, 4096] {
                assert!(run(n) == whole, "{n}");
            }
        }
    }

    #[test]
    fn a_relief_of_any_density_is_the_same_relief() {
        let tiles = |density: [f64; 2]| {
            let at = |x: usize, y: usize| {
                let (x, y) = (x as f64 / density[0], y as f64 / density[1]);
                if (x * 20.0).fract() < 0.1 || (y * 16.0).fract() < 0.1 { 0.0 } else { 100.0 }
            };
            let size = density.map(|d| (0.5 * d) as usize);
            let surface = Surface { density, depth: 1e-3, ..Surface::default() };
            Luma { grid: Grid::from_fn(size[0], size[1], at), surface, ..luma(1.0, 1e-3, 1, |_| 0.0) }
        };
        let path = vec![(0, piece([0.01, 0.01], [0.3, 0.2], 0.3))];
        let even = force(tiles([4000.0; 2]), None, path.clone(), 0.3);
        let uneven = force(tiles([4000.0, 2000.0]), None, path, 0.3);
        let ratio = rms(&uneven) / rms(&even);
        assert!((ratio - 1.0).abs() < 0.1, "{ratio}");
    }

    #[test]
    fn a_relief_of_no_numbers_is_an_error() {
        let broken = luma(1000.0, 1e-4, 16, |_| f32::NAN);
        let error = solo(broken, None, vec![], 0.1).run().map(|_| ()).unwrap_err();
        assert!(error.code == "F128" && error.to_string().contains("none at all"), "{error}");
    }
}
