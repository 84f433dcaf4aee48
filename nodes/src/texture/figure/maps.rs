//! Maps as data of ports, with the figures of Picard, Tsingos and Faure (VRIPHYS 2008).

use super::picture::picture;
use crate::core::item::Data;
use crate::core::random::Rng;
use crate::plot::{Axis, Line, chart};
use crate::texture::filter::sobel::length;
use crate::texture::grid::{Grid, Wrap, percentile};
use crate::texture::holes::valid_samples;
use crate::texture::map_code::code::CodedMap;
use crate::texture::map_code::file::encode_map;
use crate::texture::maps::{
    Detail, DiscontinuityMap, FeatureMap, Luma, LumaKind, NoiseMap, NoisePart, NoiseProfile, Surface,
};
use crate::texture::noise::noise_profile_file::encode_profile;
use crate::texture::noise::profile::variance;

/// Maximum length of a drawn profile, in samples.
const MAX_SHOWN: usize = 2000;

/// Draws the luminance.
fn luma(luma: &Luma) -> Option<String> {
    let unit = match luma.kind {
        LumaKind::Lstar => "lightness, 0 to 100",
        LumaKind::Rec601 => "luminance, 0 to 255",
    };
    picture(&format!("Surface: {unit}"), &luma.grid, [0.0, luma.kind.max()], &luma.surface)
}

/// Draws the magnitude of the gradient, white for the largest: figure 3.
fn discontinuities(map: &DiscontinuityMap) -> Option<String> {
    let g = length(&map.gx, &map.gy);
    let top = percentile(g.samples.iter().copied(), 0.999);
    let title = format!("Discontinuity map: white is a change of {top:.3} per pixel");
    picture(&title, &g, [0.0, top], &map.surface)
}

/// Draws features dark on white: figure 5.
fn features(map: &FeatureMap) -> Option<String> {
    picture("Main features", &map.grid, [1.0, 0.0], &map.surface)
}

/// Draws noise in grey, from -3 to 3 standard deviations: figure 5.
fn noise(map: &NoiseMap) -> Option<String> {
    let deviation = variance(valid_samples(&map.grid, &map.holes)).sqrt() as f32;
    let ends = [-3.0 * deviation, 3.0 * deviation];
    picture(&format!("Noise: standard deviation {deviation:.3}"), &map.grid, ends, &map.surface)
}

/// Draws the start of a profile.
fn profile(profile: &NoiseProfile) -> Option<String> {
    let shown = &profile.samples[..profile.samples.len().min(MAX_SHOWN)];
    let max = shown.iter().fold(0.0_f32, |max, x| max.max(x.abs()));
    if shown.len() < 2 || max <= 0.0 {
        return None;
    }
    let points = shown.iter().enumerate().map(|(k, x)| [k as f64 * profile.spacing, f64::from(*x)]).collect();
    let axis = |label: &str, range| Axis { label: label.into(), range, log: false };
    let max = f64::from(max);
    let length = profile.samples.len() as f64 * profile.spacing;
    Some(chart(
        &format!("Noise profile: the first of {length:.2} m"),
        &axis("position, m", [0.0, (shown.len() - 1) as f64 * profile.spacing]),
        &axis("height, luminance", [-max, max]),
        &[Line::new(String::new(), points)],
    ))
}

/// Random grid. All have the same size, for nodes that read two maps of one image.
fn trial_grid(rng: &mut Rng, low: f64, high: f64) -> Grid {
    let (width, height) = (29, 22);
    Grid::from_fn(width, height, |_, _| rng.between(low, high) as f32)
}

fn trial_surface(rng: &mut Rng) -> Surface {
    let wrap = [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp][rng.below(3)];
    Surface { density: [rng.between(100.0, 4000.0), rng.between(100.0, 4000.0)], depth: 1e-4, wrap }
}

impl Data for Luma {
    const NAME: &'static str = "luma";
    const PLOTS: bool = true;

    fn trial(rng: &mut Rng) -> Self {
        Self {
            grid: trial_grid(rng, 0.0, 100.0),
            holes: Vec::new(),
            kind: LumaKind::Lstar,
            surface: trial_surface(rng),
        }
    }

    fn plot(&self) -> Option<String> {
        luma(self)
    }
}

impl Data for DiscontinuityMap {
    const NAME: &'static str = "discontinuity map";
    const PLOTS: bool = true;

    fn trial(rng: &mut Rng) -> Self {
        let gx = trial_grid(rng, -20.0, 20.0);
        let gy = Grid::from_fn(gx.width, gx.height, |_, _| rng.between(-20.0, 20.0) as f32);
        Self { gx, gy, surface: trial_surface(rng) }
    }

    fn plot(&self) -> Option<String> {
        discontinuities(self)
    }
}

impl Data for FeatureMap {
    const NAME: &'static str = "feature map";
    const PLOTS: bool = true;
    const FILES: bool = true;

    fn trial(rng: &mut Rng) -> Self {
        Self { grid: trial_grid(rng, 0.0, 1.0), surface: trial_surface(rng) }
    }

    fn plot(&self) -> Option<String> {
        features(self)
    }

    /// A byte per pixel, for `MapFile`.
    fn file(&self) -> Option<Vec<u8>> {
        Some(encode_map(&CodedMap::of_features(self)))
    }
}

impl Data for NoiseMap {
    const NAME: &'static str = "noise map";
    const PLOTS: bool = true;

    fn trial(rng: &mut Rng) -> Self {
        let mut grid = trial_grid(rng, -5.0, 5.0);
        let mut holes = Vec::new();
        if rng.below(2) == 0 {
            holes = grid.samples.iter().map(|_| rng.below(4) == 0).collect();
            grid.samples.iter_mut().zip(&holes).for_each(|(x, hole)| *x = if *hole { 0.0 } else { *x });
        }
        Self { grid, holes, surface: trial_surface(rng) }
    }

    fn plot(&self) -> Option<String> {
        noise(self)
    }
}

impl Data for NoiseProfile {
    const NAME: &'static str = "noise profile";
    const PLOTS: bool = true;
    const FILES: bool = true;

    fn trial(rng: &mut Rng) -> Self {
        let samples = (0..64 + rng.below(200)).map(|_| rng.between(-5.0, 5.0) as f32).collect();
        let spacing = 1.0 / rng.between(500.0, 20_000.0);
        let detail = (rng.below(2) == 0).then(|| Detail { factor: 1 << (1 + rng.below(3)), seed: 9 });
        Self { samples, spacing, detail, part: NoisePart::Whole }
    }

    fn plot(&self) -> Option<String> {
        profile(self)
    }

    fn file(&self) -> Option<Vec<u8>> {
        Some(encode_profile(self))
    }
}
