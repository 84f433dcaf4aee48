use super::*;
use crate::core::item::AnyValue;
use crate::core::node::Node;
use crate::core::ports::{Port, Stream};
use crate::core::standalone::{Feed, Standalone, StandaloneRun};
use crate::core::time::{Rate, Tick, ticks};
use crate::dsp::Weighting;
use crate::scrape::PathPiece;
use crate::scrape::crossing::feature_crossings::{
    FeatureCrossings, FeatureCrossingsParams, FeatureCrossingsPorts,
};
use crate::scrape::force::contact_force_params::ContactForceParams;
use crate::scrape::level::matching::StrokeParams;
use crate::scrape::noise::noise_excitation::{NoiseExcitation, NoiseExcitationParams, NoiseExcitationPorts};
use crate::scrape::path::knots::{StrokeContact, pieces, through};
use crate::scrape::path::other_surface::exchanged;
use crate::scrape::relief::two_textures::{TwoTextures, TwoTexturesParams, TwoTexturesPorts};
use crate::scrape::testing::db;
use crate::texture::bilateral::{BilateralParams, bilateral};
use crate::texture::profile::{PROFILE, profile};
use crate::texture::split::noise as noise_of;
use crate::texture::{Drawing, Grid, Levels, LumaKind, Surface, Wrap, isophotes};

/// Distance travelled on the second surface per distance on the first.
const OTHER: f64 = 0.4;

/// All data of one surface.
struct Side {
    luma: Luma,
    lines: Isophotes,
    rest: NoiseMap,
    noise: NoiseProfile,
}

/// Waves of some pixels in both directions under grain.
fn side(seed: u64, density: f64, depth: f64, waves: [f64; 2]) -> Side {
    let mut rng = Rng::new(seed);
    let tau = std::f64::consts::TAU;
    let grid = Grid::from_fn(192, 192, |x, y| {
        let wave = (tau * x as f64 / waves[0]).sin() + (tau * y as f64 / waves[1]).sin();
        (50.0 + 14.0 * wave + rng.between(-3.0, 3.0)) as f32
    });
    let surface = Surface { density: [density; 2], depth, ..Surface::default() };
    let smooth = bilateral(&grid, BilateralParams { sigma_d: 3.0, sigma_r: 4.25 }, Wrap::Repeat);
    let rest = NoiseMap { grid: noise_of(&grid, &smooth, None, &[]), holes: Vec::new(), surface };
    let luma = Luma { grid, holes: Vec::new(), kind: LumaKind::Lstar, surface };
    let drawing = Drawing { levels: Levels::Quantiles(2), ..Drawing::default() };
    let lines = isophotes(&luma, &drawing).unwrap();
    Side { noise: profile(&rest, PROFILE), lines, rest, luma }
}

fn sides() -> [Side; 2] {
    [side(3, 2048.0, 5e-4, [24.0, 32.0]), side(4, 4096.0, 2e-4, [16.0, 48.0])]
}

fn value<T: crate::core::item::Data + Clone>(value: &T) -> Feed {
    Feed::value(AnyValue::new(value.clone()))
}

fn params() -> PairMatcherParams {
    let p = PairMatcherParams::read(&|_| None).unwrap();
    PairMatcherParams {
        speed: 0.6,
        other: OTHER,
        reach: 0.004,
        stroke: StrokeParams { force: 3.0, ..p.stroke },
        ..p
    }
}

fn matched(p: PairMatcherParams, [a, b]: &[Side; 2], modes: &Modes) -> StandaloneRun {
    type P = PairMatcherPorts;
    Standalone::func::<PairMatcher>(p)
        .feed(P::a.index(), value(&a.luma))
        .feed(P::b.index(), value(&b.luma))
        .feed(P::lines_a.index(), value(&a.lines))
        .feed(P::lines_b.index(), value(&b.lines))
        .feed(P::rest_a.index(), value(&a.rest))
        .feed(P::rest_b.index(), value(&b.rest))
        .feed(P::noise_a.index(), value(&a.noise))
        .feed(P::noise_b.index(), value(&b.noise))
        .feed(P::spectrum_a.index(), value(&a.noise))
        .feed(P::modes.index(), value(modes))
        .run()
        .unwrap()
}

fn strength_of(run: &StandaloneRun, port: usize) -> Strength {
    *run.value(port).unwrap().get::<Strength>().unwrap()
}

/// A path that is unrelated to the standard stroke, at about a speed.
fn path(speed: f64) -> Vec<(Tick, PathPiece)> {
    let mut rng = Rng::new(5);
    let (mut position, mut angle, mut time) = ([0.3, 0.2], 0.4, 0.0);
    let points: Vec<[f64; 4]> = (0..150)
        .map(|_| {
            let point = [time, position[0], position[1], 3.0];
            angle += rng.between(-0.5, 0.5);
            position = [position[0] + 0.01 * f64::cos(angle), position[1] + 0.01 * f64::sin(angle)];
            time += 0.01 / speed;
            point
        })
        .collect();
    pieces(&through(&points), StrokeContact { contact: 1, object: 0, other: Some(OTHER) })
}

fn drawn<N: Node>(params: N::Params, path: &[(Tick, PathPiece)], feeds: Vec<(usize, Feed)>) -> Vec<f32> {
    let end = path.last().map_or(0, |(tick, piece)| tick + piece.duration);
    let standalone =
        Standalone::new::<N>(params).feed(0, Feed::events(path.to_vec(), end)).window(ticks(1.0));
    let standalone =
        feeds.into_iter().fold(standalone, |standalone, (port, feed)| standalone.feed(port, feed));
    standalone.run().unwrap().stream(Port::<Stream<f32>>::new(0))
}

/// Output of each level of detail along a path: reliefs, crossings and noises, noises alone.
fn levels([a, b]: &[Side; 2], run: &StandaloneRun, path: &[(Tick, PathPiece)], scale: f64) -> [Vec<f32>; 3] {
    let rate = Rate::hz(44_100);
    let p = TwoTexturesParams {
        contact: ContactForceParams { rate, scale, ..TwoTexturesParams::read(&|_| None).unwrap().contact },
        ..TwoTexturesParams::read(&|_| None).unwrap()
    };
    let full = drawn::<TwoTextures>(
        p,
        path,
        vec![
            (TwoTexturesPorts::a.index(), value(&a.luma)),
            (TwoTexturesPorts::b.index(), value(&b.luma)),
            (TwoTexturesPorts::kappa.index(), value(&strength_of(run, 0))),
        ],
    );
    let p = FeatureCrossingsParams::read(&|_| None).unwrap();
    let crossings = drawn::<FeatureCrossings>(
        FeatureCrossingsParams {
            reach: params().reach,
            contact: ContactForceParams { rate, scale, ..p.contact },
            ..p
        },
        path,
        vec![
            (FeatureCrossingsPorts::first.index(), value(&a.lines)),
            (FeatureCrossingsPorts::second.index(), value(&b.lines)),
            (FeatureCrossingsPorts::kappa.index(), value(&strength_of(run, 1))),
        ],
    );
    let turned: Vec<_> = path.iter().filter_map(|(tick, piece)| Some((*tick, exchanged(piece)?))).collect();
    let noise = |side: &Side, path: &[(Tick, PathPiece)], port: usize| {
        let p = NoiseExcitationParams {
            contact: ContactForceParams {
                rate,
                scale,
                ..NoiseExcitationParams::read(&|_| None).unwrap().contact
            },
            ..NoiseExcitationParams::read(&|_| None).unwrap()
        };
        let feeds = vec![
            (NoiseExcitationPorts::noise.index(), value(&side.noise)),
            (NoiseExcitationPorts::kappa.index(), value(&strength_of(run, port))),
        ];
        drawn::<NoiseExcitation>(p, path, feeds)
    };
    let both = |port: usize| sum([&noise(a, path, port), &noise(b, &turned, port + 1)], [1.0; 2]);
    let split = sum([&crossings, &both(2)], [1.0; 2]);
    [full, split, both(4)]
}

fn modes() -> Modes {
    // Narrow modes would receive only a few waves of noise on a short path.
    Modes::new("plate", vec![310.0, 740.0, 1260.0], vec![60.0, 70.0, 90.0], vec![1.0; 3]).unwrap()
}

#[test]
fn all_levels_are_as_loud_as_the_reliefs_at_any_speed_and_of_any_size() {
    let sides = sides();
    let modes = modes();
    let run = matched(params(), &sides, &modes);
    for (scale, speed) in [(1.0, 0.6), (0.5, 0.6), (2.0, 0.6), (1.0, 0.3), (1.0, 1.2)] {
        let ring =
            |force: Vec<f32>| loudness(&rendered(force, Some(&modes), [1.0; 2]).unwrap(), Weighting::K);
        let all = levels(&sides, &run, &path(speed), scale).map(ring);
        let miss = all.map(|level| db(level / all[0]));
        println!("{scale} x at {speed} m/s: {miss:.1?} dB");
        assert!(miss.iter().all(|miss| miss.abs() < 2.0), "{scale} x at {speed} m/s: {miss:?} dB");
    }
}

#[test]
fn noises_share_their_power_as_their_slopes_do() {
    let mut sides = sides();
    let modes = modes();
    let p = PairMatcherParams { stroke: StrokeParams { by_speed: false, ..params().stroke }, ..params() };
    let reported = |run: &StandaloneRun| {
        run.summary.iter().find(|(k, _)| *k == "second_noise_share").unwrap().1.as_f64()
    };
    let before = reported(&matched(p.clone(), &sides, &modes)).unwrap();
    // Heights twice as large have four times the power.
    sides[1].luma.surface.depth *= 2.0;
    let after = reported(&matched(p, &sides, &modes)).unwrap();
    let odds = |share: f64| share / (1.0 - share);
    assert!((odds(after) / odds(before) - 4.0).abs() < 1e-3, "{before} {after}");
}

#[test]
fn what_has_no_link_is_silent() {
    let [a, b] = sides();
    let run = Standalone::func::<PairMatcher>(PairMatcherParams {
        kappa: 3.0,
        stroke: StrokeParams { by_speed: false, ..params().stroke },
        ..params()
    })
    .feed(PairMatcherPorts::a.index(), value(&a.luma))
    .feed(PairMatcherPorts::b.index(), value(&b.luma))
    .feed(PairMatcherPorts::noise_b.index(), value(&b.noise))
    .run()
    .unwrap();
    let all: Vec<f64> = (0..8).map(|port| strength_of(&run, port).kappa).collect();
    assert_eq!((all[0], all[1], all[2], all[4], all[6], all[7]), (3.0, 0.0, 0.0, 0.0, 0.0, 0.0));
    assert!(all[3] > 0.0 && all[3] == all[5], "one noise does all: {all:?}");
}
