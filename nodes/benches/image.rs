//! Time of the texture filters on smooth images of 512 and 4096 pixels square.
//!
//! Run with `cargo bench -p foley-nodes -- image`. The budgets for all preprocessing, in the last line of each
//! size, are 0.5 s and 30 s. `benches/peers/textures.py` times the same filters of OpenCV and scikit-image on the same images.

use foley_nodes::scrape::SurfaceMap;
use foley_nodes::texture::bilateral::{BilateralParams, bilateral};
use foley_nodes::texture::dog::{DogParams, difference, features};
use foley_nodes::texture::histogram::classify;
use foley_nodes::texture::profile::{PROFILE, profile};
use foley_nodes::texture::sobel::{gradient, magnitude};
use foley_nodes::texture::split::noise;
use foley_nodes::texture::{
    DiscontinuityMap, Drawing, FeatureMap, Grid, Luma, LumaKind, NoiseMap, Pyramid, Surface, Wrap, isophotes,
};
use std::error::Error;
use std::hint::black_box;
use std::time::Instant;

/// Prints the median and the best time of some runs.
fn time<T>(what: &str, size: usize, runs: usize, mut work: impl FnMut() -> T) {
    black_box(work());
    let mut ms: Vec<f64> = (0..runs)
        .map(|_| {
            let start = Instant::now();
            black_box(work());
            start.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    ms.sort_by(f64::total_cmp);
    let (best, median) = (ms[0], ms[runs / 2]);
    println!("{what} {size} x {size}: median {median:.2} ms, best {best:.2} ms");
}

/// Returns the time of all preprocessing of an image, in ms.
fn preprocess(luma: &Luma) -> Result<f64, Box<dyn Error>> {
    let (image, wrap) = (&luma.grid, luma.surface.wrap);
    let start = Instant::now();
    let class = classify(luma, 0.2, None);
    let map = SurfaceMap::slope(&{
        let [gx, gy] = gradient(image, wrap);
        DiscontinuityMap { gx, gy, surface: luma.surface }
    });
    let curves = isophotes(luma, &Drawing::default())?;
    let soft = bilateral(image, BilateralParams { sigma_d: 3.0, sigma_r: 4.25 }, wrap);
    let lines = features(&soft, DogParams::default(), wrap);
    let rest = noise(image, &soft, Some(&lines), &[]);
    let rest = NoiseMap { grid: rest, holes: Vec::new(), surface: luma.surface };
    let line = profile(&rest, PROFILE);
    let change = SurfaceMap::feature_change(&FeatureMap { grid: lines, surface: luma.surface });
    let ms = start.elapsed().as_secs_f64() * 1e3;
    black_box((class, map, curves, line, change));
    Ok(ms)
}

pub fn bench() -> Result<(), Box<dyn Error>> {
    for (size, runs) in [(512, 21), (4096, 5)] {
        let image = Grid::from_fn(size, size, |x, y| {
            let (x, y) = (x as f32, y as f32);
            50.0 + 50.0 * (0.05 * x).sin() * (0.031 * y + 0.01 * x).cos()
        });
        time("Sobel magnitude", size, runs, || magnitude(&image, Wrap::Clamp));
        time("Sobel gradient", size, runs, || gradient(&image, Wrap::Clamp));
        let widths = DogParams { ratio: 1.6, tau: 1.0, ..DogParams::default() };
        time("difference of Gaussians 1.0, 1.6", size, runs, || difference(&image, widths, Wrap::Clamp));
        time("features", size, runs, || features(&image, DogParams::default(), Wrap::Clamp));
        let few = if size > 1000 { 1 } else { runs };
        for (sigma_d, sigma_r) in [(2.0, 10.0), (3.0, 4.25)] {
            let params = BilateralParams { sigma_d, sigma_r };
            let what = format!("bilateral, radius {}", params.radius());
            time(&what, size, few, || bilateral(&image, params, Wrap::Clamp));
        }
        time("pyramid, with its copy of the image", size, runs, || Pyramid::new(image.clone(), Wrap::Repeat));
        let luma =
            Luma { grid: image, holes: Vec::new(), kind: LumaKind::Lstar, surface: Surface::default() };
        let (ms, aim) = (preprocess(&luma)?, if size == 512 { 500 } else { 30_000 });
        println!("all preprocessing of an image {size} x {size}: {ms:.0} ms, aim {aim} ms");
    }
    Ok(())
}
