//! Time per impact, and per contact in a block of 1024 samples at 44.1 kHz for each kind of excitation, on one core.
//!
//! Run with `cargo bench -p foley-nodes -- scrape`. The aims are 2 us for an impact, 15 us for a continuous contact, 100 us
//! for two textures, and a tenth of a core for 64 contacts on 8 objects of 32 modes.

use foley_nodes::core::random::Rng;
use foley_nodes::core::time::{Rate, Tick, ticks};
use foley_nodes::modal::{Bank, BankOutput, ForceRing, Modes, PulseShape};
use foley_nodes::scrape::{
    ContactSample, CrossingForce, CrossingVoice, Heading, Interp, Law, MapForce, MapVoice, NoiseBands,
    NoiseForce, NoiseVoice, PairForce, PathPiece, PathRules, Queue, Relief, Segment, SpeedCurve, SurfaceMap,
    Tracker, Voices, ball_map,
};
use foley_nodes::texture::{
    DiscontinuityMap, Drawing, FeatureMap, Grid, Kernel, Levels, Luma, LumaKind, NoiseLine, Surface,
    isophotes, smooth,
};
use std::error::Error;
use std::hint::black_box;
use std::time::Instant;

const FS: u32 = 44_100;
const BLOCK: usize = 1024;
/// Each figure is the best of this many repetitions, which is least affected by other programs.
const REPETITIONS: usize = 300;
/// Blocks of one repetition.
const BLOCKS: usize = 16;

/// Returns the path of a contact that moves on a circle at one speed, in frames of 1/60 s.
fn contact(number: u64, speed: f64) -> Vec<(Tick, PathPiece)> {
    let (frame, radius) = (1.0 / 60.0, 0.08);
    let position = |t: f64| {
        let (sin, cos) = (t * speed / radius + number as f64).sin_cos();
        [radius * cos, radius * sin]
    };
    (0..60)
        .map(|k| {
            let [a, b] = [k, k + 1].map(|k| position(f64::from(k) * frame));
            let gap = [b[0] - a[0], b[1] - a[1]];
            let piece = PathPiece {
                contact: number,
                jump: 0,
                object: 0,
                duration: ticks(frame),
                position: [a, gap, [1e-6, 0.0], [0.0; 2]],
                other: Some([[0.1, 0.2], gap.map(|x| 0.5 * x), [0.0; 2], [0.0; 2]]),
                force: [1.0, 2.0],
                gain: [1.0; 2],
                mass: None,
            };
            (Rate::hz(60).tick(k.into()), piece)
        })
        .collect()
}

/// Returns the time per contact and block in us, with `count` contacts at one speed.
fn time<S: Clone>(
    count: u64,
    speed: f64,
    blank: S,
    mut sound: impl FnMut(&mut S, &Segment, &mut [f32]),
) -> f64 {
    let fresh = blank.clone();
    time_blocks(count, speed, blank, |voices, now, first, out| {
        voices.play(now, None, first, out, |_| fresh.clone(), |s, stretch, out| sound(s, stretch, out));
    })
}

/// Returns the same time for a function that renders a block of all contacts.
fn time_blocks<S: Clone>(
    count: u64,
    speed: f64,
    blank: S,
    mut block: impl FnMut(&mut Voices<S>, &[(Tick, PathPiece)], i64, &mut [f32]),
) -> f64 {
    let rate = Rate::hz(FS);
    let mut events: Vec<_> = (0..count).flat_map(|k| contact(k, speed)).collect();
    events.sort_by_key(|(tick, _)| *tick);
    let mut out = [0.0; BLOCK];
    let mut repetition = || {
        let mut voices = Voices::new(64, rate, blank.clone());
        let start = Instant::now();
        for k in 0..BLOCKS as i64 {
            let first = k * BLOCK as i64;
            let part = |item: i64| events.partition_point(|(tick, _)| *tick < rate.tick(item));
            let now = &events[part(first)..part(first + BLOCK as i64)];
            block(&mut voices, now, first, &mut out);
            black_box(&out);
        }
        start.elapsed().as_secs_f64() * 1e6 / BLOCKS as f64 / count as f64
    };
    (0..REPETITIONS).map(|_| repetition()).fold(f64::MAX, f64::min)
}

fn law(b: f64) -> Law {
    Law::new([1.0, 1.0, b], FS.into())
}

fn map_force(interp: Interp) -> MapForce {
    MapForce::new(law(0.0), 1.0, interp, FS.into())
}

fn paths() -> f64 {
    let rules = PathRules {
        frame: ticks(1.0 / 60.0),
        look_ahead: true,
        differences: false,
        guard: true,
        teleport: 0.015,
        object: 0,
        smooth: 0.0,
    };
    let (contacts, frames) = (64, 40);
    let repetition = || {
        let (mut tracker, mut queue, mut pieces) = (Tracker::new(rules, 64), Queue::new(512), 0);
        let start = Instant::now();
        for k in 0..frames {
            let tick = Rate::hz(60).tick(k);
            for contact in 0..contacts {
                let at = 0.01 * k as f64;
                let sample = ContactSample {
                    contact,
                    tick,
                    position: [at, 0.0],
                    velocity: Some([0.6, 0.0]),
                    other: None,
                    force: 1.0,
                    gain: 1.0,
                    mass: None,
                    begins: false,
                    ends: false,
                };
                tracker.due(tick, &mut queue);
                tracker.frame(&sample, &mut queue);
            }
            queue.give(tick, |_, piece| pieces += black_box(piece).jump + 1);
        }
        black_box(pieces);
        let blocks = frames as f64 / 60.0 * f64::from(FS) / BLOCK as f64;
        start.elapsed().as_secs_f64() * 1e6 / blocks / contacts as f64
    };
    (0..REPETITIONS).map(|_| repetition()).fold(f64::MAX, f64::min)
}

/// Returns the time per impact in us, from its energy to its samples, without the modal bank.
fn impact(time: f64) -> f64 {
    let mut ring = ForceRing::new(FS.into(), 1, 0.04);
    let mut out = vec![0.0; BLOCK];
    let impacts = 32;
    let mut repetition = |impacts: usize| {
        let start = Instant::now();
        for k in 0..impacts {
            ring.add(k as f64 * 0.37 * BLOCK as f64 / 32.0, 0, 0.01, black_box(time), PulseShape::Cosine);
        }
        ring.read(&mut out);
        black_box(&out);
        start.elapsed().as_secs_f64() * 1e6
    };
    let mut best = |impacts| (0..REPETITIONS).map(|_| repetition(impacts)).fold(f64::MAX, f64::min);
    (best(impacts) - best(0)) / impacts as f64
}

fn objects(count: usize) -> Result<f64, Box<dyn Error>> {
    let frequencies = (0..32).map(|k| 150.0 * 1.14_f64.powi(k)).collect();
    let modes = Modes::new("bench", frequencies, vec![4.0; 32], vec![1e-3; 32])?;
    let mut bank = Bank::new(&modes, FS.into(), BankOutput::Acceleration)?;
    let mut rng = Rng::new(1);
    let force: Vec<f32> = (0..BLOCK).map(|_| rng.between(-1.0, 1.0) as f32).collect();
    let mut sound = vec![0.0; BLOCK];
    let mut repetition = || {
        let start = Instant::now();
        for _ in 0..BLOCKS {
            bank.process(&force, &mut sound);
            black_box(&sound);
        }
        start.elapsed().as_secs_f64() * 1e6 / BLOCKS as f64
    };
    Ok((0..REPETITIONS).map(|_| repetition()).fold(f64::MAX, f64::min) * count as f64)
}

pub fn bench() -> Result<(), Box<dyn Error>> {
    let mut rng = Rng::new(3);
    let grid = Grid::from_fn(512, 512, |_, _| rng.between(-1.0, 1.0) as f32);
    let other = Grid { samples: grid.samples.iter().rev().copied().collect(), ..grid };
    let surface = Surface::default();
    let map = DiscontinuityMap { gx: grid.clone(), gy: other.clone(), surface };
    let features = FeatureMap { grid: grid.clone(), surface };
    println!("us per impact                                          us            aim");
    let print_impact = |name: &str, us: f64| println!("  {name:<44} {us:7.2}             2");
    print_impact("impact of 1 ms", impact(1e-3));
    print_impact("impact of 20 ms", impact(2e-2));
    println!("us per continuous contact, 44.1 kHz          1024 samples   1 ms     aim");
    let per_ms = f64::from(FS) / 1000.0 / BLOCK as f64;
    let line = |name: &str, us: f64, aim: f64| {
        println!("  {name:<44} {us:7.2} {:8.3}   {aim:5.0}", us * per_ms);
    };

    line("path between frames", paths(), 15.0);
    let slope = SurfaceMap::slope(&map);
    for (name, interp) in
        [("linear", Interp::Linear), ("catmull", Interp::Catmull), ("b-spline", Interp::Bspline3)]
    {
        let mut force = map_force(interp);
        let us = time(1, 0.5, MapVoice::default(), |s, stretch, out| force.add(&slope, s, stretch, out));
        line(&format!("map, slope, {name}"), us, 15.0);
    }
    let mut force = map_force(Interp::Bspline3);
    force.law.curve = Some(SpeedCurve::new(0.4, std::array::from_fn(|k| 1.0 + 0.1 * k as f64)));
    let us = time(1, 0.5, MapVoice::default(), |s, stretch, out| force.add(&slope, s, stretch, out));
    line("map, slope, b-spline, matched by speed", us, 15.0);
    let maps = [
        ("map, size", SurfaceMap::size(&map)),
        ("features, change", SurfaceMap::feature_change(&features)),
        ("features, strength", SurfaceMap::feature(&features)),
    ];
    for (name, map) in &maps {
        let mut force = map_force(Interp::Bspline3);
        line(
            name,
            time(1, 0.5, MapVoice::default(), |s, stretch, out| force.add(map, s, stretch, out)),
            15.0,
        );
    }
    let mut force = map_force(Interp::Bspline3);
    let us = time(1, 90.0, MapVoice::default(), |s, stretch, out| force.add(&slope, s, stretch, out));
    line("map, slope, a pixel a sample", us, 15.0);

    let samples = (0..8192).map(|_| rng.between(-1.0, 1.0) as f32).collect();
    let noise = NoiseBands::new(&NoiseLine { samples, spacing: 2.0 / f64::from(FS) });
    for (name, speed) in [("noise, 0.5 m/s", 0.5), ("noise, 6 m/s, three samples a sample", 6.0)] {
        let mut force = NoiseForce::new(Law::new([1.0, 0.5, 0.5], FS.into()), 1.0, FS.into());
        let us = time(1, speed, NoiseVoice::default(), |s, stretch, out| force.add(&noise, s, stretch, out));
        line(name, us, 15.0);
    }

    let heights = |grid: &Grid| Grid { samples: grid.samples.iter().map(|x| x * 5e-5).collect(), ..*grid };
    let (a, b) = (heights(&grid), heights(&other));
    let ball = ball_map(&a, &surface, 0.02);
    let mut force = MapForce::new(law(1.0), 1.0, Interp::Bspline3, FS.into());
    let us = time(1, 0.5, MapVoice::default(), |s, stretch, out| force.add(&ball, s, stretch, out));
    line("ball on a relief", us, 15.0);
    let reliefs = [Relief::new(&a, &surface), Relief::new(&b, &surface)];
    for speed in [0.5, 5.0] {
        let range = reliefs[0].range() + reliefs[1].range();
        let mut force = PairForce::new(law(0.0), 33, 0.02, range);
        let us = time(1, speed, Heading::default(), |s, stretch, out| {
            force.add([&reliefs[0], &reliefs[1]], s, stretch, out);
        });
        line(&format!("two reliefs, 33 points, {speed} m/s"), us, 100.0);
    }

    let soft = smooth(&grid, &Kernel::gaussian(3.0, 4.0), surface.wrap);
    let luma = Luma { grid: soft, holes: Vec::new(), kind: LumaKind::Lstar, surface };
    let curves = isophotes(&luma, &Drawing { levels: Levels::Quantiles(2), ..Drawing::default() })?;
    let mut force = CrossingForce::new([&curves; 2], law(0.0), FS.into(), 1);
    let fresh = |_: &PathPiece| CrossingVoice::default();
    let us = time_blocks(1, 0.5, CrossingVoice::default(), |voices, now, first, out| {
        voices.play_cells(
            now,
            None,
            first,
            out,
            &mut force,
            fresh,
            CrossingForce::add,
            CrossingForce::ring_out,
        );
    });
    line("two sets of lines, 2 levels, 2 mm, 0.5 m/s", us, 25.0);

    line("bank of 32 modes", objects(1)?, 25.0);
    let mut force = map_force(Interp::Bspline3);
    let each = time(64, 0.5, MapVoice::default(), |s, stretch, out| force.add(&slope, s, stretch, out));
    let banks = objects(8)?;
    // The cost of contacts is measured with all 64 at once; banks and paths are added.
    let all = 64.0 * (each + paths()) + banks;
    let block = BLOCK as f64 / f64::from(FS) * 1e6;
    println!(
        "64 contacts and 8 objects of 32 modes: {all:.0} us of {block:.0}, {:.1} % of a core",
        100.0 * all / block
    );
    println!(
        "  of which 8 objects {banks:.0} us, 64 contacts {:.0} us: {each:.2} us each and their paths",
        all - banks
    );
    Ok(())
}
