//! Mode-samples per second of the modal bank on one core, compared with the same arithmetic in registers.
//!
//! Run with `cargo bench -p foley-nodes -- modal`. A mode-sample is one sample of one mode.

use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch, f32x16};
use foley_nodes::modal::{Bank, BankForm, BankOutput, Modes};
use std::error::Error;
use std::hint::black_box;
use std::time::{Duration, Instant};

const RATE: f64 = 44_100.0;
/// Each figure is the best of this many repetitions, which is least affected by other programs.
const REPETITIONS: usize = 15;
const REPETITION_TIME: Duration = Duration::from_millis(60);

/// Returns the best rate in units per second. `work` returns the number of its units.
fn best(mut work: impl FnMut() -> u64) -> f64 {
    let repetition = |work: &mut dyn FnMut() -> u64| {
        let (start, mut units) = (Instant::now(), 0);
        while start.elapsed() < REPETITION_TIME {
            units += work();
        }
        units as f64 / start.elapsed().as_secs_f64()
    };
    (0..REPETITIONS).map(|_| repetition(&mut work)).fold(0.0, f64::max)
}

#[inline(always)]
fn registers<S: Simd, const U: usize>(simd: S, samples: u64) -> f32 {
    let less_one: [_; U] = std::array::from_fn(|u| f32x16::splat(simd, black_box(-1e-5 * u as f32)));
    let sin: [_; U] = std::array::from_fn(|u| f32x16::splat(simd, black_box(1e-3 * u as f32)));
    let mut re = [f32x16::splat(simd, black_box(1.0)); U];
    let mut im = re;
    let mut sum = f32x16::splat(simd, 0.0);
    for _ in 0..samples {
        let mut now = f32x16::splat(simd, 0.0);
        for u in 0..U {
            let (x, y) = (re[u], im[u]);
            re[u] = (-sin[u]).mul_add(y, less_one[u].mul_add(x, x));
            im[u] = sin[u].mul_add(x, less_one[u].mul_add(y, y));
            now += im[u];
        }
        sum = sum.max(now);
    }
    sum.reduce_sum()
}

#[inline(always)]
fn bound_on<S: Simd>(simd: S, samples: u64) -> (f32, u64) {
    // As many vectors as fit into the registers.
    match S::f32s::LEN {
        16.. => (registers::<S, 4>(simd, samples), 4),
        8.. => (registers::<S, 2>(simd, samples), 2),
        _ => (registers::<S, 1>(simd, samples), 1),
    }
}

/// Returns the rate of the arithmetic of the bank in registers.
fn bound(level: Level) -> f64 {
    best(|| {
        let samples = 20_000;
        let (sum, vectors) = dispatch!(level, simd => bound_on(simd, black_box(samples)));
        black_box(sum);
        16 * vectors * samples
    })
}

/// Returns modes over the audible range that ring for seconds, so that none decays to silence.
fn modes(n: usize) -> Result<Modes, Box<dyn Error>> {
    let frequency = |k: usize| 60.0 * (16_000.0_f64 / 60.0).powf(k as f64 / n as f64);
    let damping = |k: usize| 6.9 / (0.2 + 1.8 * ((k * 7919) % 1000) as f64 / 1000.0);
    let all = 0..n;
    Ok(Modes::new(
        "bench",
        all.clone().map(frequency).collect(),
        all.clone().map(damping).collect(),
        vec![1e-3; n],
    )?)
}

/// Compares the forms of the bank: with impacts at several intervals, in blocks of 1024 samples.
fn forms() -> Result<(), Box<dyn Error>> {
    let mut impulse = vec![0.0; 1024];
    impulse[100] = 1.0;
    for n in [16, 32, 48, 64, 96, 128, 256, 1000, 2000, 5000, 10_000, 50_000] {
        let modes = modes(n)?;
        for (name, interval) in
            [("an impact each second  ", 43), ("an impact each 4 blocks", 4), ("an impact each block   ", 1)]
        {
            let found =
                [(BankForm::Time, 5), (BankForm::Fourier, 5), (BankForm::Fourier, 9)].map(|(form, bins)| {
                    let mut bank = Bank::new(&modes, RATE, BankOutput::Acceleration).ok()?;
                    bank.set_form(form, bins);
                    let mut out = vec![0.0; 1024];
                    let mut k = 0_u64;
                    Some(best(|| {
                        bank.process(if k.is_multiple_of(interval) { &impulse } else { &[] }, &mut out);
                        k += 1;
                        black_box(&out);
                        out.len() as u64
                    }))
                });
            let [Some(time), Some(five), Some(nine)] = found else { return Err("no bank".into()) };
            println!(
                "{n:6} modes, {name}: time {:8.1}, Fourier with 5 bins {:8.1}, with 9 bins {:8.1} times real time; {:5.2} times as fast",
                time / RATE,
                five / RATE,
                nine / RATE,
                five / time
            );
        }
    }
    Ok(())
}

/// Changes of the damping of an object while it sounds.
#[derive(Clone, Copy, PartialEq)]
enum Supports {
    /// Nothing.
    Constant,
    /// The damping of each mode changes in every window.
    Moving,
    /// The modes are coupled in every sample.
    Coupling,
}

/// Objects of 100 modes that one core computes in real time, in windows of 64 and 128 samples with an impact in every 256th: beside
/// constant dampings, those of supports that move and those of supports that couple the modes.
fn objects() -> Result<(), Box<dyn Error>> {
    let modes = modes(100)?;
    let matrix: Vec<f32> = (0..100 * 100).map(|k| if k % 101 == 0 { -1e-4 } else { -1e-6 }).collect();
    for window in [64, 128] {
        let mut constant = None;
        let cases = [
            ("constant damping   ", Supports::Constant),
            ("moving supports    ", Supports::Moving),
            ("coupled by supports", Supports::Coupling),
        ];
        for (name, supports) in cases {
            let mut bank = Bank::new(&modes, RATE, BankOutput::Acceleration)?;
            let (mut force, mut out) = (vec![0.0; window], vec![0.0; window]);
            let (mut scratch, mut added) = (vec![0.0; 100], vec![0.0_f32; 100]);
            let mut k = 0_u32;
            let found = best(|| {
                k += 1;
                force[0] = f32::from(u8::from(k % 256 == 1));
                if supports == Supports::Coupling {
                    for (force, out) in force.chunks(1).zip(out.chunks_mut(1)) {
                        bank.process(force, out);
                        bank.couple(&matrix, &mut scratch);
                    }
                } else {
                    if supports == Supports::Moving {
                        added.iter_mut().enumerate().for_each(|(i, x)| *x = ((k as usize + i) % 50) as f32);
                        bank.add_damping(&added);
                    }
                    bank.process(&force, &mut out);
                }
                black_box(&out);
                window as u64
            });
            let constant = *constant.get_or_insert(found);
            println!(
                "   100 modes, windows of {window:3}, {name}: {:6.1} objects in real time, {:3.0} % of constant damping",
                found / RATE,
                100.0 * found / constant
            );
        }
    }
    Ok(())
}

pub fn bench() -> Result<(), Box<dyn Error>> {
    let level = Level::new();
    let bound = bound(level);
    println!("{level:?}, one core; arithmetic alone: {:.2} G mode-samples/s", bound / 1e9);
    for n in [64, 1000, 10_000] {
        let modes = modes(n)?;
        let mut out = vec![0.0; 1024];
        let mut impulse = vec![0.0; 1024];
        impulse[0] = 1.0;
        let mut time = |name: &str, force: &[f32], damped: bool| -> Result<(), Box<dyn Error>> {
            let mut bank = Bank::new(&modes, RATE, BankOutput::Acceleration)?;
            let mut k = 0_u32;
            let found = best(|| {
                k += 1;
                if damped {
                    for (k, out) in out.chunks_mut(64).enumerate() {
                        bank.damp(&[1.0 + 0.01 * k as f32]);
                        bank.process(force.get(64 * k..64 * k + 64).unwrap_or_default(), out);
                    }
                } else {
                    // An impact every 16 blocks.
                    bank.process(if k % 16 == 1 { &impulse } else { force }, &mut out);
                }
                black_box(&out);
                (n * out.len()) as u64
            });
            println!(
                "{n:6} modes, {name}: {:6.2} G mode-samples/s, {:3.0} % of the arithmetic, {:6.0} modes in real time",
                found / 1e9,
                100.0 * found / bound,
                found / RATE
            );
            Ok(())
        };
        let scrape: Vec<f32> = (0..1024).map(|k| (k as f32 * 0.7).sin()).collect();
        time("occasional impacts    ", &[], false)?;
        time("continuous force      ", &scrape, false)?;
        time("damping every 64      ", &impulse, true)?;
    }
    objects()?;
    forms()?;
    let mut quiet = Bank::new(&modes(10_000)?, RATE, BankOutput::Acceleration)?;
    let mut out = vec![0.0; 1024];
    let found = best(|| {
        quiet.process(&[], &mut out);
        black_box(&out);
        10_000 * out.len() as u64
    });
    println!(" 10000 modes, silent: {:.1} times the arithmetic", found / bound);
    Ok(())
}
