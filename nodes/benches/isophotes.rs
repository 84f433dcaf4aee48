//! Isophotes of images of 512 and 4096 pixels a side, and the time per block and contact of the excitation force from them.
//!
//! Run with `cargo bench -p foley-nodes -- isophotes`. The images are random numbers at every 16th pixel with cubic interpolation,
//! as in most comparisons of contour tracers, with one level at 0.5 and eight at quantiles. `FOLEY_BENCH_IMAGES=DIR` writes them to `DIR`
//! for `benches/peers/textures.py`. On Linux the peak memory is printed as well.

use crate::common::{best, new_peak, peak};
use foley_nodes::core::params::Params;
use foley_nodes::core::random::Rng;
use foley_nodes::core::standalone::Standalone;
use foley_nodes::core::time::{Rate, ticks};
use foley_nodes::scrape::ContactForceParams;
use foley_nodes::scrape::isophote::isophote_excitation::{
    IsophoteExcitation, IsophoteExcitationParams, IsophoteExcitationPorts,
};
use foley_nodes::scrape::{IsophoteIndex, PathPiece, Reading};
use foley_nodes::texture::{
    Drawing, Field, Grid, Isophotes, Kernel, Levels, Luma, LumaKind, Saddle, Surface, Wrap, contours,
    encode_isophotes, isophotes, smooth,
};
use std::error::Error;
use std::hint::black_box;
use std::time::Instant;

/// Returns smooth noise between 0 and 1.
fn image(n: usize) -> Grid {
    let (mut rng, m) = (Rng::new(9), n / 16 + 4);
    let coarse = Grid::from_fn(m, m, |_, _| rng.uniform() as f32);
    let weights = |x: usize| {
        let t = (x % 16) as f32 / 16.0;
        // Catmull-Rom weights.
        [
            t * (-0.5 + t * (1.0 - 0.5 * t)),
            1.0 + t * t * (1.5 * t - 2.5),
            t * (0.5 + t * (2.0 - 1.5 * t)),
            t * t * (0.5 * t - 0.5),
        ]
    };
    Grid::from_fn(n, n, |x, y| {
        let (wx, wy) = (weights(x), weights(y));
        let at = |i: usize, j: usize| wx[i] * wy[j] * coarse.samples[(y / 16 + j) * m + x / 16 + i];
        (0..16).map(|k| at(k % 4, k / 4)).sum()
    })
}

fn curves() -> Result<(), Box<dyn Error>> {
    for (n, runs) in [(512, 11), (4096, 3)] {
        let grid = image(n);
        if let Some(dir) = std::env::var_os("FOLEY_BENCH_IMAGES") {
            let bytes: Vec<u8> = grid.samples.iter().flat_map(|x| x.to_le_bytes()).collect();
            std::fs::write(std::path::Path::new(&dir).join(format!("isophotes_{n}.f32")), bytes)?;
        }
        let field = Field { width: n, samples: &grid.samples, torus: false };
        let one = best(runs, || contours(&field, &[0.5], Saddle::Decider));
        let luma = Luma {
            grid: grid.clone(),
            holes: Vec::new(),
            kind: LumaKind::Lstar,
            surface: Surface::default(),
        };
        let drawn = isophotes(&luma, &Drawing::default())?;
        let eight = best(runs, || contours(&field, &drawn.levels, Saddle::Decider));
        let all = best(runs, || isophotes(&luma, &Drawing::default()));
        let index = best(runs, || IsophoteIndex::new(&drawn));
        let bytes = encode_isophotes(&drawn).len();
        let image = (n * n * size_of::<f32>()) as f64;
        let before = new_peak();
        drop(black_box(isophotes(&luma, &Drawing::default())));
        let more = (peak() - before) * f64::from(1 << 20);
        println!("{n:4} x {n}: peak memory {:.1} times the image, including its own 1.0", more / image + 1.0);
        println!(
            "{n:4} x {n}: {one:7.2} ms for one level, {eight:7.2} ms for eight; blurred, with gradients and simplified {all:7.2} ms; \
             index {index:6.2} ms; {} points in {:.1} kB, {:.2} bytes each",
            drawn.points.len(),
            bytes as f64 / 1e3,
            bytes as f64 / drawn.points.len() as f64
        );
    }
    Ok(())
}

/// Returns isophotes of a rough texture, with about one crossing per 1.5 pixels.
fn rough() -> Result<Isophotes, Box<dyn Error>> {
    let mut rng = Rng::new(4);
    let grid = Grid::from_fn(512, 512, |_, _| rng.between(0.0, 100.0) as f32);
    let grid = smooth(&grid, &Kernel::gaussian(1.5, 4.0), Wrap::Repeat);
    let luma = Luma { grid, holes: Vec::new(), kind: LumaKind::Lstar, surface: Surface::default() };
    let levels = Levels::Quantiles(8);
    Ok(isophotes(&luma, &Drawing { levels, ..Drawing::default() })?)
}

fn force(all: &Isophotes) -> Result<(), Box<dyn Error>> {
    const SECONDS: f64 = 2.0;
    for reading in [Reading::Crossing, Reading::Proximity] {
        // Crossings per contact and second, and microseconds per contact and millisecond.
        let mut found = Vec::new();
        for speed in [0.1, 1.0, 10.0] {
            let contacts = 8;
            let mut pieces = Vec::new();
            let frames = (SECONDS * 60.0) as i64;
            for (k, contact) in (0..frames).flat_map(|k| (0..contacts).map(move |c| (k, c))) {
                let t = k as f64 / 60.0;
                let angle = 0.3 + 0.5 * contact as f64;
                let v = [speed * f64::cos(angle) / 60.0, speed * f64::sin(angle) / 60.0];
                let from = [v[0] * t * 60.0 + 0.1 * contact as f64, v[1] * t * 60.0];
                let piece = PathPiece {
                    contact: contact as u64,
                    jump: 0,
                    object: 0,
                    duration: ticks(1.0 / 60.0),
                    position: [from, v, [0.0; 2], [0.0; 2]],
                    other: None,
                    force: [1.0; 2],
                    gain: [1.0; 2],
                    mass: None,
                };
                pieces.push((ticks(1.0 / 60.0) * k, piece));
            }
            let p = IsophoteExcitationParams::read(&|_| None).map_err(|e| format!("{e:?}"))?;
            let rate = Rate::hz(44_100);
            let standalone = Standalone::new::<IsophoteExcitation>(IsophoteExcitationParams {
                reading,
                contact: ContactForceParams { rate, ..p.contact },
                ..p
            })
            .events(IsophoteExcitationPorts::paths, pieces, ticks(SECONDS))
            .value(IsophoteExcitationPorts::isophotes, all.clone())
            .window(rate.span(1024));
            let time = (0..5).map(|_| {
                let mut run = standalone.start()?;
                let start = Instant::now();
                while run.step()? {}
                Ok::<_, Box<dyn Error>>(start.elapsed().as_secs_f64())
            });
            let time = time.collect::<Result<Vec<_>, _>>()?.into_iter().fold(f64::INFINITY, f64::min);
            let blocks = SECONDS * 44_100.0 / 1024.0 * contacts as f64;
            let reported = standalone.run()?.summary;
            let reported =
                reported.iter().find(|(key, _)| *key == "crossings").and_then(|(_, count)| count.as_f64());
            let crossings = reported.unwrap_or(0.0) / SECONDS / contacts as f64;
            found.push([crossings, 1e6 * time / (1000.0 * SECONDS * contacts as f64)]);
            println!(
                "{reading:?} at {speed:4} m/s: {:6.2} us per contact and block of 1024, {:.3} us per contact and millisecond",
                1e6 * time / blocks,
                1e6 * time / (1000.0 * SECONDS * contacts as f64)
            );
        }
        if let ([slow, fast, ..], Reading::Crossing) = (&found[..], reading) {
            let each = 1000.0 * (fast[1] - slow[1]) / (fast[0] - slow[0]);
            println!(
                "  {:.0} and {:.0} crossings a second: {each:.2} us per crossing, plus {:.2} us per millisecond",
                slow[0],
                fast[0],
                slow[1] - each * slow[0] / 1000.0
            );
        }
    }
    Ok(())
}

pub fn bench() -> Result<(), Box<dyn Error>> {
    curves()?;
    force(&rough()?)
}
