//! Concatenative synthesis at the size of the takes of the cloth paper: features, database, selection.
//!
//! Run with `cargo bench -p foley-nodes -- unit`, or a part of it: `-- unit features`, `global`, `sleep`, `smooth`, `noise` or `database`. Each figure is printed with that of
//! the paper (eight cores of 2.9 GHz).

use crate::common::{new_peak, peak};
use foley_nodes::core::item::Channels;
use foley_nodes::core::params::Params;
use foley_nodes::core::random::Rng;
use foley_nodes::core::standalone::Standalone;
use foley_nodes::core::time::Rate;
use foley_nodes::feature::{FeatureConventions, FeatureFormat, MelCepstrum, TemporalFilter};
use foley_nodes::unit::global::{BeamParams, FixedLag, GlobalParams, Joins, Table, beam, difference, exact};
use foley_nodes::unit::selection::unit_selector::{UnitSelector, UnitSelectorParams, UnitSelectorPorts};
use foley_nodes::unit::{
    Blend, Concatenator, Segment, SelectorParams, Take, UnitDatabase, UnitSource, Units, build, selector,
};
use std::error::Error;
use std::hint::black_box;
use std::time::Instant;

const RATE: Rate = Rate::hz(96_000);
const UNIT: u32 = 400;

fn noise(seed: u64, samples: usize) -> Vec<f32> {
    let mut rng = Rng::new(seed);
    let mut swell = 0.0;
    (0..samples)
        .map(|i| {
            if i % 4000 == 0 {
                swell = rng.uniform() * rng.uniform();
            }
            (swell * rng.between(-0.5, 0.5)) as f32
        })
        .collect()
}

/// Returns smooth features with the spread of cloth recordings: three dimensions, filtered by the Gaussian of the paper.
fn features(seed: u64, units: usize) -> Vec<f32> {
    let mut rng = Rng::new(seed);
    let mut slow = [0.0; 3];
    let spread = [9.0, 3.0, 2.0];
    let mut out = Vec::with_capacity(3 * units);
    for _ in 0..units {
        for (slow, spread) in slow.iter_mut().zip(spread) {
            *slow += 0.02 * (spread * 6.0 * rng.between(-1.0, 1.0) - *slow);
            out.push((*slow + rng.between(-1.0, 1.0)) as f32);
        }
    }
    TemporalFilter::new(&[20.0, 50.0, 10.0], false).process_segment(&out)
}

fn of_units() -> Result<(), Box<dyn Error>> {
    let c = FeatureConventions::cloth(RATE, UNIT);
    let (mut cepstrum, x, mut out) = (MelCepstrum::new(&c, 1e-10), noise(1, 400_000), [0.0; 3]);
    let best = (0..10).map(|_| {
        let start = Instant::now();
        let units =
            x.windows(800).step_by(400).map(|frame| cepstrum.process(black_box(frame), &mut out)).count();
        start.elapsed().as_secs_f64() / units as f64
    });
    let best = best.fold(f64::INFINITY, f64::min);
    println!(
        "features              {:>8.2} us per unit and channel, H = 400   (aim 10; paper 24,000)",
        best * 1e6
    );
    Ok(())
}

fn of_database() -> Result<(), Box<dyn Error>> {
    let mut c = FeatureConventions::cloth(RATE, UNIT);
    c.widths = vec![20.0, 50.0, 10.0];
    let samples = 240 * 96_000;
    let takes = [Take { channels: vec![noise(2, samples), noise(3, samples)].into(), ..Take::default() }];
    let start = Instant::now();
    let db = build(&takes, &c, None)?;
    let seconds = start.elapsed().as_secs_f64();
    println!(
        "database              {seconds:>8.2} s for 4 min of stereo at 96 kHz, {} units   (aim 5; paper 1051 to 1392)",
        db.len()
    );
    let mut rng = Rng::new(4);
    let picks: Vec<u32> = (0..14_400).map(|_| rng.below(db.len()) as u32).collect();
    let start = Instant::now();
    black_box(Concatenator::new(&db, Blend::EqualPower).whole(0, &picks));
    println!(
        "concatenation         {:>8.2} s for a minute of mono that joins at every unit",
        start.elapsed().as_secs_f64()
    );
    Ok(())
}

/// Times a target that sounds for a quarter of a minute, with and without its audio as an input.
fn of_sleep() -> Result<(), Box<dyn Error>> {
    let (units, targets, rate) = (57_600_usize, 14_400_usize, Rate::hz(240));
    let c = FeatureConventions { unit: 4, frame: 8, rate: Rate::hz(960), ..FeatureConventions::trial() };
    let made = features(6, units);
    let db = UnitDatabase {
        version: foley_nodes::unit::database::DATABASE_VERSION,
        floor_energy: 1e-10,
        segments: vec![Segment { start: 0, units: units as u32, source: 0, ..Segment::default() }],
        sources: vec![UnitSource::default()],
        audio: vec![0.0; 4 * units],
        unfiltered: made.clone(),
        features: made,
        conventions: c.clone(),
    };
    let sound: Vec<f32> = (0..4 * targets).map(|k| f32::from(u8::from(k < targets))).collect();
    let mut seconds = [0.0; 2];
    for (seconds, sleeps) in seconds.iter_mut().zip([false, true]) {
        let params = UnitSelectorParams::read(&|_| None).map_err(|e| format!("{e:?}"))?;
        let format = FeatureFormat { vectors: 1, conventions: c.clone().into() };
        let mut standalone = Standalone::new::<UnitSelector>(params)
            .input(UnitSelectorPorts::features, rate, format, features(5, targets))
            .value(UnitSelectorPorts::database, db.clone());
        if sleeps {
            standalone =
                standalone.optional(UnitSelectorPorts::target, Rate::hz(960), Channels(1), sound.clone());
        }
        let start = Instant::now();
        black_box(standalone.run().map_err(|e| e.to_string())?);
        *seconds = start.elapsed().as_secs_f64();
    }
    println!(
        "sleep                 {:>8.2} s for a minute of which three quarters are silent, {:.2} s without sleep (57,600 units, index included)",
        seconds[1], seconds[0]
    );
    Ok(())
}

fn of_selection() -> Result<(), Box<dyn Error>> {
    let (targets, units) = (144_000, 57_600);
    let (target, database) = (features(5, targets), features(6, units));
    for (look, d_max) in [(10, 2.0), (5, 2.0), (10, 8.0)] {
        let before = new_peak();
        let start = Instant::now();
        let set = Units::new(&database, 3, vec![(0, units)]);
        let params = SelectorParams { look, d_max, cool_off: 20, loop_guard: 0, causal: false, effort: None };
        let mut selector = selector(&set, params).ok_or("no unit")?;
        let (mut fallbacks, mut runs, mut last) = (0, 0, u32::MAX);
        for i in 0..targets {
            let to = (i + look + 1).min(targets);
            let choice = selector.choose(&target[3 * i..3 * to]).map_err(|e| format!("{e:?}"))?;
            fallbacks += usize::from(choice.fallback);
            runs += usize::from(choice.unit == last.wrapping_add(1));
            last = choice.unit;
        }
        let share = |n: usize| 100.0 * n as f64 / targets as f64;
        println!(
            "selection             {:>8.2} s for 144,000 targets, 57,600 units, L = {look}, d_max = {d_max}, one thread: {:.1} % fallbacks, \
             {:.1} % run on, {:.0} MB more at the peak   (aim 10 s, 200 MB; paper 25 to 197 s)",
            start.elapsed().as_secs_f64(),
            share(fallbacks),
            share(runs),
            peak() - before
        );
    }
    Ok(())
}

/// Features that are nearly noise: each is nine tenths of the one before and a Gaussian number, with a variance of 1.
fn noisy_features(dims: usize, seed: u64, units: usize) -> Vec<f32> {
    let mut rng = Rng::new(seed);
    let mut gauss = || (0..12).map(|_| rng.between(-0.5, 0.5)).sum::<f64>();
    let mut last: Vec<f64> = (0..dims).map(|_| gauss()).collect();
    let mut out = Vec::with_capacity(dims * units);
    for _ in 0..units {
        last.iter_mut().for_each(|x| *x = 0.9 * *x + 0.19_f64.sqrt() * gauss());
        out.extend(last.iter().map(|x| *x as f32));
    }
    out
}

/// Times the selection over features in which a run of units is soon worse than other units: a few units lie within `d_max`.
fn of_noisy_selection() -> Result<(), Box<dyn Error>> {
    let (targets, units) = (140_000, 57_000);
    for (dims, d_max, look) in [(3, 0.14, 10), (3, 0.14, 5), (6, 0.575, 10)] {
        let (database, target) = (noisy_features(dims, 11, units), noisy_features(dims, 22, targets));
        let start = Instant::now();
        let set = Units::new(&database, dims, vec![(0, units)]);
        let params = SelectorParams { look, d_max, cool_off: 20, loop_guard: 0, causal: true, effort: None };
        let mut selector = selector(&set, params).ok_or("no unit")?;
        let index = start.elapsed().as_secs_f64();
        let mut fallbacks = 0;
        for i in 0..targets {
            let window = &target[i.saturating_sub(look) * dims..(i + 1) * dims];
            fallbacks += usize::from(selector.choose(window).map_err(|e| format!("{e:?}"))?.fallback);
        }
        println!(
            "selection of noise    {:>8.2} s for 140,000 targets, 57,000 units, d = {dims}, L = {look}, d_max = {d_max}, one thread, {index:.2} s of it for \
             the index: {:.1} % fallbacks",
            start.elapsed().as_secs_f64(),
            100.0 * fallbacks as f64 / targets as f64
        );
    }
    Ok(())
}

/// Times the best path with and without cool-off, beam search, and decisions after 50 ms.
fn of_global_selection() -> Result<(), Box<dyn Error>> {
    let (targets, units) = (144_000, 57_600);
    let (target, database) = (features(5, targets), features(6, units));
    let set = Units::new(&database, 3, vec![(0, units)]);
    let finite = |e| format!("{e:?}");
    let table = Table::new(&set).ok_or("no unit")?;
    let free = GlobalParams { switch_cost: 0.5, cap: f64::INFINITY, cool_off: 0, loop_guard: 0 };
    let best = {
        let (before, start) = (new_peak(), Instant::now());
        let path = exact(&table, &target, &free, None).map_err(finite)?;
        println!(
            "global selection      {:>8.2} s for 144,000 targets, 57,600 units, exact, {} threads: cost {:.0}, {:.0} MB more at the \
             peak   (aim 120 s, 300 MB; not in the paper)",
            start.elapsed().as_secs_f64(),
            rayon::current_num_threads(),
            path.cost,
            peak() - before
        );
        path
    };
    let params = GlobalParams { cool_off: 20, ..free };
    let start = Instant::now();
    let path = exact(&table, &target, &params, None).map_err(finite)?;
    println!(
        "  with cool-off of 20 {:>8.2} s: cost {:.0}, {} came back too early, {} rounds, {} replaced",
        start.elapsed().as_secs_f64(),
        path.cost,
        path.repeats,
        path.rounds,
        path.replaced
    );
    let beam_params = BeamParams { path: params, candidates: 64, feature: 0.3, level: 0.0, crossing: 0.0 };
    let (before, start) = (new_peak(), Instant::now());
    let path = beam(&table, &Joins::default(), &target, &[], &beam_params).map_err(finite)?;
    println!(
        "  beam of 64          {:>8.2} s: cost {:.0}, {:.0} MB more",
        start.elapsed().as_secs_f64(),
        path.cost,
        peak() - before
    );
    let mut online = FixedLag::new(table, free, 12);
    let (part, start) = (14_400, Instant::now());
    let chosen: Result<Vec<u32>, _> =
        (0..part).map(|i| Ok(online.choose(&target[3 * i..3 * (i + 13)])?.unit)).collect();
    println!(
        "  after 50 ms         {:>8.1} us per unit, one thread; {:.2} % of a minute differ from the best path",
        start.elapsed().as_secs_f64() / part as f64 * 1e6,
        100.0 * difference(&chosen.map_err(finite)?, best.units.get(..part).unwrap_or_default())
    );
    Ok(())
}

pub fn bench() -> Result<(), Box<dyn Error>> {
    type Part = (&'static str, fn() -> Result<(), Box<dyn Error>>);
    let parts: [Part; 6] = [
        ("features", of_units),
        ("global", of_global_selection),
        ("sleep", of_sleep),
        ("smooth", of_selection),
        ("noise", of_noisy_selection),
        ("database", of_database),
    ];
    let named = |name: &str| std::env::args().any(|arg| arg == name);
    let any = parts.iter().any(|(name, _)| named(name));
    parts.iter().filter(|(name, _)| !any || named(name)).try_for_each(|(_, part)| part())
}
