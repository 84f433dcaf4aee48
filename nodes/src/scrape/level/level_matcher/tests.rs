use super::*;
use crate::core::item::AnyValue;
use crate::core::item::Channels;
use crate::core::node::Node;
use crate::core::random::Random;
use crate::core::standalone::{Feed, Standalone, StandaloneRun};
use crate::core::time::{Rate, Tick, ticks};
use crate::dsp::Weighting;
use crate::scrape::PathPiece;
use crate::scrape::force::contact_force_params::ContactForceParams;
use crate::scrape::isophote::isophote_excitation::{
    IsophoteExcitation, IsophoteExcitationParams, IsophoteExcitationPorts,
};
use crate::scrape::level::lod_select::{LodSelect, LodSelectParams, LodSelectPorts};
use crate::scrape::level::matching::StrokeParams;
use crate::scrape::map::map_excitation::{MapExcitation, MapExcitationParams, MapExcitationPorts};
use crate::scrape::noise::noise_excitation::{NoiseExcitation, NoiseExcitationParams, NoiseExcitationPorts};
use crate::scrape::path::knots::{StrokeContact, circle, pieces, through};
use crate::scrape::testing::db;
use crate::texture::bilateral::{BilateralParams, bilateral};
use crate::texture::decode::decode;
use crate::texture::dog::{DogParams, features as lines_of};
use crate::texture::luma::luminance;
use crate::texture::profile::{PROFILE, profile};
use crate::texture::spectrum::NoiseModel;
use crate::texture::split::{noise as noise_of, statistics};
use crate::texture::{Detail, Drawing, Grid, Luma, LumaKind, NoisePart, Surface, Wrap, isophotes};

/// All maps of an image of paving with joints and grain.
struct Floor {
    map: DiscontinuityMap,
    isophotes: Isophotes,
    features: FeatureMap,
    rest: NoiseMap,
    noise: NoiseProfile,
    spectrum: NoiseProfile,
    /// Detail finer than the image.
    detail: NoiseProfile,
}

fn floor(grain: f64) -> Floor {
    let mut rng = Rng::new(17);
    let grid = Grid::from_fn(192, 192, |x, y| {
        let joint = (x + 16 * (y / 24 % 2)) % 32 < 3 || y % 24 < 3;
        (if joint { 30.0 } else { 65.0 }) + (grain * rng.between(-1.0, 1.0)) as f32
    });
    made_of(grid)
}

/// A floor that looks like an image of the examples.
fn picture(name: &str) -> Floor {
    let path = format!("{}/../graphs/assets/images/{name}.png", env!("CARGO_MANIFEST_DIR"));
    let picture = decode(&std::fs::read(path).unwrap()).unwrap();
    made_of(luminance(&picture, LumaKind::Lstar, false).unwrap().0)
}

/// A floor that looks like an image.
fn made_of(grid: Grid) -> Floor {
    let surface = Surface::default();
    let smooth = bilateral(&grid, BilateralParams { sigma_d: 3.0, sigma_r: 4.25 }, Wrap::Repeat);
    let features = lines_of(&smooth, DogParams::default(), Wrap::Repeat);
    let grid_of_rest = noise_of(&grid, &smooth, Some(&features), &[]);
    let rest = NoiseMap { grid: grid_of_rest, holes: Vec::new(), surface };
    let model = NoiseModel::poles(&rest, statistics(&rest.grid, &[]).kurtosis);
    let spacing = 1.0 / surface.density[0];
    let samples = model.synthesize(PROFILE, &Random::new(3, "spectrum"));
    let noise = NoiseProfile { detail: Some(Detail { factor: 16, seed: 3 }), ..profile(&rest, PROFILE) };
    let [gx, gy] = gradient(&grid, Wrap::Repeat);
    let luma = Luma { grid, holes: Vec::new(), kind: LumaKind::Lstar, surface };
    Floor {
        map: DiscontinuityMap { gx, gy, surface },
        isophotes: isophotes(&luma, &Drawing::default()).unwrap(),
        features: FeatureMap { grid: features, surface },
        detail: NoiseProfile { part: NoisePart::Detail, ..noise.clone() },
        noise,
        spectrum: NoiseProfile {
            samples,
            spacing,
            detail: Some(Detail { factor: 16, seed: 4 }),
            ..NoiseProfile::default()
        },
        rest,
    }
}

fn params() -> LevelMatcherParams {
    // At one speed, which is faster, if a test does not depend on speed.
    LevelMatcherParams {
        stroke: StrokeParams { by_speed: false, ..LevelMatcherParams::read(&|_| None).unwrap().stroke },
        reference: crate::dsp::Reference::Absolute,
        ..LevelMatcherParams::read(&|_| None).unwrap()
    }
}

fn value<T: crate::core::item::Data + Clone>(value: &T) -> Feed {
    Feed::value(AnyValue::new(value.clone()))
}

fn matched(p: LevelMatcherParams, floor: &Floor, modes: Option<&Modes>) -> StandaloneRun {
    let mut standalone = Standalone::func::<LevelMatcher>(p)
        .feed(LevelMatcherPorts::map.index(), value(&floor.map))
        .feed(LevelMatcherPorts::isophotes.index(), value(&floor.isophotes))
        .feed(LevelMatcherPorts::features.index(), value(&floor.features))
        .feed(LevelMatcherPorts::rest.index(), value(&floor.rest))
        .feed(LevelMatcherPorts::noise.index(), value(&floor.noise))
        .feed(LevelMatcherPorts::detail.index(), value(&floor.detail))
        .feed(LevelMatcherPorts::spectrum.index(), value(&floor.spectrum));
    if let Some(modes) = modes {
        standalone = standalone.feed(LevelMatcherPorts::modes.index(), value(modes));
    }
    standalone.run().unwrap()
}

/// Loudness of a sound.
fn loud(x: &[f32]) -> f64 {
    loudness(x, Weighting::K)
}

fn strength_of(run: &StandaloneRun, port: usize) -> Strength {
    *run.value(port).unwrap().get::<Strength>().unwrap()
}

fn kappa(run: &StandaloneRun, port: usize) -> f64 {
    strength_of(run, port).kappa
}

/// A path that is unrelated to the standard stroke, at about a speed.
fn path(speed: f64, force: f64) -> Vec<(Tick, PathPiece)> {
    let mut rng = Rng::new(5);
    let (mut position, mut angle, mut time) = ([0.3, 0.2], 0.4, 0.0);
    let points: Vec<[f64; 4]> = (0..200)
        .map(|_| {
            let point = [time, position[0], position[1], force];
            let step = 0.04;
            angle += rng.between(-0.5, 0.5);
            position = [position[0] + step * f64::cos(angle), position[1] + step * f64::sin(angle)];
            time += step / speed;
            point
        })
        .collect();
    pieces(&through(&points), StrokeContact { contact: 1, object: 0, other: None })
}

fn drawn<N: Node>(params: N::Params, path: &[(Tick, PathPiece)], feeds: Vec<(usize, Feed)>) -> Vec<f32> {
    let end = path.last().map_or(0, |(tick, piece)| tick + piece.duration);
    let standalone =
        Standalone::new::<N>(params).feed(0, Feed::events(path.to_vec(), end)).window(ticks(1.0));
    let standalone =
        feeds.into_iter().fold(standalone, |standalone, (port, feed)| standalone.feed(port, feed));
    let run = standalone.run().unwrap();
    run.stream(crate::core::ports::Port::<crate::core::ports::Stream<f32>>::new(0))
}

/// Output of each level of detail along a path: map and isophotes with detail, features and noise, noise, noise from a spectrum.
fn levels(floor: &Floor, run: &StandaloneRun, path: &[(Tick, PathPiece)]) -> [Vec<f32>; 5] {
    let rate = Rate::hz(44_100);
    let map = |feed: (usize, Feed), port: usize| {
        let p = MapExcitationParams {
            contact: ContactForceParams { rate, ..MapExcitationParams::read(&|_| None).unwrap().contact },
            ..MapExcitationParams::read(&|_| None).unwrap()
        };
        let feeds = vec![feed, (MapExcitationPorts::kappa.index(), value(&strength_of(run, port)))];
        drawn::<MapExcitation>(p, path, feeds)
    };
    let noise_by = |profile: &NoiseProfile, port: usize, [a, b]: [f64; 2]| {
        let p = NoiseExcitationParams {
            a,
            b,
            contact: ContactForceParams { rate, ..NoiseExcitationParams::read(&|_| None).unwrap().contact },
            ..NoiseExcitationParams::read(&|_| None).unwrap()
        };
        let feeds = vec![
            (NoiseExcitationPorts::noise.index(), value(profile)),
            (NoiseExcitationPorts::kappa.index(), value(&strength_of(run, port))),
        ];
        drawn::<NoiseExcitation>(p, path, feeds)
    };
    let noise = |profile: &NoiseProfile, port: usize| noise_by(profile, port, [0.5; 2]);
    let detail = |port: usize| noise_by(&floor.detail, port, [1.0, 0.0]);
    let p = IsophoteExcitationParams {
        contact: ContactForceParams { rate, ..IsophoteExcitationParams::read(&|_| None).unwrap().contact },
        ..IsophoteExcitationParams::read(&|_| None).unwrap()
    };
    let feeds = vec![
        (IsophoteExcitationPorts::isophotes.index(), value(&floor.isophotes)),
        (IsophoteExcitationPorts::kappa.index(), value(&strength_of(run, 1))),
    ];
    let lines = map((MapExcitationPorts::features.index(), value(&floor.features)), 4);
    let both = sum([&lines, &noise(&floor.noise, 5)], [1.0; 2]);
    let whole = map((MapExcitationPorts::map.index(), value(&floor.map)), 0);
    [
        sum([&whole, &detail(2)], [1.0; 2]),
        sum([&drawn::<IsophoteExcitation>(p, path, feeds), &detail(3)], [1.0; 2]),
        both,
        noise(&floor.noise, 6),
        noise(&floor.spectrum, 7),
    ]
}

#[test]
fn all_levels_of_detail_are_equally_strong_within_two_db() {
    for grain in [1.0, 8.0] {
        let floor = floor(grain);
        let run = matched(params(), &floor, None);
        let reported = |key: &str| run.summary.iter().find(|(k, _)| *k == key).unwrap().1.as_f64().unwrap();
        assert!((reported("split_loudness") / reported("loudness") - 1.0).abs() < 1e-6, "{:?}", run.summary);
        let all = levels(&floor, &run, &path(1.0, 1.0)).map(|x| loud(&x));
        for (k, level) in all.iter().enumerate() {
            assert!(db(level / all[0]).abs() < 2.0, "grain {grain}, level {k}: {} dB", db(level / all[0]));
        }
    }
}

/// The path of `graphs/lib/levels.ron`: a circle that is unrelated to those of the standard stroke.
#[test]
fn surfaces_of_the_examples_are_equally_strong_on_all_levels() {
    for name in ["tiles", "sk_brick", "sk_gravel"] {
        let floor = picture(name);
        let run = matched(LevelMatcherParams { speed: 0.8, ..params() }, &floor, None);
        let pen = StrokeContact { contact: 0, object: 0, other: None };
        let path = pieces(&circle([0.5; 2], 0.3, 1.0, 0.0, 0.8, 1.0).unwrap(), pen);
        let all = levels(&floor, &run, &path).map(|x| loud(&x));
        let levels = all.map(|level| db(level / all[0]));
        println!("{name}: {levels:.1?} dB");
        assert!(levels.iter().all(|level| level.abs() < 2.0), "{name}: {levels:?} dB");
    }
}

#[test]
fn who_walks_away_hears_no_click_and_no_level_louder_than_another() {
    let floor = floor(4.0);
    let run = matched(params(), &floor, None);
    let path = path(1.0, 1.0);
    let end = path.last().map_or(0, |(tick, piece)| tick + piece.duration);
    // From 1 m to 55 m: through all audible levels.
    let rate = Rate::hz(100);
    let distances =
        (0..rate.first_at(end)).map(|k| 1.0 + 54.0 * (k as f32) / rate.first_at(end) as f32).collect();
    let lod = Standalone::new::<LodSelect>(LodSelectParams::read(&|_| None).unwrap())
        .events(LodSelectPorts::paths, path.clone(), end)
        .optional(LodSelectPorts::distance, rate, Channels(1), distances)
        .run()
        .unwrap();
    let mut out: Vec<f32> = Vec::new();
    for (port, level) in [
        (LodSelectPorts::full, 0),
        (LodSelectPorts::split, 2),
        (LodSelectPorts::noise, 3),
        (LodSelectPorts::spectrum, 4),
    ] {
        let part = lod.events(port);
        assert!(!part.is_empty(), "level {level} sounds");
        let made = &levels(&floor, &run, &part)[level];
        out.resize(out.len().max(made.len()), 0.0);
        out.iter_mut().zip(made).for_each(|(out, x)| *out += x);
    }
    let mut most = 0.0_f32;
    for (n, pair) in out.windows(2).enumerate() {
        let step = (pair[1] - pair[0]).abs();
        assert!(n < 2000 || step < 4.0 * most, "{n}: {step} after {most}");
        most = most.max(step);
    }
    // Each half second of the path is as loud as all of it, within the unevenness of the floor.
    let whole = loud(&out);
    for part in out[..out.len() - 22_050].chunks_exact(22_050) {
        assert!(db(loud(part) / whole).abs() < 3.5, "{} dB", db(loud(part) / whole));
    }
}

#[test]
fn they_are_so_at_the_speed_and_force_of_the_stroke_whatever_the_exponents() {
    let floor = floor(4.0);
    let p = LevelMatcherParams {
        speed: 0.3,
        kappa: 7.0,
        stroke: StrokeParams { force: 2.5, ..params().stroke },
        ..params()
    };
    let run = matched(p, &floor, None);
    assert_eq!(kappa(&run, 0), 7.0);
    let all = levels(&floor, &run, &path(0.3, 2.5)).map(|x| loud(&x));
    for (k, level) in all.iter().enumerate() {
        assert!(db(level / all[0]).abs() < 2.0, "level {k}: {} dB", db(level / all[0]));
    }
}

#[test]
fn with_modes_it_is_their_sound_that_is_equally_loud() {
    let floor = floor(4.0);
    let modes = Modes::new("bar", vec![1410.0, 3130.0], vec![4.0, 6.0], vec![1.0, 0.6]).unwrap();
    let ring = |force: &Vec<f32>| loud(&rendered(force.clone(), Some(&modes), [1.0; 2]).unwrap());
    let run = matched(params(), &floor, Some(&modes));
    let all = levels(&floor, &run, &path(1.0, 1.0));
    for (k, level) in all.iter().enumerate() {
        let miss = db(ring(level) / ring(&all[0]));
        assert!(miss.abs() < 2.0, "level {k}: {miss} dB");
    }
}

/// The slope of bricks and the box of `graphs/texture/brick_slide.ron`, and gravel, which is not matched by its map alone.
#[test]
fn with_modes_all_levels_follow_the_whole_map_from_half_to_four_times_the_speed() {
    // Narrow modes would receive only a few waves of noise on a short path.
    let dampings = vec![40.0, 50.0, 60.0, 80.0];
    let modes = Modes::new("box", vec![271.0, 410.0, 663.0, 1190.0], dampings, vec![1.0; 4]).unwrap();
    for name in ["sk_brick", "sk_gravel"] {
        let floor = picture(name);
        let p = LevelMatcherParams {
            speed: 1.2,
            stroke: StrokeParams { force: 2.0, by_speed: true, ..params().stroke },
            ..params()
        };
        let run = matched(p.clone(), &floor, Some(&modes));
        let still = matched(
            LevelMatcherParams { stroke: StrokeParams { by_speed: false, ..p.stroke }, ..p },
            &floor,
            Some(&modes),
        );
        let mut worst = [0.0_f64; 2];
        for times in [0.5, 1.0, 2.0, 4.0] {
            let path = path(1.2 * times, 2.0);
            let ring = |force: Vec<f32>| loud(&rendered(force, Some(&modes), [1.0; 2]).unwrap());
            for (run, worst) in [&run, &still].into_iter().zip(&mut worst) {
                let all = levels(&floor, run, &path).map(ring);
                let miss = all.map(|level| db(level / all[0]));
                println!("{name} at {times} x: {miss:.1?} dB");
                *worst = miss.iter().fold(*worst, |w, miss| w.max(miss.abs()));
            }
        }
        assert!(worst[0] < 2.0, "{name}: {} dB", worst[0]);
        assert!(worst[1] > 4.0, "{name}: matched at one speed it is {} dB off", worst[1]);
    }
}

#[test]
fn a_surface_of_twice_the_size_is_matched_as_well() {
    let floor = floor(4.0);
    let modes = Modes::new("bar", vec![271.0, 663.0], vec![9.0, 15.0], vec![1.0; 2]).unwrap();
    let p = LevelMatcherParams { stroke: StrokeParams { by_speed: true, ..params().stroke }, ..params() };
    let run = matched(p, &floor, Some(&modes));
    let path = path(1.6, 1.0);
    let contact = |contact| ContactForceParams { rate: Rate::hz(44_100), scale: 2.0, ..contact };
    let noise = |profile: &NoiseProfile, port: usize, law: [f64; 2]| {
        let p = NoiseExcitationParams::read(&|_| None).unwrap();
        let p = NoiseExcitationParams { contact: contact(p.contact), a: law[0], b: law[1], ..p };
        let feeds = vec![
            (NoiseExcitationPorts::noise.index(), value(profile)),
            (NoiseExcitationPorts::kappa.index(), value(&strength_of(&run, port))),
        ];
        drawn::<NoiseExcitation>(p, &path, feeds)
    };
    let map = {
        let p = MapExcitationParams::read(&|_| None).unwrap();
        let feeds = vec![
            (MapExcitationPorts::map.index(), value(&floor.map)),
            (MapExcitationPorts::kappa.index(), value(&strength_of(&run, 0))),
        ];
        drawn::<MapExcitation>(MapExcitationParams { contact: contact(p.contact), ..p }, &path, feeds)
    };
    let ring = |force: Vec<f32>| loud(&rendered(force, Some(&modes), [1.0; 2]).unwrap());
    let whole = ring(sum([&map, &noise(&floor.detail, 2, [1.0, 0.0])], [1.0; 2]));
    let far = ring(noise(&floor.noise, 6, [0.5; 2]));
    let miss = db(far / whole);
    assert!(miss.abs() < 2.0, "{miss} dB");
}

#[test]
fn the_noise_has_the_share_that_its_slopes_have() {
    let shares = [0.5, 8.0].map(|grain| {
        let floor = floor(grain);
        let run = matched(params(), &floor, None);
        run.summary.iter().find(|(k, _)| *k == "noise_share").unwrap().1.as_f64().unwrap()
    });
    let odds = shares.map(|share| share / (1.0 - share));
    assert!(odds[1] > 10.0 * odds[0] && odds[0] > 0.0, "{shares:?}");
}

#[test]
fn what_has_no_link_is_silent_and_silence_matches_silence() {
    let floor = floor(2.0);
    let alone = Standalone::func::<LevelMatcher>(params()).value(LevelMatcherPorts::map, floor.map.clone());
    let run = alone.run().unwrap();
    let all: Vec<f64> = (0..8).map(|port| kappa(&run, port)).collect();
    assert_eq!(all, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let none = Grid::from_fn(16, 16, |_, _| 0.0);
    let flat = DiscontinuityMap { gx: none.clone(), gy: none.clone(), surface: Surface::default() };
    let quiet = Standalone::func::<LevelMatcher>(params())
        .value(LevelMatcherPorts::map, flat)
        .feed(LevelMatcherPorts::noise.index(), value(&floor.noise));
    assert_eq!(kappa(&quiet.run().unwrap(), 6), 0.0);
}

#[test]
fn a_strength_that_is_none_is_refused() {
    let p = MapExcitationParams::read(&|_| None).unwrap();
    let standalone = Standalone::new::<MapExcitation>(p)
        .events::<PathPiece>(MapExcitationPorts::paths, vec![], 1)
        .feed(MapExcitationPorts::map.index(), value(&floor(1.0).map))
        .feed(MapExcitationPorts::kappa.index(), value(&Strength::constant(2e6)));
    let error = standalone.run().map(|_| ()).unwrap_err();
    assert!(error.code == "F128" && error.to_string().contains("2000000"), "{error}");
}

#[test]
fn a_class_chooses_between_map_and_isophotes() {
    use crate::texture::histogram::classify;
    let floor = floor(2.0);
    let grid = Grid::from_fn(8, 8, |x, y| (x * y) as f32);
    let luma = Luma { grid, holes: Vec::new(), kind: LumaKind::Lstar, surface: Surface::default() };
    let given = |class, curves: bool| {
        let mut standalone = Standalone::func::<LevelMatcher>(params())
            .feed(LevelMatcherPorts::map.index(), value(&floor.map))
            .feed(LevelMatcherPorts::class.index(), value(&classify(&luma, 0.2, Some(class))));
        if curves {
            standalone = standalone.feed(LevelMatcherPorts::isophotes.index(), value(&floor.isophotes));
        }
        let run = standalone.run().unwrap();
        [kappa(&run, 0), kappa(&run, 1)]
    };
    assert_eq!(given(Class::Simple, true), [1.0, 0.0]);
    let [map, curves] = given(Class::Complex, true);
    assert!(map == 0.0 && curves > 0.0, "{map} {curves}");
    assert_eq!(given(Class::Complex, false), [1.0, 0.0]);
}
